"""A result's instances as objects of their own, and back: what was done to these objects is done to the result's points."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from ...engine.errors import ProblemError
from ..targets.depsgraph import evaluated_depsgraph
from ..targets.mesh_attributes import add_attribute, read_attribute, write_attribute
from ..targets.target import put_offset, world_matrix
from . import pins
from .attributes import BODY_ANGLE, FIT, HEADING, HEIGHT, PLACED_AT, ROTATION, SCALE, TO_ORIGIN
from .display import get_inputs, matrix_of_points, our_modifier, set_inputs, shown_objects
from .node_group import DISPLAYS
from .standing_now import heights

__all__ = ["Changes", "changes_of", "discard_real", "make_real", "real_objects_of", "take_over"]

# Custom properties of a collection of real objects: the result that they stand for, the numbers of its points that were made real, a
# number for where these were, and whether the result was hidden in viewport and renders.
REAL_OF, POINTS, MADE_OF, HIDDEN = "esh_real_of", "esh_points", "esh_made_of", "esh_hidden"
# And of a real object: the number of its point, and its matrix when it was made, row by row.
POINT, MADE_AT = "esh_point", "esh_made_at"
# How far a matrix may be from what it was, as a share of its own numbers, without having been changed.
SAME = 1e-5
# What a copy of an object to place is not.
_NOT_COPIED = ("esh_asset", "esh_prototype")
# What a result is shown as while its instances are read: all of it.
_WHOLE = {"Display": DISPLAYS[0], "Share": 1.0, "Culling": False}


class _Instances(NamedTuple):
    """What a result shows: numbers of points and classes ``[n]``, matrices in the world ``[n, 4, 4]``, what stands there."""

    identity: np.ndarray
    class_index: np.ndarray
    matrix: np.ndarray
    source: list[bpy.types.ID]


class Changes(NamedTuple):
    """What was done to real objects.

    Attributes:
        points: Of the result: those whose objects were moved, turned or scaled, shape ``[m]``.
        ways: From where these objects were made to where they are, in the world, shape ``[m, 4, 4]``.
        removed: Points whose objects were deleted, shape ``[k]``.
        objects: The real objects, each of which stands for a point.
        added: How many others there are in the collection.
    """

    points: np.ndarray
    ways: np.ndarray
    removed: np.ndarray
    objects: list[bpy.types.Object]
    added: int


def real_objects_of(result: bpy.types.Object) -> bpy.types.Collection | None:
    """Return the collection with the real objects of a result, or None where there are none."""
    return next((one for one in bpy.data.collections if one.get(REAL_OF) == result), None)


def make_real(context: bpy.types.Context, result: bpy.types.Object, class_names: Sequence[str]) -> bpy.types.Collection:
    """Make an object of every instance that a result shows, where it shows it, and hide the result.

    Objects share the data of what they are copies of. A collection that is placed as one becomes an empty that instances it.

    Args:
        context: Whose view layer.
        result: Whose instances.
        class_names: What ``class_index`` counts.

    Raises:
        ProblemError: It shows no instances.
    """
    for source in shown_objects(result):
        if isinstance(source, bpy.types.Collection):
            put_offset(source, context)
    pins.tell_copies_apart(result.data)
    shown = _read(context, result)
    if not len(shown.identity):
        raise ProblemError(f'"{result.name}" must show instances to make real; it shows none')
    collection = bpy.data.collections.new(f"{result.name} Objects")
    parent = result.users_collection[0] if result.users_collection else context.scene.collection
    parent.children.link(collection)
    for identity, name, matrix, source in zip(
        shown.identity.tolist(), _numbered(shown, class_names), shown.matrix, shown.source, strict=True
    ):
        item = _copy_of(source, name)
        item.matrix_basis = Matrix(matrix.tolist())
        collection.objects.link(item)
        item[POINT], item[MADE_AT] = identity, np.array(item.matrix_basis, np.float64).ravel().tolist()
    collection[REAL_OF], collection[POINTS] = result, shown.identity.tolist()
    collection[MADE_OF], collection[HIDDEN] = _state_of(result), [result.hide_viewport, result.hide_render]
    result.hide_viewport = result.hide_render = True
    return collection


def changes_of(context: bpy.types.Context, collection: bpy.types.Collection) -> Changes:
    """Return what was done to real objects since they were made.

    Raises:
        ProblemError: Their result is gone, or was made anew since.
    """
    result = collection.get(REAL_OF)
    if result is None:
        raise ProblemError(f'the result that "{collection.name}" stands for must be in the file; it was removed')
    if collection.get(MADE_OF) != _state_of(result):
        raise ProblemError(
            f'"{result.name}" must be as it was when its objects were made real, to take their changes over; it has been '
            "updated since"
        )
    if context.view_layer is not None:
        context.view_layer.update()
    index = {number: point for point, number in enumerate(read_attribute(result.data, "id").tolist())}
    # Copies of a real object say that they are the same; the first one is.
    members = [item for item in collection.all_objects if POINT in item]
    first: dict[int, bpy.types.Object] = {}
    for item in sorted(members, key=lambda one: one.session_uid):
        first.setdefault(int(item[POINT]), item)
    points, ways = [], []
    for number, item in first.items():
        made = np.array(item[MADE_AT], np.float64).reshape(4, 4)
        now = world_matrix(item, context).astype(np.float64)
        if number in index and not np.allclose(now, made, rtol=SAME, atol=SAME * np.abs(made[:3, :3]).max()):
            points.append(index[number])
            ways.append(now @ np.linalg.inv(made))
    removed = [index[number] for number in collection[POINTS] if number not in first and number in index]
    return Changes(
        np.array(points, np.int64),
        np.array(ways).reshape(-1, 4, 4),
        np.array(sorted(removed), np.int64),
        list(first.values()),
        len(collection.all_objects) - len(first),
    )


def take_over(result: bpy.types.Object, changes: Changes) -> int:
    """Have the objects of a result's points stand as their real objects do, and stay so in the next run; none are removed.

    Points have no mirrored objects: these stand there as they were before, with the direction and size of the mirrored one. Returns
    how many do.
    """
    mesh, points = result.data, changes.points
    if not len(points):
        return 0
    mirrored = 0
    world = matrix_of_points(result)
    ways = np.linalg.inv(world) @ changes.ways @ world
    names = ("position", ROTATION, SCALE, TO_ORIGIN, HEADING)
    position, rotation, scale, to_origin, heading = (read_attribute(mesh, name) for name in names)
    height = heights(result)
    fit, angle = add_attribute(mesh, FIT, 1.0), add_attribute(mesh, BODY_ANGLE, 0.0)
    for point, way in zip(points.tolist(), ways, strict=True):
        before = Matrix.LocRotScale(
            position[point].tolist(), Quaternion(rotation[point].tolist()), scale[point].tolist()
        )
        after = Matrix(way.tolist()) @ before
        if after.determinant() < 0.0:
            after = after @ Matrix.Diagonal((1.0, -1.0, 1.0, 1.0))
            mirrored += 1
        place, turned, sized = after.decompose()
        # About its own axis: what else was turned does not outlast the next run.
        x, y, _ = Quaternion(rotation[point].tolist()).inverted() @ turned @ Matrix.Identity(3).col[0]
        turn, factor = math.atan2(y, x), float(np.mean(sized)) / float(np.mean(scale[point]))
        position[point], rotation[point], scale[point] = place, turned, sized
        to_origin[point] = way[:3, :3] @ to_origin[point]
        height[point] = way[:3, :3] @ height[point]
        heading[point] += turn
        angle[point] += turn
        fit[point] *= factor
    values = (position, rotation, scale, to_origin, heading)
    for name, value in zip((*names, FIT, BODY_ANGLE), (*values, fit, angle), strict=True):
        write_attribute(mesh, name, value)
    if HEIGHT in mesh.attributes:
        write_attribute(mesh, HEIGHT, height.astype(np.float32))
    pins.pin(mesh, points)
    return mirrored


def discard_real(collection: bpy.types.Collection, objects: Sequence[bpy.types.Object] | None = None) -> None:
    """Remove real objects, None for all that stand for points, and show their result again; others stay, with the collection."""
    if objects is None:
        objects = [item for item in collection.all_objects if POINT in item]
    bpy.data.batch_remove(list(objects))
    result, hidden = collection.get(REAL_OF), list(collection.get(HIDDEN, (False, False)))
    if result is not None:
        result.hide_viewport, result.hide_render = (bool(one) for one in hidden)
    if len(collection.all_objects) or len(collection.children):
        for name in (REAL_OF, POINTS, MADE_OF, HIDDEN):
            if name in collection:
                del collection[name]
        for item in collection.all_objects:
            for name in (POINT, MADE_AT):
                if name in item:
                    del item[name]
    else:
        bpy.data.collections.remove(collection)


def _read(context: bpy.types.Context, result: bpy.types.Object) -> _Instances:
    """Read what a result shows, all of it whatever the viewport's share is."""
    modifier = our_modifier(result)
    if modifier is None:
        raise ProblemError(f'"{result.name}" must have the modifier that shows its objects; it was removed')
    before = get_inputs(modifier)
    set_inputs(modifier, _WHOLE)
    try:
        context.view_layer.update()
        evaluated = result.evaluated_get(evaluated_depsgraph(context))
        geometry = evaluated.evaluated_geometry()
        cloud = geometry.instances_pointcloud()
        count = 0 if cloud is None else len(cloud.points)
        identity, class_index, chosen = (np.zeros(count, np.int32) for _ in range(3))
        matrix = np.zeros(16 * count, np.float32)
        if cloud is not None:
            for name, values in (
                ("id", identity),
                ("class_index", class_index),
                (".reference_index", chosen),
                ("instance_transform", matrix),
            ):
                cloud.attributes[name].data.foreach_get("value", values)
        shown = [one.original if isinstance(one, bpy.types.ID) else None for one in geometry.instance_references()]
        world = np.array(result.matrix_world, np.float64)
        # Stored column by column.
        placed = world @ matrix.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
    finally:
        set_inputs(modifier, before)
        context.view_layer.update()
    # In the order of the points.
    order = [row for row in np.argsort(identity, kind="stable").tolist() if shown[chosen[row]] is not None]
    return _Instances(identity[order], class_index[order], placed[order], [shown[chosen[row]] for row in order])


def _numbered(shown: _Instances, class_names: Sequence[str]) -> list[str]:
    """Return a name for every instance: that of its class, with a number that begins at 1 in each."""
    names = [
        class_names[number] if number < len(class_names) else source.name
        for number, source in zip(shown.class_index.tolist(), shown.source, strict=True)
    ]
    counted: Counter[str] = Counter()
    numbered = []
    for name in names:
        counted[name] += 1
        numbered.append((name, counted[name]))
    return [f"{name} {number:0{max(4, len(str(counted[name])))}d}" for name, number in numbered]


def _copy_of(source: Any, name: str) -> bpy.types.Object:
    """Return an object that is like what a result places, but bound to nothing."""
    if isinstance(source, bpy.types.Collection):
        item = bpy.data.objects.new(name, None)
        item.instance_type, item.instance_collection = "COLLECTION", source
        item.empty_display_size = 0.25
        return item
    item = source.copy()
    item.name = name
    item.parent = None
    item.constraints.clear()
    item.animation_data_clear()
    item.delta_location, item.delta_scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    item.delta_rotation_euler, item.delta_rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    item.hide_viewport = item.hide_render = item.hide_select = False
    for key in _NOT_COPIED:
        if key in item:
            del item[key]
    return item


def _state_of(result: bpy.types.Object) -> str:
    """Return a word for where the points of a result were put, and which they are."""
    mesh = result.data
    parts = [read_attribute(mesh, name).tobytes() for name in ("position", "id", PLACED_AT) if name in mesh.attributes]
    return f"{len(mesh.vertices)} {zlib.crc32(b''.join(parts))}"
