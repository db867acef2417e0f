"""Lists of the sidebar: scatters, classes, sizes."""

import bpy

from .properties import ESH_PG_class, ESH_PG_scatter, ESH_PG_size

__all__ = ["CLASSES"]


class ESH_UL_scatters(bpy.types.UIList):
    """The scene's scatters: name, and whether the result shows in viewport and renders."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: object,
        item: ESH_PG_scatter,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one scatter."""
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="STICKY_UVS_DISABLE")
        if item.outdated:
            row.label(text="", icon="FILE_REFRESH")
        result = item.result_in(context.scene)
        if result is not None:
            row.prop(result, "hide_viewport", text="", emboss=False)
            row.prop(result, "hide_render", text="", emboss=False)


class ESH_UL_classes(bpy.types.UIList):
    """The classes of a scatter: colour swatch, name, how many."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: ESH_PG_scatter,
        item: ESH_PG_class,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one class."""
        row = layout.row(align=True)
        swatch = row.row()
        swatch.ui_units_x = 1.2
        swatch.prop(item, "color", text="")
        row.separator()
        row.prop(item, "name", text="", emboss=False)
        count = row.row()
        count.alignment = "RIGHT"
        if data.target is not None and data.target.type == "MESH" and item.obstacle(data.target):
            count.label(text="", icon="ERROR")
        count.label(text="cover" if item.count_kind == "COVER" else f"{item.count:,}")


class ESH_UL_sizes(bpy.types.UIList):
    """The sizes of a class: name, what is placed, how many."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: ESH_PG_class,
        item: ESH_PG_size,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one size."""
        split = layout.split(factor=0.36, align=True)
        split.prop(item, "name", text="", emboss=False)
        source = item.source
        icon = "OBJECT_DATA" if item.source_kind == "OBJECT" else "OUTLINER_COLLECTION"
        row = split.row(align=True)
        row.label(text=source.name if source else "none yet", icon=icon if source else "ERROR")
        count = row.row()
        count.alignment = "RIGHT"
        count.label(text=f"{item.count:,}" if data.count_kind == "SIZES" else f"share {item.share:g}")


CLASSES = (ESH_UL_scatters, ESH_UL_classes, ESH_UL_sizes)
