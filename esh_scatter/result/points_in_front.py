"""A result whose points are edited: they show in front of the objects that stand on them, and hide them otherwise."""

from __future__ import annotations

import bpy

__all__ = ["hide_points", "show_points"]

# Whether it was us who had a result shown in front: an own property of it, for as long as its points are edited.
SHOWN_BY_US = "esh_points_in_front"
# Seconds after which it is looked again whether somebody has left Edit Mode by Tab.
LOOK_AGAIN = 0.5


def show_points(result: bpy.types.Object) -> None:
    """Have a result's points shown in front of all else, until :func:`hide_points` or until Edit Mode is left."""
    if result.show_in_front:
        return
    result.show_in_front = result[SHOWN_BY_US] = True
    if not bpy.app.background:
        name = result.name
        bpy.app.timers.register(lambda: _look(name), first_interval=LOOK_AGAIN)


def hide_points(result: bpy.types.Object) -> None:
    """Have a result shown as it was before :func:`show_points`."""
    if SHOWN_BY_US in result:
        del result[SHOWN_BY_US]
        result.show_in_front = False


def _look(name: str) -> float | None:
    """Hide the points of a result that is edited no longer; return when to look again, or None where nothing is left to do."""
    result = bpy.data.objects.get(name)
    if result is None or SHOWN_BY_US not in result or not result.is_editable:
        return None
    if result.mode == "EDIT":
        return LOOK_AGAIN
    hide_points(result)
    return None
