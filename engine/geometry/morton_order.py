"""An order of points in which neighbors follow each other."""

from __future__ import annotations

import numpy as np

__all__ = ["morton_order"]

# Of the cells along each axis.
BITS_OF_CELL = 12


def morton_order(position: np.ndarray) -> np.ndarray:
    """An order of points ``[n, 3]`` in which neighbors follow each other: that of their cells along Morton's curve."""
    low, high = position.min(axis=0), position.max(axis=0)
    steps = (1 << BITS_OF_CELL) - 1
    cell = ((position - low) / max(float((high - low).max()), 1e-300) * steps).astype(np.int64)
    code = np.zeros(len(position), np.int64)
    for bit in range(BITS_OF_CELL):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
