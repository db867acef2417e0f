"""The sizes of a class: added, removed, moved."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
from bpy.props import EnumProperty

from ..properties.scene import active_scatter, selected_class
from ..properties.size import list_variants
from .edit import DIRECTIONS, ClassEdit, Edit, move_by, remove_at

__all__ = ["CLASSES"]


class ESH_OT_size_add(ClassEdit):
    """Add a size to the selected class. Larger sizes keep more distance"""

    bl_idname = "esh.size_add"
    bl_label = "Add Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        selected_class(context).add_size()
        return {"FINISHED"}


class _SizeEdit(Edit):
    _missing = "Select a size first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.active_class and scatter.active_class.active_size


class ESH_OT_size_remove(_SizeEdit):
    """Remove the selected size"""

    bl_idname = "esh.size_remove"
    bl_label = "Remove Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        body_class = selected_class(context)
        body_class.size_index = remove_at(body_class.sizes, body_class.size_index)
        return {"FINISHED"}


class ESH_OT_size_move(_SizeEdit):
    """Move the selected size in the list"""

    bl_idname = "esh.size_move"
    bl_label = "Move Size"

    direction: EnumProperty(items=DIRECTIONS, name="Direction")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Move it."""
        body_class = selected_class(context)
        body_class.size_index = move_by(body_class.sizes, body_class.size_index, self.direction)
        return {"FINISHED"}


class ESH_OT_variants_list(_SizeEdit):
    """List the objects of the collection, which were changed since it was chosen, to give them weights"""

    bl_idname = "esh.variants_list"
    bl_label = "List Objects"

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
