"""The layers of a density: added, removed, moved, painted."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import math

import bpy
from bpy.props import EnumProperty, IntProperty
from mathutils import Vector

from ...engine.errors import EshError
from ..densities.density_curve import remove_curve
from ..properties.layer import KINDS
from ..properties.renamed_on_mesh import follow_renamed
from ..properties.scene import selected_class, selected_scatter
from ..result.scene_units import sentence
from .edit import ClassEdit, MoveEntry, RemoveEntry

__all__ = ["CLASSES"]

# What is near something, at most, as a share of the ground's extent.
NEAR = 0.25


class ESH_OT_layer_add(ClassEdit):
    """Add a layer to the density of the selected class. Each layer acts on those above it"""

    bl_idname = "esh.layer_add"
    bl_label = "Add Layer"

    kind: EnumProperty(
        name="Follow",
        description="What the layer reads",
        items=[(name, kind.label, kind.help, kind.icon, number) for number, (name, kind) in enumerate(KINDS.items())],
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Say what the layer reads."""
        return KINDS[properties.kind].help

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it, with values that fit the target."""
        scatter = selected_scatter(context)
        layer = selected_class(context).add_layer(self.kind)
        target = scatter.first_target
        if target is not None and target.type == "MESH":
            heights = [(target.matrix_world @ Vector(corner)).z for corner in target.bound_box]
            # The upper half of the ground, and patches of a tenth of it.
            low, high = min(heights), max(heights)
            layer.altitude_low, layer.altitude_high = _rounded(0.5 * (low + high), high - low), high
            layer.altitude_falloff = _rounded(max(0.1 * (high - low), 0.0), high - low)
            extent = max(target.dimensions.x, target.dimensions.y)
            layer.noise_scale = max(0.1 * extent, 1e-3)
            # On a table nothing is as far away as on a terrain.
            far = layer.distance_far / context.scene.unit_settings.scale_length
            layer.distance_far = min(far, float(f"{NEAR * extent:.1g}")) or far
        if self.kind == "NOISE":
            # Another noise than those that are there; who wants the same in two classes gives both the same seed.
            layer.noise_seed = sum(one.kind == "NOISE" for c in scatter.classes for one in c.layers) - 1
        return {"FINISHED"}


def _rounded(length: float, extent: float) -> float:
    """Return a length with no more digits than matter beside an extent."""
    return round(length, 3 - math.floor(math.log10(extent))) if extent > 0.0 else 0.0


class ESH_OT_layer_remove(RemoveEntry):
    """Remove the selected layer"""

    bl_idname = "esh.layer_remove"
    bl_label = "Remove Layer"
    _entry, _missing = "layer", "Select a layer first"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it, and its curve."""
        layer = selected_class(context).active_layer
        curve = layer.curve if layer else None
        outcome = super().execute(context)
        remove_curve(curve)
        return outcome


class ESH_OT_layer_move(MoveEntry):
    """Move the selected layer in the list"""

    bl_idname = "esh.layer_move"
    bl_label = "Move Layer"
    _entry, _missing = "layer", "Select a layer first"


class ESH_OT_layer_paint(ClassEdit):
    """Paint where the selected class stands. An image, a vertex group or a color attribute is created if there is none"""

    bl_idname = "esh.layer_paint"
    bl_label = "Paint Density"

    kind: EnumProperty(
        name="Paint",
        description="What is painted",
        items=(
            (
                "SELECTED",
                "Selected Layer",
                "The image, the vertex group or the colors of the selected layer; a new image where there is none",
            ),
            ("IMAGE", "New Image", "A layer with an image of its own"),
            ("VERTEX_GROUP", "New Vertex Group", "A layer with a vertex group of its own"),
            ("ATTRIBUTE", "New Color Attribute", "A layer with vertex colors of its own"),
        ),
        default="SELECTED",
    )
    resolution: IntProperty(
        name="Resolution", description="Pixels along each side of a new image", default=1024, min=16, max=8192
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip what keeps the target from being painted on."""
        from ..editing.painting import why_not_painted

        if not super().poll(context):
            return False
        why = why_not_painted(selected_scatter(context).first_target)
        if why:
            cls.poll_message_set(why)
        return why is None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make what is missing, and begin to paint."""
        from ..editing.painting import begin_to_paint, can_be_painted

        scatter, body_class = selected_scatter(context), selected_class(context)
        # Otherwise a group that was renamed would be made anew.
        follow_renamed(scatter)
        layer, target, selected = body_class.active_layer, scatter.first_target, body_class.layer_index
        layers_before = len(body_class.layers)
        if self.kind != "SELECTED":
            layer = body_class.add_layer(self.kind)
        elif not any(can_be_painted(one, target) for one in body_class.layers):
            layer = body_class.add_layer("IMAGE")
        elif layer is None or not can_be_painted(layer, target):
            text = "Select a layer that follows an image, a vertex group or a color attribute, or paint a new one"
            self.report({"ERROR"}, text)
            return {"CANCELLED"}
        try:
            begin_to_paint(context, target, layer, body_class.name, self.resolution)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            if len(body_class.layers) > layers_before:
                body_class.layers.remove(layers_before)
                body_class.layer_index = selected
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (
    ESH_OT_layer_add,
    ESH_OT_layer_remove,
    ESH_OT_layer_move,
    ESH_OT_layer_paint,
)
