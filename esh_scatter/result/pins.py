"""Objects of a result that were moved, turned or pinned by hand: they stay there in the next run, and the rest makes room."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import bpy
import numpy as np
from mathutils import Vector

from ...engine.problem.fixed_bodies import FixedBodies
from ...engine.problem.unit_vectors import tangent_frame, unit_vectors
from ..targets.mesh_attributes import read_attribute, write_attribute
from ..targets.target import extent_of
from .attributes import (
    BODY_ANGLE,
    BODY_LENGTH,
    FIT,
    HEADING,
    INSTANCE_INDEX,
    NORMAL,
    PINNED,
    PLACED_AT,
    SCALE,
    TO_ORIGIN,
    any_twice,
    numbers_of,
    read_flags,
)
from .display import shown_objects
from .kept_ground import body_places, sources_by_number
from .standing_now import moved_with, raised, rotations

# Warp is not imported before something is computed.
if TYPE_CHECKING:
    from ...engine.surface.chart import Chart
    from ...engine.surface.whole_surface import WholeSurface

__all__ = [
    "PINNED",
    "Pins",
    "add_pins",
    "balls_of",
    "can_be_edited",
    "checksum_of",
    "knows_places",
    "lost_with_classes",
    "lost_with_target",
    "moved_by_hand",
    "pin",
    "read_pins",
    "remove",
    "selected_points",
    "stand_there",
    "staying",
    "tell_copies_apart",
    "turn",
    "unpin",
]

# A point that is farther from where it was put was moved [m], and as a share of the result's extent.
MOVED, MOVED_SHARE = 1e-4, 1e-6
# Positions of pins are told apart by this much [m].
TOLD_APART = 1e-3
# Radius of the place of an object that has no extent [m].
SMALLEST_DISC = 0.01
# What lies no farther beside a target than this share of its extent is still on it.
AROUND = 0.01


class Pins(NamedTuple):
    """Bodies that stay; what any thread may look at.

    Attributes:
        position: On the surface, in the world [m], shape ``[n, 3]``.
        class_index: Which of the classes that are placed now, shape ``[n]``.
        size_index: Which of its sizes, shape ``[n]``.
        angle: How the placement has them lie [rad], shape ``[n]``.
        length: Of lines [m], shape ``[n]``; 0 where there is none.
        scale: Of the object, shape ``[n]``.
        fit: What of that scale fits the object to its footprint, shape ``[n]``.
        source: ``session_uid`` of the object that stands there, shape ``[n]``; -1 where it is gone.
        identity: Numbers of the points, shape ``[n]``.
        normal: Of the surface there when they were placed, shape ``[n, 3]``.
        turned: How all that is there has been turned since, and mirrored, with the target that a result follows, shape ``[n, 3, 3]``.
        turn: How far that is about their own axes [rad], shape ``[n]``.
    """

    position: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    scale: np.ndarray
    fit: np.ndarray
    source: np.ndarray
    identity: np.ndarray
    normal: np.ndarray
    turned: np.ndarray
    turn: np.ndarray

    def fixed_in(self, chart: Chart, variant: np.ndarray, scale: np.ndarray) -> FixedBodies:
        """Return them as the solver takes them, brought into the rectangle of a chart.

        Args:
            chart: Of the target.
            variant: Which of its size's objects each is, shape ``[n]``.
            scale: Of its class now, which its outline has, too, shape ``[n]``.
        """
        size = np.asarray(chart.size, np.float64)
        return FixedBodies(
            np.clip(self.position[:, :2] - chart.origin, 0.0, size),
            self.class_index.astype(object),
            self.size_index.astype(object),
            self.angle + self.turn,
            np.where(self.length > 0.0, self.length, np.nan),
            None,
            self.identity,
            variant,
            self.scale / scale,
        )

    def fixed_on(self, surface: WholeSurface, area: np.ndarray, variant: np.ndarray, scale: np.ndarray) -> FixedBodies:
        """Return them as the solver takes them, put onto a whole surface where that is nearest.

        Args:
            surface: The target.
            area: What ground each takes [m²], shape ``[n]``; NaN for that of its size.
            variant: Which of its size's objects each is, shape ``[n]``.
            scale: Of its class now, which its outline has, too, shape ``[n]``.
        """
        normal = unit_vectors(np.einsum("nij,nj->ni", self.turned, self.normal))
        triangle, weight = surface.nearest(self.position, normal)
        corner = surface.mesh.position[surface.mesh.triangle[triangle]].astype(np.float64)
        return FixedBodies(
            # The ground may have moved away from where they were.
            np.einsum("nk,nkd->nd", weight, corner),
            self.class_index.astype(object),
            self.size_index.astype(object),
            self._angle_on(normal),
            np.where(self.length > 0.0, self.length, np.nan),
            area,
            self.identity,
            variant,
            self.scale / scale,
            mesh=0,
            triangle=triangle,
            barycentric=weight,
        )

    def _angle_on(self, normal: np.ndarray) -> np.ndarray:
        """Angles [rad] in the planes of the normals that the surface has now, ``[n, 3]``."""
        first, second = tangent_frame(self.normal)
        way = np.cos(self.angle)[:, None] * first + np.sin(self.angle)[:, None] * second
        way = np.einsum("nij,nj->ni", self.turned, way)
        first, second = tangent_frame(normal)
        angle = np.arctan2((way * second).sum(axis=1), (way * first).sum(axis=1))
        # What was not turned stays to the last digit.
        return np.where((self.turned == np.eye(3)).all(axis=(1, 2)), self.angle, angle)


def moved_by_hand(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return which points of a result are not where the last run has put them, shape ``[n]``."""
    if PLACED_AT not in mesh.attributes:
        return np.zeros(len(mesh.vertices), bool)
    position, placed = read_attribute(mesh, "position"), read_attribute(mesh, PLACED_AT)
    # Panels ask with every drawing, and nearly always nothing was moved.
    if np.array_equal(position, placed):
        return np.zeros(len(position), bool)
    away = np.abs(position - placed).max(axis=1, initial=0.0)
    extent = float(np.ptp(position, axis=0).max()) if len(position) else 0.0
    return away > max(MOVED, MOVED_SHARE * extent)


def staying(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return which points of a result stay in the next run, shape ``[n]``: those that are pinned, that were moved, or copied."""
    stays = moved_by_hand(mesh)
    if PINNED in mesh.attributes:
        stays |= read_attribute(mesh, PINNED)
    copied, covered = _copies(mesh)
    stays[copied], stays[covered] = True, False
    return stays


def _copies(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return which points were copied by hand or are copies, and which of such lie where the one does that they are copies of.

    Of a point and a copy somewhere else nobody knows which is which: both are where somebody wants them. A copy that lies on what it
    is a copy of was called off.
    """
    number = read_attribute(mesh, "id")
    if PLACED_AT not in mesh.attributes or not any_twice(number):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    _, which, times = np.unique(number, return_inverse=True, return_counts=True)
    twice = np.flatnonzero(times[which] > 1)
    # Points of two results that were joined may have one number, and were put elsewhere.
    same = np.column_stack([number[twice], read_attribute(mesh, PLACED_AT)[twice].view(np.int32)])
    _, group = np.unique(same, axis=0, return_inverse=True)
    place = np.column_stack([group.ravel(), read_attribute(mesh, "position")[twice].view(np.int32)])
    found, first = np.unique(place, axis=0, return_index=True)
    covered = np.ones(len(twice), bool)
    covered[first] = False
    places = np.bincount(found[:, 0])[group.ravel()]
    return twice[~covered & (places > 1)], twice[covered]


def tell_copies_apart(mesh: bpy.types.Mesh) -> None:
    """Give copies that were made by hand numbers of their own, and have all of them and what they are copies of stay."""
    copied, covered = _copies(mesh)
    if not len(copied) and not len(covered):
        return
    number, pinned, placed = numbers_of(mesh), _read_pinned(mesh), read_attribute(mesh, PLACED_AT)
    pinned[copied], pinned[covered] = True, False
    placed[covered] = read_attribute(mesh, "position")[covered]
    for name, values in (("id", number), (PINNED, pinned), (PLACED_AT, placed)):
        write_attribute(mesh, name, values)


def read_pins(
    result: bpy.types.Object,
    names: str,
    sizes: Sequence[Sequence[str]],
    numbers: Sequence[int | None],
    others: Sequence[bpy.types.Object] = (),
) -> Pins | None:
    """Return what stays of a result in the next run. Only the main thread may call this.

    Args:
        result: What an earlier run has made.
        names: Its names of classes, and of their sizes, as JSON.
        sizes: By class that is placed now, the names of its sizes.
        numbers: By class of the result, which of those that are placed now it is; None for none of them.
        others: Targets that take the place of those that it stands on: what is elsewhere does not stay.
    """
    mesh, stays = result.data, _kept_by_hand(result)
    stays = stays[~_elsewhere(result, stays, others)]
    if not len(stays):
        return None
    new_class, new_size = _known_now(mesh, stays, names, sizes, numbers)
    kept = new_size >= 0
    stays = stays[kept]
    if not len(stays):
        return None
    now = moved_with(result, body_places(mesh), bpy.context)
    turn = _heading(now.axes(rotations(result))[stays]) - _heading(rotations(result)[stays])

    def of(name: str) -> np.ndarray:
        return read_attribute(mesh, name)[stays] if name in mesh.attributes else np.zeros(len(stays), np.float32)

    return Pins(
        now.position[stays],
        new_class[kept],
        new_size[kept],
        of(BODY_ANGLE).astype(np.float64),
        of(BODY_LENGTH).astype(np.float64),
        of(SCALE)[:, 0].astype(np.float64),
        of(FIT).astype(np.float64) if FIT in mesh.attributes else np.ones(len(stays)),
        sources_by_number(result)[of(INSTANCE_INDEX).astype(np.int64)],
        numbers_of(mesh)[stays].astype(np.int64),
        read_attribute(mesh, NORMAL)[stays].astype(np.float64),
        now.turned[stays],
        turn,
    )


def _kept_by_hand(result: bpy.types.Object) -> np.ndarray:
    """Return which points of a result were moved or pinned; none where it is edited, or is from before that could be told."""
    mesh = result.data
    if result.mode == "EDIT" or PLACED_AT not in mesh.attributes or TO_ORIGIN not in mesh.attributes:
        return np.empty(0, np.int64)
    return np.flatnonzero(staying(mesh))


def _known_now(
    mesh: bpy.types.Mesh,
    points: np.ndarray,
    names: str,
    sizes: Sequence[Sequence[str]],
    numbers: Sequence[int | None],
) -> tuple[np.ndarray, np.ndarray]:
    """Return which class and size points of a result are of in the next run, of what :func:`read_pins` takes; -1 for none."""
    class_index, size_index = read_attribute(mesh, "class_index")[points], read_attribute(mesh, "size_index")[points]
    _, size_names = json.loads(names)
    new_class, new_size = np.full(len(points), -1), np.full(len(points), -1)
    for old in np.unique(class_index).tolist():
        new = numbers[old] if old < min(len(numbers), len(size_names)) else None
        if new is None:
            continue
        for number, size in enumerate(size_names[old]):
            own = (class_index == old) & (size_index == number)
            # A class with one size is known whatever that is called.
            only = len(sizes[new]) == len(size_names[old]) == 1
            known = 0 if only else list(sizes[new]).index(size) if size in sizes[new] else -1
            new_class[own], new_size[own] = new, known
    return new_class, new_size


def lost_with_classes(
    result: bpy.types.Object, names: str, sizes: Sequence[Sequence[str]], numbers: Sequence[int | None]
) -> dict[str, int]:
    """Return how many objects of a result would stay, but are of a class or size that the next run does not place.

    Args:
        result: What an earlier run has made.
        names: Its names of classes, and of their sizes, as JSON.
        sizes: By class that is placed now, the names of its sizes.
        numbers: By class of the result, which of those that are placed now it is; None for none of them.

    Returns:
        By the name that the class had.
    """
    mesh, stays = result.data, _kept_by_hand(result)
    if not names or not len(stays):
        return {}
    _, size = _known_now(mesh, stays, names, sizes, numbers)
    lost = read_attribute(mesh, "class_index")[stays[size < 0]]
    classes = json.loads(names)[0]
    return {
        classes[number]: int((lost == number).sum()) for number in np.unique(lost).tolist() if number < len(classes)
    }


def lost_with_target(result: bpy.types.Object, targets: Sequence[bpy.types.Object]) -> int:
    """Return how many objects of a result would stay, but are neither above nor below the boxes around some targets."""
    return int(_elsewhere(result, _kept_by_hand(result), targets).sum())


def _elsewhere(result: bpy.types.Object, points: np.ndarray, targets: Sequence[bpy.types.Object]) -> np.ndarray:
    """Return which of some points of a result are neither above nor below the boxes around targets, shape ``[n]``."""
    if not len(points) or not targets:
        return np.zeros(len(points), bool)
    corners = np.concatenate([[item.matrix_world @ Vector(corner) for corner in item.bound_box] for item in targets])
    low, high = corners.min(axis=0)[:2], corners.max(axis=0)[:2]
    place = moved_with(result, body_places(result.data), bpy.context).position[points, :2]
    beside = AROUND * float((high - low).max())
    elsewhere: np.ndarray = ((place < low - beside) | (place > high + beside)).any(axis=1)
    return elsewhere


def _heading(rotation: np.ndarray) -> np.ndarray:
    """How objects are turned about their own axes [rad], of rotations ``[n, 3, 3]``."""
    upright = raised(rotation)
    return np.arctan2(upright[:, 1, 0], upright[:, 0, 0])


def checksum_of(result: bpy.types.Object) -> list[int]:
    """Return how many objects of a result stay, and a number for where and how; empty for none."""
    mesh = result.data
    if result.mode == "EDIT" or PLACED_AT not in mesh.attributes:
        return []
    stays = np.flatnonzero(staying(mesh))
    if not len(stays):
        return []
    order = stays[np.argsort(read_attribute(mesh, "id")[stays], kind="stable")]
    parts = [
        np.round(read_attribute(mesh, "position")[order] / TOLD_APART).astype(np.int64),
        read_attribute(mesh, "id")[order],
    ]
    if BODY_ANGLE in mesh.attributes:
        parts.append(np.round(read_attribute(mesh, BODY_ANGLE)[order] / TOLD_APART).astype(np.int64))
    return [len(stays), zlib.crc32(b"".join(part.tobytes() for part in parts))]


def selected_points(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the indices of the points that are selected, outside Edit Mode."""
    return np.flatnonzero(read_flags(mesh, "select"))


def pin(mesh: bpy.types.Mesh, points: np.ndarray) -> None:
    """Have points stay where they are."""
    _mark(mesh, points, True)


def unpin(mesh: bpy.types.Mesh, points: np.ndarray) -> None:
    """Have points go where the next run puts them, also those that were moved."""
    _mark(mesh, points, False)
    placed = read_attribute(mesh, PLACED_AT)
    placed[points] = read_attribute(mesh, "position")[points]
    write_attribute(mesh, PLACED_AT, placed)


def can_be_edited(result: bpy.types.Object) -> bool:
    """Tell whether a result knows where its points were put; those of earlier versions do not. In Edit Mode it does."""
    return result.mode == "EDIT" or knows_places(result.data)


def knows_places(mesh: bpy.types.Mesh) -> bool:
    """Tell whether the points of a result say where they were put and what stands on them; also in Edit Mode."""
    return PLACED_AT in mesh.attributes and TO_ORIGIN in mesh.attributes


def balls_of(result: bpy.types.Object, points: np.ndarray) -> np.ndarray:
    """Return middles, seen from a result, and radii of about what stands on points [m], shape ``[n, 4]``."""
    mesh = result.data
    position = moved_with(result, body_places(mesh), bpy.context).position[points]
    shown = shown_objects(result)
    half = [0.0 if item is None else 0.5 * float(extent_of(item, bpy.context)[:2].max()) for item in shown]
    index = read_attribute(mesh, INSTANCE_INDEX)[points]
    radius = np.array([half[number] if number < len(half) else 0.0 for number in index.tolist()])
    return np.column_stack([position, np.maximum(radius * read_attribute(mesh, SCALE)[points, 0], SMALLEST_DISC)])


def stand_there(mesh: bpy.types.Mesh, places: Sequence[tuple[float, ...]]) -> list[bool]:
    """Return of each of some places in a mesh whether one of its points is exactly there."""
    position, wanted = read_attribute(mesh, "position"), np.array(places, np.float32)
    # By one coordinate first: there are few places, and panels ask with every drawing.
    ordered = np.sort(wanted[:, 0])
    near = ordered[np.minimum(np.searchsorted(ordered, position[:, 0]), len(ordered) - 1)] == position[:, 0]
    there = {tuple(one) for one in position[near].tolist()}
    return [tuple(one) in there for one in wanted.tolist()]


def remove(mesh: bpy.types.Mesh, points: np.ndarray) -> None:
    """Take points out of a result; the others keep everything."""
    import bmesh

    edited = bmesh.new()
    edited.from_mesh(mesh)
    edited.verts.ensure_lookup_table()
    bmesh.ops.delete(edited, geom=[edited.verts[number] for number in points.tolist()], context="VERTS")
    edited.to_mesh(mesh)
    edited.free()
    mesh.update()


def turn(mesh: bpy.types.Mesh, points: np.ndarray, angle: float) -> None:
    """Turn the objects on points about their own axis [rad], and have them stay; they show it once they stand anew."""
    if BODY_ANGLE not in mesh.attributes:
        mesh.attributes.new(BODY_ANGLE, "FLOAT", "POINT")
    turned = read_attribute(mesh, BODY_ANGLE)
    turned[points] += np.float32(angle)
    write_attribute(mesh, BODY_ANGLE, turned)
    heading = read_attribute(mesh, HEADING)
    heading[points] += np.float32(angle)
    write_attribute(mesh, HEADING, heading)
    pin(mesh, points)


def add_pins(fixed: np.ndarray, position: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes that tell the next run who stays: who did in this one, and where all have been put."""
    found = {PLACED_AT: ("FLOAT_VECTOR", position)}
    if fixed.any():
        found[PINNED] = ("BOOLEAN", fixed)
    return found


def _mark(mesh: bpy.types.Mesh, points: np.ndarray, value: bool) -> None:
    tell_copies_apart(mesh)
    pinned = _read_pinned(mesh)
    pinned[points] = value
    write_attribute(mesh, PINNED, pinned)
    mesh.update()


def _read_pinned(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return which points are pinned, shape ``[n]``; a mesh that does not say so can be told from now on."""
    if PINNED not in mesh.attributes:
        mesh.attributes.new(PINNED, "BOOLEAN", "POINT")
    return read_attribute(mesh, PINNED)
