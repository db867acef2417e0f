"""Triangles of a surface, split until no side of them is longer than asked for: slivers become short, or are turned into others."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from ..geometry.seams import merged_ends, points_on_sides
from ..geometry.sides import Sides, sides_of
from ..geometry.small_matrices import determinants
from ..problem.surface import Surface
from .cuts import Cuts, across, at_points, in_halves
from .flips import Flips, cotangents, find_flips, laid_flat

__all__ = ["SplitTriangles", "even_triangles", "split_triangles"]

# Where there would be too many triangles sides may be so much longer.
LONGER = 1.5
# A side is cut in four by each of so many passes at seams: at 4,000 points, and as many times the two others.
MOST_SEAM_PASSES = 18


@dataclass(frozen=True, eq=False)
class SplitTriangles:
    """Triangles of a surface that are split, and whose sides are turned.

    Attributes:
        flat: Their corners, each in a plane of its own [m], counter-clockwise, shape ``[t, 3, 2]``.
        area: Their areas [m²], shape ``[t]``.
        sides: Their sides.
    """

    flat: np.ndarray
    area: np.ndarray
    sides: Sides
    _wholes: int = field(repr=False)
    _steps: tuple[Cuts | Flips, ...] = field(default=(), repr=False)

    def __len__(self) -> int:
        return len(self.area)

    @property
    def is_whole(self) -> bool:
        """Whether nothing was split or turned."""
        return not self._steps

    @property
    def cotangents(self) -> np.ndarray:
        """Of the angles at their corners, shape ``[t, 3]``."""
        return cotangents(self.flat)

    @functools.cached_property
    def lengths(self) -> np.ndarray:
        """Lengths of their sides, each opposite of a corner [m], shape ``[t, 3]``."""
        side = self.flat[:, [2, 0, 1]] - self.flat[:, [1, 2, 0]]
        return np.sqrt(np.einsum("tkd,tkd->tk", side, side))

    @property
    def border(self) -> float:
        """Length of all sides where the surface ends [m]."""
        return float(self.lengths.ravel()[self.sides.count[self.sides.number] == 1].sum())

    def points(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return triangles of the surface ``[n]``, and weights of corners ``[n, 3]``, of points given by the same here."""
        for step in reversed(self._steps):
            triangle, weight = step.back(triangle, weight)
        return triangle, weight

    def locate(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the same the other way round."""
        for step in self._steps:
            triangle, weight = step.locate(triangle, weight)
        return triangle, weight

    def reach_into(self, wholes: np.ndarray) -> np.ndarray:
        """Which of them have a part of some triangles of the surface, given by their numbers, or may have; shape ``[t]``."""
        reach = np.isin(np.arange(self._wholes), wholes)
        for step in self._steps:
            reach = step.handed_on(reach)
        return reach

    def delaunay(self) -> SplitTriangles:
        """The same vertices, with the best triangles between them."""
        flips, flat, vertex = find_flips(self.flat, self.sides)
        if not flips:
            return self
        (first, second), (third, fourth) = ((flat[:, k] - flat[:, 0]).T for k in (1, 2))
        area = 0.5 * np.abs(first * fourth - second * third)
        return SplitTriangles(flat, area, sides_of(vertex), self._wholes, (*self._steps, *flips))

    def beside_slivers(self, lowest: float, width: float, longer: float = 0.0) -> float:
        """Share of the area that lies within a width [m] of slivers, about: triangles as low as this over the longest side.

        Of slivers with longer sides than asked for [m]. Those of which two corners are one are none.
        """
        is_flat = (self.sides.start == self.sides.end).reshape(-1, 3).any(axis=1)
        longest = self.lengths.max(axis=1)
        slivers = ~is_flat & (2.0 * self.area < lowest * longest**2) & (longest > longer)
        return float(longest[slivers].sum()) * width / float(self.area.sum())

    def _after(self, cuts: Cuts, vertex: np.ndarray) -> SplitTriangles:
        """What is left of them once they are cut; ``vertex`` are those of the parts."""
        flat = np.einsum("tkc,tcd->tkd", cuts.weight, self.flat[cuts.parent])
        area = self.area[cuts.parent] * np.abs(determinants(cuts.weight))
        return SplitTriangles(flat, area, sides_of(vertex), self._wholes, (*self._steps, cuts))


def split_triangles(surface: Surface, longest: float, most: int, near: float = 0.0) -> SplitTriangles:
    """Split triangles until no side is longer than asked for.

    Neighbors are split at the same points, so that the parts have whole sides in common, as the triangles had. Whatever is large all
    around is cut in halves and again. Slivers, one side of which is short, are cut across, once, into as many parts as they need: in
    halves they would become as narrow as they get short.

    Args:
        surface: The surface.
        longest: Length of a side [m].
        most: How many triangles there may be; sides may be longer where there would be more.
        near: Sides that are no farther apart than this touch [m]; 0: those that are one.
    """
    result = _whole(surface, near)
    while True:
        is_large = (result.lengths > longest).all(axis=1)
        # By its number, so that both triangles of a side agree on it.
        is_halved = np.zeros(len(result.sides.count), bool)
        is_halved[result.sides.number.reshape(-1, 3)[is_large]] = True
        halved = is_halved[result.sides.number].reshape(-1, 3)
        if not halved.any() or len(result) + int(halved.sum()) > most:
            break
        result = result._after(*in_halves(halved, result.sides, is_halved))
    parts = np.ones(len(result.sides.count), np.int64)
    while True:
        # Sides that are one are as long, but for rounding.
        np.maximum.at(parts, result.sides.number, np.ceil(result.lengths.ravel() / longest).astype(np.int64))
        of_sides = parts[result.sides.number].reshape(-1, 3)
        of_sides[of_sides.min(axis=1) > 1] = 1
        # With none split there are as many as before, which may be more.
        if int(of_sides.sum()) - 2 * len(result) <= max(most, len(result)):
            break
        longest, parts = LONGER * longest, np.ones_like(parts)
    return result if of_sides.max() == 1 else result._after(*across(parts, result.sides))


def even_triangles(surface: Surface, longest: float, most: int, near: float = 0.0) -> SplitTriangles:
    """Make triangles nearly as long as they are wide, whatever those of the surface are like, with no side longer than asked for.

    The longest sides of triangles are halved, and sides turned, by turns. Arguments are those of :func:`split_triangles`.
    """
    result = _whole(surface, near)
    while True:
        length, number = result.lengths, result.sides.number.reshape(-1, 3)
        at, rows = length.argmax(axis=1), np.arange(len(length))
        is_halved = np.zeros(len(result.sides.count), bool)
        is_halved[number[rows, at][length[rows, at] > longest]] = True
        halved = is_halved[number]
        if not halved.any() or len(result) + int(halved.sum()) > most:
            return result
        result = result._after(*in_halves(halved, result.sides, is_halved)).delaunay()


def _whole(surface: Surface, near: float) -> SplitTriangles:
    """The triangles of a surface as they are, but for sides that touch others: these have all ends in common."""
    corner = surface.position[surface.triangle]
    result = SplitTriangles(laid_flat(corner), surface.triangle_area, surface.sides, len(corner))
    if near <= 0.0 or not (surface.sides.count == 1).any():
        return result
    place = np.zeros((int(surface.welded.max()) + 1, 3))
    place[surface.welded] = corner
    one = merged_ends(surface.sides, place, near)
    if int(one.max()) + 1 < len(place):
        place[one] = place.copy()
        result = replace(result, sides=sides_of(one[surface.welded]))
    for _ in range(MOST_SEAM_PASSES):
        points = points_on_sides(result.sides, place, near)
        if not len(points.side):
            break
        result = result._after(*at_points(points, result.sides))
    return result
