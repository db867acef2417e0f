"""Whether long bodies that keep apart stand so close together that they could tangle."""

from __future__ import annotations

import math

from ..problem.problem import Problem
from ..problem.size import Size

__all__ = ["may_tangle"]

# What is longer than so many times its width is long.
LONG = 2.5
# Ground that bodies cover however they turn, over the ground that they have, from which on long ones among them tangle. Up to 1.4 none
# of 8 crowds of sticks and discs kept overlaps however soft they were; of compact outlines none did up to a cover of .8, where points
# keep some as well.
CROWDED = 1.0


def may_tangle(problem: Problem, spacing: float) -> bool:
    """Tell whether soft bodies could slip through each other so that contact cannot part them again.

    Args:
        problem: Whose outlines keep apart, or not.
        spacing: Of charges, where the average body is [m].
    """
    sizes = [size for c in problem.classes for size in c.sizes]
    if not problem.avoid_overlap or not any(_is_long(size) for size in sizes):
        return False
    around = sum((size.count or 0) * math.pi * _reach(size) ** 2 for size in sizes)
    return around > CROWDED * problem.charge_count * spacing**2


def _is_long(size: Size) -> bool:
    return size.line is not None or any(2.0 * one.circumradius > LONG * one.width for one in size.outlines)


def _reach(size: Size) -> float:
    """How far a body reaches from its middle [m], with the room that it keeps."""
    reach = size.longest_reach if size.outlines else 0.5 * size.kind.extent(size.area_span[1])
    return size.room * reach + 0.5 * size.gap
