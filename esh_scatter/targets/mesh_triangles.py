"""The triangles of a mesh's faces. Blender tells them one after the other, and of most faces there is no need to ask."""

from __future__ import annotations

import bpy
import numpy as np

__all__ = ["corners_of_triangles"]


def corners_of_triangles(
    mesh: bpy.types.Mesh, position: np.ndarray, vertex: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of every triangle, and its face, as Blender divides faces.

    Args:
        mesh: A mesh with faces.
        position: Of its vertices, as it sees them itself, shape ``[n, 3]``.
        vertex: Of every corner, shape ``[m]``.

    Returns:
        Corners, shape ``[t, 3]``, int32, and faces, shape ``[t]``, int32.
    """
    start = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    sides = np.diff(start, append=np.int32(len(vertex)))
    if not ((sides == 3) | (sides == 4)).all():
        return _as_told(mesh)
    face = np.repeat(np.arange(len(start), dtype=np.int32), sides - 2)
    if (sides == 4).all():
        return _of_quads(start, position, vertex).reshape(-1, 3), face
    corner = np.empty((len(face), 3), np.int32)
    # A face of so many sides has two triangles less.
    first = start - 2 * np.arange(len(start), dtype=np.int32)
    corner[first] = start[:, None] + np.array([0, 1, 2], np.int32)
    quads = np.flatnonzero(sides == 4)
    divided = _of_quads(start[quads], position, vertex)
    corner[first[quads]], corner[first[quads] + 1] = divided[:, 0], divided[:, 1]
    return corner, face


def _of_quads(start: np.ndarray, position: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """Return the corners of both triangles of quads that begin at some corners, shape ``[n, 2, 3]``, int32."""
    corner = start[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    across = _lies_outside(*(position[vertex[start + k]] for k in range(4)))
    corner[across] = start[across, None, None] + np.array([[0, 1, 3], [1, 2, 3]], np.int32)
    return corner


def _lies_outside(first: np.ndarray, second: np.ndarray, third: np.ndarray, fourth: np.ndarray) -> np.ndarray:
    """Tell of quads, by their corners ``[n, 3]``, if the line from the first to the third leaves them: the other divides those."""
    middle = third - first
    a, b = second - first, fourth - first

    def dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.einsum("ij,ij->i", one, other)

    # The other two corners lie on one side of it: the product of their two normals is positive (Lagrange).
    with np.errstate(invalid="ignore", over="ignore"):
        outside: np.ndarray = dot(a, b) * dot(middle, middle) > dot(a, middle) * dot(middle, b)
    return outside


def _as_told(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return what Blender tells; faces of many sides are divided in ways of its own."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    corner, face = np.empty((count, 3), np.int32), np.empty(count, np.int32)
    mesh.loop_triangles.foreach_get("loops", corner.ravel())
    mesh.loop_triangle_polygons.foreach_get("value", face)
    return corner, face
