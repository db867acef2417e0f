"""A result whose points are edited: its attributes are read and written outside Edit Mode, which is left for that moment."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..targets.mesh_attributes import read_attribute
from ..targets.modes import hold_file_in_step
from .attributes import read_flags
from .pins import tell_copies_apart

__all__ = ["can_leave_edit_mode", "checksum_of_edited", "outside_edit_mode"]

# Blender has to look at all instances anew with every mode: of so many in less than a tenth of a second.
MOST_POINTS = 30_000


def can_leave_edit_mode(context: bpy.types.Context, result: bpy.types.Object) -> bool:
    """Tell whether a result is what is edited, and nothing else, and has so few points that it takes no time to leave that.

    What is hidden could not be edited again.
    """
    active = context.view_layer.objects.active
    alone = result.mode == "EDIT" and active == result and len(context.objects_in_mode) == 1 and result.visible_get()
    return alone and len(result.data.vertices) <= MOST_POINTS


def checksum_of_edited(result: bpy.types.Object) -> tuple[int, int]:
    """Return how many points a result in Edit Mode has, and a checksum of where they are; Blender does not hear of it."""
    import bmesh

    position = np.array([vertex.co[:] for vertex in bmesh.from_edit_mesh(result.data).verts], np.float32)
    return len(position), zlib.crc32(position.tobytes())


@contextmanager
def outside_edit_mode(result: bpy.types.Object | None) -> Iterator[None]:
    """Leave Edit Mode for a ``with`` block, if a result is in it; points are selected and hidden as before, by their numbers.

    A result that is hidden by then stays outside.
    """
    if result is None or result.mode != "EDIT":
        yield
        return
    # Whatever else is selected would be edited, too.
    edited = set(bpy.context.objects_in_mode)
    others = [item for item in bpy.context.view_layer.objects.selected if item not in edited]
    bpy.ops.object.mode_set(mode="OBJECT")
    # Copies have the numbers of what they were copied from.
    tell_copies_apart(result.data)
    shown = _Shown(result.data)
    try:
        yield
    finally:
        shown.give(result.data)
        for item in others:
            item.select_set(False)
        # What is hidden cannot be edited.
        if bpy.ops.object.mode_set.poll():
            bpy.ops.object.mode_set(mode="EDIT")
            hold_file_in_step()
        for item in others:
            item.select_set(True)


class _Shown:
    """Which points of a mesh are selected, and which are hidden.

    Args:
        mesh: The mesh, outside Edit Mode.
    """

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        number = _numbers(mesh)
        self._number = {name: number[read_flags(mesh, name)] for name in ("select", "hide")}

    def give(self, mesh: bpy.types.Mesh) -> None:
        """Select and hide the points with the same numbers, and no others."""
        number = _numbers(mesh)
        for name, own in self._number.items():
            flags = np.isin(number, own)
            if not np.array_equal(flags, read_flags(mesh, name)):
                mesh.vertices.foreach_set(name, flags)


def _numbers(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return what points are told apart by, shape ``[n]``."""
    return read_attribute(mesh, "id") if "id" in mesh.attributes else np.arange(len(mesh.vertices))
