"""How much ground an object takes: the area of its outline seen from above."""

from __future__ import annotations

import bpy
import numpy as np

from ..engine.errors import ProblemError
from .chart import TopView
from .target import TriangleMesh, read_triangles, world_matrix

__all__ = ["footprint_area", "outline_area"]

# Rays along the longer side of the bounding rectangle: outlines are right to better than 1 %.
RESOLUTION = 512


def outline_area(mesh: TriangleMesh) -> float:
    """Return the area [m²] of everything that lies below some triangle; what overlaps counts once, holes do not count."""
    view = TopView(mesh)
    size = view.high[:2] - view.low[:2]
    if not size.min() > 0.0:
        return 0.0
    columns, rows = np.maximum(np.ceil(size / size.max() * RESOLUTION).astype(int), 16)
    x = view.low[0] + (np.arange(columns) + 0.5) * size[0] / columns
    y = view.low[1] + (np.arange(rows) + 0.5) * size[1] / rows
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return float((view.cast(xy) >= 0).mean() * size.prod())


def footprint_area(item: bpy.types.Object, context: bpy.types.Context, key: str) -> float:
    """Return the footprint [m²] of an object as it stands, with its rotation and scale.

    Modifiers count where Blender evaluates the object, that is, in the view layer.

    Raises:
        ProblemError: It has no faces, or all of them stand upright.
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
        area = outline_area(read_triangles(mesh, matrix, name))
    finally:
        evaluated.to_mesh_clear()
    if not 0.0 < area < np.inf:
        raise ProblemError(f"{key} must be given in m²: {name} covers no ground seen from above")
    return area
