"""Triangles that are parts of larger ones: sides within these are turned until the parts are Delaunay.

Of all triangulations of the same points this has the widest small angles. Cotangents of the angles opposite of a side sum to no less
than 0 there, so that no weight of the Laplacian is negative (Bobenko and Springborn 2007, *A discrete Laplace-Beltrami operator for
simplicial surfaces*).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..problem.sides import sides_of

__all__ = ["Flips", "cotangents", "find_flips"]

# Passes at most; ten or twenty are enough. Sides are turned where the cotangents opposite of them sum to less than this.
PASSES = 100
TURNED = -1e-6


class Flips(NamedTuple):
    """Sides turned in one pass, no two of one triangle.

    Attributes:
        triangle: The triangles beside them, ascending, shape ``[2 m]``.
        one: Of each, the one that lies where ``way`` is positive afterwards, shape ``[2 m]``.
        other: And the one that lies where it is negative.
        way: Its product with the weights of a point is 0 along the new side, shape ``[2 m, 3]``.
    """

    triangle: np.ndarray
    one: np.ndarray
    other: np.ndarray
    way: np.ndarray

    def locate(self, triangle: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Where points are afterwards that were in these triangles; ``weight`` is of the corners of the larger ones, ``[n, 3]``."""
        at = np.minimum(np.searchsorted(self.triangle, triangle), len(self.triangle) - 1)
        is_ahead = np.einsum("nk,nk->n", weight, self.way[at]) > 0.0
        return np.where(self.triangle[at] == triangle, np.where(is_ahead, self.one[at], self.other[at]), triangle)


def find_flips(
    corner: np.ndarray, weight: np.ndarray, vertex: np.ndarray, origin: np.ndarray
) -> tuple[list[Flips], np.ndarray, np.ndarray, np.ndarray]:
    """Turn sides within larger triangles until the parts of each are Delaunay (Lawson 1977), many at a time.

    Args:
        corner: Corners of the parts [m], shape ``[t, 3, 3]``.
        weight: Weights of the corners of the larger ones there, shape ``[t, 3, 3]``.
        vertex: Numbers of their vertices, shape ``[t, 3]``.
        origin: What each is a part of, shape ``[t]``.

    Returns:
        What was turned, pass by pass, and the corners, weights and vertices afterwards.
    """
    corner, weight, vertex = corner.copy(), weight.copy(), vertex.copy()
    flips: list[Flips] = []
    live = np.flatnonzero(np.bincount(origin)[origin] > 1)
    for _ in range(PASSES if len(live) else 0):
        sides = sides_of(vertex[live])
        first, second = sides.pairs()
        inner = origin[live[first // 3]] == origin[live[second // 3]]
        first, second = first[inner], second[inner]
        cotangent = cotangents(corner[live]).ravel()
        sums = cotangent[first] + cotangent[second]
        wide = np.flatnonzero(sums < TURNED)
        if not len(wide):
            break
        # What lies within others that are as they should be is not looked at again.
        is_live = np.zeros(int(origin.max()) + 1, bool)
        is_live[origin[live[first[wide] // 3]]] = True
        chosen = wide[_apart(first[wide] // 3, second[wide] // 3, sums[wide], len(live))]
        flips.append(_turn(live, first[chosen], second[chosen], corner, weight, vertex))
        live = live[is_live[origin[live]]]
    return flips, corner, weight, vertex


def _apart(one: np.ndarray, other: np.ndarray, sums: np.ndarray, count: int) -> np.ndarray:
    """Pairs of triangles, shape ``[m]`` each, that come before all others of theirs by ``sums``: their numbers."""
    rank = np.empty(len(sums), np.int64)
    rank[np.argsort(sums, kind="stable")] = np.arange(len(sums))
    least = np.full(count, len(sums))
    for own in (one, other):
        np.minimum.at(least, own, rank)
    return np.flatnonzero((least[one] == rank) & (least[other] == rank))


def _turn(
    live: np.ndarray, first: np.ndarray, second: np.ndarray, corner: np.ndarray, weight: np.ndarray, vertex: np.ndarray
) -> Flips:
    """Turn sides, given as sides of the triangles ``live``, in place."""
    t, u, k, m = live[first // 3], live[second // 3], first % 3, second % 3
    for values in (corner, weight, vertex):
        a, b, c, d = values[t, k], values[t, (k + 1) % 3], values[t, (k + 2) % 3], values[u, m]
        values[t], values[u] = np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)
    way = np.cross(weight[t, 0], weight[t, 2])
    way *= np.sign(np.einsum("nk,nk->n", way, weight[t, 1]))[:, None]
    beside = np.concatenate([t, u])
    order = np.argsort(beside)
    twice = [np.concatenate([values, values])[order] for values in (t, u, way)]
    return Flips(beside[order], *twice)


def cotangents(corner: np.ndarray) -> np.ndarray:
    """Cotangents of the angles at the corners of triangles, shape ``[t, 3]``."""
    result = []
    for k in range(3):
        to_next, to_last = (corner[:, (k + step) % 3] - corner[:, k] for step in (1, 2))
        double_area = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        result.append((to_next * to_last).sum(axis=1) / np.maximum(double_area, 1e-300))
    return np.stack(result, axis=1)
