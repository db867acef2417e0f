"""Whether targets have faces, and a top: without faces nothing can be scattered on them, and without a top not from above."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...engine.surface.upper_side import NARROWEST, SMALLEST_COVER
from . import checksums
from .depsgraph import evaluated_depsgraph
from .target import read_triangles, world_matrix

__all__ = ["have_no_top", "lacks_faces"]

# Faces that are looked at before all are: nearly always one of them is visible from above.
FIRST_FACES = 16


def lacks_faces(item: bpy.types.Object) -> bool:
    """Tell whether a mesh object is known to have no faces, with its modifiers; it costs next to nothing, so that drawing may ask."""
    if len(item.data.polygons) and not item.modifiers:
        return False
    mesh = _evaluated_mesh(item)
    return mesh is not None and not len(mesh.polygons)


def have_no_top(objects: Sequence[bpy.types.Object]) -> bool:
    """Tell whether nothing of some mesh objects is visible from above, as the engine judges it; False where that is not known.

    It costs next to nothing where there is a top, and is told again for a while where there is none, so that drawing may ask.
    """
    meshes = [(mesh, world_matrix(item, bpy.context)) for item in objects if (mesh := _mesh_of(item)) is not None]
    if len(meshes) < len(objects) or not meshes or any(_has_top_at_once(item) for item in meshes):
        return False
    key = "top", *(item.session_uid for item in objects)
    return bool(checksums.worked_out(key, lambda: int(_show_no_top(meshes))))


def _show_no_top(meshes: Sequence[tuple[bpy.types.Mesh, np.ndarray]]) -> bool:
    """Look at all triangles of meshes in the world."""
    low, high, area = np.full(3, np.inf), np.full(3, -np.inf), 0.0
    for mesh, matrix in meshes:
        corner = _corners(mesh, matrix)
        low, high = np.minimum(low, corner.min(axis=(0, 1))), np.maximum(high, corner.max(axis=(0, 1)))
        side = corner[:, 1:] - corner[:, :1]
        area += 0.5 * float(np.abs(side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]).sum())
    size = high - low
    return bool(size[:2].min() <= NARROWEST * size.max() or area < SMALLEST_COVER * size[0] * size[1])


def _mesh_of(item: bpy.types.Object) -> bpy.types.Mesh | None:
    """Return the evaluated mesh of an object; None where it has no faces to look at now."""
    mesh = _evaluated_mesh(item)
    return mesh if mesh is not None and len(mesh.polygons) else None


def _evaluated_mesh(item: bpy.types.Object) -> bpy.types.Mesh | None:
    """Return the mesh of an object with its modifiers; None where that is not known, as in Edit Mode."""
    evaluated = item.evaluated_get(evaluated_depsgraph(bpy.context))
    known = evaluated.is_evaluated and evaluated.mode != "EDIT" and isinstance(evaluated.data, bpy.types.Mesh)
    return evaluated.data if known else None


def _has_top_at_once(mesh_in_world: tuple[bpy.types.Mesh, np.ndarray]) -> bool:
    """Whether one of the first faces lies flat enough that the mesh has a top, whatever the others are."""
    mesh, matrix = mesh_in_world
    count = len(mesh.polygons)
    # How normals are turned. Not by an inverse: LAPACK's threads wait for each other while something is solved.
    turned = np.cross(np.roll(matrix[:3, :3], -1, axis=0), np.roll(matrix[:3, :3], -2, axis=0))
    for number in range(0, count, max(1, count // FIRST_FACES)):
        normal = turned @ np.array(mesh.polygons[number].normal)
        if abs(normal[2]) > 0.1 * np.linalg.norm(normal) and mesh.polygons[number].area > 0.0:
            return True
    return False


def _corners(mesh: bpy.types.Mesh, matrix: np.ndarray) -> np.ndarray:
    """Corners of a mesh's triangles in the world, shape ``[n, 3, 3]``."""
    read = read_triangles(mesh, matrix, "")
    return read.position[read.triangle]
