"""Obstacles that are outlines on a surface, and how far points of it are from them.

Everything here is told by the outlines themselves, each in the plane between the two that touch the smooth surface at it and at a
point, as outlines of bodies meet each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from weakref import ref

import numpy as np

from ..geometry.outline_distances import OutlineCorners
from ..geometry.unit_vectors import turned, unit_vectors
from .footprint import Footprint
from .one_sheet import LEAST_COSINE, STEEPER
from .surface import PointsOnSurface

__all__ = ["OutlinesOnSurface"]

# Levels of size, each of outlines within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
# Points whose share is remembered, at most so many times some.
MOST_KNOWN = 4
# Points that are looked at together: as many as a processor's cache holds with all that is worked out of them.
POINTS_AT_ONCE = 10_000
# Couples of a point and a spot that are.
COUPLES_AT_ONCE = 25_000


@dataclass(frozen=True, eq=False)
class OutlinesOnSurface:
    """Outlines that lie on a surface; arrays of shape ``[m]`` unless said otherwise, lengths in meters.

    Attributes:
        shapes: The outlines that there are, without margins.
        shape: Which of them each is, int32.
        scale: Factor on it.
        margin: How far bodies keep off its edge.
        points: Where on the surface the origins are.
        position: The same, shape ``[m, 3]``.
        normal: Where the smooth surface looks to there, shape ``[m, 3]``.
        along: Where their x axes point along that, shape ``[m, 3]``.
        away: How far from the surface they were given [m].
        spot: Number of the spot that each lies at, int64: those of one spot have one place, normal and direction.
    """

    shapes: tuple[Footprint, ...]
    shape: np.ndarray
    scale: np.ndarray
    margin: np.ndarray
    points: PointsOnSurface
    position: np.ndarray
    normal: np.ndarray
    along: np.ndarray
    away: np.ndarray
    spot: np.ndarray
    _known: list[tuple[ref[PointsOnSurface], float, np.ndarray]] = field(default_factory=list, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.shape)

    @cached_property
    def rounding(self) -> np.ndarray:
        """Radius around the scaled cores, margins among it."""
        return np.array([one.rounding for one in self.shapes] + [0.0])[self.shape] * self.scale + self.margin

    @cached_property
    def reach(self) -> np.ndarray:
        """How far they reach from their origins, with their margins."""
        return np.array([one.circumradius for one in self.shapes] + [0.0])[self.shape] * self.scale + self.margin

    @property
    def out_of_reach(self) -> np.ndarray:
        """How far from the surface spots were given from which nothing reaches it [m]."""
        if not len(self):
            return self.away
        order, start, reach = self._spots
        away = self.away[order[start[:-1]]]
        return away[away > reach]

    def larger_than(self, reach: float) -> OutlinesOnSurface:
        """Those that reach farther [m]."""
        return self._some(self.reach > reach)

    def smaller_than(self, reach: float) -> OutlinesOnSurface:
        """All others."""
        return self._some(self.reach <= reach)

    def _some(self, chosen: np.ndarray) -> OutlinesOnSurface:
        points = self.points
        return OutlinesOnSurface(
            self.shapes,
            self.shape[chosen],
            self.scale[chosen],
            self.margin[chosen],
            points.surface.points(points.triangle[chosen], points.barycentric[chosen]),
            self.position[chosen],
            self.normal[chosen],
            self.along[chosen],
            self.away[chosen],
            self.spot[chosen],
        )

    def free(self, points: PointsOnSurface, edge: float) -> np.ndarray:
        """Return what outlines leave of a density at points, shape ``[n]``: it ends within an edge so wide [m]."""
        for known, width, values in self._known:
            # Classes that ask for the same points have it worked out once.
            if known() is points and width == edge:
                return values
        values = np.clip(0.5 + self.distance(points, 0.5 * edge) / edge, 0.0, 1.0)
        self._known[:] = [*self._known[1 - MOST_KNOWN :], (ref(points), edge, values)]
        return values

    def distance(self, points: PointsOnSurface, most: float) -> np.ndarray:
        """Return how far points of the surface are from the nearest outline with its margin [m], shape ``[n]``.

        It is below 0 within one, and ``most`` where none is so near.
        """
        position, normal = points.position, points.normal
        result = np.full(len(position), most)
        if not len(self):
            return result
        for level in self._levels(most):
            for first in range(0, len(position), POINTS_AT_ONCE):
                some = slice(first, first + POINTS_AT_ONCE)
                row, spot = level.near(position[some])
                for begin in range(0, len(row), COUPLES_AT_ONCE):
                    couples = slice(begin, begin + COUPLES_AT_ONCE)
                    self._bring_nearer(result[some], position[some], normal[some], row[couples], spot[couples], most)
        return result

    @cached_property
    def _spots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outlines ordered by spot; where those of every spot begin, shape ``[spots + 1]``; and how far they reach from it [m]."""
        order = np.argsort(self.spot, kind="stable")
        start = np.flatnonzero(np.diff(self.spot[order], prepend=-1))
        return order, np.append(start, len(order)), np.maximum.reduceat(self.reach[order], start)

    def _levels(self, most: float) -> Iterator[_Level]:
        order, start, reach = self._spots
        level = np.clip(np.log2(reach.max() / reach), 0, MOST_LEVELS - 1).astype(int)
        for number in np.unique(level).tolist():
            own = np.flatnonzero(level == number)
            yield _Level(own, self.position[order[start[own]]], float(reach[own].max()) + most)

    def _bring_nearer(
        self,
        result: np.ndarray,
        position: np.ndarray,
        normal: np.ndarray,
        row: np.ndarray,
        spot: np.ndarray,
        most: float,
    ) -> None:
        """Bring the distances of some couples of a point and the outlines of a spot into those of the points."""
        order, start, reach = self._spots
        lead = order[start[spot]]
        way = position[row] - self.position[lead]
        away = np.sqrt(np.einsum("nd,nd->n", way, way))
        near = np.flatnonzero(away < reach[spot] + most)
        row, spot, lead, way, away = row[near], spot[near], lead[near], way[near], away[near]
        here, there = normal[row], self.normal[lead]
        seen = np.flatnonzero(_on_one_sheet(way, away, here, there))
        row, spot, lead, way, away = row[seen], spot[seen], lead[seen], way[seen], away[seen]
        place = np.stack(self._seen_from(lead, way, away, here[seen]), axis=1)
        # All that lie at the spot.
        count = start[spot + 1] - start[spot]
        couple = np.repeat(np.arange(len(spot)), count)
        outline = order[start[spot][couple] + np.arange(len(couple)) - np.repeat(np.cumsum(count) - count, count)]
        middle, radius = self._circles
        off = place[couple] - middle[outline]
        near = np.flatnonzero(np.einsum("nd,nd->n", off, off) < (radius[outline] + most) ** 2)
        couple, outline = couple[near], outline[near]
        scale = self.scale[outline]
        core = self._corners.distance(place[couple] / scale[:, None], self.shape[outline])
        found = np.minimum(core * scale - self.rounding[outline], most)
        # Couples of one point follow each other.
        row = row[couple]
        first = np.flatnonzero(np.diff(row, prepend=-1))
        if len(first):
            own = row[first]
            result[own] = np.minimum(result[own], np.minimum.reduceat(found, first))

    @cached_property
    def _corners(self) -> OutlineCorners:
        return OutlineCorners([one.corners for one in self.shapes])

    @cached_property
    def _circles(self) -> tuple[np.ndarray, np.ndarray]:
        """Middles of circles around the outlines in the frames of their spots [m], shape ``[m, 2]``, and radii [m]."""
        middle = np.array([one.corners.mean(axis=0) for one in self.shapes]).reshape(-1, 2)
        away = [np.hypot(*(one.corners - at).T).max() for one, at in zip(self.shapes, middle, strict=True)]
        radius = np.array([*away, 0.0])[self.shape] * self.scale + self.rounding
        return middle[self.shape] * self.scale[:, None], radius

    def _seen_from(
        self, outline: np.ndarray, way: np.ndarray, away: np.ndarray, normal: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where points at a way from outlines are in their frames: as far off as in a straight line."""
        own = self.normal[outline]
        between = unit_vectors(own + normal)
        flat = way - np.einsum("nd,nd->n", way, between)[:, None] * between
        flat *= (away / np.maximum(np.linalg.norm(flat, axis=1), 1e-300))[:, None]
        flat = turned(flat, between, own)
        along = self.along[outline]
        beside = np.cross(own, along)
        return np.einsum("nd,nd->n", flat, along), np.einsum("nd,nd->n", flat, beside)


class _Level:
    """Spots with outlines of about one size in cells as large as they reach: each is in all cells that it reaches into.

    Args:
        number: Which spots.
        position: Where they are.
        reach: How far any of them reaches.
    """

    def __init__(self, number: np.ndarray, position: np.ndarray, reach: float) -> None:
        self._size = reach
        low, high = np.floor((position - reach) / reach), np.floor((position + reach) / reach)
        self._low = low.min(axis=0)
        self._extent = (high.max(axis=0) - self._low + 1.0).astype(np.int64)
        steps = np.stack(np.meshgrid(*3 * [np.arange(3)], indexing="ij"), axis=-1).reshape(-1, 3)
        cell = low[:, None] + steps
        there = (cell <= high[:, None]).all(axis=2)
        key = self._keys(cell)[there]
        member = np.broadcast_to(number[:, None], there.shape)[there]
        order = np.argsort(key, kind="stable")
        self._key, self._member = key[order], member[order]

    def _keys(self, cell: np.ndarray) -> np.ndarray:
        """Numbers of cells; -1 of those in which nothing can be."""
        at = (cell - self._low).astype(np.int64)
        inside = ((at >= 0) & (at < self._extent)).all(axis=-1)
        key = (at[..., 0] * self._extent[1] + at[..., 1]) * self._extent[2] + at[..., 2]
        return np.where(inside, key, -1)

    def near(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Couples of a position, by its number, and a spot whose outlines may be near it."""
        key = self._keys(np.floor(position / self._size))
        first = np.searchsorted(self._key, key)
        count = np.searchsorted(self._key, key, side="right") - first
        row = np.repeat(np.arange(len(key)), count)
        within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        return row, self._member[first[row] + within]


def _on_one_sheet(way: np.ndarray, away: np.ndarray, normal: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether what lies at ways from somewhere lies on the sheet of the surface that is there; normals here and there."""
    cosine = np.einsum("nd,nd->n", normal, other)
    apart = np.maximum(away, 1e-300)
    leaves = np.arcsin(np.minimum(np.abs(np.einsum("nd,nd->n", way, normal)) / apart, 1.0))
    leaves += np.arcsin(np.minimum(np.abs(np.einsum("nd,nd->n", way, other)) / apart, 1.0))
    return (cosine >= LEAST_COSINE) & (leaves <= np.arccos(np.clip(cosine, -1.0, 1.0)) + STEEPER)
