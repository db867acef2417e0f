"""What is done step by step with the mouse: brush strokes, and objects that are moved, turned or scaled."""

from __future__ import annotations

from enum import Enum, auto

import bpy

__all__ = ["COLORS", "WEIGHTS", "Stroke", "brush", "edits_points", "is_under_way", "operator_among"]

# Operators of brush strokes, by their names.
COLORS, WEIGHTS = {"PAINT_OT_image_paint", "IMAGE_OT_paint", "PAINT_OT_vertex_paint"}, "PAINT_OT_weight_paint"
_BRUSHES = COLORS | {WEIGHTS, "SCULPT_OT_brush_stroke"}
_DRAGS = {"TRANSFORM_OT_translate", "TRANSFORM_OT_rotate", "TRANSFORM_OT_resize"}
# What operators are called that hold on to points in Edit Mode.
_ON_POINTS = ("TRANSFORM_OT_", "MESH_OT_", "VIEW3D_OT_select")


class Stroke(Enum):
    """Which part of something that is done step by step is followed."""

    BEGINS = auto()
    GOES_ON = auto()
    # It has ended, and is followed as a whole, from where bodies were when it began: each part on its own has bodies move on a
    # little, wherever they are.
    ENDS = auto()


def brush() -> str | None:
    """Return the name of the operator whose brush stroke is under way in some window."""
    return operator_among(_BRUSHES)


def is_under_way() -> bool:
    """Tell whether something is changed step by step: by a brush stroke, or objects by the mouse."""
    return operator_among(_BRUSHES | _DRAGS) is not None


def edits_points() -> bool:
    """Tell whether an operator of Edit Mode is under way in some window: the mode may not be left then."""
    windows = bpy.context.window_manager.windows
    return any(one.bl_idname.startswith(_ON_POINTS) for window in windows for one in window.modal_operators)


def operator_among(names: set[str]) -> str | None:
    """Return which of some operators is under way in some window."""
    for window in bpy.context.window_manager.windows:
        for operator in window.modal_operators:
            if operator.bl_idname in names:
                return str(operator.bl_idname)
    return None
