"""The density of the selected class in the sidebar: its layers, and what they say where."""

from __future__ import annotations

from typing import Any

import bpy

from ..densities.density_curve import curve_node
from ..editing.painting import PAINTED_IN, can_be_painted, unsaved_images
from ..properties.described import shown_settings
from . import density_preview
from .panel_parts import draw_image, draw_property, is_narrow

__all__ = ["draw_density", "is_painted"]


def draw_density(context: bpy.types.Context, column: bpy.types.UILayout, scatter: Any, body_class: Any) -> list[str]:
    """Draw the layers of a class's density; return sentences that are worth attention."""
    layers = body_class.layers
    top = column.row(align=True)
    top.use_property_split = False
    top.prop(bpy.context.window_manager, "esh_scatter_show_density", toggle=True, icon="HIDE_OFF")
    if not len(layers):
        column.label(text="Even, the same everywhere", translate=False)
        row = column.row(align=True)
        row.menu("ESH_MT_layer_add", text="Add Layer", icon="ADD", translate=False)
        row.menu("ESH_MT_layer_paint", text="Paint", icon="BRUSH_DATA", translate=False)
        return []
    row = column.row()
    row.template_list(
        "ESH_UL_layers", "", body_class, "layers", body_class, "layer_index", rows=4 if len(layers) > 1 else 2
    )
    side = row.column(align=True)
    side.menu("ESH_MT_layer_add", text="", icon="ADD")
    side.operator("esh.layer_remove", text="", icon="REMOVE")
    if len(layers) > 1:
        side.separator(factor=0.5)
        side.operator("esh.layer_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator("esh.layer_move", text="", icon="TRIA_DOWN").direction = "DOWN"
    layer = body_class.active_layer
    if layer is not None:
        _draw_layer(context, column, scatter, layer, len(layers) > 1)
    notes = [density_preview.message()] if density_preview.message() else []
    names = [f'"{image.name}"' for image in unsaved_images(scatter)]
    if names:
        them = "it is" if len(names) == 1 else "they are"
        notes.append(f"{', '.join(names)} painted, not saved: {them} packed into the file when you save it")
    return notes


def is_painted(context: bpy.types.Context, scatter: Any) -> bool:
    """Tell whether somebody is in the mode that paints a layer of a scatter, on one of its targets."""
    layers = (layer for body_class in scatter.classes for layer in body_class.layers)
    return (
        context.mode in PAINTED_IN.values()
        and any(item.mode != "OBJECT" for item in scatter.targets)
        and any(PAINTED_IN.get(layer.kind) == context.mode for layer in layers)
    )


def _draw_layer(
    context: bpy.types.Context, column: bpy.types.UILayout, scatter: Any, layer: Any, several: bool
) -> None:
    target = scatter.first_target if scatter.first_target and scatter.first_target.type == "MESH" else None
    if several:
        column.prop(layer, "name", text="Name", placeholder=layer.label, translate=False)
    draw_property(context, column, layer, "kind")
    _draw_source(context, column, scatter, layer, target)
    for shown in shown_settings(layer.told.settings, layer.told.by_hand, layer.told.prefix):
        if shown.name == "image_mapping" and layer.image_mapping == "UV" and target:
            column.prop(layer, shown.name)
            # Beside its icon it needs no label where there is no room for it.
            text = {"text": ""} if is_narrow(context) else {}
            column.prop_search(layer, "uv_map", target.data, "uv_layers", icon="GROUP_UVS", **text)
        else:
            draw_property(context, column, layer, shown.name, slider=shown.slider)
    column.separator()
    column.prop(layer, "blend")
    column.prop(layer, "strength", slider=True)
    column.prop(layer, "invert")
    column.prop(layer, "use_curve")
    node = curve_node(layer.curve) if layer.use_curve and layer.curve else None
    if node is not None:
        column.template_curve_mapping(node, "mapping")


def _draw_source(
    context: bpy.types.Context, column: bpy.types.UILayout, scatter: Any, layer: Any, target: bpy.types.Object | None
) -> None:
    kind = layer.kind
    if kind == "IMAGE":
        draw_image(context, column, layer, "image")
    elif kind in ("VERTEX_GROUP", "ATTRIBUTE"):
        if target is None:
            column.label(text="Choose a target first", icon="ERROR", translate=False)
        elif kind == "VERTEX_GROUP":
            column.prop_search(layer, "vertex_group", target, "vertex_groups", icon="GROUP_VERTEX")
        else:
            column.prop(layer, "attribute", icon="SPREADSHEET")
    elif kind in ("DISTANCE", "INSIDE"):
        column.prop(layer, "source_kind")
        row = column.row()
        row.alert = layer.source is None or bool(layer.gone(context.scene))
        row.prop(layer, "source_object" if layer.source_kind == "OBJECT" else "source_collection")
    elif kind == "CLASS":
        row = column.row()
        row.alert = layer.other_class is None
        row.prop(layer, "class_name", icon="POINTCLOUD_DATA")
    elif kind == "CAMERA":
        row = column.row()
        row.alert = bool(layer.gone(context.scene))
        row.prop(layer, "camera")
    if kind in PAINTED_IN and context.mode == PAINTED_IN[kind]:
        paint = scatter.id_data.tool_settings.image_paint
        if kind == "IMAGE" and paint.mode == "IMAGE" and paint.canvas != layer.image:
            # Another layer's is painted, or none: undo and redo take away what strokes go to.
            column.operator("esh.layer_paint", text="Paint This Image", icon="BRUSH_DATA").kind = "SELECTED"
        column.operator("object.mode_set", text="Done", icon="CHECKMARK", translate=False).mode = "OBJECT"
    elif can_be_painted(layer, target):
        column.operator("esh.layer_paint", text="Paint", icon="BRUSH_DATA").kind = "SELECTED"
