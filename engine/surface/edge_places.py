"""Places along edges, at which it is looked for what lies beside these."""

from __future__ import annotations

import numpy as np

__all__ = ["places_along"]


def places_along(
    start: np.ndarray, end: np.ndarray, per_unit: float, most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return even places along edges, at least one of each.

    Args:
        start: Where edges begin, shape ``[s, 3]``.
        end: Where they end.
        per_unit: How many places a unit of length has.
        most: How many an edge has at most.

    Returns:
        Number of the edge of every place, shape ``[n]``; the places, shape ``[n, 3]``; and the length of edge that each stands for,
        shape ``[n]``.
    """
    along = end - start
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.ceil(per_unit * length), 1, most).astype(np.int64)
    number = np.repeat(np.arange(len(start)), count)
    within = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    place = start[number] + along[number] * ((within + 0.5) / count[number])[:, None]
    return number, place, (length / count)[number]
