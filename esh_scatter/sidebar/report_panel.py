"""The panel of the last run's report."""

from typing import Any

import bpy

from ..editing import forecast
from ..properties.scene import active_scatter, selected_scatter
from ..result import words
from ..result.scene_units import length_text
from .panel_parts import SubPanel, write_text

__all__ = ["CLASSES"]


class ESH_PT_report(SubPanel, bpy.types.Panel):
    """What the last run reached."""

    bl_label = "Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only while there is a result."""
        scatter = active_scatter(context)
        return scatter is not None and scatter.report is not None and scatter.result_in(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the last run's report."""
        layout = self.layout
        scatter = selected_scatter(context)
        report = scatter.report_as_it_stands()
        assert report is not None
        _draw_counts(layout.box(), report, scatter.names_in_report())
        facts = layout.column(align=True)
        _draw_fact(facts, "Overlaps", words.overlaps(report), "ERROR" if report["overlaps"] else "NONE")
        if report["overlaps"] and report.get("deepest_overlap"):
            _draw_fact(facts, "Deepest", length_text(context.scene, report["deepest_overlap"]))
        if leaning := words.leaning(report):
            _draw_fact(facts, "Lean Together", leaning, "INFO" if words.leans(report) else "NONE")
        if report.get("deepest_leaning") and words.leans(report) and not report.get(words.LEANING_CHANGED):
            _draw_fact(facts, "Deepest", length_text(context.scene, report["deepest_leaning"]))
        if words.worst(report) is not None or (report.get("leaning") and report.get(words.COUNTING)):
            row = facts.row(align=True)
            row.operator("esh.select_overlapping", text="Select")
            row.operator("esh.frame_overlap", text="Frame Worst")
        if evenness := words.evenness(report):
            # Which classes are uneven stands beside their counts.
            _draw_fact(facts, "Evenness", evenness.partition(":")[0])
        if report.get("closest") is not None:
            _draw_fact(facts, "Closest Pair", length_text(context.scene, report["closest"]))
            _draw_fact(facts, "Typical Spacing", length_text(context.scene, report["usual"]))
        _draw_fact(facts, "Ground Covered", f"{report['covered']:.0%}")
        _draw_fact(facts, "Time", f"{report['seconds']:.1f} s, {report['steps']} steps")
        _draw_fact(facts, "Device", report["device"].upper())
        foreseen = scatter.avoid_overlap and words.placed(report) <= forecast.MOST_BODIES
        for note in words.notes(report, foreseen=foreseen):
            write_text(context, layout, note, icon="ERROR")


def _draw_counts(layout: bpy.types.UILayout, report: dict[str, Any], names: list[str]) -> None:
    """Draw a row for each class and size: how many were placed, of how many if not of all, and how evenly."""
    rows = []
    for entry, class_name in zip(report["classes"], names, strict=True):
        several = len(entry["sizes"]) > 1
        spread = words.evenness_word(entry["coverage_error"]) if len(names) > 1 else ""
        if several:
            placed = sum(size["placed"] for size in entry["sizes"])
            rows.append((class_name, f"{placed:,}", spread))
        for size in entry["sizes"]:
            count = f"{size['placed']:,}"
            if size["placed"] != size["asked"]:
                count += f" of {size['asked']:,}"
            rows.append((f"    {size['name']}", count, "") if several else (class_name, count, spread))
    column = layout.column(align=True)
    for name, count, spread in rows:
        split = column.split(factor=0.42)
        split.label(text=name, translate=False)
        row = split.row()
        cell = row.row()
        cell.alignment = "RIGHT"
        cell.label(text=count, translate=False)
        if any(other for _, _, other in rows):
            row.label(text=spread, translate=False)


def _draw_fact(layout: bpy.types.UILayout, label: str, value: str, icon: str = "NONE") -> None:
    # The longest label and the longest value are not cut in a narrow sidebar.
    split = layout.split(factor=0.5)
    name = split.row()
    name.alignment = "RIGHT"
    name.active = False
    name.label(text=label, translate=False)
    split.label(text=value, icon=icon, translate=False)


CLASSES = (ESH_PT_report,)
