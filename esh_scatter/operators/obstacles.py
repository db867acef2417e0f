"""What objects keep off: added, removed, taken from the selection."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ..properties.scatter import ESH_PG_scatter
from ..properties.scene import selected_scatter
from ..targets.target import is_result, members_of
from .edit import Edit, RemoveEntry

__all__ = ["CLASSES"]


class ESH_OT_obstacle_add(Edit):
    """Add something for objects to keep away from: the selected objects, or if none are selected an entry to choose it in"""

    bl_idname = "esh.obstacle_add"
    bl_label = "Add Obstacle"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        scatter = selected_scatter(context)
        selected = [item for item in context.selected_objects if item not in scatter.targets and not is_result(item)]
        if not selected:
            _select_empty_entry(scatter)
            return {"FINISHED"}
        taken = {*_placed_by(scatter), *(entry.item for entry in scatter.obstacles)}
        chosen = [item for item in selected if item not in taken and _has_shape(item)]
        if not chosen:
            text = "Nothing was added: what is selected is placed, is an obstacle already, or has no shape"
            self.report({"WARNING"}, text)
            return {"CANCELLED"}
        for item in sorted(chosen, key=lambda item: item.name_full):
            scatter.obstacles.add().item = item
        scatter.obstacle_index = len(scatter.obstacles) - 1
        return {"FINISHED"}


def _placed_by(scatter: ESH_PG_scatter) -> set[bpy.types.ID | None]:
    """Return what the classes of a scatter place, and the objects in it."""
    sources = [size.source for body_class in scatter.classes for size in body_class.sizes]
    return {*sources, *(item for source in sources for item in members_of(source))}


def _has_shape(item: bpy.types.Object) -> bool:
    """Tell whether an object covers or crosses any ground; lights and cameras do not."""
    return item.type == "META" or bool(members_of(item))


def _select_empty_entry(scatter: ESH_PG_scatter) -> None:
    """Select an entry in which nothing is chosen yet; there is one at most."""
    empty = (number for number, one in enumerate(scatter.obstacles) if one.item is None and one.collection is None)
    found = next(empty, len(scatter.obstacles))
    if found == len(scatter.obstacles):
        scatter.obstacles.add()
    scatter.obstacle_index = found


class ESH_OT_obstacle_remove(RemoveEntry):
    """Remove the selected obstacle from the list. The object stays in the scene"""

    bl_idname = "esh.obstacle_remove"
    bl_label = "Remove Obstacle"
    _entry, _missing = "obstacle", "Select an obstacle first"


CLASSES = (ESH_OT_obstacle_add, ESH_OT_obstacle_remove)
