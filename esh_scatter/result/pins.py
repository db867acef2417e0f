"""Objects of a result that were moved, turned or pinned by hand: they stay there in the next run, and the rest makes room."""

from __future__ import annotations

import zlib

import bpy
import numpy as np

from ..targets.mesh_attributes import read_attribute, write_attribute
from ..targets.target import extent_of
from .attributes import (
    BODY_ANGLE,
    HEADING,
    INSTANCE_INDEX,
    PINNED,
    PLACED_AT,
    SCALE,
    TO_ORIGIN,
    any_twice,
    numbers_of,
    read_flags,
)
from .display import shown_objects
from .kept_ground import body_places
from .standing_now import moved_with

__all__ = [
    "add_pins",
    "balls_of",
    "can_be_edited",
    "checksum_of",
    "knows_places",
    "moved_by_hand",
    "pin",
    "remove",
    "selected_points",
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
