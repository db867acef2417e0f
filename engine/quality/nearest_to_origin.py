"""The point of a tetrahedron that is nearest to the origin, of many at once; its corners may coincide."""

from __future__ import annotations

import numpy as np

__all__ = ["nearest_to_origin"]

# The parts of a tetrahedron, by their corners: four corners, six edges, four faces and itself.
EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
FACES = np.array([(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])
OPPOSITE = np.array([3, 2, 1, 0])
PARTS = np.zeros((15, 4), bool)
PARTS[:4] = np.eye(4, dtype=bool)
for _number, _edge in enumerate(EDGES):
    PARTS[4 + _number, _edge] = True
for _number, _face in enumerate(FACES):
    PARTS[10 + _number, _face] = True
PARTS[14] = True
# Sine between two edges, squared, below which a face is a line.
LEAST_SINE = 1e-20


def nearest_to_origin(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of tetrahedra that are nearest to the origin, and which corners span the parts that they lie on.

    Args:
        corner: Shape ``[n, 4, 3]``.

    Returns:
        Shapes ``[n, 3]`` and ``[n, 4]``.
    """
    n = len(corner)
    points = np.empty((n, 15, 3))
    there = np.ones((n, 15), bool)
    points[:, :4] = corner
    points[:, 4:10], there[:, 4:10] = _on_edges(corner)
    points[:, 10:14], there[:, 10:14], beyond = _on_faces(corner)
    points[:, 14] = 0.0
    # Inside, the origin lies on the side of every face where the fourth corner is.
    there[:, 14] = ~beyond
    square = np.where(there, np.einsum("npk,npk->np", points, points), np.inf)
    part = square.argmin(axis=1)
    return points[np.arange(n), part], PARTS[part]


def _on_edges(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Feet of perpendiculars from the origin to the six edges' lines, and whether they are on the edges."""
    start = corner[:, EDGES[:, 0]]
    way = corner[:, EDGES[:, 1]] - start
    square = np.einsum("nek,nek->ne", way, way)
    along = -np.einsum("nek,nek->ne", start, way) / np.where(square > 0.0, square, 1.0)
    return start + along[..., None] * way, (along > 0.0) & (along < 1.0)


def _on_faces(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Feet of perpendiculars from the origin to the four faces' planes, whether they are on the faces; and who is outside of all."""
    start = corner[:, FACES[:, 0]]
    one, two = corner[:, FACES[:, 1]] - start, corner[:, FACES[:, 2]] - start
    normal = np.cross(one, two)
    square = np.einsum("nfk,nfk->nf", normal, normal)
    sides = np.einsum("nfk,nfk->nf", one, one) * np.einsum("nfk,nfk->nf", two, two)
    flat = square <= LEAST_SINE * sides
    height = np.einsum("nfk,nfk->nf", start, normal)
    divisor = np.where(flat, 1.0, square)
    foot = (height / divisor)[..., None] * normal
    from_start = foot - start
    second = np.einsum("nfk,nfk->nf", np.cross(from_start, two), normal) / divisor
    third = np.einsum("nfk,nfk->nf", np.cross(one, from_start), normal) / divisor
    on_face = ~flat & (second > 0.0) & (third > 0.0) & (second + third < 1.0)
    fourth = np.einsum("nfk,nfk->nf", corner[:, OPPOSITE] - start, normal)
    # The origin is at -height; on a face it is on that.
    beyond = (flat | (fourth == 0.0) | (fourth * -height <= 0.0)).any(axis=1)
    return foot, on_face, beyond
