"""Reading what densities keep near to or away from, and what obstacles are: objects, curves and collections."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ..targets.depsgraph import evaluated_depsgraph
from ..targets.evaluated_mesh import evaluated_mesh, vertices_in_world
from ..targets.target import check_exists, is_result, read_triangles, world_matrix
from .density_source import Known, checksum

__all__ = ["Shapes", "check_finite", "check_shapes", "read_shapes", "shape_objects"]

# Corners of the outlines of instances, and directions along which their farthest points are looked for.
CORNERS_OF_INSTANCES, DIRECTIONS = 24, 256


@dataclass(frozen=True, eq=False)
class Shapes:
    """Shapes as they were when they were read, in the world [m]: what any thread may look at.

    Attributes:
        names: Of what was asked for.
        triangle: Faces, edges without faces (two corners are the same) and points (all three are), seen from above, shape
            ``[t, 3, 2]``, float64.
        outlines: For each object the pieces of the closed outlines that its edges without faces make, seen from above, shape
            ``[s, 2, 2]``, float64.
        solid: Faces, edges and points in space, shape ``[k, 3, 3]``, float64.
    """

    names: tuple[str, ...]
    triangle: np.ndarray
    outlines: tuple[np.ndarray, ...]
    solid: np.ndarray

    @cached_property
    def checksum(self) -> Hashable:
        """Numbers that differ where shapes do."""
        return checksum(self.triangle, *self.outlines)

    @cached_property
    def checksum_in_space(self) -> Hashable:
        """Numbers that differ where faces, edges and points in space do."""
        return checksum(self.solid)


class _Shape(NamedTuple):
    triangle: np.ndarray
    outline: np.ndarray
    solid: np.ndarray


def check_shapes(source: object, key: str) -> object:
    """Return what shapes are read from; raise ProblemError unless it is objects and collections."""
    items = source if isinstance(source, list | tuple) else (source,)
    if isinstance(source, Shapes):
        return source
    if not items or not all(isinstance(item, bpy.types.Object | bpy.types.Collection) for item in items):
        raise ProblemError(f"{key} must be an object, a collection, or a list of them; got {show(source)}")
    return tuple(items) if isinstance(source, list | tuple) else source


def shape_objects(source: object, key: str) -> list[bpy.types.Object]:
    """Return the objects that shapes are read from, by name.

    Raises:
        ProblemError: One has been removed from the file, or there is none.
    """
    found: dict[int, bpy.types.Object] = {}
    items: Sequence = source if isinstance(source, tuple) else (source,)
    for item in items:
        check_exists(item, key)
        for member in item.all_objects if isinstance(item, bpy.types.Collection) else (item,):
            found[member.session_uid] = member
    if not found:
        name = getattr(items[0], "name", "")
        raise ProblemError(f'{key} needs an object; collection "{name}" is empty')
    return sorted(found.values(), key=lambda item: item.name_full)


def read_shapes(source: object, key: str, known: Known) -> Shapes:
    """Read objects as they stand in the world, with their modifiers. Only the main thread may call this.

    Of another scatter's result, its points are read; of what shows instances, these as well; of what has no geometry, its origin.
    """
    if isinstance(source, Shapes):
        return source
    context = bpy.context
    triangles, outlines, solids = [], [], []
    for item in shape_objects(source, key):
        number = "shape", item.session_uid
        if number not in known:
            known[number] = list(_shapes_of(item, world_matrix(item, context), context))
        shapes: list[_Shape] = known[number]
        for shape in shapes:
            check_finite(shape.solid, item, key)
            check_finite(shape.triangle, item, key)
        triangles += [shape.triangle for shape in shapes]
        solids += [shape.solid for shape in shapes]
        outlines.append(np.concatenate([shape.outline for shape in shapes]) if shapes else np.empty((0, 2, 2)))
    triangle = np.concatenate(triangles) if triangles else np.empty((0, 3, 2))
    if not len(triangle):
        raise ProblemError(f"{key} needs an object that shows something; what was given is empty")
    items = source if isinstance(source, tuple) else (source,)
    names = tuple(str(getattr(item, "name", item)) for item in items)
    return Shapes(names, triangle, tuple(outlines), np.concatenate(solids))


def check_finite(position: np.ndarray, item: bpy.types.Object, key: str) -> None:
    """Raise ProblemError where positions that were read of an object are not finite."""
    if not np.isfinite(position).all():
        raise ProblemError(
            f'{key} needs objects with finite positions; "{item.name}" has coordinates that are not finite'
        )


def _shapes_of(item: bpy.types.Object, matrix: np.ndarray, context: bpy.types.Context) -> Iterator[_Shape]:
    if item.type == "EMPTY" and item.instance_type == "COLLECTION" and item.instance_collection is not None:
        offset = np.eye(4)
        offset[:3, 3] = -np.array(item.instance_collection.instance_offset)
        for member in item.instance_collection.all_objects:
            yield from _shapes_of(member, matrix @ offset @ world_matrix(member, context), context)
        return
    if is_result(item):
        yield _points(vertices_in_world(item.data, matrix))
        return
    instances = list(_instances_of(item, context)) if _may_instance(item) else []
    yield from instances
    with evaluated_mesh(item, context) as mesh:
        if mesh is None or not len(mesh.vertices):
            if not instances:
                yield _points(matrix[None, :3, 3])
        elif len(mesh.polygons):
            read = read_triangles(mesh, matrix, item.name)
            yield _seen_from_above(read.position[read.triangle].astype(np.float64))
        elif len(mesh.edges):
            yield _edges(mesh, vertices_in_world(mesh, matrix), item.type == "CURVE")
        else:
            yield _points(vertices_in_world(mesh, matrix))


def _may_instance(item: bpy.types.Object) -> bool:
    """Whether an object may show others: by its vertices and faces, its particles, or its nodes."""
    return item.instance_type != "NONE" or any(m.type in {"NODES", "PARTICLE_SYSTEM"} for m in item.modifiers)


def _instances_of(item: bpy.types.Object, context: bpy.types.Context) -> Iterator[_Shape]:
    """Give what an object shows of others: of each a convex outline, as of what is scattered. There may be very many of them."""
    found: dict[int, tuple[np.ndarray, list[np.ndarray]]] = {}
    for one in evaluated_depsgraph(context).object_instances:
        if not one.is_instance or one.parent is None or one.parent.original != item:
            continue
        mesh = one.object.data
        if not isinstance(mesh, bpy.types.Mesh) or not len(mesh.vertices):
            continue
        number = mesh.as_pointer()
        if number not in found:
            found[number] = _outermost(vertices_in_world(mesh, np.eye(4))), []
        found[number][1].append(np.array(one.matrix_world))
    angle = np.arange(CORNERS_OF_INSTANCES) * (2.0 * np.pi / CORNERS_OF_INSTANCES)
    way = np.stack([np.cos(angle), np.sin(angle)])
    for position, matrices in found.values():
        matrix = np.array(matrices, np.float64)
        place = np.einsum("nij,pj->npi", matrix[:, :2, :3], position) + matrix[:, None, :2, 3]
        # The farthest ones along directions, one after the other, go round.
        corner = np.take_along_axis(place, (place @ way).argmax(axis=1)[:, :, None], axis=1)
        first = np.broadcast_to(corner[:, :1], corner[:, 1:-1].shape)
        fan = np.stack([first, corner[:, 1:-1], corner[:, 2:]], axis=2)
        # In space what counts is the ground that each covers at its origin, as of what is scattered.
        own = position[(position[:, :2] @ way).argmax(axis=0), :2]
        flat = np.einsum("nij,cj->nci", matrix[:, :3, :2], own) + matrix[:, None, :3, 3]
        start = np.broadcast_to(flat[:, :1], flat[:, 1:-1].shape)
        solid = np.stack([start, flat[:, 1:-1], flat[:, 2:]], axis=2)
        yield _Shape(fan.reshape(-1, 3, 2), np.empty((0, 2, 2)), solid.reshape(-1, 3, 3))


def _outermost(position: np.ndarray) -> np.ndarray:
    """Return the points ``[n, 3]`` that are the farthest along some direction; where there are few, all of them."""
    if len(position) <= DIRECTIONS:
        return position
    number = np.arange(DIRECTIONS) + 0.5
    # Spread evenly over the sphere, by the golden angle.
    height, turn = 1.0 - 2.0 * number / DIRECTIONS, number * (np.pi * (3.0 - 5.0**0.5))
    across = np.sqrt(1.0 - height**2)
    way = np.stack([across * np.cos(turn), across * np.sin(turn), height])
    return position[np.unique((position @ way).argmax(axis=0))]


def _seen_from_above(solid: np.ndarray) -> _Shape:
    return _Shape(solid[..., :2], np.empty((0, 2, 2)), solid)


def _points(position: np.ndarray) -> _Shape:
    return _seen_from_above(np.repeat(position[:, None], 3, axis=1))


def _edges(mesh: bpy.types.Mesh, position: np.ndarray, closed: bool) -> _Shape:
    """Return edges; as outlines, those whose ends lie open are closed by a straight piece where ``closed``."""
    edge = np.empty((len(mesh.edges), 2), np.int32)
    mesh.edges.foreach_get("vertices", edge.ravel())
    segment = position[edge][..., :2]
    outline = segment
    ends = np.flatnonzero(np.bincount(edge.ravel(), minlength=len(position)) == 1)
    if closed and len(ends) % 2 == 0:
        # Of curves, vertices follow one another: two ends in a row are those of one spline.
        outline = np.concatenate([segment, position[ends.reshape(-1, 2)][..., :2]])
    return _Shape(segment[:, [0, 1, 1]], outline, position[edge][:, [0, 1, 1]])
