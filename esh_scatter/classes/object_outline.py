"""How much ground an object of Blender takes."""

from __future__ import annotations

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ...engine.surface.mesh_outline import Outline, outline_from_above
from ...engine.surface.triangle_mesh import TriangleMesh
from ..targets.evaluated_mesh import evaluated_mesh
from ..targets.target import check_exists, origin_of, read_triangles, shown_members_of, with_shown, world_matrix
from .shown_geometry import is_shown_as_it_is, realized, repeats_by

__all__ = ["NoFacesError", "measure_footprint", "outline_of", "read_source"]

# Types of objects whose instances may show more than themselves: meshes by nodes and modifiers, empties by collections.
MEASURED = {"MESH", "EMPTY"}


class NoFacesError(ProblemError):
    """Something has no faces, which cover ground: a curve that guides others, an empty."""


def measure_footprint(
    item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context | None = None, key: str = "`area`"
) -> Outline:
    """Measure the footprint of an object as it stands, with its rotation and scale.

    Modifiers count where Blender evaluates the object, that is, in the view layer.

    Args:
        item: A mesh, or whatever Blender makes one of.
        context: Whose view layer; None is Blender's own.
        key: How sentences name what was asked for.

    Raises:
        ProblemError: It has no faces, or they are upright lines seen from above.
    """
    if not isinstance(item, bpy.types.Object | bpy.types.Collection):
        raise ProblemError(f"`item` must be an object or a collection; got {show(item)}")
    check_exists(item, "`item`")
    return outline_of(read_source(item, context or bpy.context, key), key)


def read_source(item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context, key: str) -> TriangleMesh:
    """Read an object to place as it stands, with its rotation and scale; its origin is where it is in no matter what place.

    Of a collection, all objects are read as one, at their places about its offset, or about the object that the others hang on.

    Raises:
        NoFacesError: It has no faces.
        ProblemError: Nothing can measure it.
    """
    as_one = isinstance(item, bpy.types.Collection)
    objects = with_shown(item.all_objects if as_one else [item])
    for one in objects:
        by = repeats_by(one)
        if by is not None:
            raise ProblemError(
                f'{key} must be given in m²: object "{one.name}" repeats others by its {by}, which nothing measures; make them real'
            )
    if not all(is_shown_as_it_is(one, context) for one in objects if one.type in MEASURED):
        with realized(item, context) as mesh:
            if mesh is not None and len(mesh.polygons):
                return read_triangles(mesh, np.eye(4), f'{"collection" if as_one else "object"} "{item.name}"')
    if as_one:
        return _read_as_one(item, context, key)
    matrix = world_matrix(item, context)
    matrix[:3, 3] = 0.0
    return _read(item, matrix, context, key)


def _read_as_one(collection: bpy.types.Collection, context: bpy.types.Context, key: str) -> TriangleMesh:
    parts, origin = [], origin_of(collection, context)
    for item in shown_members_of(collection):
        matrix = world_matrix(item, context)
        matrix[:3, 3] -= origin
        try:
            parts.append(_read(item, matrix, context, key))
        except ProblemError:  # a curve among meshes takes no ground
            continue
    name = f'collection "{collection.name}"'
    if not parts:
        raise NoFacesError(f"{key} must be given in m²: {name} has no faces to measure it from")
    first = np.cumsum([0, *(len(part.position) for part in parts)])
    triangle = np.concatenate([part.triangle + start for part, start in zip(parts, first, strict=False)])
    position = np.concatenate([part.position for part in parts])
    corner = np.arange(triangle.size, dtype=np.int32).reshape(-1, 3)
    face = np.arange(len(triangle), dtype=np.int32)
    return TriangleMesh(name, position, triangle.astype(np.int32), corner, face, np.empty((0, 3), np.float32))


def _read(item: bpy.types.Object, matrix: np.ndarray, context: bpy.types.Context, key: str) -> TriangleMesh:
    name = f'object "{item.name}"'
    with evaluated_mesh(item, context) as mesh:
        if mesh is None or not len(mesh.polygons):
            raise NoFacesError(f"{key} must be given in m²: {name} has no faces to measure it from")
        return read_triangles(mesh, matrix, name)


def outline_of(mesh: TriangleMesh, key: str) -> Outline:
    """Return the outline of what :func:`read_source` has read; touches nothing of Blender.

    Raises:
        ProblemError: Seen from above it is a point.
    """
    found = outline_from_above(mesh)
    if not 0.0 < found.area < np.inf:
        raise ProblemError(f"{key} must be given in m²: {mesh.name} covers no ground seen from above")
    return found
