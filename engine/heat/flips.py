"""Sides of triangles, turned until these are Delaunay: also across the edges of a surface, which is flat along each of them.

Two triangles that share a side are laid out in one plane, wherever they bend; nothing that spreads along the surface can tell. Of all
triangulations of the same points this *intrinsic* Delaunay one has the widest small angles, and cotangents of the angles opposite of a
side sum to no less than 0, so that no weight of the Laplacian is negative (Bobenko and Springborn 2007, *A discrete Laplace-Beltrami
operator for simplicial surfaces*; Fisher, Springborn, Bobenko and Schröder 2006, *An algorithm for the construction of intrinsic
Delaunay triangulations*).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.sides import Sides

__all__ = ["Flips", "cotangents", "find_flips", "laid_flat"]

# Passes at most; ten or twenty are enough. Sides are turned where the cotangents opposite of them sum to less than this.
PASSES = 100
TURNED = -1e-6
# Below this share of the product of two sides a triangle has no area.
NO_AREA = 1e-14
# As many as a processor's cache holds with all that is worked out of them.
POINTS_AT_ONCE = 1 << 14


class Flips(NamedTuple):
    """Sides turned in one pass, no two of one triangle.

    Of each, the triangles beside it are (a, b, c) and (d, c, b) before, with b and c the ends of the side, and (a, b, d) and (a, d, c)
    afterwards.

    Attributes:
        triangle: All of these triangles, ascending, shape ``[2 m]``.
        flip: Which side was turned beside each, shape ``[2 m]``.
        one: Number of the first triangle of every side, shape ``[m]``.
        other: And of the second.
        place: Which corner of the first was a, shape ``[m]``.
        other_place: And of the second d.
        flat: Where a, b, c and d lie in the plane [m], shape ``[m, 4, 2]``.
    """

    triangle: np.ndarray
    flip: np.ndarray
    one: np.ndarray
    other: np.ndarray
    place: np.ndarray
    other_place: np.ndarray
    flat: np.ndarray

    def locate(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles ``[n]`` afterwards of points given by triangles before and weights of corners ``[n, 3]``; and weights then."""
        own, flip, is_one = self._beside(triangle)
        a, b, c, d = np.moveaxis(self.flat[flip], 1, 0)
        first = np.where(is_one, self.place[flip], self.other_place[flip])
        turned = np.take_along_axis(weight[own], (first[:, None] + np.arange(3)) % 3, axis=1)
        flat = np.where(is_one[:, None, None], np.stack([a, b, c], axis=1), np.stack([d, c, b], axis=1))
        at = np.einsum("nk,nkd->nd", turned, flat)
        is_first = _across(d - a, at - a) <= 0.0
        now = np.where(is_first[:, None, None], np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1))
        triangle, weight = triangle.copy(), weight.copy()
        triangle[own] = np.where(is_first, self.one[flip], self.other[flip])
        weight[own] = _weights(at, now, _least_area(now))
        return triangle, weight

    def back(self, triangle: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same the other way round."""
        triangle, weight = triangle.copy(), weight.copy()
        a, b, c, d = np.moveaxis(self.flat, 1, 0)
        # Both triangles of every side, as they are and as they were.
        now = np.stack([a, b, d, a, d, c], axis=1).reshape(-1, 3, 2)
        before = np.stack([a, b, c, d, c, b], axis=1).reshape(-1, 3, 2)
        number = np.stack([self.one, self.other], axis=1).ravel()
        place = np.stack([self.place, self.other_place], axis=1).ravel()
        side, least = c - b, _least_area(before)
        for start in range(0, len(triangle), POINTS_AT_ONCE):
            some = slice(start, start + POINTS_AT_ONCE)
            own, flip, is_one = self._beside(triangle[some])
            at = np.einsum("nk,nkd->nd", weight[some][own], now[2 * flip + ~is_one])
            row = 2 * flip + ~(_across(side[flip], at - b[flip]) >= 0.0)
            part = _weights(at, before[row], least[row])
            triangle[some][own] = number[row]
            for k in range(3):
                weight[some][own, (place[row] + k) % 3] = part[:, k]
        return triangle, weight

    def handed_on(self, values: np.ndarray) -> np.ndarray:
        """What triangles have, bool, shape ``[triangles]``, of those that lay where they lie."""
        values = values.copy()
        values[self.one] = values[self.other] = values[self.one] | values[self.other]
        return values

    def _beside(self, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which of some triangles lie beside turned sides, beside which of these, and whether they are the first one there."""
        at = np.minimum(np.searchsorted(self.triangle, triangle), len(self.triangle) - 1)
        own = np.flatnonzero(self.triangle[at] == triangle)
        flip = self.flip[at[own]]
        return own, flip, self.one[flip] == triangle[own]


def find_flips(flat: np.ndarray, sides: Sides) -> tuple[list[Flips], np.ndarray, np.ndarray]:
    """Turn sides until triangles are Delaunay (Lawson 1977), many at a time.

    Args:
        flat: Their corners, each in a plane of its own [m], counter-clockwise, shape ``[t, 3, 2]``.
        sides: Their sides; those of exactly two triangles that run along it in opposite directions may be turned.

    Returns:
        What was turned, pass by pass; corners in planes, and vertices afterwards, shape ``[t, 3]``.
    """
    flat, vertex = flat.copy(), np.roll(sides.start.reshape(-1, 3), 1, axis=1)
    beside = _beside(sides)
    flips: list[Flips] = []
    known = np.sort(_keys(sides.start, sides.end, len(flat)))
    looked_at = np.flatnonzero(beside > np.arange(len(beside)))
    for _ in range(PASSES):
        first = looked_at[beside[looked_at] >= 0]
        second = beside[first]
        sums = _cotangent(flat, first) + _cotangent(flat, second)
        # No two sides may have the same ends: around a thin tube, or a corner of three triangles, one between these is there already.
        ends = vertex.ravel()[first], vertex.ravel()[second]
        key = _keys(*ends, len(flat))
        is_new = known[np.minimum(np.searchsorted(known, key), len(known) - 1)] != key
        wide = np.flatnonzero((sums < TURNED) & is_new & (ends[0] != ends[1]))
        if not len(wide):
            break
        first, second, sums, key = first[wide], second[wide], sums[wide], key[wide]
        chosen = _apart(first // 3, second // 3, sums, len(flat))
        chosen = chosen[np.unique(key[chosen], return_index=True)[1]]
        known = np.sort(np.concatenate([known, key[chosen]]), kind="stable")
        flips.append(_turn(first[chosen], second[chosen], flat, vertex, beside))
        # Those that had to wait, and all around what was turned; each once, by whichever of its two is the first.
        near = np.concatenate([first, (flips[-1].triangle[:, None] * 3 + np.arange(3)).ravel()])
        looked_at = np.unique(np.minimum(near, np.where(beside[near] < 0, near, beside[near])))
    return flips, flat, vertex


def _keys(one: np.ndarray, other: np.ndarray, count: int) -> np.ndarray:
    """Numbers of pairs of vertices, of which so many triangles have at most three times as many."""
    return np.minimum(one, other) * np.int64(3 * count) + np.maximum(one, other)


def _beside(sides: Sides) -> np.ndarray:
    """The side of the other triangle that every side is, shape ``[3 t]``; -1 where there is none."""
    beside = np.full(len(sides.start), -1)
    first, second = sides.pairs()
    along = (sides.start[first] == sides.end[second]) & (sides.start[first] != sides.end[first])
    beside[first[along]], beside[second[along]] = second[along], first[along]
    return beside


def _apart(one: np.ndarray, other: np.ndarray, sums: np.ndarray, count: int) -> np.ndarray:
    """Pairs of triangles, shape ``[m]`` each, that come before all others of theirs by ``sums``: their numbers."""
    rank = np.empty(len(sums), np.int64)
    rank[np.argsort(sums, kind="stable")] = np.arange(len(sums))
    least = np.full(count, len(sums))
    for own in (one, other):
        np.minimum.at(least, own, rank)
    return np.flatnonzero((least[one] == rank) & (least[other] == rank))


def _turn(first: np.ndarray, second: np.ndarray, flat: np.ndarray, vertex: np.ndarray, beside: np.ndarray) -> Flips:
    """Turn sides, given by both triangles' numbers of them, in place."""
    t, u, k, m = first // 3, second // 3, first % 3, second % 3
    a, b, c = (flat[t, (k + step) % 3] for step in range(3))
    # The other triangle in the plane of the one, by what its third corner is along the side and beside it.
    along, from_b = flat[u, (m + 1) % 3] - flat[u, (m + 2) % 3], flat[u, m] - flat[u, (m + 2) % 3]
    square = np.maximum(np.einsum("nd,nd->n", along, along), 1e-300)
    share, beside_it = np.einsum("nd,nd->n", along, from_b) / square, _across(along, from_b) / square
    side = c - b
    d = b + share[:, None] * side + beside_it[:, None] * np.stack([-side[:, 1], side[:, 0]], axis=1)
    flat[t], flat[u] = np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)
    va, vb, vc, vd = (*(vertex[t, (k + step) % 3] for step in range(3)), vertex[u, m])
    vertex[t], vertex[u] = np.stack([va, vb, vd], axis=1), np.stack([va, vd, vc], axis=1)
    # Sides, each opposite of a corner: c a and a b of the one, b d and d c of the other, before and now.
    before = np.concatenate([3 * t + (k + 1) % 3, 3 * t + (k + 2) % 3, 3 * u + (m + 1) % 3, 3 * u + (m + 2) % 3])
    now = np.concatenate([3 * u + 1, 3 * t + 2, 3 * t, 3 * u])
    moved = np.arange(len(beside))
    moved[before] = now
    partner = beside[before]
    partner = np.where(partner < 0, -1, moved[partner])
    beside[now] = partner
    beside[partner[partner >= 0]] = now[partner >= 0]
    beside[3 * t + 1], beside[3 * u + 2] = 3 * u + 2, 3 * t + 1
    triangle = np.concatenate([t, u])
    order = np.argsort(triangle)
    number = np.tile(np.arange(len(t)), 2)[order]
    return Flips(triangle[order], number, t, u, k, m, np.stack([a, b, c, d], axis=1))


def laid_flat(corner: np.ndarray) -> np.ndarray:
    """Triangles in space, shape ``[t, 3, 3]``, each in a plane, counter-clockwise, shape ``[t, 3, 2]``."""
    to_second, to_third = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.maximum(np.linalg.norm(to_second, axis=1), 1e-300)
    flat = np.zeros((len(corner), 3, 2))
    flat[:, 1, 0] = length
    flat[:, 2, 0] = np.einsum("nd,nd->n", to_second, to_third) / length
    flat[:, 2, 1] = np.linalg.norm(np.cross(to_second, to_third), axis=1) / length
    return flat


def cotangents(flat: np.ndarray) -> np.ndarray:
    """Cotangents of the angles at the corners of triangles in planes, ``[t, 3, 2]``; shape ``[t, 3]``."""
    return _cotangent(flat, np.arange(3 * len(flat))).reshape(-1, 3)


def _cotangent(flat: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Cotangents of the angles opposite of sides, by their numbers."""
    t, k = side // 3, side % 3
    at = flat[t, k]
    to_next, to_last = flat[t, (k + 1) % 3] - at, flat[t, (k + 2) % 3] - at
    return np.einsum("nd,nd->n", to_next, to_last) / np.maximum(np.abs(_across(to_next, to_last)), 1e-300)


def _across(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


def _least_area(flat: np.ndarray) -> np.ndarray:
    """Twice the area below which triangles in planes, ``[n, 3, 2]``, have none [m²], shape ``[n]``."""
    side = np.abs(flat - np.roll(flat, 1, axis=1)).max(axis=(1, 2))
    return NO_AREA * side**2


def _weights(at: np.ndarray, flat: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Weights of the corners of triangles in planes, ``[n, 3, 2]``, at places in them, none below 0.

    They are a third each where triangles have no more than the least area, see :func:`_least_area`.
    """
    x, y = (flat[:, :, k].T - at[:, k] for k in range(2))
    part = np.stack([x[(k + 1) % 3] * y[(k + 2) % 3] - y[(k + 1) % 3] * x[(k + 2) % 3] for k in range(3)])
    part = np.maximum(part, 0.0)
    total = part[0] + part[1] + part[2]
    return np.where(total > least, part / np.maximum(total, 1e-300), 1.0 / 3.0).T
