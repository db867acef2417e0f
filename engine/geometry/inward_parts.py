"""Closed meshes whose faces look inwards, as those of a mesh do that is inside out."""

from __future__ import annotations

import numpy as np

from .sides import Sides

__all__ = ["has_inward_part"]


def has_inward_part(corner: np.ndarray, part: np.ndarray, sides: Sides) -> bool:
    """Tell whether a closed part of a surface looks to its inside, and is not the inner wall of another part.

    A part is closed where every side has two triangles. The signed volume that it encloses is below 0 if it looks inwards (the
    divergence theorem: the sum of the volumes between its triangles and any point).

    Args:
        corner: Corners of the triangles, shape ``[t, 3, 3]``.
        part: Which part each is in, shape ``[t]``.
        sides: Their sides.
    """
    count = int(part.max()) + 1
    is_open = (sides.count != 2)[sides.number].reshape(-1, 3).any(axis=1)
    closed = np.bincount(part, is_open, count) == 0.0
    if not closed.any():
        return False
    corner = corner - corner.mean(axis=(0, 1))
    volume = np.bincount(part, np.einsum("td,td->t", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])), count)
    if not (closed & (volume < 0.0)).any():
        return False
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, corner.min(axis=1))
    np.maximum.at(high, part, corner.max(axis=1))
    for inward in np.flatnonzero(closed & (volume < 0.0)).tolist():
        around = ((low <= low[inward]) & (high >= high[inward])).all(axis=1) & closed & (volume > 0.0)
        if not around.any():
            return True
    return False
