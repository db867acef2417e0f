"""The copies of bodies that a periodic domain shows where they reach over its edges."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..problem.placement_footprints import footprints_of_placement

if TYPE_CHECKING:
    from ..problem.placement import Placement

__all__ = ["Copies", "boxes_of_bodies", "copies_of_bodies", "copies_within"]

# Copies on either side along an axis: of lines that are longer than so many domains, the rest is not drawn.
MOST_COPIES = 32

# By how much what is drawn is shifted [m], shape [2], and which of it can then be seen, shape [n], bool.
Copies = list[tuple[np.ndarray, np.ndarray]]


def copies_within(low: np.ndarray, high: np.ndarray, size: tuple[float, float]) -> Copies:
    """By how much a periodic domain repeats what lies in boxes, and which of them can then be seen.

    Args:
        low: Lower left corners of the boxes [m], shape ``[n, 2]``.
        high: Upper right ones.
        size: Extent of the domain [m].
    """
    if not len(low):
        return [(np.zeros(2), np.zeros(0, dtype=bool))]
    # Clipped before they become whole numbers: those of an endless line are none.
    first = np.clip(np.floor(-high.max(axis=0) / size) + 1.0, -MOST_COPIES, 0).astype(int).tolist()
    last = np.clip(np.ceil((np.array(size) - low.min(axis=0)) / size) - 1.0, 0, MOST_COPIES).astype(int).tolist()
    result = []
    for y in range(first[1], last[1] + 1):
        for x in range(first[0], last[0] + 1):
            shift = np.array([x, y]) * size
            result.append((shift, ((high + shift > 0.0) & (low + shift < size)).all(axis=1)))
    return result


def copies_of_bodies(placement: Placement) -> Copies:
    """As :func:`copies_within`, for the bodies of a placement; in an open domain, every body once."""
    domain = placement.problem.rectangle
    if not domain.periodic:
        return [(np.zeros(2), np.ones(len(placement.position), dtype=bool))]
    return copies_within(*boxes_of_bodies(placement), domain.size)


def boxes_of_bodies(placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Lower left and upper right corners of boxes around bodies [m], shape ``[n, 2]`` each."""
    half = 0.5 * placement.length[:, None] * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)
    low = placement.position - np.abs(half)
    high = placement.position + np.abs(half)
    if placement.bends is not None:
        bent = np.isfinite(placement.bends[:, 0, 0])
        if bent.any():
            low[bent], high[bent] = np.nanmin(placement.bends[bent], axis=1), np.nanmax(placement.bends[bent], axis=1)
    # A disc of the domain's diagonal covers all of it from wherever it is: no copy of a larger one adds anything.
    footprints = footprints_of_placement(placement)
    radius = np.where(footprints.is_outline, np.maximum(footprints.circumradius, placement.radius), placement.radius)
    radius = np.minimum(radius, math.hypot(*placement.problem.rectangle.size))[:, None]
    return low - radius, high + radius
