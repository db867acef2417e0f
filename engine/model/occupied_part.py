"""The part of a domain that forces are computed in, where that is a small one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..problem.problem import Problem
from ..space.asked_counts import typical_spacing
from ..space.part import LARGEST_PART, Part, part_of
from ..space.space import Space

__all__ = ["occupied_part"]

# How far around all densities it reaches, in spacings: what is farther, across a border that is a mirror or joined, is even.
ROOM_AROUND = 6.0


def occupied_part(problem: Problem, images: Iterable[np.ndarray] | None = None) -> Part | None:
    """Return the part of a rectangle that holds all bodies and what attracts them, with some room around; None for no small one.

    Args:
        problem: The problem.
        images: What attracts them, densities over the domain; None for those of the classes.
    """
    part = part_of([c.density_image for c in problem.classes] if images is None else images)
    if part is None:
        return None
    domain = problem.rectangle
    longest = max(size.kind.longest for c in problem.classes for size in c.sizes)
    part = part.with_positions(problem.fixed.position, domain.size)
    part = part.with_margin(ROOM_AROUND * typical_spacing(problem) + 0.5 * longest, domain.size)
    # Across borders that are joined, or mirrors, others are seen.
    sees_across = domain.mirrored or not Space.of(domain).has_edges
    return None if part.share > LARGEST_PART or (sees_across and part.touches_border) else part
