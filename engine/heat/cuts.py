"""Triangles cut into parts: in halves, across, and at points of their sides; and points that move between wholes and parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.seams import PointsOnSides
from ..geometry.sides import Sides
from ..geometry.small_matrices import inverses
from .flips import POINTS_AT_ONCE

__all__ = ["Cuts", "across", "at_points", "in_halves"]

# The three ways to halve sides of a triangle, for one side, two and three: corners of the parts. 0 to 2 are the corners of the whole,
# 3 to 5 the middles of the sides opposite of them. Of one the side is opposite of corner 0, of two the others are halved.
ONE = ((0, 1, 3), (0, 3, 2))
TWO = ((0, 5, 4), (5, 1, 4), (1, 2, 4))
THREE = ((0, 5, 4), (1, 3, 5), (2, 4, 3), (3, 4, 5))
# Weights of a triangle's corners at its corners and at the middles of its sides.
PLACES = np.concatenate([np.eye(3), 0.5 * (1.0 - np.eye(3))])
# Parts around the one where a point is looked for first that may hold it instead.
PARTS_AROUND = 3


class Cuts(NamedTuple):
    """Triangles cut in one pass.

    Attributes:
        first: Where the parts of each begin, shape ``[t]``.
        number: How many there are, shape ``[t]``.
        weight: Weights of the whole's corners at those of every part, shape ``[parts, 3, 3]``.
        apex: Corner from which the parts of each follow each other, shape ``[t]``; -1 where there are few in any order.
    """

    first: np.ndarray
    number: np.ndarray
    weight: np.ndarray
    apex: np.ndarray

    @property
    def parent(self) -> np.ndarray:
        """What every part is a part of."""
        return np.repeat(np.arange(len(self.number)), self.number)

    def handed_on(self, values: np.ndarray) -> np.ndarray:
        """What parts have of their wholes."""
        return values[self.parent]

    def back(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Wholes that points lie in, and weights of their corners, of points given by the parts."""
        parent, weight = self.parent[triangle], weight.copy()
        # What is not cut has the weights that it had.
        cut = np.flatnonzero(self.number[parent] > 1)
        for start in range(0, len(cut), POINTS_AT_ONCE):
            own = cut[start : start + POINTS_AT_ONCE]
            weight[own] = np.einsum("nk,nkd->nd", weight[own], self.weight[triangle[own]])
        return parent, weight

    def locate(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parts that points lie in, and weights of their corners, of points given by the wholes."""
        part, inside = self.first[triangle], weight.copy()
        # What is not cut has the weights that it had.
        cut = np.flatnonzero(self.number[triangle] > 1)
        if len(cut):
            part[cut], inside[cut] = self._locate_cut(triangle[cut], weight[cut])
        return part, _inside(inside)

    def _locate_cut(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of points in triangles that are cut; weights may be a little below 0."""
        apex, count, rows = self.apex[triangle], self.number[triangle], np.arange(len(triangle))
        ahead = np.where(apex < 0, 0.0, 1.0 - weight[rows, apex])
        guess = (ahead * count).astype(np.int64)
        around = np.arange(-PARTS_AROUND if (self.apex >= 0).any() else 0, PARTS_AROUND + 1)[:, None]
        candidates = self.first[triangle] + np.clip(guess + around, 0, count - 1)
        needed, place = np.unique(candidates, return_inverse=True)
        back = inverses(self.weight[needed])
        least, part, inside = np.full(len(triangle), -np.inf), np.zeros_like(triangle), np.zeros_like(weight)
        for tried, at in zip(candidates, place.reshape(candidates.shape), strict=True):
            found = np.einsum("nk,nkd->nd", weight, back[at])
            better = found.min(axis=1) > least
            least = np.where(better, found.min(axis=1), least)
            part, inside = np.where(better, tried, part), np.where(better[:, None], found, inside)
        return part, inside


def in_halves(halved: np.ndarray, sides: Sides, is_halved: np.ndarray) -> tuple[Cuts, np.ndarray]:
    """Cut triangles whose sides are ``halved``, shape ``[t, 3]``: the cuts, and the parts' vertices."""
    middle = _vertex_count(sides) - 1 + np.cumsum(is_halved)
    place = np.concatenate([_vertices(sides), middle[sides.number].reshape(-1, 3)], axis=1)
    number = halved.sum(axis=1)
    count = number + 1
    first = np.cumsum(count) - count
    weight, vertex = np.empty((int(count.sum()), 3, 3)), np.empty((int(count.sum()), 3), np.int64)
    for halves, parts in enumerate((((0, 1, 2),), ONE, TWO, THREE)):
        for turn in range(3):
            # Turned so that the side that is alone in being halved, or in not being so, is opposite of the first corner.
            alone = halved[:, turn] == (halves == 1) if halves in (1, 2) else np.full(len(halved), turn == 0)
            own = np.flatnonzero((number == halves) & alone)
            turned = np.concatenate([np.roll(np.arange(3), -turn), 3 + np.roll(np.arange(3), -turn)])
            for k, part in enumerate(parts):
                at = turned[list(part)]
                weight[first[own] + k] = PLACES[at]
                vertex[first[own] + k] = place[own][:, at]
    return Cuts(first, count, weight, np.full(len(halved), -1)), vertex


def across(parts: np.ndarray, sides: Sides) -> tuple[Cuts, np.ndarray]:
    """Cut triangles across, whose sides are divided into so many ``parts`` by their numbers: the cuts, and the parts' vertices.

    One side at least of each is whole.
    """
    corner = _vertices(sides)
    of_sides = parts[sides.number].reshape(-1, 3)
    apex = np.argmin(of_sides, axis=1)
    rows = np.arange(len(corner))
    left, right = of_sides[rows, (apex + 2) % 3], of_sides[rows, (apex + 1) % 3]
    count = left + right - 1
    first = np.cumsum(count) - count
    # Points within sides are counted from the end with the lower number.
    inner = _vertex_count(sides) + np.cumsum(parts - 1) - (parts - 1)
    weight, vertex = np.empty((int(count.sum()), 3, 3)), np.empty((int(count.sum()), 3), np.int64)
    number = sides.number.reshape(-1, 3)
    for key in np.unique(left * (int(parts.max()) + 1) + right).tolist():
        p, q = divmod(key, int(parts.max()) + 1)
        for turn in range(3):
            own = np.flatnonzero((left == p) & (right == q) & (apex == turn))
            one, other = (turn + 1) % 3, (turn + 2) % 3
            # Along the sides from the apex to its two neighbors.
            along_left = _along(corner[own, turn], corner[own, one], inner[number[own, other]], p)
            along_right = _along(corner[own, turn], corner[own, other], inner[number[own, one]], q)
            at = np.concatenate([along_left, along_right], axis=1)
            places = np.zeros((p + q + 2, 3))
            places[: p + 1, one], places[p + 1 :, other] = np.arange(p + 1) / p, np.arange(q + 1) / q
            places[:, turn] = 1.0 - places.sum(axis=1)
            pattern = _zipped(p, q)
            to = first[own][:, None] + np.arange(len(pattern))
            weight[to], vertex[to] = places[pattern], at[:, pattern]
    return Cuts(first, count, weight, np.where(count > 1, apex, -1)), vertex


def at_points(points: PointsOnSides, sides: Sides) -> tuple[Cuts, np.ndarray]:
    """Cut triangles at points of a side each, three at most: the cuts, and the parts' vertices."""
    corner = _vertices(sides)
    triangle = points.side // 3
    of_first_side = points.side == points.side[np.searchsorted(triangle, triangle)]
    first = np.searchsorted(points.side, points.side)
    rank, count = np.arange(len(first)) - first, np.searchsorted(points.side, points.side, side="right") - first
    # Of more, those at the quarters.
    chosen = of_first_side & ((count <= 3) | (rank == count // 4) | (rank == count // 2) | (rank == 3 * count // 4))
    pieces = np.bincount(triangle[chosen], minlength=len(corner)) + 1
    first = np.cumsum(pieces) - pieces
    weight = np.broadcast_to(np.eye(3), (int(pieces.sum()), 3, 3)).copy()
    vertex = np.repeat(corner, pieces, axis=0)
    cut, side = triangle[chosen], points.side[chosen]
    # The side goes from the next corner to the next but one.
    apex = side % 3
    start, end = (apex + 1) % 3, (apex + 2) % 3
    place = np.arange(len(cut)) - np.searchsorted(cut, cut)
    at = np.zeros((len(cut), 3))
    rows = np.arange(len(cut))
    at[rows, start], at[rows, end] = 1.0 - points.along[chosen], points.along[chosen]
    before, behind = first[cut] + place, first[cut] + place + 1
    # What ends at a point, and what begins there.
    weight[before, end], vertex[before, end] = at, points.vertex[chosen]
    weight[behind, start], vertex[behind, start] = at, points.vertex[chosen]
    return Cuts(first, pieces, weight, np.full(len(corner), -1)), vertex


def _along(start: np.ndarray, end: np.ndarray, inner: np.ndarray, parts: int) -> np.ndarray:
    """Vertices along sides, both ends among them, shape ``[n, parts + 1]``; the first within each has the number ``inner``."""
    step = np.arange(1, parts)
    within = inner[:, None] + np.where((start < end)[:, None], step - 1, parts - 1 - step)
    return np.concatenate([start[:, None], within, end[:, None]], axis=1)


def _zipped(left: int, right: int) -> np.ndarray:
    """Triangles between two rows of points that begin at one, of ``left + 1`` and ``right + 1``, numbered one after the other."""
    i, j, pattern = 1, 1, [(0, 1, left + 2)]
    while i < left or j < right:
        if j == right or (i < left and (i + 1) * right <= (j + 1) * left):
            pattern.append((i, i + 1, left + 1 + j))
            i += 1
        else:
            pattern.append((i, left + 2 + j, left + 1 + j))
            j += 1
    return np.array(pattern)


def _inside(weight: np.ndarray) -> np.ndarray:
    """Weights of corners, shape ``[n, 3]``, none of which rounding has left below 0."""
    weight = np.maximum(weight, 0.0)
    return weight / weight.sum(axis=1, keepdims=True)


def _vertices(sides: Sides) -> np.ndarray:
    """Numbers of the triangles' vertices, shape ``[t, 3]``."""
    return np.roll(sides.start.reshape(-1, 3), 1, axis=1)


def _vertex_count(sides: Sides) -> int:
    return int(max(sides.start.max(), sides.end.max())) + 1
