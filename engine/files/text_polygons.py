"""Concave polygons of OBJ and OFF files, cut into triangles: readers make fans of them, which reach beyond their outlines."""

from __future__ import annotations

import numpy as np

from .polygons import cut_concave

__all__ = ["obj_without_concave_polygons", "off_without_concave_polygons"]


def obj_without_concave_polygons(text: str) -> str | None:
    """Return what an OBJ file says, with its concave polygons cut into triangles; None where it has none.

    What else stands at corners, of UV maps and normals, stays there. A line that is no face, or names a vertex that there is not, is
    left to whoever reads the rest.
    """
    lines = text.replace("\\\n", " ").split("\n")
    rows, index, count = [], [], 0
    for number, line in enumerate(lines):
        if line.startswith("v "):
            count += 1
        elif line.startswith("f ") and len(found := _whole_numbers(_corners_of(line))) > 3:
            rows.append(number)
            # Numbers below 0 count back from the vertices that stand before a face.
            index.append([k - 1 if k > 0 else count + k for k in found])
    if not rows:
        return None
    vertices = np.array([_place(line.split()[1:4]) for line in lines if line.startswith("v ")]).reshape(-1, 3)
    cut = cut_concave(index, vertices)
    for face, triangles in cut.items():
        corners = _corners_of(lines[rows[face]])
        lines[rows[face]] = "\n".join(f"f {' '.join(corners[k] for k in three)}" for three in triangles)
    return "\n".join(lines) if cut else None


def off_without_concave_polygons(text: str) -> str | None:
    """Return what an OFF file says, with its concave polygons cut into triangles; None where it has none.

    A line that is none of the format is left to whoever reads the rest.
    """
    kind, word, rest = text.partition("OFF")
    lines = [words for line in rest.split("\n") if (words := line.split("#")[0].split())]
    counts = _whole_numbers(lines[0]) if lines else []
    if len(counts) < 2:
        return None
    first, end = 1 + counts[0], 1 + counts[0] + counts[1]
    # Colors may follow the corners.
    sizes = [_whole_numbers(words[:1]) for words in lines[first:end]]
    faces = [
        _whole_numbers(words[1 : 1 + size[0]]) if size else []
        for size, words in zip(sizes, lines[first:end], strict=True)
    ]
    cut = cut_concave(faces, np.array([_place(words[:3]) for words in lines[1:first]]).reshape(-1, 3))
    if not cut:
        return None
    whole = [words for number, words in enumerate(lines[first:end]) if number not in cut]
    parts = [["3", *(str(faces[face][k]) for k in three)] for face, triangles in cut.items() for three in triangles]
    total = [str(counts[0]), str(len(whole) + len(parts)), "0"]
    return f"{kind}{word}\n" + "\n".join(" ".join(words) for words in [total, *lines[1:first], *whole, *parts])


def _corners_of(line: str) -> list[str]:
    return line.split("#")[0].split()[1:]


def _whole_numbers(words: list[str]) -> list[int]:
    """Numbers that words begin with, before a slash; none where one does not."""
    try:
        return [int(word.split("/")[0]) for word in words]
    except ValueError:
        return []


def _place(words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words] if len(words) == 3 else [np.nan] * 3
    except ValueError:
        return [np.nan] * 3
