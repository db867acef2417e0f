"""The sidebar tab: the panels of a scatter."""

import bpy

from ...engine.problem.balance import Balance
from ...engine.problem.problem import SamplingSettings
from ...engine.problem.scatter_settings import BorderSettings, RunSettings, TargetSettings
from ..editing import forecast
from ..properties.asked_once import asked_once
from ..properties.scatter import BY_HAND, ESH_PG_scatter
from ..properties.scene import active_scatter, selected_scatter
from ..result import real_objects
from ..result.display import followed_targets, get_inputs, input_property, our_modifier
from ..result.edited_points import can_leave_edit_mode
from ..result.local_views import is_left_out
from ..solving import live, loading, running
from ..solving.redrawing import redraw_later
from ..targets import checksums
from ..targets.bending import bends_alone_in_renders
from . import class_panels, report_panel
from .density_panel import is_painted
from .followed_names import follow_names_later
from .foreign_results import draw_foreign
from .panel_parts import (
    Panel,
    SubPanel,
    draw_inputs,
    draw_list,
    draw_property,
    draw_settings,
    is_narrow,
    text_of_field,
    write_text,
)
from .preset_pictures import draw_pictures
from .status import draw_status

__all__ = ["CLASSES"]


# What limits faces: whether it is chosen from the mesh or from the object, from which of its lists, and how that is drawn. Names are
# short enough for a narrow sidebar.
FACES = {
    "face_material": (True, "materials", "Material", "MATERIAL"),
    "face_group": (False, "vertex_groups", "Group", "GROUP_VERTEX"),
    "face_attribute": (True, "attributes", "Attribute", "SPREADSHEET"),
}


# How large the picture by which a preset is chosen is, in units of lines.
PICTURE_SCALE = 4.0
# How much of the line the button has; Live has the rest.
BUTTON = 0.74


class ESH_PT_scatter(Panel, bpy.types.Panel):
    """Which scatter, on what, the button, and how it went."""

    bl_label = "ESH Scatter"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the active scatter, its target, the button and the status."""
        if not bpy.app.background:
            # Before the button is pressed.
            loading.begin()
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scatter = active_scatter(context)
        if scatter is None:
            if running.session is not None:
                # The first run adds its scatter when it ends.
                _draw_progress(layout)
                return
            draw_foreign(context, layout.column())
            _draw_beginning(context, layout.column())
            return
        top = layout.column()
        top.enabled = running.session is None
        _draw_active_scatter(context, top.row(align=True), scatter)
        row = top.row(align=True)
        choice = row.row()
        choice.alert = scatter.chosen_target is None
        # Beside its icon it needs no label where there is no room for it.
        text = {"text": ""} if is_narrow(context) else text_of_field(context, scatter.chosen_target)
        choice.prop(scatter, "target" if scatter.target_kind == "OBJECT" else "target_collection", **text)
        row.prop(scatter, "target_kind", text="", icon_only=True)
        layout.separator(factor=0.5)
        if running.session is not None:
            _draw_progress(layout)
            return
        button = layout.split(factor=BUTTON, align=True)
        button.scale_y = 1.8
        # The switch is as wide as its place, without a column for its name.
        button.use_property_split = False
        result = scatter.result_in(context.scene)
        editing = result is not None and result.mode == "EDIT"
        if editing:
            # There is no run in Edit Mode.
            button.operator("esh.instances_edit", text="Done", icon="CHECKMARK")
        else:
            button.operator(
                "esh.scatter", text="Update" if result else "Scatter", icon="FILE_REFRESH" if result else "PLAY"
            )
        button.prop(scatter, "live", toggle=True)
        if scatter.live and not live.is_live(context.scene, scatter):
            # It was switched on in the file that was opened, or by redo.
            live.wake()
        follow_names_later(scatter)
        if editing:
            _draw_editing(context, layout.column(align=True), scatter, result)
            return
        if is_painted(context, scatter):
            # The layer has that button, too, but often below the lower edge of the window.
            layout.operator("object.mode_set", text="Done Painting", icon="CHECKMARK", translate=False).mode = "OBJECT"
        with asked_once():
            draw_status(context, layout.column(align=True), scatter)
        if result is not None and real_objects.real_objects_of(result) is not None:
            _draw_real(context, layout.column(align=True), "The instances are real objects now")
        elif result is not None and is_left_out(result, context):
            write_text(context, layout, "The result is not in this local view; View > Local View ends it", icon="INFO")
        elif result is not None:
            _draw_bending(context, layout, result)
        draw_foreign(context, layout.column())
        if checksums.is_old():
            redraw_later()


class ESH_PT_surface(SubPanel, bpy.types.Panel):
    """Which part of the target is scattered on."""

    bl_label = "Surface"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw which side, and which faces."""
        column = self._column()
        scatter = selected_scatter(context)
        target = scatter.first_target
        draw_property(context, column, scatter, "surface")
        if scatter.surface == "AUTO" and not scatter.both_sides:
            write_text(context, column, _what_is_automatic(context.scene, scatter))
        draw_settings(context, column, scatter, TargetSettings, ("surface", *FACES))
        if target is None:
            return
        column.label(text="Only on Faces of", translate=False)
        for name, (of_mesh, where, text, icon) in FACES.items():
            column.prop_search(scatter, name, target.data if of_mesh else target, where, text=text, icon=icon)


class ESH_PT_classes(SubPanel, bpy.types.Panel):
    """What is scattered."""

    bl_label = "Classes"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of classes."""
        column = self._column()
        scatter = selected_scatter(context)
        if scatter.classes:
            names = "classes", "class_index", "class"
            with asked_once():
                draw_list(column, "ESH_UL_classes", scatter, *names, rows=5, move=True, menu="ESH_MT_classes")
            return
        write_text(context, column, "A class is one kind of thing, for example pines. It has its own density.")
        column.separator()
        row = column.row()
        row.scale_y = 1.5
        row.operator("esh.class_add", text="Add a Class", icon="ADD")
        for name in ("esh.classes_from_selection", "esh.classes_from_collection", "esh.classes_from_image"):
            column.operator(name)


class ESH_PT_balance(SubPanel, bpy.types.Panel):
    """How the classes and sizes get on with each other."""

    bl_label = "Balance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the balance."""
        column = self._column()
        scatter = selected_scatter(context)
        draw_settings(context, column, scatter, Balance, BY_HAND)
        # The seed is among what few need.
        draw_settings(context, column, scatter, SamplingSettings, ("seed",))
        if scatter.surface != "WHOLE":
            draw_settings(context, column, scatter, BorderSettings)


class ESH_PT_obstacles(SubPanel, bpy.types.Panel):
    """What objects keep off."""

    bl_label = "Obstacles"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the list of obstacles, the selected one, and whether other scatters are some."""
        column = self._column()
        scatter = selected_scatter(context)
        if scatter.obstacles:
            draw_list(column, "ESH_UL_obstacles", scatter, "obstacles", "obstacle_index", "obstacle", rows=3)
        else:
            column.operator("esh.obstacle_add", text="Add Obstacle", icon="ADD")
        chosen = scatter.active_obstacle
        if chosen is not None:
            column.separator()
            column.prop(chosen, "kind")
            row = column.row()
            row.alert = bool(chosen.gone)
            row.prop(chosen, "item" if chosen.kind == "OBJECT" else "collection")
            if chosen.has_lines:
                column.prop(chosen, "width")
            column.prop(chosen, "margin")
        column.separator()
        column.prop(scatter, "keep_off_others")


class ESH_PT_instances(SubPanel, bpy.types.Panel):
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
        if real_objects.real_objects_of(result) is not None:
            _draw_real(context, column, "The instances are real objects now, and the result is hidden")
            return
        editing = result.mode == "EDIT"
        row = column.row()
        row.scale_y = 1.3
        text, icon = ("Done", "CHECKMARK") if editing else ("Edit Instances", "EDITMODE_HLT")
        row.operator("esh.instances_edit", text=text, icon=icon)
        if editing:
            write_text(
                context, column, "Select points; move (G) or remove (X) them. What you move stays there in the next run"
            )
        buttons = column.column(align=True)
        row = buttons.row(align=True)
        row.operator("esh.instances_pin", icon="PINNED")
        row.operator("esh.instances_unpin", icon="UNPINNED")
        row = buttons.row(align=True)
        row.operator("esh.instances_turn", icon="FILE_REFRESH")
        row.operator("esh.instances_remove", icon="X")
        column.operator("esh.instances_select_pinned", icon="RESTRICT_SELECT_OFF")
        if scatter.free_places:
            column.operator("esh.instances_refill")
        column.operator("esh.instances_make_real", icon="OBJECT_DATA")


class ESH_PT_display(SubPanel, bpy.types.Panel):
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
            draw_inputs(column, modifier, ("Display", "Share", "Scale", "Follow"))
            column.separator()
            culling = input_property(modifier, "Culling")
            draw_inputs(column, modifier, ("Culling",))
            if culling and get_inputs(modifier)["Culling"]:
                draw_inputs(column, modifier, ("Margin", "Distance"))
            draw_inputs(column, modifier, ("In Renders",))
            column.separator()
        column.prop(scatter, "points_above")
        column.prop(scatter, "cap")


class ESH_PT_advanced(SubPanel, bpy.types.Panel):
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
        draw_settings(context, column, scatter, RunSettings)


def _draw_editing(
    context: bpy.types.Context, column: bpy.types.UILayout, scatter: ESH_PG_scatter, result: bpy.types.Object
) -> None:
    """Say what to do with points that are edited, and what Live does meanwhile."""
    said = "Select points; move (G) or remove (X) them. Instances, below, has more"
    follows = can_leave_edit_mode(context, result)
    live_does = "Live has the others make room" if follows else "Live goes on when you are done"
    write_text(context, column, f"{said}. {live_does}" if scatter.live else said, icon="INFO")
    if told := live.status(context.scene, scatter):
        write_text(context, column, told, icon="ERROR")


def _what_is_automatic(scene: bpy.types.Scene, scatter: ESH_PG_scatter) -> str:
    """Say what of the target the setting Automatic takes, as far as the last run or a forecast knows."""
    whole = scatter.stands_on_whole()
    if whole is None and scatter.obstacle(scene) is None:
        whole = forecast.takes_whole_surface(scatter, scene)
    return "Automatic: " + {None: "the run will tell", False: "from above", True: "whole surface"}[whole]


def _draw_beginning(context: bpy.types.Context, column: bpy.types.UILayout) -> None:
    """Say what to click where there is no scatter."""
    write_text(context, column, "Select the objects to place, then the ground, and click:")
    column.separator()
    row = column.row()
    row.scale_y = 1.8
    row.operator("esh.scatter_selection", icon="PLAY")
    column.separator()
    write_text(context, column, "Or step by step, on the active mesh:")
    column.operator("esh.scatter_add", text="New Scatter", icon="ADD")
    column.menu("ESH_MT_presets", text="From a Preset", icon="PRESET", translate=False)
    draw_pictures(column, PICTURE_SCALE)
    column.separator()
    write_text(context, column, "Or look at one first:")
    column.operator("esh.example", icon="OUTLINER_OB_POINTCLOUD")


def _draw_bending(context: bpy.types.Context, layout: bpy.types.UILayout, result: bpy.types.Object) -> None:
    """Say of a target that bends, but in renders without what stands on it, what to do about that."""
    modifier = our_modifier(result)
    if modifier is None or not get_inputs(modifier).get("Follow"):
        return
    for one in followed_targets(modifier):
        placed_at = one.finer.level if one.finer is not None else None
        if one.target is not None and bends_alone_in_renders(one.target, context.scene.render, placed_at):
            said = f'In renders "{one.target.name}" bends without its objects, since it is subdivided to another level there'
            write_text(context, layout.column(), f"{said}. Give both levels the same number", icon="INFO")


def _draw_active_scatter(context: bpy.types.Context, row: bpy.types.UILayout, scatter: ESH_PG_scatter) -> None:
    """Draw which scatter is shown, and whether its result is."""
    row.menu("ESH_MT_scatters", text="", icon="DOWNARROW_HLT")
    row.prop(scatter, "name", text="")
    result = scatter.result_in(context.scene)
    if result is not None and not is_narrow(context):
        row.prop(result, "hide_viewport", text="")
        row.prop(result, "hide_render", text="")
    row.operator("esh.scatter_add", text="", icon="ADD")
    row.operator("esh.scatter_remove", text="", icon="REMOVE")


def _draw_real(context: bpy.types.Context, column: bpy.types.UILayout, said: str) -> None:
    """Say that there are real objects in place of instances, and offer the way back."""
    write_text(context, column, said, icon="INFO")
    column.operator_menu_enum("esh.instances_from_real", "changes", icon="LOOP_BACK")


def _draw_progress(layout: bpy.types.UILayout) -> None:
    """Draw how far the run is, where the button was, and below it how to end it: in no more lines than there were."""
    session = running.session
    assert session is not None
    row = layout.row()
    row.scale_y = 1.8
    row.progress(factor=session.factor, text=session.text, translate=False)
    buttons = layout.row(align=True)
    buttons.operator("esh.keep", text="Keep", icon="CHECKMARK")
    buttons.operator("esh.stop", text="Stop", icon="CANCEL")


# In the order that they are drawn in; parents come before what is in them.
CLASSES = (
    ESH_PT_scatter,
    ESH_PT_surface,
    ESH_PT_classes,
    *class_panels.CLASSES,
    ESH_PT_balance,
    ESH_PT_obstacles,
    ESH_PT_instances,
    ESH_PT_display,
    *report_panel.CLASSES,
    ESH_PT_advanced,
)
