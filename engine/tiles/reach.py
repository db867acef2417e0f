"""How far footprints reach from the positions of their bodies: across the cuts of windows, which see no more than their own bodies."""

from __future__ import annotations

import numpy as np

from ..problem.problem import Problem
from ..problem.size import Size
from .groups import TileGroups

__all__ = ["largest_reach", "reaches"]


def reaches(problem: Problem, groups: TileGroups, identity: np.ndarray) -> np.ndarray:
    """Return how far bodies reach with the room that they keep from others [m], shape ``[k]``, float64, however they lie.

    Args:
        problem: What is to be placed.
        groups: Its groups.
        identity: Numbers of the bodies, shape ``[k]``.
    """
    group, area = groups.group_of(identity), groups.areas(identity)
    drawn = groups.outlines(identity) if groups.outlined else None
    result = np.zeros(len(identity))
    for g in np.unique(group).tolist():
        size, own = groups.sizes[g], np.flatnonzero(group == g)
        if drawn is None or size.footprint is None:
            far = size.kind.reach_across(area[own])
        else:
            circle = np.array([outline.circumradius for outline in size.outlines])
            far = circle[drawn.variant[own]] * drawn.scale[own]
        result[own] = _with_room(problem, int(groups.class_index[g]), size, far)
    return result


def largest_reach(problem: Problem, groups: TileGroups) -> float:
    """Return the longest of all :func:`reaches` [m], without looking at every body."""
    far = [
        float(_with_room(problem, c, size, _farthest(size))[0])
        for c, body_class in enumerate(problem.classes)
        for size in body_class.sizes
    ]
    return max([*far, *reaches(problem, groups, groups.fixed_identity).tolist()])


def _farthest(size: Size) -> np.ndarray:
    """How far the largest body of a size reaches across its axis, or from its position [m], without room; shape ``[1]``."""
    if size.footprint is not None:
        return np.array([size.longest_reach])
    return size.kind.reach_across(np.array(size.area_span[1:]))


def _with_room(problem: Problem, class_index: int, size: Size, far: np.ndarray) -> np.ndarray:
    body_class = problem.classes[class_index]
    along = 0.0 if size.line is None else 0.5 * size.line.longest
    return (along + far) * size.room * body_class.room + 0.5 * (size.gap + body_class.gap)
