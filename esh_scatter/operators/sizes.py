"""The sizes of a class: added, removed, moved."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ..properties.scene import selected_class
from ..properties.size import list_variants
from .edit import ClassEdit, EntryEdit, MoveEntry, RemoveEntry

__all__ = ["CLASSES"]


class ESH_OT_size_add(ClassEdit):
    """Add a size to the selected class. Larger sizes keep more distance"""

    bl_idname = "esh.size_add"
    bl_label = "Add Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        selected_class(context).add_size()
        return {"FINISHED"}


class ESH_OT_size_remove(RemoveEntry):
    """Remove the selected size"""

    bl_idname = "esh.size_remove"
    bl_label = "Remove Size"
    _entry, _missing = "size", "Select a size first"


class ESH_OT_size_move(MoveEntry):
    """Move the selected size in the list"""

    bl_idname = "esh.size_move"
    bl_label = "Move Size"
    _entry, _missing = "size", "Select a size first"


class ESH_OT_variants_list(EntryEdit):
    """Update this list after objects were added to the collection or removed from it"""

    bl_idname = "esh.variants_list"
    bl_label = "Refresh Objects"
    _entry, _missing = "size", "Select a size first"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """List them."""
        size = selected_class(context).active_size
        assert size is not None
        list_variants(size, context)
        return {"FINISHED"}


CLASSES = (
    ESH_OT_size_add,
    ESH_OT_size_remove,
    ESH_OT_size_move,
    ESH_OT_variants_list,
)
