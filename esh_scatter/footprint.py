"""How much ground an object of Blender takes."""

from __future__ import annotations

import bpy
import numpy as np

from ..engine.errors import ProblemError
from ..engine.surface.footprint import Outline, outline
from .target import read_triangles, world_matrix

__all__ = ["measure_footprint"]


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
    context = context or bpy.context
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
        footprint = outline(read_triangles(mesh, matrix, name))
    finally:
        evaluated.to_mesh_clear()
    if not 0.0 < footprint.area < np.inf:
        raise ProblemError(f"{key} must be given in m²: {name} covers no ground seen from above")
    return footprint
