"""Concave polygons of OBJ files, cut into triangles: readers make fans of them, which reach beyond their outlines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

__all__ = ["without_concave_polygons"]

# Corners of a polygon on which the outline turns back by less than this share of a right angle lie on a straight side.
STRAIGHT = 1e-9


def without_concave_polygons(text: str) -> str | None:
    """Return what an OBJ file says, with its concave polygons cut into triangles; None where it has none.

    What else stands at corners, of UV maps and normals, stays there. A line that is no face, or names a vertex that there is not, is
    left to whoever reads the rest.
    """
    lines = text.replace("\\\n", " ").split("\n")
    faces = [number for number, line in enumerate(lines) if line.startswith("f ") and len(line.split()) > 4]
    if not faces:
        return None
    before = np.cumsum([line.startswith("v ") for line in lines])
    vertices = np.array([_numbers(line) for line in lines if line.startswith("v ")]).reshape(-1, 3)
    changed = False
    for number in faces:
        tokens = lines[number].split("#")[0].split()[1:]
        outline = _outline(tokens, vertices, int(before[number]))
        if outline is not None and _is_concave(outline):
            lines[number] = "\n".join(f"f {' '.join(tokens[k] for k in three)}" for three in _ears(outline))
            changed = True
    return "\n".join(lines) if changed else None


def _numbers(line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()[1:4]] if len(line.split()) > 3 else [np.nan] * 3
    except ValueError:
        return [np.nan] * 3


def _outline(tokens: list[str], vertices: np.ndarray, before: int) -> np.ndarray | None:
    """Corners of a polygon in the plane that it lies in most nearly, against the clock, shape ``[n, 2]``; None if it is none."""
    try:
        index = np.array([int(token.split("/")[0]) for token in tokens])
    except ValueError:
        return None
    # Numbers below 0 count back from the vertices that stand before the face.
    index = np.where(index > 0, index - 1, before + index)
    if len(index) < 4 or index.min() < 0 or index.max() >= len(vertices):
        return None
    corner = vertices[index] - vertices[index[0]]
    normal = 0.5 * np.cross(corner, np.roll(corner, -1, axis=0)).sum(axis=0)
    length = np.linalg.norm(normal)
    if not 0.0 < length < np.inf:
        return None
    normal /= length
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    along /= np.linalg.norm(along)
    return np.stack([corner @ along, corner @ np.cross(normal, along)], axis=1)


def _turn(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def _is_concave(outline: np.ndarray) -> bool:
    side = np.roll(outline, -1, axis=0) - outline
    long = np.linalg.norm(side, axis=1)
    return bool((_turn(np.roll(side, 1, axis=0), side) < -STRAIGHT * np.roll(long, 1) * long).any())


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
