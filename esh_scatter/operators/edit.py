"""What the buttons of the sidebar share: when they can be pressed, lists that are changed, errors as sentences."""

from typing import Any

import bpy

from .. import running
from ..properties.scene import active_scatter

__all__ = ["DIRECTIONS", "ClassEdit", "Edit", "move_by", "remove_at", "sentence", "settings_editable"]

DIRECTIONS = (("UP", "Up", "Towards the top of the list"), ("DOWN", "Down", "Towards the end of the list"))


class Edit(bpy.types.Operator):
    """Base of the small edits of the settings."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not settings_editable(cls, context):
            return False
        if cls._needs(context) is None:
            cls.poll_message_set(cls._missing)
            return False
        return True

    _missing = "Add a scatter first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return active_scatter(context)


class ClassEdit(Edit):
    _missing = "Select a class first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.active_class


def settings_editable(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Tell whether settings can be changed now; otherwise the tooltip of ``operator`` says why not."""
    reason = None
    if running.session is not None:
        reason = "A run is in progress. Press Esc to stop it"
    elif context.scene is None or not context.scene.is_editable:
        reason = "This scene is linked from a library and cannot be changed"
    if reason:
        operator.poll_message_set(reason)
    return reason is None


def remove_at(collection: Any, index: int) -> int:
    """Remove an entry of one of Blender's lists and return which is selected then."""
    collection.remove(index)
    return max(0, min(index, len(collection) - 1))


def move_by(collection: Any, index: int, direction: str) -> int:
    """Move an entry of one of Blender's lists by one place and return where it is then."""
    to = max(0, min(index + (-1 if direction == "UP" else 1), len(collection) - 1))
    collection.move(index, to)
    return to


def sentence(error: Exception | str) -> str:
    """Return a sentence as Blender's status line shows it: with a capital letter, without back quotes."""
    text = str(error).replace("`", "")
    return text[:1].upper() + text[1:]
