"""Convex obstacles as outlines that stand among the bodies and do not move: outlines are parted from them as from each other."""

from __future__ import annotations

import numpy as np

from ..problem.footprint import Footprint
from ..problem.obstacles import convex_outline
from ..problem.problem import Problem

__all__ = ["StandingOutlines", "standing_outlines"]


class StandingOutlines:
    """Outlines of obstacles, each about a place inside the domain.

    Args:
        outlines: In the domain [m].
        size: Of the domain [m].

    Attributes:
        position: The places [m], shape ``[m, 2]``.
        footprints: The outlines as they are seen from there.
    """

    def __init__(self, outlines: list[Footprint], size: tuple[float, float]) -> None:
        middle = np.array([outline.middle for outline in outlines]).reshape(-1, 2)
        # Cells of neighbors know places inside the domain only.
        self.position = np.clip(middle, 0.0, np.nextafter(np.array(size), 0.0))
        self.footprints = [
            Footprint(outline.corners - place, outline.rounding)
            for outline, place in zip(outlines, self.position, strict=True)
        ]

    def __len__(self) -> int:
        return len(self.footprints)


def standing_outlines(problem: Problem) -> StandingOutlines:
    """Return the convex obstacles of a problem that come upon its domain."""
    domain = problem.rectangle
    found = []
    for outline in map(convex_outline, problem.obstacles):
        if outline is None:
            continue
        low, high = (limit(outline.corners, axis=0) for limit in (np.min, np.max))
        # In a periodic domain they go on at the other side.
        if domain.periodic or ((high >= -outline.rounding) & (low <= np.array(domain.size) + outline.rounding)).all():
            found.append(outline)
    return StandingOutlines(found, domain.size)
