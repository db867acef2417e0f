"""The sidebar tab."""

import textwrap
from collections.abc import Collection
from typing import Any

import bpy

from ..engine.problem.balance import Balance
from ..engine.problem.body_class import ClassSettings
from ..engine.problem.problem import SamplingSettings
from ..engine.problem.scatter_settings import RunSettings, Standing, TargetSettings
from . import checksums, forecast, live, running, words
from .class_copy import KEPT_APART
from .density_panel import draw_density
from .display import get_inputs, input_property, our_modifier
from .properties.body_class import DERIVED_COUNTS
from .properties.described import shown_settings
from .properties.scatter import BY_HAND, ESH_PG_scatter
from .properties.scene import active_scatter, selected_class, selected_scatter

__all__ = ["CLASSES"]


# What limits faces: whether it is chosen from the mesh or from the object, from which of its lists, and how that is drawn.
FACES = {
    "face_material": (True, "materials", "MATERIAL"),
    "face_group": (False, "vertex_groups", "GROUP_VERTEX"),
    "face_attribute": (True, "attributes", "SPREADSHEET"),
}


class _Panel:
    layout: bpy.types.UILayout
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = running.SIDEBAR_TAB


class _SubPanel(_Panel):
    bl_parent_id = "ESH_PT_scatter"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_scatter(context) is not None

    def _column(self) -> bpy.types.UILayout:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = running.session is None
        return layout.column()


class ESH_PT_scatter(_Panel, bpy.types.Panel):
    """Which scatter, on what, the button, and how it went."""

    bl_label = "ESH Scatter"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the active scatter, its target, the button and the status."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scatter = active_scatter(context)
        if scatter is None:
            _draw_beginning(context, layout.column())
            return
        top = layout.column()
        top.enabled = running.session is None
        _draw_active_scatter(context, top.row(align=True), scatter)
        row = top.row(align=True)
        choice = row.row()
        choice.alert = scatter.chosen_target is None
        choice.prop(scatter, "target" if scatter.target_kind == "OBJECT" else "target_collection")
        row.prop(scatter, "target_kind", text="", icon_only=True)
        layout.separator(factor=0.5)
        if running.session is not None:
            _draw_progress(context, layout)
            return
        button = layout.row(align=True)
        button.scale_y = 1.8
        result = scatter.result_in(context.scene)
        button.operator(
            "esh.scatter", text="Update" if result else "Scatter", icon="FILE_REFRESH" if result else "PLAY"
        )
        switch = button.row(align=True)
        switch.ui_units_x = 3.5
        switch.prop(scatter, "live", toggle=True)
        if scatter.live and not live.is_live(context.scene, scatter):
            # It was switched on in the file that was opened, or by redo.
            live.wake()
        _draw_status(context, layout.column(align=True), scatter)
        if checksums.is_old():
            running.redraw_later()


class ESH_PT_surface(_SubPanel, bpy.types.Panel):
    """Which part of the target is scattered on."""

    bl_label = "Surface"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw which side, and which faces."""
        column = self._column()
        scatter = selected_scatter(context)
        target = scatter.first_target
        _draw_settings(column, scatter, TargetSettings, FACES)
        if target is None:
            return
        for name, (of_mesh, where, icon) in FACES.items():
            column.prop_search(scatter, name, target.data if of_mesh else target, where, icon=icon)


class ESH_PT_classes(_SubPanel, bpy.types.Panel):
    """What is scattered."""

    bl_label = "Classes"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of classes."""
        column = self._column()
        scatter = selected_scatter(context)
        if scatter.classes:
            _draw_list(
                column,
                "ESH_UL_classes",
                scatter,
                "classes",
                "class_index",
                "class",
                rows=5,
                move=True,
                menu="ESH_MT_classes",
            )
            return
        _write_text(context, column, "A class is one kind of thing, for example pines. It has its own density.")
        column.separator()
        row = column.row()
        row.scale_y = 1.5
        row.operator("esh.class_add", text="Add a Class", icon="ADD")
        for name in ("esh.classes_from_selection", "esh.classes_from_collection", "esh.classes_from_image"):
            column.operator(name)


class _ClassPanel(_SubPanel):
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
        self.layout.label(text=selected_class(context).name)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what is placed and how many; the list of sizes where there are several."""
        column = self._column()
        body_class = selected_class(context)
        if not body_class.sizes:
            _write_text(context, column, "A size says which object is placed, and how many.")
            column.separator()
            column.operator("esh.size_add", text="Add a Size", icon="ADD")
            return
        size = body_class.active_size
        if len(body_class.sizes) > 1:
            _draw_count(column, body_class)
            _draw_list(column, "ESH_UL_sizes", body_class, "sizes", "size_index", "size", rows=2, move=True)
            if size is None:
                return
            column.separator()
            _draw_source(column, size)
            column.prop(size, "count" if body_class.count_kind == "SIZES" else "share")
        else:
            size = body_class.sizes[0]
            _draw_source(column, size)
            _draw_count(column, body_class)
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
        for note in draw_density(column, selected_scatter(context), selected_class(context)):
            _write_text(context, column, note, icon="INFO")


class ESH_PT_standing(_ClassSubPanel, bpy.types.Panel):
    """How each one of the selected class stands; changed at once, without solving."""

    bl_label = "Turn and Scale"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw how each one stands."""
        _draw_settings(self._column(), selected_class(context), Standing)


class ESH_PT_density_more(_ClassSubPanel, bpy.types.Panel):
    """What is done to the density, and where long ones point."""

    bl_label = "Direction and Detail"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw direction, sharpening and correction."""
        column = self._column()
        body_class = selected_class(context)
        column.prop(body_class, "direction_kind")
        if body_class.direction_kind == "ANGLE":
            column.prop(body_class, "direction_angle")
        elif body_class.direction_kind == "IMAGE":
            _draw_image(column, body_class, "direction_image")
        column.separator()
        _draw_settings(column, body_class, ClassSettings, KEPT_APART)


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


class ESH_PT_balance(_SubPanel, bpy.types.Panel):
    """How the classes and sizes get on with each other."""

    bl_label = "Together"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the balance."""
        column = self._column()
        scatter = selected_scatter(context)
        _draw_settings(column, scatter, Balance, BY_HAND)
        # The seed is among what few need.
        _draw_settings(column, scatter, SamplingSettings, ("seed",))


class ESH_PT_obstacles(_SubPanel, bpy.types.Panel):
    """What objects keep off."""

    bl_label = "Obstacles"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of obstacles, the selected one, and whether other scatters are some."""
        column = self._column()
        scatter = selected_scatter(context)
        if scatter.obstacles:
            _draw_list(column, "ESH_UL_obstacles", scatter, "obstacles", "obstacle_index", "obstacle", rows=3)
        else:
            column.operator("esh.obstacle_add", text="Add Obstacle", icon="ADD")
        chosen = scatter.active_obstacle
        if chosen is not None:
            column.separator()
            column.prop(chosen, "kind")
            column.prop(chosen, "item" if chosen.kind == "OBJECT" else "collection")
            column.prop(chosen, "width")
            column.prop(chosen, "margin")
        column.separator()
        column.prop(scatter, "keep_off_others")


class ESH_PT_instances(_SubPanel, bpy.types.Panel):
    """Instances that are put where they are by hand."""

    bl_label = "Instances"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a result."""
        scatter = active_scatter(context)
        return scatter is not None and scatter.result_in(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons to pick, pin, turn and remove instances."""
        column = self._column()
        scatter = selected_scatter(context)
        result = scatter.result_in(context.scene)
        assert result is not None
        editing = result.mode == "EDIT"
        row = column.row()
        row.scale_y = 1.3
        text, icon = ("Done", "CHECKMARK") if editing else ("Edit Instances", "EDITMODE_HLT")
        row.operator("esh.instances_edit", text=text, icon=icon)
        if editing:
            _write_text(context, column, "Select points and move them (G). What you move stays there in the next run")
        buttons = column.column(align=True)
        row = buttons.row(align=True)
        row.operator("esh.instances_pin", icon="PINNED")
        row.operator("esh.instances_unpin", icon="UNPINNED")
        row = buttons.row(align=True)
        row.operator("esh.instances_turn", icon="FILE_REFRESH")
        row.operator("esh.instances_remove", icon="X")
        if len(scatter.free_places):
            column.operator("esh.instances_refill")


class ESH_PT_report(_SubPanel, bpy.types.Panel):
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
        report = scatter.report
        assert report is not None
        _draw_counts(layout.box(), report, scatter.names_in_report())
        facts = layout.column(align=True)
        _draw_fact(facts, "Overlaps", words.overlaps(report), "ERROR" if report["overlaps"] else "NONE")
        if report["overlaps"] and report.get("deepest_pair") is not None:
            row = facts.row(align=True)
            row.operator("esh.select_overlapping", text="Select")
            row.operator("esh.frame_overlap", text="Frame Worst")
        if evenness := words.evenness(report):
            _draw_fact(facts, "Spread", evenness)
        if report.get("closest") is not None:
            _draw_fact(facts, "Closest", words.meters(report["closest"]))
            _draw_fact(facts, "Usual", f"{words.meters(report['usual'])} to the nearest")
        _draw_fact(facts, "Ground taken", f"{report['covered']:.0%}")
        _draw_fact(facts, "Time", f"{report['seconds']:.1f} s, {report['steps']} steps on {report['device']}")
        for note in words.notes(report):
            _write_text(context, layout, note, icon="ERROR")


class ESH_PT_display(_SubPanel, bpy.types.Panel):
    """What of the result is shown: the inputs of its modifier."""

    bl_label = "Display"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what is shown in the viewport, and when that is less."""
        column = self._column()
        scatter = selected_scatter(context)
        result = scatter.result_in(context.scene)
        modifier = our_modifier(result) if result is not None else None
        if modifier is not None:
            _draw_inputs(column, modifier, ("Display", "Viewport Share", "Scale", "Follow Target"))
            column.separator()
            culling = input_property(modifier, "Camera Culling")
            _draw_inputs(column, modifier, ("Camera Culling",))
            if culling and get_inputs(modifier)["Camera Culling"]:
                _draw_inputs(column, modifier, ("Margin", "Distance"))
            _draw_inputs(column, modifier, ("Limit Renders",))
            column.separator()
        column.prop(scatter, "points_above")
        column.prop(scatter, "cap")


class ESH_PT_advanced(_SubPanel, bpy.types.Panel):
    """Seed, device and steps."""

    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw seed, device and steps."""
        column = self._column()
        scatter = selected_scatter(context)
        seed = column.row(align=True)
        seed.prop(scatter, "seed")
        seed.operator("esh.seed_roll", text="", icon="FILE_REFRESH")
        _draw_settings(column, scatter, RunSettings)


def _draw_inputs(column: bpy.types.UILayout, modifier: bpy.types.Modifier, names: Collection[str]) -> None:
    """Draw inputs of a result's modifier, as far as it has them."""
    for name in names:
        found = input_property(modifier, name)
        if found is not None:
            column.prop(*found, text=name)


def _draw_beginning(context: bpy.types.Context, column: bpy.types.UILayout) -> None:
    """Say what to click where there is no scatter."""
    _write_text(context, column, "Select the objects to place, then the ground, and click:")
    column.separator()
    row = column.row()
    row.scale_y = 1.8
    row.operator("esh.scatter_selection", icon="PLAY")
    column.separator()
    _write_text(context, column, "Or step by step, on the active mesh:")
    column.operator("esh.scatter_add", text="New Scatter", icon="ADD")
    column.menu("ESH_MT_presets", text="From a Preset", icon="PRESET")


def _draw_active_scatter(context: bpy.types.Context, row: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Draw which scatter is shown, and whether its result is."""
    row.menu("ESH_MT_scatters", text="", icon="DOWNARROW_HLT")
    row.prop(scatter, "name", text="")
    result = scatter.result_in(context.scene)
    if result is not None:
        row.prop(result, "hide_viewport", text="")
        row.prop(result, "hide_render", text="")
    row.operator("esh.scatter_add", text="", icon="ADD")
    row.operator("esh.scatter_remove", text="", icon="REMOVE")


def _draw_status(context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Say what is missing, what has changed since the last run, or how that went."""
    obstacle = scatter.obstacle(context.scene)
    if obstacle:
        _write_text(context, column, obstacle, icon="INFO")
        return
    report = scatter.report
    if report is not None and scatter.result_in(context.scene) is None:
        _write_text(context, column, "The result is no longer there", icon="INFO")
    elif report is not None:
        changes = scatter.changes()
        if changes and live.is_busy(context.scene, scatter):
            _write_text(context, column, "Following …", icon="FILE_REFRESH")
        elif changes:
            more = f" and {len(changes) - 3} more" if len(changes) > 3 else ""
            _write_text(context, column, f"Changed: {', '.join(changes[:3])}{more}", icon="FILE_REFRESH")
        else:
            _write_text(
                context,
                column,
                words.summary(report, words.UNBROKEN),
                icon="ERROR" if report["overlaps"] else "CHECKMARK",
            )
    said = live.status(context.scene, scatter)
    if said:
        _write_text(context, column, said, icon="ERROR")
    _draw_forecast(context, column, scatter)
    left_out = scatter.left_out()
    if left_out:
        more = f" (and {len(left_out) - 1} more)" if len(left_out) > 1 else ""
        _write_text(context, column, f"{left_out[0]}{more}", icon="ERROR")


def _draw_forecast(context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Say before a run what cannot be placed without overlap."""
    if not scatter.avoid_overlap:
        return
    cover = forecast.known(scatter, context.scene)
    text = words.cover(cover.covered, cover.fits, cover.crowded) if cover is not None else ""
    if cover is not None and text:
        _write_text(context, column, text, icon="ERROR")
        if cover.covered > cover.fits:
            column.operator("esh.counts_to_fit")


def _draw_source(column: bpy.types.UILayout, size: bpy.types.PropertyGroup) -> None:
    column.prop(size, "source_kind")
    source = column.row()
    source.alert = size.source is None or size.source_deleted
    source.prop(size, "source_object" if size.source_kind == "OBJECT" else "source_collection")


def _draw_count(column: bpy.types.UILayout, body_class: bpy.types.PropertyGroup) -> None:
    column.prop(body_class, "count_kind")
    kind = body_class.count_kind
    if kind == "SIZES" and len(body_class.sizes) == 1:
        column.prop(body_class.sizes[0], "count")
    elif kind == "TOTAL":
        column.prop(body_class, "total")
    elif kind in DERIVED_COUNTS:
        column.prop(body_class, DERIVED_COUNTS[kind])


def _draw_image(column: bpy.types.UILayout, group: bpy.types.PropertyGroup, name: str) -> None:
    """Draw an image over the whole width, so that its name can be read."""
    row = column.row()
    row.use_property_split = False
    row.template_ID(group, name, new="image.new", open="image.open")


def _draw_settings(
    layout: bpy.types.UILayout, group: bpy.types.PropertyGroup, cls: Any, by_hand: Collection[str] = ()
) -> None:
    """Draw the properties that stand for the settings of a class; a group of settings only where it is switched on."""
    for shown in shown_settings(cls, by_hand):
        if not shown.switch or getattr(group, shown.switch):
            layout.prop(group, shown.name, slider=shown.slider)


def _draw_list(
    layout: bpy.types.UILayout,
    list_class: str,
    owner: bpy.types.PropertyGroup,
    items: str,
    index: str,
    noun: str,
    *,
    rows: int,
    move: bool = False,
    menu: str = "",
) -> None:
    movable = move and len(getattr(owner, items)) > 1
    row = layout.row()
    # The buttons beside a list that can be reordered are four rows high.
    row.template_list(list_class, "", owner, items, owner, index, rows=max(rows, 4) if movable else rows)
    side = row.column(align=True)
    side.operator(f"esh.{noun}_add", text="", icon="ADD")
    side.operator(f"esh.{noun}_remove", text="", icon="REMOVE")
    if menu:
        side.menu(menu, text="", icon="DOWNARROW_HLT")
    if movable:
        side.separator(factor=0.5)
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_DOWN").direction = "DOWN"


def _draw_progress(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    session = running.session
    assert session is not None
    row = layout.row(align=True)
    row.scale_y = 1.8
    row.progress(factor=session.factor, text=session.text)
    row.operator("esh.keep", text="Keep")
    row.operator("esh.stop", text="", icon="CANCEL")
    _write_text(context, layout, "Esc stops the run and changes nothing. Keep takes what is there", icon="INFO")


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
        split.label(text=name)
        row = split.row()
        cell = row.row()
        cell.alignment = "RIGHT"
        cell.label(text=count)
        if any(other for _, _, other in rows):
            last = row.row()
            last.active = False
            last.label(text=spread)


def _draw_fact(layout: bpy.types.UILayout, label: str, value: str, icon: str = "NONE") -> None:
    split = layout.split(factor=0.42)
    name = split.row()
    name.alignment = "RIGHT"
    name.active = False
    name.label(text=label)
    split.label(text=value, icon=icon)


def _write_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """Draw ``text`` on as many lines as the sidebar's width asks for."""
    scale = context.preferences.system.ui_scale
    # A character of the interface's font is about 7 pixels wide; margins and the icon take about 60.
    characters = max(20, int((context.region.width / scale - 60) / 6.3))
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, characters, break_on_hyphens=False)):
        column.label(
            text=line.replace(words.UNBROKEN, " "),
            icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"),
        )


CLASSES = (
    ESH_PT_scatter,
    ESH_PT_surface,
    ESH_PT_classes,
    ESH_PT_class,
    ESH_PT_density,
    ESH_PT_standing,
    ESH_PT_density_more,
    ESH_PT_overlap,
    ESH_PT_balance,
    ESH_PT_obstacles,
    ESH_PT_instances,
    ESH_PT_report,
    ESH_PT_display,
    ESH_PT_advanced,
)
