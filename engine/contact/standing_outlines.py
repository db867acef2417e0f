"""Convex obstacles as outlines that stand among the bodies and do not move: outlines are parted from them as from each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..problem.footprint import Footprint
from ..problem.problem import Problem

__all__ = ["StandingOutlines", "standing_outlines"]


@dataclass(frozen=True, eq=False)
class StandingOutlines:
    """Outlines of obstacles, each seen from a place inside the domain.

    Attributes:
        outlines: The outlines, about the domain's origin [m].
        position: The places [m], shape ``[m, 2]``.
    """

    outlines: Sequence[Footprint]
    position: np.ndarray

    def __len__(self) -> int:
        return len(self.outlines)


def standing_outlines(problem: Problem, reach: float, *, has_edges: bool) -> StandingOutlines:
    """Return the convex obstacles of a problem that bodies may touch which reach so far beyond its domain [m].

    Where that has no edges, all obstacles come upon it somewhere.
    """
    size = np.array(problem.rectangle.size)
    found = []
    for obstacle in problem.obstacles:
        outline = obstacle.outline
        if outline is None:
            continue
        away = outline.rounding + reach
        near = (outline.corners.max(axis=0) >= -away) & (outline.corners.min(axis=0) <= size + away)
        if near.all() or not has_edges:
            found.append(outline)
    middle = np.array([outline.middle for outline in found]).reshape(-1, 2)
    # Cells of neighbors know places inside the domain only.
    return StandingOutlines(found, np.clip(middle, 0.0, np.nextafter(size, 0.0)))
