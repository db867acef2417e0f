"""What objects keep off: added, removed, taken from the selection."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ..properties.scene import selected_scatter
from ..targets.target import is_result, members_of
from .edit import Edit, RemoveEntry

__all__ = ["CLASSES"]


class ESH_OT_obstacle_add(Edit):
    """Add something for objects to keep away from: the selected objects, or an empty entry if none are selected"""

    bl_idname = "esh.obstacle_add"
    bl_label = "Add Obstacle"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        scatter = selected_scatter(context)
        there = {*scatter.targets, *(entry.item for entry in scatter.obstacles)}
        sources = [size.source for body_class in scatter.classes for size in body_class.sizes]
        placed = {*sources, *(item for source in sources for item in members_of(source))}
        chosen = [item for item in context.selected_objects if item not in there | placed and not is_result(item)]
        for item in sorted(chosen, key=lambda item: item.name_full) or [None]:
            scatter.obstacles.add().item = item
        scatter.obstacle_index = len(scatter.obstacles) - 1
        return {"FINISHED"}


class ESH_OT_obstacle_remove(RemoveEntry):
    """Remove the selected obstacle from the list. The object stays in the scene"""

    bl_idname = "esh.obstacle_remove"
    bl_label = "Remove Obstacle"
    _entry, _missing = "obstacle", "Select an obstacle first"


CLASSES = (ESH_OT_obstacle_add, ESH_OT_obstacle_remove)
