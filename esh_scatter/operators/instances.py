"""Objects of a result, by hand: picked in the viewport as points, pinned, turned, removed; the next run leaves them."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.props import FloatProperty

from ..properties.scatter import ESH_PG_scatter
from ..properties.scene import active_scatter, selected_scatter
from ..result import pins
from ..result.kept_ground import CLASSES_OF_POINTS, read_attribute, stand_anew
from .edit import Edit, select_points

__all__ = ["CLASSES"]


class _OnResult(Edit):
    _missing = "Scatter first: there are no instances yet"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        result = scatter and scatter.result_in(context.scene)
        return result if result is not None and pins.can_be_edited(result) else None


class ESH_OT_instances_edit(_OnResult):
    """Select instances in the viewport, by their points in Edit Mode. Those that you move stay where you put them"""

    bl_idname = "esh.instances_edit"
    bl_label = "Edit Instances"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Enter Edit Mode, or leave it."""
        result = selected_scatter(context).result_in(context.scene)
        assert result is not None
        if result.mode == "EDIT":
            bpy.ops.object.mode_set(mode="OBJECT")
            return {"FINISHED"}
        return select_points(self, context, np.zeros(len(result.data.vertices), bool))


class _OnInstances(_OnResult):
    """Base of what is done with the instances that are selected."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it."""
        scatter = selected_scatter(context)
        with _outside_edit_mode(scatter.result_in(context.scene)) as result:
            points = pins.selected_points(result.data)
            if len(points):
                self._do(scatter, result, points)
        if not len(points):
            self.report({"WARNING"}, "No instances are selected. Click Edit Instances and select their points")
            return {"CANCELLED"}
        return {"FINISHED"}

    def _do(self, scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        raise NotImplementedError


class ESH_OT_instances_pin(_OnInstances):
    """Keep the selected instances where they are in the next runs. They are part of the count, and the others make room"""

    bl_idname = "esh.instances_pin"
    bl_label = "Pin"

    def _do(self, _scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        pins.pin(result.data, points)


class ESH_OT_instances_unpin(_OnInstances):
    """Let the next run move the selected instances, including those that were moved by hand"""

    bl_idname = "esh.instances_unpin"
    bl_label = "Unpin"

    def _do(self, _scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        pins.unpin(result.data, points)


class ESH_OT_instances_turn(_OnInstances):
    """Rotate the selected instances about their own axis, and pin them"""

    bl_idname = "esh.instances_turn"
    bl_label = "Rotate"

    angle: FloatProperty(
        name="Angle", description="Angle of rotation, counter-clockwise", subtype="ANGLE", default=math.radians(15.0)
    )

    def _do(self, scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        pins.turn(result.data, points, self.angle)
        uids = list(result.data.get(CLASSES_OF_POINTS, ()))
        classes = {body_class.uid: body_class for body_class in scatter.classes}
        for number in np.unique(read_attribute(result.data, "class_index")[points]).tolist():
            if number < len(uids) and uids[number] in classes:
                one = classes[uids[number]]
                stand_anew(result, number, one.standing(), one.look_at())


class ESH_OT_instances_remove(_OnInstances):
    """Remove the selected instances. Their places stay free in the next runs. Counts do not change, so others appear elsewhere"""

    bl_idname = "esh.instances_remove"
    bl_label = "Remove"

    def _do(self, scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        for x, y, z, radius in pins.balls_of(result, points).tolist():
            entry = scatter.free_places.add()
            entry.place, entry.radius, entry.has_height, entry.height = (x, y), radius, True, z
        pins.remove(result.data, points)


class ESH_OT_instances_refill(Edit):
    """Let the next run place objects again where instances were removed"""

    bl_idname = "esh.instances_refill"
    bl_label = "Refill Gaps"
    _missing = "No instances were removed"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter if scatter and len(scatter.free_places) else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Forget them."""
        selected_scatter(context).free_places.clear()
        return {"FINISHED"}


@contextmanager
def _outside_edit_mode(result: bpy.types.Object | None) -> Iterator[bpy.types.Object]:
    """Leave Edit Mode, in which attributes cannot be written, for a ``with`` block."""
    assert result is not None
    editing = result.mode == "EDIT"
    if editing:
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield result
    finally:
        if editing:
            bpy.ops.object.mode_set(mode="EDIT")


CLASSES = (
    ESH_OT_instances_edit,
    ESH_OT_instances_pin,
    ESH_OT_instances_unpin,
    ESH_OT_instances_turn,
    ESH_OT_instances_remove,
    ESH_OT_instances_refill,
)
