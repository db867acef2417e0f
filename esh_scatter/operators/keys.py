"""Keys that delete points of a result as the button Remove does, and anything else as Blender does.

An operator that cannot be called leaves its key to what comes after it in the keymap, which is Blender's own menu.
"""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ..properties.scatter import ESH_PG_scatter
from ..result import pins, real_objects
from ..result.edited_points import outside_edit_mode
from .edit import settings_editable
from .instances import remove_and_keep_free

__all__ = ["CLASSES", "attach", "detach"]

# Where Blender listens in Edit Mode of meshes, and what deletes there.
KEYMAP, KEYS = "Mesh", ("X", "DEL")


class ESH_OT_instances_delete(bpy.types.Operator):
    """Remove the selected instances of the result that is in Edit Mode. Their places stay free in the next runs"""

    bl_idname = "esh.instances_delete"
    bl_label = "Remove Points"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where nothing but results of scatters is in Edit Mode, whichever scatter the sidebar shows."""
        return settings_editable(cls, context) and bool(_edited(context))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove them."""
        edited, removed = _edited(context), 0
        with outside_edit_mode(edited[0].result):
            for scatter in edited:
                points = pins.selected_points(scatter.result.data)
                if len(points):
                    remove_and_keep_free(scatter, scatter.result, points)
                    removed += len(points)
        if not removed:
            self.report({"WARNING"}, "No instances are selected")
            return {"CANCELLED"}
        return {"FINISHED"}


def _edited(context: bpy.types.Context) -> list[ESH_PG_scatter]:
    """Return the scatters whose results are in Edit Mode; none where something else is, too, or points cannot be removed."""
    items = context.objects_in_mode if context.mode == "EDIT_MESH" else ()
    found = [scatter for scatter in context.scene.esh_scatter.scatters if scatter.result_in(context.scene) in items]
    results = {scatter.result for scatter in found}
    return found if results == set(items) and all(_can_be_removed_from(result) for result in results) else []


def _can_be_removed_from(result: bpy.types.Object) -> bool:
    return pins.knows_places(result.data) and real_objects.real_objects_of(result) is None


def attach() -> None:
    """Listen for the keys; only once, and not where there are none."""
    detach()
    keyconfig = _keyconfig()
    if keyconfig is None:
        return
    keymap = keyconfig.keymaps.new(name=KEYMAP, space_type="EMPTY")
    for key in KEYS:
        keymap.keymap_items.new(ESH_OT_instances_delete.bl_idname, key, "PRESS", head=True)


def detach() -> None:
    """Listen no longer. The keymap stays: other add-ons may have keys in it."""
    keyconfig = _keyconfig()
    keymap = None if keyconfig is None else keyconfig.keymaps.find(KEYMAP, space_type="EMPTY")
    if keymap is None:
        return
    # Looked up anew: Blender may have made its keymaps anew since.
    for item in list(keymap.keymap_items):
        if item.idname == ESH_OT_instances_delete.bl_idname:
            keymap.keymap_items.remove(item)


def _keyconfig() -> bpy.types.KeyConfig | None:
    """Return where add-ons have their keys; None without a window, and on leaving."""
    manager = bpy.context.window_manager
    return manager.keyconfigs.addon if manager is not None else None


CLASSES = (ESH_OT_instances_delete,)
