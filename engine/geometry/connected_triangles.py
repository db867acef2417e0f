"""Which triangles of a surface hang together."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from .connected import connected
from .sides import Sides

__all__ = ["parts_of"]

# Sides of more triangles than this join all of them: who belongs to whom is not asked there.
MOST_AT_SIDE = 8


def parts_of(welded: np.ndarray, sides: Sides) -> np.ndarray:
    """Return the number of the part that every triangle is in, shape ``[t]``.

    Triangles are in one part that share a side, unless they are the two sides of one face: a wall whose both sides are given has two
    parts. So are triangles that share a vertex at which both parts have borders, as where squares meet corner to corner. An eye that
    touches the head within a vertex is none of its parts.

    Args:
        welded: Vertices of the triangles, shape ``[t, 3]``, by numbers that are one where they lie in one place.
        sides: The sides of these.
    """
    part = connected(len(welded), *_beside(welded, sides))
    # Parts and the vertices at their borders are joined: numbers of vertices follow on those of parts.
    parts, is_open = int(part.max()) + 1, np.flatnonzero((sides.count == 1)[sides.number])
    own = np.repeat(part[is_open // 3], 2)
    vertex = np.stack([sides.start[is_open], sides.end[is_open]], axis=1).ravel()
    label = connected(parts + int(welded.max()) + 1, own, parts + vertex)[:parts]
    return np.unique(label[part], return_inverse=True)[1].ravel()


def _beside(welded: np.ndarray, sides: Sides) -> tuple[np.ndarray, np.ndarray]:
    """Couples of triangles that are one part because they share a side: one of each, and the other."""
    first = np.cumsum(sides.count) - sides.count
    ahead = sides.start < sides.end
    # Triangles of one face have the same three vertices.
    face = np.sort(welded, axis=1)
    ones, others = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for many in np.unique(sides.count[sides.count > 1]).tolist():
        at = first[sides.count == many]
        side = sides.order[at[:, None] + np.arange(many)]
        if many > MOST_AT_SIDE:
            ones.append(side[:, :-1].ravel() // 3)
            others.append(side[:, 1:].ravel() // 3)
            continue
        met = np.zeros(len(side), bool)
        # Neighbors run along the side between them in opposite directions; where none do, all that are there are neighbors.
        for opposite in (True, False):
            met_before = met.copy()
            for a, b in combinations(range(many), 2):
                one, other = side[:, a], side[:, b]
                fits = ((ahead[one] != ahead[other]) == opposite) & ~met_before
                fits &= (face[one // 3] != face[other // 3]).any(axis=1)
                ones.append(one[fits] // 3)
                others.append(other[fits] // 3)
                met |= fits
    return np.concatenate(ones), np.concatenate(others)
