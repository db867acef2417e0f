"""Objects of a result, by hand: picked in the viewport as points, pinned, turned, removed; the next run leaves them."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import json
import math

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty

from ...engine.errors import EshError
from ..properties.scatter import ESH_PG_scatter
from ..properties.scene import active_scatter, selected_scatter
from ..result import pins, real_objects
from ..result.edited_points import outside_edit_mode
from ..result.kept_ground import CLASSES_OF_POINTS, stand_anew
from ..result.points_in_front import hide_points
from ..result.result import CLASS_NAMES
from ..result.scene_units import sentence
from ..solving import live
from ..targets.mesh_attributes import read_attribute
from .edit import Edit, select_points

__all__ = ["CLASSES", "remove_and_keep_free"]

# From so many on, making them real is asked about.
MANY = 10_000


class _OnResult(Edit):
    _missing = "Scatter first: there are no instances yet"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Not while the instances are objects of their own."""
        if not super().poll(context):
            return False
        if real_objects_in(context) is not None:
            cls.poll_message_set("The instances are real objects now. Turn them back into instances first")
            return False
        return True

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return _result_in(context)


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
            hide_points(result)
            result.select_set(True)
            return {"FINISHED"}
        return select_points(self, context, np.zeros(len(result.data.vertices), bool))


class _OnInstances(_OnResult):
    """Base of what is done with the instances that are selected."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it."""
        scatter = selected_scatter(context)
        result = scatter.result_in(context.scene)
        assert result is not None
        with outside_edit_mode(result):
            points = pins.selected_points(result.data)
            if len(points):
                self._do(scatter, result, points)
        live.look_at_edited(context.scene, scatter)
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


class ESH_OT_instances_select_pinned(_OnResult):
    """Select the instances that stay where they are in the next runs: those that are pinned, and those that were moved by hand"""

    bl_idname = "esh.instances_select_pinned"
    bl_label = "Select Pinned"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Select them, in Edit Mode."""
        result = _result_in(context)
        assert result is not None
        with outside_edit_mode(result):
            chosen = pins.staying(result.data)
        count = int(chosen.sum())
        if not count:
            self.report({"INFO"}, "No instances are pinned")
            return {"CANCELLED"}
        answer = select_points(self, context, chosen)
        if answer == {"FINISHED"}:
            self.report({"INFO"}, f"{count:,} pinned instance{'s are' if count > 1 else ' is'} selected")
        return answer


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
    """Remove the selected instances; X does so in Edit Mode. Their places stay free in the next runs. Counts do not change, so others appear elsewhere"""  # noqa: E501

    bl_idname = "esh.instances_remove"
    bl_label = "Remove"

    def _do(self, scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
        remove_and_keep_free(scatter, result, points)


class ESH_OT_instances_refill(Edit):
    """Let the next run place objects again where instances were removed"""

    bl_idname = "esh.instances_refill"
    bl_label = "Refill Gaps"
    _missing = "No instances were removed"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter if scatter and scatter.free_places else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Forget them."""
        selected_scatter(context).free_places.clear()
        return {"FINISHED"}


class ESH_OT_instances_make_real(_OnResult):
    """Turn the instances into objects of their own that share their data, in a collection, and hide the result. Back to Instances takes them back"""  # noqa: E501

    bl_idname = "esh.instances_make_real"
    bl_label = "Make Real"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask first where there are many."""
        result = selected_scatter(context).result_in(context.scene)
        assert result is not None
        if len(result.data.vertices) > MANY:
            return context.window_manager.invoke_confirm(
                self,
                event,
                title="Make This Many Objects?",
                message=f"{len(result.data.vertices):,} objects make Blender slow and the file large",
            )
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make them."""
        result = selected_scatter(context).result_in(context.scene)
        assert result is not None
        if not result.visible_get():
            self.report({"ERROR"}, f'"{result.name}" is hidden. Show it first')
            return {"CANCELLED"}
        names = json.loads(result.get(CLASS_NAMES, "[[], []]"))[0]
        with outside_edit_mode(result):
            try:
                made = real_objects.make_real(context, result, names)
            except EshError as error:
                self.report({"ERROR"}, sentence(error))
                return {"CANCELLED"}
        self.report({"INFO"}, f'{len(made.objects):,} objects are in the collection "{made.name}"')
        return {"FINISHED"}


class ESH_OT_instances_from_real(Edit):
    """Turn the real objects back into instances. Those that were moved, rotated or scaled stay pinned like that, and the places of deleted ones stay free"""  # noqa: E501

    bl_idname = "esh.instances_from_real"
    bl_label = "Back to Instances"

    changes: EnumProperty(
        name="Changes",
        description="What happens to changes of the objects",
        items=(
            ("KEEP", "Keep", "Instances stand as the objects do"),
            ("DISCARD", "Discard", "The result is as it was"),
        ),
    )

    _missing = "The instances of this scatter are not real objects"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return real_objects_in(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Take them back."""
        scatter = selected_scatter(context)
        result = scatter.result_in(context.scene)
        assert result is not None
        collection = real_objects_in(context)
        assert collection is not None
        if self.changes == "DISCARD":
            real_objects.discard_real(collection)
            return {"FINISHED"}
        try:
            found = real_objects.changes_of(context, collection)
        except EshError as error:
            self.report({"ERROR"}, f"{sentence(error)}. Choose to discard the changes, or keep the objects")
            return {"CANCELLED"}
        mirrored = real_objects.take_over(result, found)
        if len(found.removed):
            remove_and_keep_free(scatter, result, found.removed)
        real_objects.discard_real(collection, found.objects)
        changed = len(found.points) or len(found.removed)
        text = f"{len(found.points):,} pinned as they were changed, {len(found.removed):,} removed"
        text = text if changed else "The instances are as they were"
        text += f". {found.added:,} other objects stay in the scene" if found.added else ""
        if mirrored:
            text += f". Instances cannot be mirrored: {mirrored:,} stand unmirrored"
        self.report({"WARNING" if mirrored else "INFO"}, text)
        return {"FINISHED"}


def _result_in(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the result whose instances can be changed by hand, or None."""
    scatter = active_scatter(context)
    result = scatter and scatter.result_in(context.scene)
    return result if result is not None and pins.can_be_edited(result) else None


def real_objects_in(context: bpy.types.Context) -> bpy.types.Collection | None:
    """Return the collection of real objects that the active scatter's instances are now, or None."""
    result = _result_in(context)
    return None if result is None else real_objects.real_objects_of(result)


def remove_and_keep_free(scatter: ESH_PG_scatter, result: bpy.types.Object, points: np.ndarray) -> None:
    """Take points out of a result, and keep their places free in the next runs."""
    for x, y, z, radius in pins.balls_of(result, points).tolist():
        entry = scatter.free_places.add()
        entry.place, entry.radius, entry.has_height, entry.height = (x, y), radius, True, z
    pins.remove(result.data, points)


CLASSES = (
    ESH_OT_instances_edit,
    ESH_OT_instances_pin,
    ESH_OT_instances_unpin,
    ESH_OT_instances_select_pinned,
    ESH_OT_instances_turn,
    ESH_OT_instances_remove,
    ESH_OT_instances_refill,
    ESH_OT_instances_make_real,
    ESH_OT_instances_from_real,
)
