"""Connected components: what hangs together where pairs of things are joined."""

from __future__ import annotations

import numpy as np

__all__ = ["connected", "connected_pixels"]


def connected(count: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Number of the connected component of every one of ``count`` things, shape ``[count]``, of which pairs are joined.

    Args:
        count: How many things there are.
        one: One of every pair, shape ``[pairs]``.
        other: The other one.
    """
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


def connected_pixels(mask: np.ndarray) -> np.ndarray:
    """Number of the part that every pixel of a mask is in, from 0 on; -1 elsewhere. Pixels that share a side are in one part.

    Args:
        mask: Shape ``[height, width]``, bool.
    """
    # Runs of pixels are far fewer than pixels.
    begins = mask & ~np.pad(mask[:, :-1], ((0, 0), (1, 0)))
    run = np.cumsum(begins).reshape(mask.shape) - 1
    meets = mask[1:] & mask[:-1]
    # Side by side, pixels above which there are others belong to the same two runs: the first of them says so.
    meets[:, 1:] &= ~(meets[:, :-1])
    label = connected(int(begins.sum()), run[:-1][meets], run[1:][meets])
    return np.where(mask, label[np.maximum(run, 0)], -1) if len(label) else np.full(mask.shape, -1)
