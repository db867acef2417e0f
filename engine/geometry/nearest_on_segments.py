"""Which of many straight pieces is nearest to each of many points."""

from __future__ import annotations

import numpy as np

from .morton_order import morton_order

__all__ = ["nearest_on_segments"]

# Points times pieces that are compared at once.
MOST_COMPARED = 1 << 16
# Lengths are a little more, for rounding.
SAFELY = 1.0 + 1e-9


def nearest_on_segments(segment: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return which segment is nearest to every point.

    Points that are neighbors are looked at together: what is too far away for the middle of a group is so for all of it.

    Args:
        segment: Both ends of each [m], shape ``[s, 2, 3]``; at least one.
        position: The points [m], shape ``[n, 3]``.

    Returns:
        Numbers of segments, shape ``[n]``, int64; of those that are as near the first.
    """
    result = np.zeros(len(position), np.int64)
    if not len(position):
        return result
    waiting = [(morton_order(position), np.arange(len(segment)))]
    while waiting:
        rows, chosen = waiting.pop()
        point = position[rows]
        low, high = point.min(axis=0), point.max(axis=0)
        away = np.sqrt(_squares(segment[chosen], 0.5 * (low + high)[None])[0])
        # No point of the group is farther from its middle than half the diagonal.
        near = chosen[away <= (away.min() + float(np.linalg.norm(high - low))) * SAFELY]
        if len(rows) * len(near) <= MOST_COMPARED or len(rows) == 1:
            result[rows] = near[_squares(segment[near], point).argmin(axis=1)]
        else:
            half = len(rows) // 2
            waiting += [(rows[:half], near), (rows[half:], near)]
    return result


def _squares(segment: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Squared distances of points ``[n, 3]`` to segments ``[s, 2, 3]``, shape ``[n, s]``."""
    side = segment[:, 1] - segment[:, 0]
    way = point[:, None] - segment[None, :, 0]
    share = np.einsum("nsd,sd->ns", way, side) / np.maximum((side * side).sum(axis=1), 1e-300)
    way -= np.clip(share, 0.0, 1.0)[:, :, None] * side
    return np.einsum("nsd,nsd->ns", way, way)
