"""The sidebar tab."""

import textwrap
from collections.abc import Collection
from typing import Any

import bpy

from ..engine.problem.problem import Balance, ClassSettings, SamplingSettings
from ..engine.problem.scatter_settings import RunSettings, Standing
from . import running
from .described_properties import shown_settings
from .properties import BY_HAND, active_scatter, selected_class, selected_scatter

__all__ = ["CLASSES"]


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
    """Which scatter, on what."""

    bl_label = "ESH Scatter"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of scatters and the target."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = running.session is None
        settings = context.scene.esh_scatter
        if not settings.scatters:
            column = layout.column()
            _write_text(context, column, "Select the mesh to scatter on, then click:")
            column.separator()
            row = column.row()
            row.scale_y = 1.5
            row.operator("esh.scatter_add", text="New Scatter", icon="ADD")
            return
        _draw_list(layout, "ESH_UL_scatters", settings, "scatters", "scatter_index", "scatter", rows=2)
        if settings.active is not None:
            row = layout.row()
            row.alert = settings.active.target is None
            row.prop(settings.active, "target")


class ESH_PT_classes(_SubPanel, bpy.types.Panel):
    """What is scattered."""

    bl_label = "Classes"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of classes."""
        column = self._column()
        scatter = selected_scatter(context)
        if scatter.classes:
            _draw_list(column, "ESH_UL_classes", scatter, "classes", "class_index", "class", rows=3, move=True)
            column.operator("esh.classes_from_image", icon="IMAGE_RGB")
            return
        _write_text(context, column, "A class is one kind of thing, for example pines. It has its own density.")
        column.separator()
        row = column.row()
        row.scale_y = 1.5
        row.operator("esh.class_add", text="Add a Class", icon="ADD")
        column.operator("esh.classes_from_image", icon="IMAGE_RGB")


class _ClassPanel(_SubPanel):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scatter = active_scatter(context)
        return scatter is not None and scatter.active_class is not None


class ESH_PT_density(_ClassPanel, bpy.types.Panel):
    """Where the selected class stands."""

    bl_label = "Density"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Name the class whose density this is."""
        _draw_class_name(self.layout, context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the density of the selected class."""
        column = self._column()
        scatter = selected_scatter(context)
        body_class = selected_class(context)
        target = scatter.target if scatter.target and scatter.target.type == "MESH" else None
        column.prop(body_class, "density_kind")
        if body_class.density_kind == "UNIFORM":
            return
        if body_class.density_kind == "IMAGE":
            column.template_ID(body_class, "image", open="image.open", text="Image")
            column.prop(body_class, "mapping")
            if body_class.mapping == "UV" and target:
                column.prop_search(body_class, "uv_map", target.data, "uv_layers", icon="GROUP_UVS")
        elif target is None:
            column.label(text="Choose a target first", icon="ERROR")
        elif body_class.density_kind == "VERTEX_GROUP":
            column.prop_search(body_class, "vertex_group", target, "vertex_groups", icon="GROUP_VERTEX")
        elif body_class.density_kind == "ATTRIBUTE":
            column.prop_search(body_class, "attribute", target.data, "attributes", icon="SPREADSHEET")
        column.prop(body_class, "invert")


class ESH_PT_density_more(_ClassPanel, bpy.types.Panel):
    """What is done to the density, and where long ones point."""

    bl_label = "Direction and Detail"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Name the class whose direction and detail these are."""
        _draw_class_name(self.layout, context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw direction, sharpening, correction and which classes may overlap."""
        column = self._column()
        scatter = selected_scatter(context)
        body_class = selected_class(context)
        column.prop(body_class, "direction_kind")
        if body_class.direction_kind == "ANGLE":
            column.prop(body_class, "direction_angle")
        elif body_class.direction_kind == "IMAGE":
            column.template_ID(body_class, "direction_image", open="image.open", text="Flow Image")
        column.separator()
        _draw_settings(column, body_class, ClassSettings)
        if len(scatter.classes) > 1:
            column.separator()
            column.prop(body_class, "may_overlap")


class ESH_PT_sizes(_ClassPanel, bpy.types.Panel):
    """The selected class's sizes."""

    bl_label = "Sizes"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Name the class whose sizes these are."""
        _draw_class_name(self.layout, context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of sizes and the selected one."""
        column = self._column()
        body_class = selected_class(context)
        if not body_class.sizes:
            _write_text(context, column, "A size says which object is placed, and how many.")
            column.separator()
            column.operator("esh.size_add", text="Add a Size", icon="ADD")
            return
        column.prop(body_class, "count_kind")
        if body_class.count_kind == "TOTAL":
            column.prop(body_class, "total")
        _draw_list(column, "ESH_UL_sizes", body_class, "sizes", "size_index", "size", rows=2, move=True)
        size = body_class.active_size
        if size is None:
            return
        column.separator()
        column.prop(size, "source_kind")
        source = column.row()
        source.alert = size.source is None
        source.prop(size, "source_object" if size.source_kind == "OBJECT" else "source_collection")
        column.prop(size, "count" if body_class.count_kind == "SIZES" else "share")
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


class ESH_PT_balance(_SubPanel, bpy.types.Panel):
    """How the aims are weighed."""

    bl_label = "Balance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the balance."""
        column = self._column()
        scatter = selected_scatter(context)
        _draw_settings(column, scatter, Balance, BY_HAND)
        # The seed stands beside its button.
        _draw_settings(column, scatter, SamplingSettings, ("seed",))


class ESH_PT_placement(_SubPanel, bpy.types.Panel):
    """How each one stands."""

    bl_label = "Placement"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw how each one stands."""
        column = self._column()
        _draw_settings(column, selected_scatter(context), Standing)


class ESH_PT_solve(_SubPanel, bpy.types.Panel):
    """Seed, device and the button."""

    bl_label = "Solve"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button, or how far the run is."""
        column = self._column()
        scatter = selected_scatter(context)
        seed = column.row(align=True)
        seed.prop(scatter, "seed")
        seed.operator("esh.seed_roll", text="", icon="FILE_REFRESH")
        _draw_settings(column, scatter, RunSettings)
        column.separator()
        if running.session is not None:
            self.layout.enabled = True
            column.enabled = False
            _draw_progress(context, self.layout)
            return
        button = column.row()
        button.scale_y = 1.8
        button.operator(
            "esh.scatter", text="Scatter Again" if scatter.result_in(context.scene) else "Scatter", icon="PLAY"
        )
        obstacle = scatter.obstacle(context.scene)
        if obstacle:
            _write_text(context, column, obstacle, icon="INFO")
        elif not scatter.report_json:
            _write_text(context, column, "The first run compiles the solver. This takes up to a minute.", icon="INFO")


class ESH_PT_report(_SubPanel, bpy.types.Panel):
    """What the last run reached."""

    bl_label = "Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only after a run."""
        scatter = active_scatter(context)
        return scatter is not None and scatter.report is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the last run's report."""
        layout = self.layout
        scatter = selected_scatter(context)
        report = scatter.report
        assert report is not None
        if scatter.outdated and running.session is None:
            _write_text(
                context,
                layout,
                "Settings have changed since this run. Scatter again to apply them.",
                icon="FILE_REFRESH",
            )
        for note in report["notes"]:
            _write_text(context, layout, note.replace("`", ""), icon="ERROR")
        _draw_counts(layout.box(), report)
        facts = layout.column(align=True)
        spacing = report["smallest_spacing"]
        overlaps = report["overlaps"]
        _draw_fact(facts, "Overlaps", f"{overlaps:,}" if overlaps else "none", "ERROR" if overlaps else "NONE")
        _draw_fact(facts, "Coverage error", f"{report['coverage_error']:.4f}")
        if len(report["classes"]) > 1:
            for entry in report["classes"]:
                _draw_fact(facts, entry["name"], f"{entry['coverage_error']:.4f} (this class)")
        _draw_fact(facts, "Least spacing", "-" if spacing is None else f"{spacing:.2f} (lattice = 1)")
        _draw_fact(facts, "Space covered", f"{report['covered']:.0%}")
        converged = "" if report["converged"] else ", not converged"
        _draw_fact(facts, "Steps", f"{report['steps']}{converged}", "NONE" if report["converged"] else "ERROR")
        _draw_fact(facts, "Time", f"{report['seconds']:.1f} s on {report['device']}")


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
) -> None:
    movable = move and len(getattr(owner, items)) > 1
    row = layout.row()
    # The buttons beside a list that can be reordered are four rows high.
    row.template_list(list_class, "", owner, items, owner, index, rows=4 if movable else rows)
    side = row.column(align=True)
    side.operator(f"esh.{noun}_add", text="", icon="ADD")
    side.operator(f"esh.{noun}_remove", text="", icon="REMOVE")
    if movable:
        side.separator()
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_DOWN").direction = "DOWN"


def _draw_class_name(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    body_class = selected_scatter(context).active_class
    row = layout.row()
    row.active = False
    row.label(text=body_class.name if body_class else "")


def _draw_progress(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    session = running.session
    assert session is not None
    row = layout.row(align=True)
    row.scale_y = 1.8
    row.progress(factor=session.factor, text=session.text)
    row.operator("esh.stop", text="", icon="CANCEL")
    _write_text(context, layout, "Esc stops the run. The scene stays as it is.", icon="INFO")


def _draw_counts(layout: bpy.types.UILayout, report: dict[str, Any]) -> None:
    """Draw a table with a row per class and size: what was asked, and what was placed."""
    rows = [("", "Asked", "Placed")]
    for entry in report["classes"]:
        for size in entry["sizes"]:
            name = entry["name"] if len(entry["sizes"]) == 1 else f"{entry['name']}, {size['name']}"
            rows.append((name, f"{size['asked']:,}", f"{size['placed']:,}"))
    column = layout.column(align=True)
    for number, (name, *counts) in enumerate(rows):
        split = column.split(factor=0.5)
        split.active = number > 0
        split.label(text=name)
        for count in counts:
            cell = split.row()
            cell.alignment = "RIGHT"
            cell.label(text=count)


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
    for number, line in enumerate(textwrap.wrap(text, characters)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))


CLASSES = (
    ESH_PT_scatter,
    ESH_PT_classes,
    ESH_PT_density,
    ESH_PT_density_more,
    ESH_PT_sizes,
    ESH_PT_balance,
    ESH_PT_placement,
    ESH_PT_solve,
    ESH_PT_report,
)
