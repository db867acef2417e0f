"""Polygons, whose edges may cross, cut into convex pieces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

__all__ = ["convex_pieces"]

# Corners this close, as a share of a polygon's extent, are one, and what bends by less is straight.
SAME_CORNER = 1e-9
# Edges of a polygon that is looked at for crossings.
MOST_EDGES_THAT_CROSS = 1000


def convex_pieces(corners: np.ndarray, most_corners: int) -> Iterator[np.ndarray]:
    """Cut a polygon ``[n, 2]``, whose edges may cross, into convex pieces ``[k, 2]`` of at most ``most_corners`` corners each."""
    close = SAME_CORNER * float(np.ptp(corners, axis=0).max())
    growing: list[tuple[list[np.ndarray], list[np.ndarray]]] = []
    for slab in _slabs(corners):
        for left, right in growing:
            # What ends where this one begins may go on in it.
            met = max(np.abs(left[-1] - slab[0]).max(), np.abs(right[-1] - slab[1]).max()) <= close
            if met and _goes_on(left, right, slab, close, most_corners):
                break
        else:
            growing.append(([slab[0], slab[3]], [slab[1], slab[2]]))
    for left, right in growing:
        yield np.array([*right, *reversed(left)])


def _goes_on(
    left: list[np.ndarray], right: list[np.ndarray], slab: np.ndarray, close: float, most_corners: int
) -> bool:
    """Whether a convex piece stays one when a trapezoid is set on it; if so it is. Its sides are given from bottom to top."""
    bends = [_bend(side, end) for side, end in ((left, slab[3]), (right, slab[2]))]
    # To the right on the left side, and to the left on the right one.
    if bends[0] > close or bends[1] < -close:
        return False
    straight = [abs(bend) <= close for bend in bends]
    if len(left) + len(right) + 2 - sum(straight) > most_corners:
        return False
    for side, end, on_line in zip((left, right), (slab[3], slab[2]), straight, strict=True):
        if on_line:
            side.pop()
        side.append(end)
    return True


def _bend(side: list[np.ndarray], end: np.ndarray) -> float:
    """How far a side of a piece, from bottom to top, bends to the left where it goes on to ``end`` [m]."""
    last, onwards = side[-1] - side[-2], end - side[-2]
    return float(last[0] * onwards[1] - last[1] * onwards[0]) / max(float(np.hypot(*onwards)), 1e-300)


def _slabs(corners: np.ndarray) -> Iterator[np.ndarray]:
    """Cut a polygon, whose edges may cross, into trapezoids between horizontal lines: corners of shape ``[4, 2]``."""
    start, end = corners, np.roll(corners, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    lines = np.unique(np.concatenate([corners[:, 1], _heights_of_crossings(start, end - start)]))
    slope = (end[:, 0] - start[:, 0]) / np.where(high > low, end[:, 1] - start[:, 1], 1.0)
    for below, above in pairwise(lines.tolist()):
        middle = 0.5 * (below + above)
        own = np.flatnonzero((low <= middle) & (middle < high))
        own = own[np.argsort(start[own, 0] + slope[own] * (middle - start[own, 1]), kind="stable")]
        at = np.array([start[own, 0] + slope[own] * (y - start[own, 1]) for y in (below, above)]).T
        # What is inside an odd number of times lies between the first and the second edge, the third and the fourth, and so on.
        for left, right in zip(at[::2], at[1::2], strict=False):
            yield np.array([[left[0], below], [right[0], below], [right[1], above], [left[1], above]])


def _heights_of_crossings(start: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Where edges cross, along y; of more edges than these nobody asks."""
    if len(edge) > MOST_EDGES_THAT_CROSS:
        return np.empty(0)
    between = start[None] - start[:, None]
    cross = edge[:, None, 0] * edge[None, :, 1] - edge[:, None, 1] * edge[None, :, 0]
    parted = np.where(cross == 0.0, np.nan, cross)
    along = (between[..., 0] * edge[None, :, 1] - between[..., 1] * edge[None, :, 0]) / parted
    other = (between[..., 0] * edge[:, None, 1] - between[..., 1] * edge[:, None, 0]) / parted
    met = (along > 0.0) & (along < 1.0) & (other > 0.0) & (other < 1.0)
    one = np.nonzero(met)[0]
    return start[one, 1] + along[met] * edge[one, 1]
