"""Where triangles touch without sharing corners: ends of sides that lie within other sides, and ends that are nearly one.

Tiles of a terrain, floors and walls, and what else was modeled by itself meet like that: the surface goes on there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .connected import connected
from .sides import Sides
from .unit_vectors import unit_vectors

__all__ = ["PointsOnSides", "merged_ends", "points_on_sides", "touching_sides"]

# Nothing is near that is farther away than this share of the length of a side.
NEAR_FOR_LENGTH = 0.25
# Of two triangles of which one lies on the other the cosine between the ways into both is larger: they are within 60 degrees.
LIES_ON = 0.5
# Places and points whose cells touch, looked at at once.
PAIRS_AT_ONCE = 1 << 22


class PointsOnSides(NamedTuple):
    """Vertices that lie within open sides.

    Attributes:
        side: Number of the side, as :class:`~.sides.Sides` has them, in rising order, shape ``[n]``.
        vertex: The vertex.
        along: Where it lies: 0 where the side starts, 1 where it ends; rising along each side.
    """

    side: np.ndarray
    vertex: np.ndarray
    along: np.ndarray


def merged_ends(sides: Sides, place: np.ndarray, near: float) -> np.ndarray:
    """Return numbers of vertices of which ends of open sides that are nearly in one place have one, shape ``[vertex_count]``.

    They are so only if they are far nearer than their sides are long.

    Args:
        sides: The sides of triangles.
        place: Where the vertices are [m], shape ``[vertex_count, 3]``.
        near: What is nearer is one [m].
    """
    start, end = _open_ends(sides)
    ends = np.unique(np.concatenate([start, end]))
    one, other = _close_pairs(place[ends], place[ends], near)
    one, other = ends[one], ends[other]
    length = np.linalg.norm(place[end] - place[start], axis=1)
    shortest = np.full(len(place), np.inf)
    np.minimum.at(shortest, np.concatenate([start, end]), np.concatenate([length, length]))
    # Of a border whose sides are all shorter than that, no two would be left.
    same = np.linalg.norm(place[one] - place[other], axis=1) < NEAR_FOR_LENGTH * np.minimum(
        shortest[one], shortest[other]
    )
    return connected(len(place), one[same], other[same])


def points_on_sides(sides: Sides, place: np.ndarray, near: float) -> PointsOnSides:
    """Find ends of open sides that lie within others.

    Args:
        sides: See :func:`merged_ends`, as the others.
        place: See there.
        near: No farther from the side than this [m], and farther from its ends.
    """
    open_side = np.flatnonzero(sides.count[sides.number] == 1)
    if not len(open_side):
        return PointsOnSides(open_side, open_side.copy(), np.zeros(0))
    start, end = sides.start[open_side], sides.end[open_side]
    way = place[end] - place[start]
    length = np.linalg.norm(way, axis=1)
    # So there are no more than two places for every side, whatever their lengths.
    step = max(float(length.mean()), 4.0 * near)
    count = np.ceil(length / step).astype(np.int64).clip(1)
    number = np.repeat(np.arange(len(open_side)), count)
    within = (np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[number]
    ends = np.unique(np.concatenate([start, end]))
    looked, found = _close_pairs(place[start[number]] + within[:, None] * way[number], place[ends], 0.5 * step + near)
    side, vertex = number[looked], ends[found]
    ahead = place[vertex] - place[start[side]]
    along = np.einsum("nd,nd->n", ahead, way[side]) / np.maximum(length[side] ** 2, 1e-300)
    away = np.linalg.norm(ahead - along[:, None] * way[side], axis=1)
    margin = np.minimum(near, NEAR_FOR_LENGTH * length[side])
    ahead_of_start = along * length[side]
    inside = (away <= margin) & (ahead_of_start > margin) & (ahead_of_start < length[side] - margin)
    # One that two places along a side are near to is there twice.
    _, first = np.unique(side[inside] * len(place) + vertex[inside], return_index=True)
    side, vertex, along = (values[inside][first] for values in (side, vertex, along))
    order = np.lexsort([along, side])
    return PointsOnSides(open_side[side[order]], vertex[order], along[order])


def touching_sides(sides: Sides, place: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return open sides that lie on each other in part, and share no ends there: one, the other, and whether both run the same way.

    Where more than two surfaces meet, and where one lies on the other, none is told.

    Args:
        sides: See :func:`merged_ends`, as the others.
        place: See there.
        near: See :func:`points_on_sides`.
    """
    points = points_on_sides(sides, place, near)
    open_side = np.flatnonzero(sides.count[sides.number] == 1)
    ends = np.concatenate([sides.start[open_side], sides.end[open_side]])
    order = np.argsort(ends, kind="stable")
    first, last = (np.searchsorted(ends[order], points.vertex, side=side) for side in ("left", "right"))
    number = np.repeat(np.arange(len(first)), last - first)
    at = np.arange(len(number)) - np.repeat(np.cumsum(last - first) - (last - first), last - first) + first[number]
    one, other = points.side[number], np.tile(open_side, 2)[order[at]]
    way = place[sides.end] - place[sides.start]
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    cosine = np.einsum("nd,nd->n", way[one], way[other]) / (length[one] * length[other])
    along = (1.0 - np.abs(cosine)) * length[other] <= near
    number, one, other, cosine = number[along], one[along], other[along], cosine[along]
    # One ahead and one behind, of the same surface.
    clear = np.bincount(number, minlength=len(first))[number] <= 2
    inward = [_inward(sides, place, way, side) for side in (one, other)]
    clear &= np.einsum("nd,nd->n", *inward) < LIES_ON
    return one[clear], other[clear], cosine[clear] > 0.0


def _inward(sides: Sides, place: np.ndarray, way: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Which way triangles lie from some of their sides, of length 1, shape ``[n, 3]``."""
    apex = sides.start[side - side % 3 + (side + 2) % 3]
    up, along = place[apex] - place[sides.start[side]], unit_vectors(way[side])
    return unit_vectors(up - along * np.einsum("nd,nd->n", up, along)[:, None])


def _open_ends(sides: Sides) -> tuple[np.ndarray, np.ndarray]:
    """Vertices at which sides of one triangle alone start and end."""
    is_open = sides.count[sides.number] == 1
    return sides.start[is_open], sides.end[is_open]


def _close_pairs(one: np.ndarray, other: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of points of two sets that are no farther apart than ``reach``: their numbers in both."""
    low = np.minimum(one.min(axis=0), other.min(axis=0))
    cells = [np.floor((points - low) / reach).astype(np.int64) + 1 for points in (one, other)]
    extent = np.max([cell.max(axis=0) for cell in cells], axis=0) + 2
    keys = [(cell[:, 0] * extent[1] + cell[:, 1]) * extent[2] + cell[:, 2] for cell in cells]
    order = np.argsort(keys[1], kind="stable")
    in_order = keys[1][order]
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    steps = np.array([-1, 0, 1])
    for offset in (steps[:, None] * extent[1] + steps).ravel() * extent[2]:
        # The three cells along the last axis follow one another.
        first = np.searchsorted(in_order, keys[0] + offset - 1, side="left")
        count = np.searchsorted(in_order, keys[0] + offset + 1, side="right") - first
        for some in np.array_split(np.arange(len(one)), 1 + int(count.sum()) // PAIRS_AT_ONCE):
            number = np.repeat(some, count[some])
            within = np.arange(len(number)) - np.repeat(np.cumsum(count[some]) - count[some], count[some])
            found = order[first[number] + within]
            near = np.linalg.norm(one[number] - other[found], axis=1) <= reach
            pairs.append((number[near], found[near]))
    return np.concatenate([pair[0] for pair in pairs]), np.concatenate([pair[1] for pair in pairs])
