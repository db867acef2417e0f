"""A shelf of all objects and collections in the asset libraries: a click has the selected class place one."""

import bpy

from ..editing.assets import PLACED
from ..operators.assets import SHELF, ESH_OT_source_from_shelf
from ..properties.scene import active_scatter

__all__ = ["CLASSES", "draw_choice_of_asset"]


class ESH_AST_assets(bpy.types.AssetShelf):
    """The assets that can be placed, for the sidebar's button and at the foot of the viewport, where it begins hidden."""

    bl_idname = SHELF
    bl_space_type = "VIEW_3D"
    bl_activate_operator = "ESH_OT_source_from_shelf"
    bl_default_preview_size = 64

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a class that can place them."""
        scatter = active_scatter(context)
        return context.mode == "OBJECT" and scatter is not None and scatter.active_class is not None

    @classmethod
    def asset_poll(cls, asset: bpy.types.AssetRepresentation) -> bool:
        """Objects and collections."""
        return asset.id_type in PLACED


def draw_choice_of_asset(layout: bpy.types.UILayout) -> None:
    """Draw the button that shows the shelf."""
    layout.operator(ESH_OT_source_from_shelf.bl_idname, text="", icon="ASSET_MANAGER")


CLASSES = (ESH_AST_assets,)
