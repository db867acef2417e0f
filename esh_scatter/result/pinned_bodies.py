"""What stays of a result in the next run, as bodies that the solver takes; and what of it is lost with classes or targets."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import bpy
import numpy as np
from mathutils import Vector

from ...engine.geometry.unit_vectors import tangent_frame, unit_vectors
from ...engine.problem.fixed_bodies import FixedBodies
from ..targets.mesh_attributes import read_attribute
from .attributes import (
    BODY_ANGLE,
    BODY_LENGTH,
    FIT,
    INSTANCE_INDEX,
    NORMAL,
    PLACED_AT,
    SCALE,
    TO_ORIGIN,
    numbers_of,
)
from .kept_ground import body_places, sources_by_number
from .pins import staying
from .standing_now import moved_with, raised, rotations

# Warp is not imported before something is computed.
if TYPE_CHECKING:
    from ...engine.surface.chart import Chart
    from ...engine.surface.whole_surface import WholeSurface

__all__ = ["Pins", "lost_with_classes", "lost_with_target", "read_pins"]

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


def read_pins(
    result: bpy.types.Object,
    names: str,
    sizes: Sequence[Sequence[str]],
    numbers: Sequence[int | None],
    others: Sequence[bpy.types.Object],
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
