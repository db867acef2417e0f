"""Groups of all bodies of a huge problem, and which body has which number, group and area, without a list of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..problem.fixed_table import FixedTable
from ..problem.footprints import DrawnFootprints
from ..problem.interaction import group_bodies
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.random_numbers import random_shares
from ..problem.size import Size, with_count
from .outlines import outline_areas, outlines_of_size

__all__ = ["TileGroups", "group_tiles", "in_turns"]

# Bodies of a size that say how its range is cut into levels: enough for as many levels as any number would have.
SAMPLE = 4096
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class TileGroups:
    """All groups, in class, then size order, those of a range smallest areas first.

    Attributes:
        class_index: Class of every group, shape ``[g]``.
        size_index: Size of every group among those of its class, shape ``[g]``.
        first: Number of every group's first body, and at the end the number of bodies, int64, shape ``[g + 1]``.
        first_of_size: Number of the first body of its size, int64, shape ``[g]``.
        mean_area: Mean area of its bodies [m²], shape ``[g]``.
        matrix: Interaction factors, shape ``[g, g]``.
        sizes: The size that each belongs to.
        seed: The problem's.
        fixed: Its fixed bodies; they are the last of their sizes.
        fixed_identity: Their numbers, ascending.
    """

    class_index: np.ndarray
    size_index: np.ndarray
    first: np.ndarray
    first_of_size: np.ndarray
    mean_area: np.ndarray
    matrix: np.ndarray
    sizes: tuple[Size, ...]
    seed: int
    fixed: FixedTable
    fixed_identity: np.ndarray

    @property
    def number(self) -> int:
        """Number of groups."""
        return len(self.class_index)

    @property
    def count(self) -> np.ndarray:
        """Bodies of every group, int64, shape ``[g]``."""
        return np.diff(self.first)

    @cached_property
    def free_count(self) -> np.ndarray:
        """Bodies of every group that are not fixed, int64, shape ``[g]``: the first of each."""
        return self.count - np.bincount(self.group_of(self.fixed_identity), minlength=self.number)

    def is_fixed(self, identity: np.ndarray) -> np.ndarray:
        """Which bodies of these numbers are fixed, bool, shape ``[k]``."""
        if not len(self.fixed_identity):
            return np.zeros(len(identity), bool)
        place = np.minimum(np.searchsorted(self.fixed_identity, identity), len(self.fixed_identity) - 1)
        return self.fixed_identity[place] == identity

    def fixed_at(self, identity: np.ndarray) -> FixedTable:
        """What is said of fixed bodies of these numbers."""
        place = np.searchsorted(self.fixed_identity, identity)
        return FixedTable(*(column[place] for column in self.fixed))

    @property
    def layer(self) -> np.ndarray:
        """Which size every group belongs to, counted over all classes, shape ``[g]``: levels of a range are of one."""
        return np.unique(self.first_of_size, return_inverse=True)[1].ravel()

    @property
    def layers(self) -> int:
        """Number of sizes, counted over all classes."""
        return len(np.unique(self.first_of_size))

    @property
    def body_count(self) -> int:
        """Number of bodies."""
        return int(self.first[-1])

    def group_of(self, identity: np.ndarray) -> np.ndarray:
        """Group of bodies of these numbers, shape ``[k]``."""
        return np.searchsorted(self.first, identity, side="right") - 1

    def identities(self, group: int, begin: int, end: int) -> np.ndarray:
        """Numbers of the bodies ``begin`` to ``end - 1`` of those of a group that are not fixed, int64, shape ``[k]``, ascending.

        Those of a range are taken in turns from all over its areas, so that every tile gets small and large ones.
        """
        turn = np.arange(begin, end, dtype=np.int64)
        count = int(self.free_count[group])
        if self.sizes[group].is_range:
            turn = np.sort(in_turns(turn, count))
        return self.first[group] + turn

    def areas(self, identity: np.ndarray) -> np.ndarray:
        """Area of bodies of these numbers [m²], float64."""
        group, fixed = self.group_of(identity), self.is_fixed(identity)
        result = np.zeros(len(identity))
        for g in np.unique(group).tolist():
            own = np.flatnonzero((group == g) & ~fixed)
            rank = identity[own] - self.first_of_size[g]
            size = self._with_free(g)
            result[own] = _areas_of_size(size, rank, (self.seed, *self._class_and_size(g)))
        if fixed.any():
            result[fixed] = self.fixed.area[np.searchsorted(self.fixed_identity, identity[fixed])]
        return result

    def _with_free(self, group: int) -> Size:
        """The size of a group with so many bodies as are not fixed."""
        size = self.sizes[group]
        fixed = self.fixed.number_of(*self._class_and_size(group)) if len(self.fixed_identity) else 0
        return size if not fixed else with_count(size, (size.count or 0) - fixed)

    def outlines(self, identity: np.ndarray) -> DrawnFootprints:
        """Outlines of bodies of these numbers; of those that have none the first, as large as it is and not turned."""
        group = self.group_of(identity)
        n = len(identity)
        variant, scale, turn = np.zeros(n, np.int32), np.ones(n), np.zeros(n)
        fixed = self.is_fixed(identity)
        for g in np.unique(group).tolist():
            size = self.sizes[g]
            if size.footprint is None:
                continue
            own = np.flatnonzero((group == g) & ~fixed)
            rank = identity[own] - self.first_of_size[g]
            c, s = self._class_and_size(g)
            area = self.areas(identity[own]) if isinstance(size.area, tuple) else None
            drawn = outlines_of_size(self._with_free(g), rank, (self.seed, 5, c, s), area)
            variant[own], scale[own], turn[own] = drawn.variant, drawn.scale, drawn.turn
            own = np.flatnonzero((group == g) & fixed)
            place = np.searchsorted(self.fixed_identity, identity[own])
            variant[own] = np.minimum(self.fixed.variant[place], len(size.outlines) - 1)
            turn[own] = 0.0 if size.kind.has_axis else self.fixed.angle[place]
            # One whose scale is not said has its area, where that is the outline's.
            by_area = np.ones(len(own))
            if size.area is None or isinstance(size.area, tuple):
                by_area = np.sqrt(self.fixed.area[place] / np.array([k.area for k in size.outlines])[variant[own]])
            scale[own] = np.where(np.isnan(self.fixed.scale[place]), by_area, self.fixed.scale[place])
        return DrawnFootprints(variant, scale, turn)

    @property
    def outlined(self) -> bool:
        """Whether there are bodies with outlines of their own."""
        return any(size.footprint is not None for size in self.sizes)

    def _class_and_size(self, group: int) -> tuple[int, int]:
        return int(self.class_index[group]), int(self.size_index[group])


def group_tiles(problem: Problem, densities: Sequence[np.ndarray] | None = None) -> TileGroups:
    """Return the groups of a problem of any number of bodies.

    Args:
        problem: The problem.
        densities: Coarse images of the densities of its classes, which may be read by window; None where only counts matter.
    """
    sample = _sample(problem)
    groups = group_bodies(sample, sample_of=problem, densities=densities)
    sampled = np.bincount(groups.body_group, minlength=groups.count)
    rows = []
    areas = sample.body_areas()
    total, start, g = 0, 0, 0
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            count, few = size.count or 0, sample.classes[c].sizes[s].count or 0
            first_of_size, covered, reached = total, 0, 0
            while covered < few:
                covered += int(sampled[g])
                end = round(count * covered / few)
                mean = float(areas[start : start + int(sampled[g])].mean())
                rows.append((c, s, total, first_of_size, mean, size))
                total += end - reached
                reached, start, g = end, start + int(sampled[g]), g + 1
    return TileGroups(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([*(row[2] for row in rows), total], np.int64),
        np.array([row[3] for row in rows], np.int64),
        np.array([row[4] for row in rows]),
        groups.matrix,
        tuple(row[5] for row in rows),
        problem.seed,
        problem.fixed,
        _fixed_identities(problem),
    )


def _fixed_identities(problem: Problem) -> np.ndarray:
    """Numbers of fixed bodies, in the order of the problem's table: of every size they come last."""
    result, total = [np.zeros(0, np.int64)], 0
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            total += size.count or 0
            fixed = problem.fixed.number_of(c, s)
            result.append(np.arange(total - fixed, total, dtype=np.int64))
    return np.concatenate(result)


def _sample(problem: Problem) -> Problem:
    """The problem with so few bodies of every size that they can be looked at one by one, smallest areas first."""
    classes = []
    for number, c in enumerate(problem.classes):
        sizes = []
        for index, size in enumerate(c.sizes):
            if size.footprint is not None:
                size = _without_outlines(size, (problem.seed, number, index))
            if isinstance(size.distribution, np.ndarray):
                # Of fixed ones no area is listed.
                listed = with_count(size, len(size.distribution))
                sizes.append(replace(listed, distribution=np.sort(size.distribution)))
                continue
            few = with_count(size, min(size.count or 0, SAMPLE))
            sizes.append(few if not size.is_range else replace(few, distribution="linear"))
        classes.append(PreparedClass(c.name, tuple(sizes), np.ones((1, 1), np.float32)))
    return Problem(problem.domain, classes, problem.balance, seed=problem.seed)


def _without_outlines(size: Size, seed: tuple[int, int, int]) -> Size:
    """A size of discs or lines whose areas are those of a size's outlines; as many of a range as are looked at."""
    count = size.count or 0
    if size.area is not None:
        return with_count(replace(size, footprint=None, count=None), count)
    if not size.is_range:
        return with_count(replace(size, footprint=None, count=None, area=size.mean_area), count)
    few = min(count, SAMPLE)
    rank = ((np.arange(few) + 0.5) * count / max(few, 1)).astype(np.int64)
    area = np.sort(_areas_of_size(size, rank, seed))
    span = (float(area[0]), float(area[-1]))
    if span[0] == span[1]:
        return with_count(replace(size, footprint=None, count=None, area=span[0]), few)
    return replace(size, footprint=None, share=None, count=few, area=span, distribution=area)


def _areas_of_size(size: Size, rank: np.ndarray, seed: tuple[int, int, int]) -> np.ndarray:
    """Areas of the bodies of a size by their ranks, smallest first; see :class:`~esh.Size`.

    Args:
        size: The size.
        rank: From 0.
        seed: The problem's, and the indices of class and size.
    """
    if size.area is None:
        return outline_areas(size, outlines_of_size(size, rank, (seed[0], 5, *seed[1:]), None))
    if not isinstance(size.area, tuple):
        return np.full(len(rank), float(size.area or 0.0))
    if isinstance(size.distribution, np.ndarray):
        return np.sort(size.distribution)[rank]
    low, high = size.area
    count = size.count or 0
    if size.distribution == "uniform":
        return low + (high - low) * (rank + random_shares(rank, [seed[0], 2, *seed[1:]])) / count
    return low + (high - low) * rank / (count - 1) if count > 1 else np.full(len(rank), size.mean_area)


def in_turns(place: np.ndarray, count: int) -> np.ndarray:
    """Places, shape ``[k]``, of 0 to ``count - 1``, permuted: those that follow one another are far apart and spread over all."""
    stride = max(1, round(GOLDEN * count))
    while math.gcd(stride, count) > 1:
        stride += 1
    return place * stride % count
