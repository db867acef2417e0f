"""Reading what densities keep near to or away from: objects, curves and collections, seen from above."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import bpy
import numpy as np

from ..engine.errors import ProblemError
from ..engine.problem.validation import show
from .target import check_exists, is_result, read_triangles, world_matrix

__all__ = ["Shapes", "check_shapes", "read_shapes", "shape_objects"]


class Shapes(NamedTuple):
    """Shapes seen from above, in the world's x and y [m].

    Attributes:
        triangle: Faces, edges without faces (two corners are the same) and points (all three are), shape ``[t, 3, 2]``, float64.
        outline: The pieces of closed outlines that edges without faces make, shape ``[s, 2, 2]``, float64.
    """

    triangle: np.ndarray
    outline: np.ndarray


def check_shapes(source: object, key: str) -> object:
    """Return what shapes are read from; raise ProblemError unless it is objects and collections."""
    items = source if isinstance(source, list | tuple) else (source,)
    if not items or not all(isinstance(item, bpy.types.Object | bpy.types.Collection) for item in items):
        raise ProblemError(f"{key} must be an object, a collection, or a list of them; got {show(source)}")
    return tuple(items) if isinstance(source, list | tuple) else source


def shape_objects(source: object, key: str) -> list[bpy.types.Object]:
    """Return the objects that shapes are read from, by name.

    Raises:
        ProblemError: One has been removed from the file, or there is none.
    """
    found: dict[int, bpy.types.Object] = {}
    items: Sequence = source if isinstance(source, tuple) else (source,)  # type: ignore[assignment]
    for item in items:
        check_exists(item, key)
        for member in item.all_objects if isinstance(item, bpy.types.Collection) else (item,):
            found[member.session_uid] = member
    if not found:
        name = getattr(items[0], "name", "")
        raise ProblemError(f'{key} must be near something; collection "{name}" is empty')
    return sorted(found.values(), key=lambda item: item.name_full)


def read_shapes(source: object, context: bpy.types.Context, key: str) -> Shapes:
    """Read objects as they stand in the world, with their modifiers.

    Of another scatter's result, its points are read; of what has no geometry, its origin.
    """
    triangles, outlines = [], []
    for item in shape_objects(source, key):
        for shapes in _shapes_of(item, world_matrix(item, context), context):
            triangles.append(shapes.triangle)
            outlines.append(shapes.outline)
    triangle = np.concatenate(triangles)
    if not np.isfinite(triangle).all():
        raise ProblemError(f"{key} must be near something that has finite positions; some are NaN or infinite")
    return Shapes(triangle, np.concatenate(outlines))


def _shapes_of(item: bpy.types.Object, matrix: np.ndarray, context: bpy.types.Context) -> Iterator[Shapes]:
    if item.type == "EMPTY" and item.instance_type == "COLLECTION" and item.instance_collection is not None:
        offset = np.eye(4)
        offset[:3, 3] = -np.array(item.instance_collection.instance_offset)
        for member in item.instance_collection.all_objects:
            yield from _shapes_of(member, matrix @ offset @ world_matrix(member, context), context)
        return
    if is_result(item):
        yield _points(_positions(item.data, matrix))
        return
    evaluated = item.evaluated_get(context.evaluated_depsgraph_get())
    try:
        mesh = evaluated.to_mesh()
    except RuntimeError:  # lights, cameras, empties
        mesh = None
    try:
        if mesh is None or not len(mesh.vertices):
            yield _points(matrix[None, :3, 3])
        elif len(mesh.polygons):
            read = read_triangles(mesh, matrix, item.name)
            yield Shapes(read.position[read.triangle][..., :2], np.empty((0, 2, 2)))
        elif len(mesh.edges):
            yield _edges(mesh, _positions(mesh, matrix), item.type == "CURVE")
        else:
            yield _points(_positions(mesh, matrix))
    finally:
        evaluated.to_mesh_clear()


def _positions(mesh: bpy.types.Mesh, matrix: np.ndarray) -> np.ndarray:
    position = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", position.ravel())
    return position.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _points(position: np.ndarray) -> Shapes:
    return Shapes(np.repeat(position[:, None, :2], 3, axis=1), np.empty((0, 2, 2)))


def _edges(mesh: bpy.types.Mesh, position: np.ndarray, closed: bool) -> Shapes:
    """Return edges; as outlines, those whose ends lie open are closed by a straight piece where ``closed``."""
    edge = np.empty((len(mesh.edges), 2), np.int32)
    mesh.edges.foreach_get("vertices", edge.ravel())
    segment = position[edge][..., :2]
    outline = segment
    ends = np.flatnonzero(np.bincount(edge.ravel(), minlength=len(position)) == 1)
    if closed and len(ends) % 2 == 0:
        # Of curves, vertices follow one another: two ends in a row are those of one spline.
        outline = np.concatenate([segment, position[ends.reshape(-1, 2)][..., :2]])
    return Shapes(segment[:, [0, 1, 1]], outline)
