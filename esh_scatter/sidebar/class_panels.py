"""The panels of the selected class: what is placed and how many, where, how each one stands, which classes may overlap it."""

import bpy

from ...engine.problem.body_class import ClassSettings
from ...engine.problem.scatter_settings import Standing
from ..classes.flat_objects import lift_of_class
from ..classes.sunk_objects import sunk_share_of_class
from ..editing.class_copy import KEPT_APART
from ..properties.body_class import DERIVED_COUNTS
from ..properties.scene import active_scatter, selected_class, selected_scatter
from ..result.scene_units import area_unit
from ..targets.target import members_of
from .asset_shelf import draw_choice_of_asset
from .density_panel import draw_density
from .panel_parts import (
    SubPanel,
    draw_image,
    draw_list,
    draw_property,
    draw_settings,
    text_of_field,
    write_header,
    write_text,
)

__all__ = ["CLASSES"]


class _ClassPanel(SubPanel):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scatter = active_scatter(context)
        return scatter is not None and scatter.active_class is not None


class _ClassSubPanel(_ClassPanel):
    bl_parent_id = "ESH_PT_class"


class ESH_PT_class(_ClassPanel, bpy.types.Panel):
    """The selected class: what is placed, how many, and how much room each takes."""

    bl_label = ""

    def draw_header(self, context: bpy.types.Context) -> None:
        """Name the class."""
        write_header(context, self.layout, selected_class(context).name)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what is placed and how many; the list of sizes where there are several."""
        column = self._column()
        body_class = selected_class(context)
        if not body_class.sizes:
            write_text(context, column, "A size says which object is placed, and how many.")
            column.separator()
            column.operator("esh.size_add", text="Add a Size", icon="ADD")
            return
        size = body_class.active_size
        if len(body_class.sizes) > 1:
            _draw_count(context, column, body_class)
            draw_list(column, "ESH_UL_sizes", body_class, "sizes", "size_index", "size", rows=2, move=True)
            if size is None:
                return
            column.separator()
            _draw_source(context, column, size)
            _draw_in_ground(context, column, body_class)
            column.prop(size, "count" if body_class.count_kind == "SIZES" else "share")
        else:
            size = body_class.sizes[0]
            _draw_source(context, column, size)
            _draw_in_ground(context, column, body_class)
            _draw_count(context, column, body_class)
        column.separator()
        column.prop(size, "area_kind")
        if size.area_kind == "VALUE":
            column.prop(size, "area")
        elif size.area_kind == "RANGE":
            range_column = column.column(align=True)
            range_column.prop(size, "area", text="Smallest")
            range_column.prop(size, "area_largest")
            column.prop(size, "distribution")
        column.prop(size, "shape")
        if selected_scatter(context).avoid_overlap:
            for name in KEPT_APART:
                column.prop(body_class, name)
        if len(body_class.sizes) == 1:
            column.operator("esh.size_add", text="Add a Size", icon="ADD")


class ESH_PT_density(_ClassSubPanel, bpy.types.Panel):
    """Where the selected class stands."""

    bl_label = "Density"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the layers of the density of the selected class."""
        column = self._column()
        for note in draw_density(context, column, selected_scatter(context), selected_class(context)):
            write_text(context, column, note, icon="INFO")


class ESH_PT_standing(_ClassSubPanel, bpy.types.Panel):
    """How each one of the selected class stands; changed at once, without solving."""

    bl_label = "Rotation and Scale"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw how each one stands, and where it looks."""
        column = self._column()
        body_class = selected_class(context)
        draw_settings(context, column, body_class, Standing)
        column.separator()
        column.prop(body_class, "use_look_at")
        if body_class.use_look_at:
            column.prop(body_class, "look_at_object")
            if body_class.look_at_object is None:
                column.prop(body_class, "look_at_point")
            column.prop(body_class, "look_at_spread")
            column.prop(body_class, "look_at_front")


class ESH_PT_density_more(_ClassSubPanel, bpy.types.Panel):
    """What is done to the density, and where long ones point."""

    bl_label = "Direction and Detail"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw direction, sharpening and correction."""
        column = self._column()
        body_class = selected_class(context)
        draw_property(context, column, body_class, "direction_kind")
        if body_class.direction_kind == "ANGLE":
            column.prop(body_class, "direction_angle")
        elif body_class.direction_kind == "IMAGE":
            draw_image(context, column, body_class, "direction_image")
        elif body_class.direction_kind == "CURVE":
            draw_property(context, column, body_class, "direction_object")
        elif body_class.direction_kind == "ATTRIBUTE":
            draw_property(context, column, body_class, "direction_attribute")
        column.separator()
        without_clumps = () if body_class.clustering > 0.0 else ("clump_size",)
        draw_settings(context, column, body_class, ClassSettings, (*KEPT_APART, "look_at", *without_clumps))


class ESH_PT_overlap(_ClassSubPanel, bpy.types.Panel):
    """Which classes may lie on the selected one."""

    bl_label = "May Overlap"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is another class."""
        return super().poll(context) and len(selected_scatter(context).classes) > 1

    def draw(self, context: bpy.types.Context) -> None:
        """Draw a checkbox for every other class."""
        column = self._column().column(align=True)
        mine = selected_class(context)
        for other in selected_scatter(context).classes:
            if other != mine:
                row = column.row()
                row.alignment = "LEFT"
                icon = "CHECKBOX_HLT" if mine.overlaps_with(other) else "CHECKBOX_DEHLT"
                row.operator("esh.class_overlap", text=other.name, icon=icon, emboss=False).other = other.name


def _draw_source(context: bpy.types.Context, column: bpy.types.UILayout, size: bpy.types.PropertyGroup) -> None:
    draw_property(context, column, size, "source_kind")
    source = column.row(align=True)
    source.alert = size.source is None or bool(size.gone)
    name = "source_object" if size.source_kind == "OBJECT" else "source_collection"
    source.prop(size, name, **text_of_field(context, size.source))
    beside = source.row(align=True)
    beside.alert = False
    draw_choice_of_asset(beside)
    if size.source_kind == "COLLECTION" and size.source is not None:
        _draw_variants(column, size)


def _draw_in_ground(
    context: bpy.types.Context, column: bpy.types.UILayout, body_class: bpy.types.PropertyGroup
) -> None:
    """Say of flat objects in the ground's plane that they flicker, of others that they are half sunk, and offer the way out."""
    if lift_of_class(body_class):
        write_text(context, column, "Flat objects flicker where they lie in the ground", icon="INFO")
        column.operator("esh.class_lift", icon="TRIA_UP_BAR")
    elif share := sunk_share_of_class(body_class):
        one = len(body_class.sizes) == 1 and body_class.sizes[0].source_kind != "COLLECTION"
        said = f"{'' if one else 'Up to '}{share:.0%} of their height is in the ground"
        write_text(context, column, said, icon="INFO")
        column.operator("esh.class_raise", icon="TRIA_UP_BAR")


def _draw_variants(column: bpy.types.UILayout, size: bpy.types.PropertyGroup) -> None:
    """Draw how often each object of a collection is placed."""
    members = members_of(size.source)
    if len(members) < 2:
        return
    column.label(text="How Often Each Is Placed", translate=False)
    rows = column.column(align=True)
    for entry in size.variants:
        if entry.item in members:
            rows.prop(entry, "weight", text=entry.item.name)
    if {entry.item for entry in size.variants} != set(members):
        rows.operator("esh.variants_list", icon="FILE_REFRESH")


def _draw_count(context: bpy.types.Context, column: bpy.types.UILayout, body_class: bpy.types.PropertyGroup) -> None:
    draw_property(context, column, body_class, "count_kind")
    kind = body_class.count_kind
    if kind == "SIZES" and len(body_class.sizes) == 1:
        column.prop(body_class.sizes[0], "count")
    elif kind == "TOTAL":
        column.prop(body_class, "total")
    elif kind in DERIVED_COUNTS:
        name = DERIVED_COUNTS[kind]
        column.prop(body_class, name, **({"text": f"Per {area_unit(context.scene)}"} if name == "per_area" else {}))


CLASSES = (
    ESH_PT_class,
    ESH_PT_density,
    ESH_PT_standing,
    ESH_PT_density_more,
    ESH_PT_overlap,
)
