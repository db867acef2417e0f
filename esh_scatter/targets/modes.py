"""Leaving the mode that an object is in, which Blender refuses where the object is hidden."""

from __future__ import annotations

import bpy

from ...engine.errors import ProblemError

__all__ = ["to_object_mode"]


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
