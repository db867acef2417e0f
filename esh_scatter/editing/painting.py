"""Painting densities: what is painted on, the mode that does it, and images that are kept when the file is saved."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...engine.errors import ProblemError
from ..properties.names import KEPT
from ..targets.evaluated_mesh import vertices_in_world
from ..targets.mesh_attributes import read_attribute
from ..targets.modes import to_object_mode
from ..targets.target import check_target

__all__ = ["PAINTED_IN", "attach", "begin_to_paint", "can_be_painted", "detach", "unsaved_images", "why_not_painted"]

# Kinds of layers that are painted, and the mode in which that is done.
PAINTED_IN = {"IMAGE": "PAINT_TEXTURE", "VERTEX_GROUP": "PAINT_WEIGHT", "ATTRIBUTE": "PAINT_VERTEX"}
# What a UV map is called that lays an image over the target as it is seen from above.
UV_MAP = "From Above"


def can_be_painted(layer: Any, target: bpy.types.Object | None) -> bool:
    """Tell whether what a layer follows on a mesh is painted by hand, or made for that; of attributes only colors are."""
    if layer.kind != "ATTRIBUTE" or target is None:
        return layer.kind in PAINTED_IN
    mesh = target.data
    return layer.attribute in mesh.color_attributes or layer.attribute not in mesh.attributes


def why_not_painted(target: bpy.types.Object | None) -> str | None:
    """Return what keeps a target from being painted on, as one sentence that says what to do, or None."""
    if target is None:
        return "Choose a target first: a mesh to paint on"
    if not target.is_editable or not target.data.is_editable:
        local = "To paint on it, make object and data local: Object > Relations > Make Local"
        return f'The mesh of "{target.name}" belongs to another file. {local}'
    return None


def begin_to_paint(
    context: bpy.types.Context, target: bpy.types.Object, layer: Any, name: str, resolution: int
) -> None:
    """Go into the mode that paints what a layer follows; make image, UV map, vertex group or colors where they are missing.

    Args:
        context: Whose view layer.
        target: The mesh that is painted on.
        layer: A layer that can be painted.
        name: Of what is made.
        resolution: Pixels along each side of a new image.

    Raises:
        ProblemError: The target cannot be painted on.
    """
    check_target(target, context)
    if why := why_not_painted(target):
        raise ProblemError(why)
    to_object_mode(context)
    for item in context.selected_objects:
        item.select_set(False)
    target.select_set(True)
    context.view_layer.objects.active = target
    if layer.kind == "VERTEX_GROUP":
        _paint_weights(target, layer, name)
    elif layer.kind == "ATTRIBUTE":
        _paint_colors(context, target, layer, name)
    else:
        _paint_image(context, target, layer, name, resolution)


def _paint_weights(target: bpy.types.Object, layer: Any, name: str) -> None:
    if layer.vertex_group not in target.vertex_groups:
        layer.vertex_group = target.vertex_groups.new(name=name).name
    target.vertex_groups.active = target.vertex_groups[layer.vertex_group]
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")


def _paint_colors(context: bpy.types.Context, target: bpy.types.Object, layer: Any, name: str) -> None:
    mesh = target.data
    is_new = layer.attribute not in mesh.color_attributes
    if is_new:
        # Blender makes no attribute of a name that it would have to cut.
        kept = (layer.attribute or name).encode()[:KEPT].decode(errors="ignore")
        made = mesh.color_attributes.new(name=kept, type="FLOAT_COLOR", domain="POINT")
        # Black: nothing stands there before something is painted.
        made.data.foreach_set("color", np.tile(np.array([0.0, 0.0, 0.0, 1.0], np.float32), len(mesh.vertices)))
        layer.attribute = made.name
    mesh.color_attributes.active_color = mesh.color_attributes[layer.attribute]
    bpy.ops.object.mode_set(mode="VERTEX_PAINT")
    if is_new:
        _paint_white(context, context.scene.tool_settings.vertex_paint)


def _paint_image(context: bpy.types.Context, target: bpy.types.Object, layer: Any, name: str, resolution: int) -> None:
    is_new = layer.image is None
    if is_new:
        layer.image = bpy.data.images.new(name, resolution, resolution, alpha=False, is_data=True)
        # Black: nothing stands there before something is painted.
        layer.image.generated_color = (0.0, 0.0, 0.0, 1.0)
        layer.image.pack()
    mesh = target.data
    if layer.image_mapping == "POSITION":
        # Painting goes through a UV map: one that lays the image just as it was.
        layer.uv_map = _map_from_above(target)
        layer.image_mapping = "UV"
    elif not mesh.uv_layers:
        layer.uv_map = _map_from_above(target)
    chosen = layer.uv_map or mesh.uv_layers.active.name
    if chosen in mesh.uv_layers:
        mesh.uv_layers.active = mesh.uv_layers[chosen]
    paint = context.scene.tool_settings.image_paint
    paint.mode, paint.canvas = "IMAGE", layer.image
    bpy.ops.object.mode_set(mode="TEXTURE_PAINT")
    if is_new:
        _paint_white(context, paint)


def _paint_white(context: bpy.types.Context, paint: bpy.types.Paint) -> None:
    """Have the brush paint white, and black with Ctrl: Blender's is black at first, which on a black image does nothing."""
    # Since Blender 5.0 every mode has its own.
    shared = getattr(paint, "unified_paint_settings", None) or context.scene.tool_settings.unified_paint_settings
    for owner in (shared, paint.brush):
        # Brushes of a library can be changed until Blender is closed; there is none without a window.
        if owner is not None:
            owner.color, owner.secondary_color = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def _map_from_above(target: bpy.types.Object) -> str:
    """Return the UV map that lays an image over a mesh as it is seen from above in the world; made where there is none."""
    mesh = target.data
    world = vertices_in_world(mesh, np.array(target.matrix_world))[:, :2]
    low, high = world.min(axis=0), world.max(axis=0)
    if not (high > low).all():
        raise ProblemError(f'target "{target.name}" must have an extent in x and y to be painted from above')
    uv = ((world - low) / (high - low))[read_attribute(mesh, ".corner_vert")].astype(np.float32)
    with ExitStack() as kept:
        for scatter in _scatters_on(mesh):
            kept.enter_context(scatter.keeps_shapes())
        layer = mesh.uv_layers.get(UV_MAP) or mesh.uv_layers.new(name=UV_MAP, do_init=False)
        if layer is None:
            raise ProblemError(f'target "{target.name}" must have room for a UV map; it has {len(mesh.uv_layers)}')
        layer.uv.foreach_set("vector", uv.ravel())
        mesh.update()
        return str(layer.name)


def _scatters_on(mesh: bpy.types.Mesh) -> list[Any]:
    """Return the scatters of all scenes that stand on a mesh."""
    scatters = (scatter for scene in bpy.data.scenes if scene.is_editable for scatter in scene.esh_scatter.scatters)
    return [scatter for scatter in scatters if any(item.data == mesh for item in scatter.targets)]


def unsaved_images(scatter: Any) -> list[bpy.types.Image]:
    """Return the images that a scatter follows, in densities or as flow, and that were painted since they were saved."""
    images = {layer.image for c in scatter.classes for layer in c.layers if layer.kind == "IMAGE"}
    images |= {c.direction_image for c in scatter.classes if c.direction_kind == "IMAGE"}
    images.discard(None)
    return sorted((image for image in images if image.is_dirty and image.is_editable), key=lambda image: image.name)


@persistent
def pack_painted_images(*_arguments: object) -> None:
    """Pack the images that scatters follow where they would be lost otherwise; Blender calls it before a file is saved."""
    for scene in bpy.data.scenes:
        for scatter in scene.esh_scatter.scatters:
            for image in unsaved_images(scatter):
                image.pack()


def attach() -> None:
    """Have painted images packed whenever a file is saved."""
    bpy.app.handlers.save_pre.append(pack_painted_images)


def detach() -> None:
    """Leave images as they are from now on."""
    if pack_painted_images in bpy.app.handlers.save_pre:
        bpy.app.handlers.save_pre.remove(pack_painted_images)
