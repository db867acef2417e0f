"""Hilbert's curve through cells: what follows each other along it is near in the plane, too."""

from __future__ import annotations

import numpy as np

__all__ = ["along_hilbert_curve"]


def along_hilbert_curve(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return how many cells the curve passes before it comes to each of these, int64; both are numbers from 0 on, shape ``[n]``.

    The curve goes through the smallest square of a power of two that holds all of them.
    """
    x, y = column.astype(np.int64), row.astype(np.int64)
    result = np.zeros(len(x), np.int64)
    largest = int(max(x.max(initial=0), y.max(initial=0)))
    side = 1 << max(1, largest.bit_length())
    half = side >> 1
    while half:
        right, up = (x & half) > 0, (y & half) > 0
        result += half * half * ((3 * right) ^ up)
        # The quarters below are reflected.
        turned = ~up & right
        x, y = np.where(turned, side - 1 - x, x), np.where(turned, side - 1 - y, y)
        x, y = np.where(up, x, y), np.where(up, y, x)
        half >>= 1
    return result
