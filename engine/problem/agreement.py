"""How far the directions of long bodies agree that keep the turns they are given: what agrees fits more closely."""

from __future__ import annotations

import numpy as np

from .body_footprints import BodyFootprints
from .packing import is_long
from .problem import Problem
from .surface import Surface

__all__ = ["agreement_of"]


def agreement_of(problem: Problem, footprints: BodyFootprints, area: np.ndarray) -> float:
    """How far the directions of long bodies that keep their turns agree, weighted by area: 1 if all are parallel, about 0 at random.

    0 where there are none, and where only a run tells how they lie.

    Args:
        problem: The problem.
        footprints: Its footprints.
        area: Of every outline, with the room that it keeps [m²], shape ``[n]``.
    """
    long = np.array([is_long(outline) for outline in footprints.shapes] + [False])
    kept = long[footprints.shape] & ~footprints.free
    if isinstance(problem.domain, Surface) or any(c.look_at is not None for c in problem.classes) or not kept.any():
        return 0.0
    across = np.array([_across(outline.corners) for outline in footprints.shapes] + [0.0])
    # A body that is turned half round lies as before.
    direction = np.exp(2j * (footprints.turn + across[footprints.shape]))[kept]
    return float(abs(np.average(direction, weights=area[kept])))


def _across(corners: np.ndarray) -> float:
    """Direction in which a core is narrowest [rad]."""
    edge = np.roll(corners, -1, axis=0) - corners
    edge = edge[np.hypot(*edge.T) > 0.0]
    if not len(edge):
        return 0.0
    normal = np.arctan2(-edge[:, 0], edge[:, 1])
    width = np.ptp(corners @ np.stack([np.cos(normal), np.sin(normal)]), axis=0)
    return float(normal[np.argmin(width)])
