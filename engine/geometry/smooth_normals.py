"""Directions that a smooth surface looks to, of which a mesh is an approximation; its creases stay sharp."""

from __future__ import annotations

import math

import numpy as np

from .sides import Sides
from .unit_vectors import unit_vectors

__all__ = ["bent_sides", "corner_normals", "creased_sides", "has_blunt_creases"]

# Where no triangle around a vertex looks farther from their mean than this, the surface is smooth there.
SMOOTH_COSINE = math.cos(math.radians(20.0))
# Around other vertices, triangles that look farther apart than this have a crease between them.
CREASE_COSINE = math.cos(math.radians(40.0))
# Triangles that look farther apart than this have a bend between them. Measured on a sphere of 320 triangles, 10° apart and more:
# with tiles that are fine beside all of them errors at 1 spacing are .0013, with others .0019; on one of 1,280, of 5°, both .0013.
BEND_COSINE = math.cos(math.radians(8.0))
# Creases that bend by less than this are blunt.
BLUNT_COSINE = math.cos(math.radians(80.0))
# The mean of directions that agree is hardly shorter than they are.
AGREED = 0.999
# Around more triangles creases are not looked for: every one keeps its own direction.
MOST_AROUND = 32


def corner_normals(corner: np.ndarray, normal: np.ndarray, welded: np.ndarray) -> np.ndarray:
    """Return where a surface looks to at the corners of its triangles, of length 1, shape ``[t, 3, 3]``.

    It is the mean of what the triangles around a vertex do, weighed by their angles there; across a crease, every side's own.

    Args:
        corner: Where the corners of the triangles are, shape ``[t, 3, 3]``.
        normal: Of the triangles, of length 1, shape ``[t, 3]``.
        welded: Numbers of their vertices, which are one where they lie in one place, shape ``[t, 3]``.
    """
    ahead = unit_vectors(np.roll(corner, -1, axis=1) - corner)
    cosine = -(ahead * np.roll(ahead, 1, axis=1)).sum(axis=2)
    own = np.repeat(normal, 3, axis=0)
    weighed = own * np.arccos(np.clip(cosine, -1.0, 1.0)).reshape(-1, 1)
    vertex = welded.ravel()
    count = int(vertex.max()) + 1
    mean = unit_vectors(np.stack([np.bincount(vertex, weighed[:, axis], count) for axis in range(3)], axis=1))
    result = mean[vertex]
    sharp = np.zeros(count, bool)
    sharp[vertex[(result * own).sum(axis=1) < SMOOTH_COSINE]] = True
    at_crease = np.flatnonzero(sharp[vertex])
    if len(at_crease):
        result[at_crease] = _within_creases(vertex[at_crease], own[at_crease], weighed[at_crease])
    return result.reshape(-1, 3, 3)


def creased_sides(corner_normal: np.ndarray, sides: Sides) -> np.ndarray:
    """Return which sides, opposite of each corner, have a crease or the surface's end beside them, shape ``[t, 3]``.

    Args:
        corner_normal: What :func:`corner_normals` returns, shape ``[t, 3, 3]``.
        sides: The sides of the triangles.
    """
    which, count = sides.number, sides.count
    # Where all triangles of a side agree on both of its ends, the mean of what they look to there is of length 1.
    at_ends = [np.roll(corner_normal, -step, axis=1).reshape(-1, 3) for step in (1, 2)]
    backwards = (sides.start > sides.end)[:, None]
    agreed = np.ones(len(count), bool)
    for one, other in (at_ends, at_ends[::-1]):
        looked = np.where(backwards, other, one)
        total = np.stack([np.bincount(which, looked[:, axis]) for axis in range(3)], axis=1)
        agreed &= np.linalg.norm(total, axis=1) > AGREED * count
    return ~(agreed & (count > 1))[which].reshape(-1, 3)


def bent_sides(normal: np.ndarray, sides: Sides) -> np.ndarray:
    """Return beyond which sides, opposite of each corner, the surface ends, branches or bends, shape ``[t, 3]``.

    Args:
        normal: Of the triangles, of length 1, shape ``[t, 3]``.
        sides: The sides of the triangles.
    """
    bent = np.ones(len(sides.start), bool)
    one, other = sides.pairs()
    straight = _cosines(normal, one, other) > BEND_COSINE
    bent[one[straight]] = bent[other[straight]] = False
    return bent.reshape(-1, 3)


def has_blunt_creases(normal: np.ndarray, sides: Sides, creased: np.ndarray) -> bool:
    """Return whether a crease between two triangles bends by less than 80°.

    Args:
        normal: Of the triangles, of length 1, shape ``[t, 3]``.
        sides: The sides of the triangles.
        creased: What :func:`creased_sides` returns, shape ``[t, 3]``.
    """
    one, other = sides.pairs()
    at_crease = creased.ravel()[one]
    return bool((_cosines(normal, one[at_crease], other[at_crease]) > BLUNT_COSINE).any())


def _cosines(normal: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Cosines of the angles between the triangles of pairs of sides."""
    return np.einsum("nd,nd->n", normal[one // 3], normal[other // 3])


def _within_creases(vertex: np.ndarray, own: np.ndarray, weighed: np.ndarray) -> np.ndarray:
    """Mean, for every corner, of the corners at its vertex that look to nearly the same side as its triangle."""
    result = own.copy()
    order = np.argsort(vertex, kind="stable")
    first, around = np.unique(vertex[order], return_index=True, return_counts=True)[1:]
    for number in np.unique(around[around <= MOST_AROUND]).tolist():
        corner = order[first[around == number][:, None] + np.arange(number)]
        alike = np.einsum("vid,vjd->vij", own[corner], own[corner]) > CREASE_COSINE
        result[corner] = unit_vectors(np.einsum("vij,vjd->vid", alike, weighed[corner]))
    return result
