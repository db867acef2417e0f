"""What the first panel says below its button: what is missing, what has changed since the last run, or how that went."""

import itertools
from typing import Any

import bpy

from ..editing import forecast
from ..properties.scatter import ESH_PG_scatter
from ..result import words
from ..result.refused import NOT_SEEN
from ..result.result import is_shared
from ..solving import live
from ..targets.in_scenes import is_in
from ..targets.target import members_of
from .panel_parts import fits_line, write_text

__all__ = ["draw_status"]


def draw_status(context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Say what is missing, what has changed since the last run, or how that went."""
    obstacle = scatter.obstacle(context.scene)
    if obstacle:
        if obstacle != NOT_SEEN:
            write_text(context, column, obstacle, icon="INFO")
            return
        # What to do about it is a button.
        write_text(context, column, obstacle.partition(":")[0], icon="INFO")
        row = column.row()
        row.use_property_split = False
        row.prop_enum(scatter, "surface", "WHOLE")
        return
    report = scatter.report
    follows = live.is_busy(context.scene, scatter)
    # The dearest part of drawing: made once.
    record = scatter.record()
    if report is not None and scatter.result_in(context.scene) is None:
        write_text(context, column, _why_no_result(context.scene, scatter), icon="INFO")
    elif report is not None:
        changes = scatter.changes(record)
        if changes and follows:
            write_text(context, column, "Following …", icon="FILE_REFRESH")
        elif changes:
            more = f" and {len(changes) - 3} more" if len(changes) > 3 else ""
            text = _with_leaning(context, f"Changed: {', '.join(changes[:3])}{more}", scatter)
            write_text(context, column, text, icon="FILE_REFRESH")
        else:
            report = scatter.report_as_it_stands() or report
            # One line, which the panel does not jump by when a run ends: the seconds are in the report, too.
            seconds = fits_line(context, words.summary(report))
            text = words.summary(report, words.UNBROKEN, seconds=seconds)
            clean = "INFO" if words.leans(report) else "CHECKMARK"
            write_text(context, column, text, icon="ERROR" if words.has_trouble(report) else clean)
            if report.get(words.HELD):
                write_text(context, column, report[words.HELD], icon="INFO")
            _draw_deleted_or_added(context, column, scatter, words.placed(report))
            _draw_later(context, column, scatter)
    said = live.status(context.scene, scatter)
    if scatter.live and not said and (edited := _edited(context, scatter)):
        write_text(context, column, f'Live goes on when you leave Edit Mode of "{edited}"', icon="INFO")
    if said and context.mode.startswith("PAINT"):
        # Before the first stroke there is nothing yet, and that is no mistake.
        write_text(context, column, words.behind_rule(said), icon="INFO")
    elif said:
        write_text(context, column, said, icon="ERROR")
    # Where all found room, nothing was unavoidable. What Live follows, it will say soon: a forecast would only hold it up.
    if not follows and (report is None or scatter.changes(record) or words.has_trouble(report)):
        _draw_forecast(context, column, scatter, record)
    left_out = scatter.left_out()
    if left_out:
        more = f" (and {len(left_out) - 1} more)" if len(left_out) > 1 else ""
        write_text(context, column, f"{left_out[0]}{more}", icon="ERROR")
    if muted := scatter.muted():
        write_text(context, column, muted, icon="MUTE_IPO_ON")


def _with_leaning(context: bpy.types.Context, text: str, scatter: ESH_PG_scatter) -> str:
    """Add to a line how many lean into each other since something is shown otherwise, if it remains one.

    That is counted a moment later, and nothing is to move away below the mouse then; the report says it in any case.
    """
    lean = words.leans_by_now(scatter.report_as_it_stands() or {})
    longer = [f"{text} · {short}" for short in (lean, lean.partition(" into")[0]) if short]
    return next((line for line in longer if fits_line(context, line)), text)


def _edited(context: bpy.types.Context, scatter: ESH_PG_scatter) -> str:
    """Return what a scatter is made of and nobody can read, as it is in Edit Mode; empty where nothing is."""
    edited = set(context.objects_in_mode) if context.mode.startswith("EDIT") else set()
    placed = (item for one in scatter.ready_classes() for size in one.sizes for item in members_of(size.source))
    kept_off = (item for one in scatter.obstacles if one.ready for item in one.items)
    made_of = itertools.chain(scatter.targets, placed, kept_off, scatter.other_results()) if edited else ()
    return next((str(item.name) for item in made_of if item in edited), "")


def _draw_deleted_or_added(
    context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter, placed: int
) -> None:
    """Say how many points Blender's own means deleted, of so many, and what becomes of these; or how many they added."""
    mesh = scatter.result.data
    gone = placed - len(mesh.vertices) if isinstance(mesh, bpy.types.Mesh) else 0
    if gone > 0:
        what = (
            f"{gone:,} objects were deleted: Update puts them" if gone > 1 else "1 object was deleted: Update puts it"
        )
        write_text(context, column, f"{what} back. Remove (Instances) keeps places free", icon="INFO")
    elif gone < 0:
        # Copies of points, or those of another result that was joined with this one.
        added = f"{-gone:,} objects were" if gone < -1 else "1 object was"
        write_text(context, column, f"{added} added by hand", icon="INFO")


def _draw_later(context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Say which later scatters stand where this one has placed objects since, and offer to have them make room."""
    later = scatter.later_in_the_way()
    if later:
        write_text(context, column, words.in_the_way([other.name for other in later]), icon="INFO")
        column.operator("esh.scatter_all", icon="FILE_REFRESH")


def _why_no_result(scene: bpy.types.Scene, scatter: ESH_PG_scatter) -> str:
    """Say why there is no result for this scene to change, in one sentence."""
    if not scene.is_editable:
        return "This scene is linked from a library and cannot be changed"
    result = scatter.result
    if result is not None and is_in(scene, result) and is_shared(result):
        return "Another scene shows this result, too. Scatter makes one for this scene"
    return "The result is no longer there"


def _draw_forecast(
    context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter, record: dict[str, Any]
) -> None:
    """Say before a run what cannot be placed without overlap."""
    if not scatter.avoid_overlap:
        return
    cover = forecast.known(scatter, context.scene, record)
    text = words.cover(cover) if cover is not None else ""
    if cover is not None and text:
        write_text(context, column, text, icon="ERROR")
        if cover.too_much:
            column.operator("esh.counts_to_fit")
