"""How much ground an object of Blender takes."""

from __future__ import annotations

import bpy
import numpy as np

from ..engine.errors import ProblemError
from ..engine.surface.footprint import Outline, outline
from ..engine.surface.triangle_mesh import TriangleMesh
from .target import read_triangles, world_matrix

__all__ = ["measure_footprint", "outline_of", "read_source"]


def measure_footprint(item: bpy.types.Object, context: bpy.types.Context | None = None, key: str = "`area`") -> Outline:
    """Measure the footprint of an object as it stands, with its rotation and scale.

    Modifiers count where Blender evaluates the object, that is, in the view layer.

    Args:
        item: A mesh, or whatever Blender makes one of.
        context: Whose view layer; None is Blender's own.
        key: How sentences name what was asked for.

    Raises:
        ProblemError: It has no faces, or all of them stand upright.
    """
    return outline_of(read_source(item, context or bpy.context, key), key)


def read_source(item: bpy.types.Object, context: bpy.types.Context, key: str) -> TriangleMesh:
    """Read an object to place as it stands, with its rotation and scale; its origin is where it is in no matter what place.

    Raises:
        ProblemError: It has no faces.
    """
    name = f'object "{item.name}"'
    evaluated = item.evaluated_get(context.evaluated_depsgraph_get())
    try:
        mesh = evaluated.to_mesh()
    except RuntimeError:
        mesh = None
    try:
        if mesh is None or not len(mesh.polygons):
            raise ProblemError(f"{key} must be given in m²: {name} has no faces to measure it from")
        matrix = world_matrix(item, context)
        matrix[:3, 3] = 0.0
        return read_triangles(mesh, matrix, name)
    finally:
        evaluated.to_mesh_clear()


def outline_of(mesh: TriangleMesh, key: str) -> Outline:
    """Return the outline of what :func:`read_source` has read; touches nothing of Blender.

    Raises:
        ProblemError: All of its faces stand upright.
    """
    footprint = outline(mesh)
    if not 0.0 < footprint.area < np.inf:
        raise ProblemError(f"{key} must be given in m²: {mesh.name} covers no ground seen from above")
    return footprint
