"""Modes that objects are in: leaving one, which Blender refuses where the object is hidden; and undo in Edit Mode."""

from __future__ import annotations

import bpy

from ...engine.errors import ProblemError

__all__ = ["hold_file_in_step", "to_object_mode"]


def to_object_mode(context: bpy.types.Context) -> None:
    """Leave the mode of the active object, whichever it is.

    Raises:
        ProblemError: It is hidden, so that Blender keeps it in its mode.
    """
    if context.mode == "OBJECT":
        return
    if not bpy.ops.object.mode_set.poll():
        raise ProblemError(
            f'"{context.view_layer.objects.active.name}" is hidden, but not in Object Mode: show it first'
        )
    bpy.ops.object.mode_set(mode="OBJECT")


def hold_file_in_step() -> None:
    """Have undo take back what is done now in Edit Mode, be it settings, or meshes that were written outside of it for a moment.

    Steps of Edit Mode hold what is edited alone; all else they lead to as it was before Edit Mode, or leave as it is. Once there was
    something new in the file, Blender puts a step of the whole file before the next one, and shows both as one.
    """
    if bpy.context.mode.startswith("EDIT"):
        bpy.data.meshes.remove(bpy.data.meshes.new("New"))
