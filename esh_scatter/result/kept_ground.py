"""What a result keeps with its points, and what can be changed there at once, without solving: standing, color, visibility."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ...engine.problem.look_at import LookAt
from ...engine.problem.scatter_settings import Standing
from ..classes.standing import Ground, stand, turns_any_way, turns_towards
from ..targets.evaluated_mesh import in_world
from ..targets.mesh_attributes import read_attribute, write_attribute
from .attributes import (
    ALIGN,
    BODY_ANGLE,
    BODY_LENGTH,
    CORNERS,
    FIT,
    HEADING,
    HEIGHT,
    HIDE_RENDER,
    HIDE_VIEWPORT,
    INSTANCE_INDEX,
    LAID,
    LONG,
    LOOKS,
    MIDDLE,
    NORMAL,
    PINNED,
    PLACED_AT,
    ROTATION,
    SCALE,
    TARGET,
    TO_ORIGIN,
    WEIGHTS,
    numbers_of,
)
from .display import matrix_of_points, shown_objects

__all__ = [
    "CLASSES_OF_POINTS",
    "LOWEST_POINTS",
    "ON_WHOLE",
    "SEED",
    "UNREAD_STANDING",
    "bodies_in_world",
    "body_places",
    "can_stand_anew",
    "ground_attributes",
    "hide_points",
    "kept_places",
    "paint_points",
    "sources_by_number",
    "stand_anew",
]

# Custom properties of a result's mesh: the seed of its random numbers, and which of the sidebar's classes its points belong to.
SEED = "esh_scatter_seed"
CLASSES_OF_POINTS = "esh_scatter_classes"
# Another one: how high above their origins the lowest points of the objects that it shows are, by their numbers [m].
LOWEST_POINTS = "esh_scatter_lowest"
# And how much of how its objects stand has no influence on where they are, by class of the run.
UNREAD_STANDING = "esh_scatter_unread_standing"
# And whether it stands on the whole surface, and not on what is seen from above.
ON_WHOLE = "esh_scatter_on_whole"


def ground_attributes(ground: Ground, to_origin: np.ndarray, height: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes that keep what is known of the points; of the rarer ones, those that say something."""
    kept = {
        NORMAL: ("FLOAT_VECTOR", ground.normal),
        HEADING: ("FLOAT", ground.heading),
        TO_ORIGIN: ("FLOAT_VECTOR", to_origin),
    }
    if height.any():
        kept[HEIGHT] = ("FLOAT_VECTOR", height)
    if ground.long.any():
        kept[LONG] = ("BOOLEAN", ground.long)
    if ground.middle.any() or ground.axis.any():
        kept[MIDDLE] = ("FLOAT_VECTOR", np.column_stack([ground.middle, ground.axis]))
    if ground.laid.any():
        kept[LAID] = ("BOOLEAN", ground.laid)
    if ground.looks.any():
        kept[LOOKS] = ("BOOLEAN", ground.looks)
    if (ground.fit != 1.0).any():
        kept[FIT] = ("FLOAT", ground.fit)
    return kept


def can_stand_anew(result: bpy.types.Object) -> bool:
    """Tell whether a result has kept what is needed; those of earlier versions have not, and in Edit Mode nothing can be written."""
    return (
        result.mode != "EDIT"
        and SEED in result.data
        and all(name in result.data.attributes for name in ("id", NORMAL, HEADING, TO_ORIGIN, ROTATION, SCALE))
    )


def stand_anew(result: bpy.types.Object, class_number: int, standing: Standing, look_at: LookAt | None = None) -> None:
    """Turn, tilt, move and scale the objects of one class of a result. Points that were moved by hand stay where they were put."""
    mesh = result.data
    own = _points_of(mesh, class_number)
    count = len(mesh.vertices)
    _look_anew(result, own, standing, look_at)
    middle = read_attribute(mesh, MIDDLE) if MIDDLE in mesh.attributes else np.zeros((count, 3), np.float32)
    ground = Ground(
        read_attribute(mesh, "id"),
        read_attribute(mesh, NORMAL),
        read_attribute(mesh, HEADING),
        read_attribute(mesh, LONG) if LONG in mesh.attributes else np.zeros(count, bool),
        read_attribute(mesh, FIT) if FIT in mesh.attributes else np.ones(count, np.float32),
        middle[:, :2],
        middle[:, 2],
        read_attribute(mesh, LAID) if LAID in mesh.attributes else np.zeros(count, bool),
        read_attribute(mesh, LOOKS) if LOOKS in mesh.attributes else np.zeros(count, bool),
        _lowest_points(mesh),
    ).part(own)
    if not turns_any_way(standing):
        # They turned as they fitted; the next run leaves them what is drawn for them, and so nothing else is shown.
        pinned = read_attribute(mesh, PINNED)[own] if PINNED in mesh.attributes else np.zeros(len(own), bool)
        ground.heading[~(ground.long | ground.looks | pinned)] = 0.0
    new = stand(standing, ground, int(mesh[SEED]))
    to_origin, position = read_attribute(mesh, TO_ORIGIN), read_attribute(mesh, "position")
    position[own] += new.to_origin - to_origin[own]
    if PLACED_AT in mesh.attributes:
        placed = read_attribute(mesh, PLACED_AT)
        placed[own] += new.to_origin - to_origin[own]
        write_attribute(mesh, PLACED_AT, placed)
    to_origin[own] = new.to_origin
    rotation, scale = read_attribute(mesh, ROTATION), read_attribute(mesh, SCALE)
    rotation[own], scale[own] = new.rotation, new.scale[:, None]
    if new.height.any() or HEIGHT in mesh.attributes:
        if HEIGHT not in mesh.attributes:
            mesh.attributes.new(HEIGHT, "FLOAT_VECTOR", "POINT")
        height = read_attribute(mesh, HEIGHT)
        height[own] = new.height
        write_attribute(mesh, HEIGHT, height)
    for name, values in (("position", position), (TO_ORIGIN, to_origin), (ROTATION, rotation), (SCALE, scale)):
        write_attribute(mesh, name, values)
    if ALIGN in mesh.attributes:
        align = read_attribute(mesh, ALIGN)
        align[own] = standing.align_to_normal
        write_attribute(mesh, ALIGN, align)
    mesh.update()


def _lowest_points(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return how high the lowest points of what stands on points are above its origin [m], shape ``[n]``; 0 in older results."""
    if LOWEST_POINTS not in mesh:
        return np.zeros(len(mesh.vertices), np.float32)
    index = read_attribute(mesh, INSTANCE_INDEX)
    known = np.array(list(mesh[LOWEST_POINTS]), np.float32)
    table = np.zeros(max(len(known), int(index.max(initial=-1)) + 1), np.float32)
    table[: len(known)] = known
    return table[index]


def _look_anew(result: bpy.types.Object, own: np.ndarray, standing: Standing, look_at: LookAt | None) -> None:
    """Have points look somewhere, or nowhere; those that are pinned keep their turn, and long objects their direction."""
    mesh = result.data
    if look_at is None and LOOKS not in mesh.attributes:
        return
    if LOOKS not in mesh.attributes:
        mesh.attributes.new(LOOKS, "BOOLEAN", "POINT")
    looks, heading = read_attribute(mesh, LOOKS), read_attribute(mesh, HEADING)
    before = heading.copy()
    for name in (PINNED, LONG):
        if name in mesh.attributes:
            own = own[~read_attribute(mesh, name)[own]]
    if look_at is None:
        heading[own[looks[own]]] = 0.0
    else:
        heading[own] = turns_towards(
            look_at,
            standing.align_to_normal,
            read_attribute(mesh, NORMAL)[own],
            bodies_in_world(result)[own],
            read_attribute(mesh, "id")[own],
            int(mesh[SEED]),
        )
        if BODY_ANGLE not in mesh.attributes:
            mesh.attributes.new(BODY_ANGLE, "FLOAT", "POINT")
        # The turn that a pin would keep; on a whole surface it is told from another direction.
        angle = read_attribute(mesh, BODY_ANGLE)
        on_whole = LAID in mesh.attributes
        angle[own] = angle[own] + heading[own] - before[own] if on_whole else heading[own]
        write_attribute(mesh, BODY_ANGLE, angle)
    looks[own] = look_at is not None
    write_attribute(mesh, LOOKS, looks)
    write_attribute(mesh, HEADING, heading)


def paint_points(result: bpy.types.Object, class_number: int, color: tuple[float, ...]) -> None:
    """Give the points of one class another color (red, green, blue)."""
    mesh = result.data
    if "class_color" in mesh.attributes:
        values = read_attribute(mesh, "class_color")
        values[_points_of(mesh, class_number), :3] = color
        write_attribute(mesh, "class_color", values)
        mesh.update()


def hide_points(result: bpy.types.Object, class_number: int, *, viewport: bool, render: bool) -> None:
    """Hide the objects of one class in the viewport and in renders, or show them."""
    mesh = result.data
    own = _points_of(mesh, class_number)
    for name, hidden in ((HIDE_VIEWPORT, viewport), (HIDE_RENDER, render)):
        if name not in mesh.attributes:
            if not hidden:
                continue
            mesh.attributes.new(name, "BOOLEAN", "POINT")
        values = read_attribute(mesh, name)
        values[own] = hidden
        write_attribute(mesh, name, values)
    mesh.update()


class KeptPlaces(NamedTuple):
    """Where a result's bodies are: what a solver can start from.

    Attributes:
        position: On the surface, in the world [m], shape ``[n, 3]``.
        angle: [rad], shape ``[n]``; None where none lies in any direction.
        length: [m], shape ``[n]``; None where there are no lines.
        identity: Numbers of the points, shape ``[n]``.
        class_index: Which class, shape ``[n]``.
        size_index: Which of its sizes, shape ``[n]``.
        scale: Of what stands there, with that of its class, shape ``[n]``.
        source: Number of the object that stands there, -1 where it is gone, shape ``[n]``.
        normal: Of the surface, shape ``[n, 3]``.
        corners: Which vertices of its target's mesh the triangle has that a point was put on, shape ``[n, 3]``; None where that is not
            known.
        weight: Weights of these corners, shape ``[n, 3]``.
        target: Which of the targets it is, shape ``[n]``.
    """

    position: np.ndarray
    angle: np.ndarray | None
    length: np.ndarray | None
    identity: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    scale: np.ndarray
    source: np.ndarray
    normal: np.ndarray
    corners: np.ndarray | None
    weight: np.ndarray
    target: np.ndarray


def body_places(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return where the bodies are that points stand for, as :func:`bodies_in_world`, but seen from the result."""
    return (read_attribute(mesh, "position") - read_attribute(mesh, TO_ORIGIN)).astype(np.float64)


def bodies_in_world(result: bpy.types.Object) -> np.ndarray:
    """Return where the bodies are that the objects of a result stand for, shape ``[n, 3]``, also of points that were moved by hand."""
    return in_world(body_places(result.data), matrix_of_points(result))


def kept_places(result: bpy.types.Object) -> KeptPlaces | None:
    """Return where the bodies of a result are, also of points that were moved by hand; None where too little is known of them."""
    if not can_stand_anew(result):
        return None
    mesh = result.data
    position = bodies_in_world(result)
    count = len(position)
    known = all(name in mesh.attributes for name in (*CORNERS, WEIGHTS))
    return KeptPlaces(
        position,
        read_attribute(mesh, BODY_ANGLE) if BODY_ANGLE in mesh.attributes else None,
        read_attribute(mesh, BODY_LENGTH) if BODY_LENGTH in mesh.attributes else None,
        numbers_of(mesh),
        read_attribute(mesh, "class_index"),
        read_attribute(mesh, "size_index"),
        read_attribute(mesh, SCALE)[:, 0],
        sources_by_number(result)[read_attribute(mesh, INSTANCE_INDEX)],
        read_attribute(mesh, NORMAL),
        np.stack([read_attribute(mesh, name) for name in CORNERS], axis=1) if known else None,
        read_attribute(mesh, WEIGHTS) if known else np.zeros((count, 3), np.float32),
        read_attribute(mesh, TARGET) if TARGET in mesh.attributes else np.zeros(count, np.int32),
    )


def sources_by_number(result: bpy.types.Object) -> np.ndarray:
    """Return the session's numbers of the objects that a result shows, by ``instance_index``; -1 for those that are gone."""
    found = np.full(int(read_attribute(result.data, INSTANCE_INDEX).max(initial=-1)) + 1, -1, np.int64)
    for number, item in enumerate(shown_objects(result)[: len(found)]):
        found[number] = -1 if item is None else item.session_uid
    return found


def _points_of(mesh: bpy.types.Mesh, class_number: int) -> np.ndarray:
    return np.flatnonzero(read_attribute(mesh, "class_index") == class_number)
