"""Polygons of mesh files, cut into triangles: concave ones by their ears, as a fan would reach beyond their outlines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

__all__ = ["cut_concave", "triangles_of"]

# Corners of a polygon on which the outline turns back by less than this share of a right angle lie on a straight side.
STRAIGHT = 1e-9


def triangles_of(index: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Cut polygons of equally many corners into triangles.

    Args:
        index: Vertices of their corners, shape ``[m, n]``, from 3 corners on; a number of none makes its polygon a fan.
        vertices: Shape ``[v, 3]``.

    Returns:
        Which of a polygon's corners its triangles have, shape ``[m, n - 2, 3]``.
    """
    count = index.shape[1]
    later = np.arange(1, count - 1)
    fan = np.stack([np.zeros_like(later), later, later + 1], axis=1)
    result = np.tile(fan, (len(index), 1, 1))
    if count > 3:
        for place, triangles in _cut(index, vertices):
            result[place] = triangles
    return result


def cut_concave(index: Sequence[Sequence[int]], vertices: np.ndarray) -> dict[int, list[tuple[int, int, int]]]:
    """Cut those of some polygons that are concave.

    Args:
        index: Vertices of the corners of each, as many as it has.
        vertices: Shape ``[v, 3]``.

    Returns:
        Which of its corners the triangles of a concave polygon have, by its number.
    """
    of_count: dict[int, list[int]] = {}
    for number, corners in enumerate(index):
        if len(corners) > 3:
            of_count.setdefault(len(corners), []).append(number)
    cut = {}
    for own in of_count.values():
        alike = np.array([index[number] for number in own])
        cut.update({own[place]: triangles for place, triangles in _cut(alike, vertices)})
    return cut


def _cut(index: np.ndarray, vertices: np.ndarray) -> Iterator[tuple[int, list[tuple[int, int, int]]]]:
    """Places of the concave ones of polygons of equally many corners, and their triangles."""
    outlines = _outlines_of(index, vertices)
    for place in np.flatnonzero(_are_concave(outlines)).tolist():
        yield place, list(_ears(outlines[place]))


def _outlines_of(index: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Corners of polygons in the planes that they lie in most nearly, against the clock; not finite of what is none.

    Args:
        index: Vertices of their corners, shape ``[m, n]``.
        vertices: Shape ``[v, 3]``.

    Returns:
        Shape ``[m, n, 2]``.
    """
    known = ((index >= 0) & (index < len(vertices))).all(axis=1)
    corner = np.full((*index.shape, 3), np.nan)
    corner[known] = vertices[index[known]]
    corner -= corner[:, :1]
    normal = np.cross(corner, np.roll(corner, -1, axis=1)).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([np.einsum("mnk,mk->mn", corner, one) for one in (along, np.cross(normal, along))], axis=2)


def _turn(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def _are_concave(outlines: np.ndarray) -> np.ndarray:
    """Which polygons turn back anywhere, shape ``[m]``."""
    side = np.roll(outlines, -1, axis=1) - outlines
    long = np.linalg.norm(side, axis=2)
    with np.errstate(invalid="ignore"):
        back = _turn(np.roll(side, 1, axis=1), side) < -STRAIGHT * np.roll(long, 1, axis=1) * long
    return back.any(axis=1)


def _ears(outline: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Corners of triangles that make up a polygon: each cuts off an ear, in which no other corner lies."""
    left = list(range(len(outline)))
    while len(left) > 3:
        place = next((k for k in range(len(left)) if _is_ear(outline, left, k)), 0)
        yield left[place - 1], left[place], left[(place + 1) % len(left)]
        del left[place]
    yield left[0], left[1], left[2]


def _is_ear(outline: np.ndarray, left: list[int], place: int) -> bool:
    before, own, behind = left[place - 1], left[place], left[(place + 1) % len(left)]
    a, b, c = outline[[before, own, behind]]
    if _turn(b - a, c - b) <= 0.0:
        return False
    others = outline[[k for k in left if k not in (before, own, behind)]]
    inside = (_turn(b - a, others - a) >= 0.0) & (_turn(c - b, others - b) >= 0.0) & (_turn(a - c, others - c) >= 0.0)
    # A corner in the same place as one of the ear's, as where a hole is cut open to, is none that lies within it.
    apart = (others[:, None] != outline[[before, own, behind]][None]).any(axis=2).all(axis=1)
    return not (inside & apart).any()
