"""Connected components: what hangs together where pairs of things are joined."""

from __future__ import annotations

import numpy as np

__all__ = ["connected"]


def connected(count: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Number of the connected component of every one of ``count`` things, of which pairs are joined."""
    label = np.arange(count)
    while True:
        a, b = label[one], label[other]
        apart = a != b
        if not apart.any():
            return np.unique(label, return_inverse=True)[1].ravel()
        one, other, a, b = one[apart], other[apart], a[apart], b[apart]
        # The larger label hooks onto the smaller one; then every thing follows its label to the end.
        np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
        while True:
            further = label[label]
            if np.array_equal(further, label):
                break
            label = further
