"""What can be done about overlap: counts that fit before a run, and after it the objects that overlap, selected or in view."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..editing import forecast
from ..properties.scatter import ESH_PG_scatter
from ..properties.scene import active_scatter, selected_scatter
from ..result import words
from ..result.attributes import OVERLAPPING, OVERLAPPING_ON_GROUND
from ..result.display import matrix_of_points
from ..targets.mesh_attributes import read_attribute
from .edit import Edit, select_points, settings_editable

__all__ = ["CLASSES"]

# How far the view goes from the worst place, in lengths of the usual distance between neighbors, or of the depth where that is more.
DISTANCE_OF_VIEW = 8.0
# Said where there is nothing to show.
NONE = "No two objects overlap"


class ESH_OT_counts_to_fit(Edit):
    """Lower the counts of all classes in proportion until their footprints fit on the ground without overlap"""

    bl_idname = "esh.counts_to_fit"
    bl_label = "Scale Counts to Fit"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Scale the counts."""
        factor = forecast.scale_counts_to_fit(selected_scatter(context), context.scene)
        if factor == 1.0:
            self.report({"INFO"}, "The counts fit as they are")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Counts scaled to {factor:.0%}")
        return {"FINISHED"}


class _OfResult(bpy.types.Operator):
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the tooltip what is missing."""
        if not settings_editable(cls, context):
            return False
        scatter = active_scatter(context)
        obstacle = _obstacle(scatter, context) if scatter is not None else "Add a scatter first"
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle


class ESH_OT_select_overlapping(_OfResult):
    """Select the points whose objects overlap others or lean into them, in Edit Mode of the result"""

    bl_idname = "esh.select_overlapping"
    bl_label = "Select Overlapping"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Select them."""
        scatter = selected_scatter(context)
        result = scatter.result_in(context.scene)
        assert result is not None
        if result.mode == "EDIT":
            # There its attributes cannot be read.
            bpy.ops.object.mode_set(mode="OBJECT")
        report = scatter.report_as_it_stands(wait=True)
        assert report is not None
        if words.worst(report) is None:
            return _say_none(self, report)
        chosen = _overlapping(scatter, result.data, report)
        answer = select_points(self, context, chosen)
        if answer == {"FINISHED"}:
            self.report({"INFO"}, f"{int(chosen.sum()):,} overlapping objects are selected")
        return answer


class ESH_OT_frame_overlap(_OfResult):
    """Move the 3D cursor and the view to the deepest overlap"""

    bl_idname = "esh.frame_overlap"
    bl_label = "Frame Worst Overlap"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Go there."""
        scatter = selected_scatter(context)
        result, report = scatter.result_in(context.scene), scatter.report_as_it_stands(wait=True)
        assert result is not None and report is not None
        worst = words.worst(report)
        if worst is None:
            return _say_none(self, report)
        deepest = worst[1]
        matrix = Matrix(matrix_of_points(result).tolist())
        pair = [matrix @ result.data.vertices[index].co for index in worst[0]]
        place: Vector = 0.5 * (pair[0] + pair[1])
        context.scene.cursor.location = place
        view = context.space_data.region_3d if context.area is not None and context.area.type == "VIEW_3D" else None
        if view is not None:
            view.view_location = place
            view.view_distance = DISTANCE_OF_VIEW * max((pair[0] - pair[1]).length, report.get("usual") or 0.0, deepest)
        what = "overlap" if report["overlaps"] else "of those that lean into each other"
        self.report({"INFO"}, f"The deepest {what}, {deepest:.3g} m, is at the 3D cursor")
        return {"FINISHED"}


def _say_none(operator: bpy.types.Operator, report: dict[str, Any]) -> set[str]:
    changed = report.get(words.LEANING_CHANGED, False)
    operator.report(
        {"INFO"}, "Objects lean otherwise by now, and cannot be counted. Scatter again" if changed else NONE
    )
    return {"CANCELLED"}


def _overlapping(scatter: ESH_PG_scatter, mesh: bpy.types.Mesh, report: dict[str, Any]) -> np.ndarray:
    """Tell of every point whether its object overlaps another or leans into it as they stand by now, shape ``[n]``.

    Args:
        scatter: Whose result it is.
        mesh: Of that.
        report: As it stands.
    """
    marked, of_run = OVERLAPPING, scatter.report or {}
    if report.get(words.COUNTED_AGAIN, False) and of_run.get("leaning"):
        # What leaned after the run says nothing any more.
        marked = OVERLAPPING_ON_GROUND
    chosen = read_attribute(mesh, marked) if marked in mesh.attributes else np.zeros(len(mesh.vertices), bool)
    chosen[list(report.get("leaning_bodies", ()))] = True
    return chosen


def _obstacle(scatter: ESH_PG_scatter, context: bpy.types.Context) -> str | None:
    """Return why the overlaps of the last run cannot be shown, or None; what is being counted may turn out to be none."""
    result, report = scatter.result_in(context.scene), scatter.report_as_it_stands()
    if result is None or report is None or result.type != "MESH":
        return "Scatter first"
    worst = words.worst(report)
    if not result.visible_get() and (worst is not None or report.get(words.COUNTING, False)):
        return "The result is hidden. Show it first"
    if worst is None:
        if report.get(words.COUNTING, False):
            return None
        if report.get(words.LEANING_CHANGED, False):
            edited = result.mode == "EDIT"
            return f"Objects lean otherwise by now. {'Leave Edit Mode first' if edited else 'Scatter again'}"
        return NONE
    known = OVERLAPPING in result.data.attributes or report.get(words.COUNTED_AGAIN, False)
    if not known and result.mode != "EDIT":
        return "The result does not say which objects overlap. Scatter again"
    if max(worst[0]) >= len(result.data.vertices):
        return "Points were removed by hand. Scatter again"
    return None


CLASSES = (ESH_OT_counts_to_fit, ESH_OT_select_overlapping, ESH_OT_frame_overlap)
