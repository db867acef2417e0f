"""Groups of bodies, and the interaction matrix between them.

The matrices are those of figures 5 to 8 of the paper (Schmaltz, Gwosdek and Weickert 2012).

A group is one size of one class; where sizes are a range, one level of it. The paper's entries carry the charges of both
partners; here charges belong to the bodies and the matrix holds the factors that remain, so equation 7's attraction strengths
follow from it and need no formula.

Every group has an *emphasis* e: C^rank among the sizes of its class, or a power of the area where areas are a range. Two groups see
each other with min(e_g, e_h), times the factor between their classes. The first is a positive semidefinite kernel whatever the
emphases are, the second is checked by :class:`~esh.engine.problem.balance.Balance`, and so is their product.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .ground_of_large import LEAST_RATIO, Bodies, Together, ground_radius, most_alone, spread_among_large
from .of_bodies import of_all
from .prepared_class import PreparedClass
from .problem import Problem
from .size import ALIKE, Size

__all__ = ["LEVELS", "Groups", "group_bodies", "most_levels"]

# Levels of a range of areas: the continuous matrix min(A_j², A_k²) is a sum of thresholds, and so many steps of it leave the
# coverage errors where more would.
LEVELS = 24
# A handful of bodies has no use for so many, each of which costs a transform: this many times the square root of their number, and at
# least so many. Measured, 10, 20 and 24 levels of 1,500 bodies leave coverage errors within 2 % of each other.
LEVELS_PER_ROOT = 0.5
FEWEST_LEVELS = 4
# Small bodies gather where at least so many come to each large one that they share gaps, and they are asked to fill less than a share
# of the ground. Measured with 60 large squares: else their nearest neighbors are about as far as those of random points.
GATHERING = ((2.0, 0.1), (1.0, 0.005))
# Where no two areas differ by more than that, none gather.
LEAST_SPAN = 16.0
# Share of the ground that they fill then. More brings them close to the large ones, which have to turn for them; these are as even
# with 0.8 as with 0.5 and without. And the largest factor for that, as large as an emphasis may be.
FILLED, LARGEST_FACTOR = 0.5, 1e6


@dataclass(frozen=True, eq=False)
class Groups:
    """Which group every body belongs to, and how groups see each other.

    Attributes:
        body_group: Group of every body, shape ``[body_count]``, int32.
        class_index: Class of every group, shape ``[group_count]``.
        matrix: Interaction factors, shape ``[group_count, group_count]``, float64, symmetric and positive semidefinite.
    """

    body_group: np.ndarray
    class_index: np.ndarray
    matrix: np.ndarray

    @property
    def count(self) -> int:
        """Number of groups."""
        return len(self.class_index)

    @cached_property
    def first_body(self) -> np.ndarray | None:
        """Where the bodies of every group begin and, at the end, their number, shape ``[group_count + 1]``.

        None where they do not come group after group, as those of a range of areas.
        """
        group = self.body_group
        if self.count == 1:
            return np.array([0, len(group)])
        if not (group[1:] >= group[:-1]).all():
            return None
        # Of another type NumPy would make a copy of the whole table.
        return np.searchsorted(group, np.arange(self.count + 1, dtype=group.dtype))

    @property
    def body_count(self) -> np.ndarray:
        """Bodies of every group, shape ``[group_count]``."""
        if self.first_body is None:
            return np.bincount(self.body_group, minlength=self.count)
        return np.diff(self.first_body)


def group_bodies(
    problem: Problem,
    levels: int = LEVELS,
    area: np.ndarray | None = None,
    sample_of: Problem | None = None,
    densities: Sequence[np.ndarray] | None = None,
) -> Groups:
    """Sort the bodies of ``problem`` into groups.

    Args:
        problem: What is to be placed.
        levels: Groups that a range of areas is cut into, at most.
        area: Footprints of the bodies [m²], shape ``[body_count]``; None for those that the problem draws.
        sample_of: What ``problem`` has samples of, with the same classes and sizes; None if it has all bodies.
        densities: Images of the classes' densities where the problem has others in their place; None if it has them.
    """
    area = problem.shared_areas() if area is None else area
    whole = sample_of or problem
    first_body = 0
    groups: list[np.ndarray] = []
    class_index: list[int] = []
    emphasis: list[float] = []
    # What each is a group of, and for how many bodies one of a sample stands.
    size_of_group: list[Size] = []
    stand_for: list[float] = []
    for c, body_class in enumerate(problem.classes):
        of_size = _size_emphases(problem, body_class)
        for size, size_emphasis, of_all_bodies in zip(body_class.sizes, of_size, whole.classes[c].sizes, strict=True):
            bodies = slice(first_body, first_body + (size.count or 0))
            first_body = bodies.stop
            level, level_emphasis = np.zeros(1, np.int32), np.array([size_emphasis])
            if _is_cut(problem, size):
                most = most_levels(size) if levels == LEVELS else levels
                level, level_emphasis = _levels(area[bodies] / _unit_of_area(problem), _exponent(problem), most)
            groups.append(np.broadcast_to(np.int32(len(emphasis)) + level, size.count or 0))
            emphasis.extend(level_emphasis.tolist())
            class_index.extend([c] * len(level_emphasis))
            size_of_group.extend([of_all_bodies] * len(level_emphasis))
            stand_for.extend([(of_all_bodies.count or 0) / max(size.count or 0, 1)] * len(level_emphasis))
    body_group = of_all(np.int32(0), len(area)) if len(emphasis) == 1 else np.concatenate(groups)
    e = np.array(emphasis)
    # Only ratios count: the least emphasis of every class is 1, as in the paper's tables.
    index = np.array(class_index)
    for c in range(len(problem.classes)):
        e[index == c] /= e[index == c].min()
    counts = [c.body_count for c in whole.classes]
    # Of its largest size: how many there are of each, samples do not tell.
    areas = [max(size.mean_area for size in c.sizes) for c in problem.classes]
    together = Together(whole, densities)
    between = problem.balance.class_factors(counts, areas, most_alone(together))[np.ix_(index, index)]
    matrix = between * np.minimum(e[:, None], e[None, :])
    if len(e) > 1:
        number, charge = (np.bincount(body_group, weights, len(e)) * stand_for for weights in (None, area))
        mean = charge / np.maximum(number, 1.0)
        of_groups = zip(class_index, size_of_group, mean.tolist(), strict=True)
        radius = [ground_radius(whole.classes[c], size, one) for c, size, one in of_groups]
        matrix = spread_among_large(together, Bodies(index, number, mean, np.array(radius)), matrix, between)
        spans = [one for c in problem.classes for size in c.sizes for one in size.area_span]
        if min(spans) * LEAST_SPAN <= max(spans):
            matrix = _spread_small(matrix, between, number, charge)
    return Groups(body_group, index, matrix)


def _spread_small(matrix: np.ndarray, between: np.ndarray, number: np.ndarray, charge: np.ndarray) -> np.ndarray:
    """Return factors with which small bodies do not gather in the gaps between much larger ones.

    Large bodies repel small ones with all of their charge. So the energy is least where the small ones fill the gaps between them as
    densely as the density asks of all together: they crowd on a share of the ground that is their share of the charge. Where that is
    very little, they get a term of their own, in which the large ones have no part, so strong that they fill :data:`FILLED`. What
    is added is positive semidefinite.

    Args:
        matrix: Interaction factors of groups.
        between: Those of their classes alone.
        number: Bodies of every group.
        charge: Their charge.
    """
    mean = charge / np.maximum(number, 1.0)
    order = np.argsort(mean, kind="stable")
    for last in range(len(order) - 1, 0, -1):
        if mean[order[last - 1]] * LEAST_RATIO > mean[order[last]]:
            continue
        small = np.zeros(len(order), bool)
        small[order[:last]] = True
        total = float(charge[small].sum())
        if not total > 0.0:
            continue
        own = np.where(small, charge, 0.0) / total
        filled, seen = float(own @ matrix @ own), float(own @ matrix @ (charge / total))
        many, few = number[small].sum(), number[~small].sum()
        if any(many >= least * few and filled < share * seen for least, share in GATHERING):
            factor = (FILLED * seen - filled) / ((1.0 - FILLED) * float(own @ between @ own))
            matrix = matrix + min(factor, LARGEST_FACTOR) * between * np.outer(small, small)
    return matrix


def _exponent(problem: Problem) -> float:
    """Power of the area that is the emphasis of a range: 2, the paper's, for C = 2."""
    emphasis = problem.balance.size_emphasis
    assert isinstance(emphasis, float)
    return 2.0 * math.log2(emphasis)


def _unit_of_area(problem: Problem) -> float:
    """Area [m²] whose emphasis is 1: only ratios count, but powers of very large and very small areas leave the range of float64."""
    areas = np.array([area for c in problem.classes for size in c.sizes for area in size.area_span])
    powers = _exponent(problem) * np.abs(np.log10(areas)).max()
    return 1.0 if powers < 100.0 else float(areas.max())


def _is_cut(problem: Problem, size: Size) -> bool:
    """Whether areas of a size get emphases of their own: where these are listed, size by size, outlines of one size share one."""
    return size.is_range and (isinstance(size.area, tuple) or isinstance(problem.balance.size_emphasis, float))


def _size_emphases(problem: Problem, body_class: PreparedClass) -> list[float]:
    """Emphasis of every size: by rank where all are single areas, by the mean area's power beside a range."""
    emphasis = problem.balance.size_emphasis
    if any(_is_cut(problem, size) for size in body_class.sizes):
        exponent, unit = _exponent(problem), _unit_of_area(problem)
        return [(size.mean_area / unit) ** exponent for size in body_class.sizes]
    # Equal areas share a rank.
    rank = np.unique([size.ranked_area for size in body_class.sizes], return_inverse=True)[1].ravel()
    if isinstance(emphasis, tuple):
        return np.array([1.0, *emphasis])[rank].tolist()
    assert isinstance(emphasis, float)
    return (emphasis ** rank.astype(np.float64)).tolist()


def most_levels(size: Size) -> int:
    """Levels that the areas of a size are cut into at most: a handful has no use for many, each of which costs a transform."""
    if not size.is_range:
        return 1
    # Counts may be larger than any float.
    most = max(FEWEST_LEVELS, min(LEVELS, math.ceil(LEVELS_PER_ROOT * math.sqrt(min(size.count or 0, 10**6)))))
    if size.area is not None:
        return most
    # Outlines have the areas that they have, and nobody asked for one size after the other to be even: what is alike is one level, and
    # a handful is one, too.
    low, high = size.area_span
    of_count = int(LEVELS_PER_ROOT * math.sqrt(min(size.count or 0, 10**6)))
    return max(1, min(most, of_count, math.ceil(math.log(high / low) / math.log(ALIKE))))


def _levels(area: np.ndarray, exponent: float, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut areas into levels of equal width: the level of every body, and the mean emphasis of every level that has bodies."""
    low, high = float(area.min()), float(area.max())
    width = (high - low) / most
    if width <= 0.0:
        return np.zeros(len(area), np.int32), np.array([low**exponent])
    level = np.minimum(((area - low) / width).astype(np.int64), most - 1)
    level = np.unique(level, return_inverse=True)[1].ravel()
    mean = np.bincount(level, weights=area**exponent) / np.bincount(level)
    return level.astype(np.int32), mean
