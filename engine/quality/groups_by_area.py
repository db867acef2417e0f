"""Bodies that are measured together: those of a class that are about as large as each other.

Coverage errors look no farther than the usual spacing, so a boulder among gravel is one heavy spot whatever stands around it. Where
outlines are kept apart, a class's small bodies are measured beside the ground of its large ones, as if these were of another class,
and these by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..problem.ground_of_large import LARGE
from ..problem.placement import Placement

__all__ = ["GroupsByArea", "bodies_by_class", "groups_by_area"]


@dataclass(frozen=True, eq=False)
class GroupsByArea:
    """Groups of bodies, class by class; within each, smallest areas first. Most classes have a single one.

    Attributes:
        of_class: Class of every group.
        own: Bodies of every group.
        index: Group of every body, shape ``[n]``, int32.
        total: Footprints of every group, added up [m²].
    """

    of_class: list[int]
    own: list[slice | np.ndarray]
    index: np.ndarray
    total: list[float]

    def of_classes(self, values: Sequence[float]) -> list[float]:
        """Return the mean over the groups of every class of a value of each, weighted by their footprints."""
        result = []
        for one in range(self.of_class[-1] + 1):
            of_one = [(v, total) for v, total, c in zip(values, self.total, self.of_class, strict=True) if c == one]
            whole = sum(total for _, total in of_one)
            result.append(of_one[0][0] if len(of_one) == 1 else sum(v * total for v, total in of_one) / whole)
        return result


def groups_by_area(placement: Placement, area: np.ndarray) -> GroupsByArea:
    """Return which bodies of a placement are measured together: all of a class where outlines may overlap.

    Args:
        placement: The placement.
        area: Its bodies' footprints [m²], shape ``[n]``.
    """
    of_class: list[int] = []
    found: list[slice | np.ndarray] = []
    classes = bodies_by_class(placement.class_index, len(placement.problem.classes))
    for one, bodies in enumerate(classes):
        apart = _by_area(area[bodies]) if placement.problem.avoid_overlap else []
        found += [bodies.start + some for some in apart] if len(apart) > 1 else [bodies]
        of_class += [one] * max(len(apart), 1)
    index = placement.class_index
    if len(found) > len(classes):
        index = np.zeros(len(area), np.int32)
        for number, own in enumerate(found):
            index[own] = number
    return GroupsByArea(of_class, found, index, [float(area[own].sum()) for own in found])


def bodies_by_class(class_index: np.ndarray, classes: int) -> list[slice]:
    """Return the bodies of every class, which come one class after the other."""
    if classes == 1 and class_index[-1:].sum() == 0:
        return [slice(0, len(class_index))]
    # Of another type NumPy would make a copy of the whole table.
    first = np.searchsorted(class_index, np.arange(classes + 1, dtype=class_index.dtype)).tolist()
    return [slice(begin, end) for begin, end in pairwise(first)]


def _by_area(area: np.ndarray) -> list[np.ndarray]:
    """Return groups, smallest bodies first: in none a body is so large beside the mean of all smaller ones that it counts as large."""
    if not len(area) or area.max() < LARGE * area.min():
        return []
    result, left = [], np.argsort(area, kind="stable")
    while len(left):
        ordered = area[left]
        mean_before = np.cumsum(ordered[:-1]) / np.arange(1, len(left))
        first = np.flatnonzero(ordered[1:] >= LARGE * mean_before)[:1] + 1
        end = int(first[0]) if len(first) else len(left)
        result.append(np.sort(left[:end]))
        left = left[end:]
    return result
