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
    corners: dict[int, list[list[int]]] = {}
    rows: dict[int, list[int]] = {}
    for number, line in enumerate(lines):
        if line.startswith("f ") and (found := _corners(line)):
            corners.setdefault(len(found), []).append(found)
            rows.setdefault(len(found), []).append(number)
    if not corners:
        return None
    before = np.cumsum([line.startswith("v ") for line in lines])
    vertices = np.array([_numbers(line) for line in lines if line.startswith("v ")]).reshape(-1, 3)
    changed = False
    for count, of_faces in corners.items():
        own = rows[count]
        outlines = _outlines(np.array(of_faces), vertices, before[own])
        for place in np.flatnonzero(_are_concave(outlines)).tolist():
            tokens, triangles = _tokens(lines[own[place]]), _ears(outlines[place])
            lines[own[place]] = "\n".join(f"f {' '.join(tokens[k] for k in three)}" for three in triangles)
            changed = True
    return "\n".join(lines) if changed else None


def _tokens(line: str) -> list[str]:
    return line.split("#")[0].split()[1:]


def _corners(line: str) -> list[int]:
    """Numbers of a face's vertices as they are written; none of a triangle, nor of what is no face."""
    tokens = _tokens(line)
    try:
        return [int(token.split("/")[0]) for token in tokens] if len(tokens) > 3 else []
    except ValueError:
        return []


def _numbers(line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()[1:4]] if len(line.split()) > 3 else [np.nan] * 3
    except ValueError:
        return [np.nan] * 3


def _outlines(index: np.ndarray, vertices: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Corners of polygons in the planes that they lie in most nearly, against the clock; not finite of what is none.

    Args:
        index: Numbers of their vertices as they are written, shape ``[m, n]``.
        vertices: Shape ``[v, 3]``.
        before: How many vertices stand before each face, from which numbers below 0 count back.

    Returns:
        Shape ``[m, n, 2]``.
    """
    index = np.where(index > 0, index - 1, before[:, None] + index)
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
