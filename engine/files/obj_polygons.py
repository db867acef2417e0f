"""Concave polygons of OBJ files, cut into triangles: readers make fans of them, which reach beyond their outlines."""

from __future__ import annotations

import numpy as np

from .polygons import are_concave, ears, outlines_of

__all__ = ["without_concave_polygons"]


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
        index = np.array(of_faces)
        # Numbers below 0 count back from the vertices that stand before a face.
        outlines = outlines_of(np.where(index > 0, index - 1, before[own][:, None] + index), vertices)
        for place in np.flatnonzero(are_concave(outlines)).tolist():
            tokens, triangles = _tokens(lines[own[place]]), ears(outlines[place])
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
