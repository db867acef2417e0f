"""The asset browser: its selected assets scattered or made classes, and the presets among its libraries."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
from bpy.props import EnumProperty, StringProperty

from ...engine.errors import EshError, ProblemError
from ..editing.assets import (
    PLACED,
    PRESET,
    Asset,
    asset_of_library,
    assets_from_text,
    bring_in,
    selected_assets,
    text_of_assets,
)
from ..properties.scene import selected_class, selected_scatter
from ..result.scene_units import sentence
from ..targets.target import members_of
from .classes_from import ClassesFromObjects
from .edit import ClassEdit, Edit, ground_in, stood_on
from .scatter_objects import ScatterObjects

__all__ = ["CLASSES", "SHELF"]

# Name of the shelf that shows the assets, see :mod:`..sidebar.asset_shelf`.
SHELF = "ESH_AST_assets"
_SELECT_ASSETS = "Select objects or collections in the asset browser first"
_SELECT_PRESET = "Select a preset of ESH Scatter in the asset browser first"


def _assets() -> StringProperty:
    return StringProperty(
        name="Assets",
        description="What is placed: kind, name and file of each asset, as JSON. Empty: what is selected in the asset browser",
        options={"HIDDEN", "SKIP_SAVE"},
    )


class ESH_OT_scatter_assets(ScatterObjects):
    """Scatter the assets that are selected in the asset browser on the active mesh. Each object or collection becomes a class"""

    bl_idname = "esh.scatter_assets"
    bl_label = "Scatter Selected Assets"

    assets: _assets()

    @classmethod
    def _lacks(cls, context: bpy.types.Context) -> str | None:
        ground = stood_on(context.view_layer.objects.active)
        return None if ground is not None else "Select the ground in the 3D view first; it must be a mesh"

    def _sources(self, context: bpy.types.Context) -> list:
        given = assets_from_text(self.assets) if self.assets else _placed(context)
        # They are found again when the settings of the last operation are changed.
        self.assets = text_of_assets(given)
        if not given:
            raise ProblemError(_SELECT_ASSETS)
        ground = stood_on(context.view_layer.objects.active)
        return [item for item in map(bring_in, given) if item != ground and item not in members_of(ground)]


class ESH_OT_classes_from_assets(ClassesFromObjects):
    """Add a class for each asset that is selected in the asset browser, named after it"""

    bl_idname = "esh.classes_from_assets"
    bl_label = "Classes from Selected Assets"

    assets: _assets()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        try:
            given = assets_from_text(self.assets) if self.assets else _placed(context)
            self.assets = text_of_assets(given)
            items = [bring_in(one) for one in given]
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if not items:
            self.report({"ERROR"}, _SELECT_ASSETS)
            return {"CANCELLED"}
        targets = selected_scatter(context).targets
        return self._add(context, [item for item in items if item not in targets])


class ESH_OT_source_from_asset(ClassEdit):
    """Have the selected class place the asset that is active in the asset browser"""

    bl_idname = "esh.source_from_asset"
    bl_label = "Place This Asset"

    assets: _assets()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        try:
            given = assets_from_text(self.assets) if self.assets else _placed(context)[:1]
            self.assets = text_of_assets(given)
            item = bring_in(given[0]) if given else None
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if item is None:
            self.report({"ERROR"}, _SELECT_ASSETS)
            return {"CANCELLED"}
        _place(context, item)
        return {"FINISHED"}


class ESH_OT_source_from_shelf(ClassEdit):
    """Choose an object or a collection of the asset libraries, which the selected class places from then on"""

    bl_idname = "esh.source_from_shelf"
    bl_label = "Choose Asset"

    # By these names, and with these numbers, a shelf tells its operator which asset was clicked.
    asset_library_type: EnumProperty(
        name="Library Type",
        items=(
            ("LOCAL", "Current File", "", 1),
            ("ALL", "All Libraries", "", 2),
            ("ESSENTIALS", "Essentials", "", 3),
            ("CUSTOM", "Asset Library", "", 100),
        ),
        options={"HIDDEN", "SKIP_SAVE"},
    )
    asset_library_identifier: StringProperty(name="Library", options={"HIDDEN", "SKIP_SAVE"})
    relative_asset_identifier: StringProperty(name="Asset", options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Show the assets where none was clicked."""
        if self.relative_asset_identifier:
            return self.execute(context)
        return set(bpy.ops.wm.call_asset_shelf_popover("INVOKE_DEFAULT", name=SHELF))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        try:
            item = bring_in(
                asset_of_library(self.asset_library_type, self.asset_library_identifier, self.relative_asset_identifier)
            )
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        _place(context, item)
        return {"FINISHED"}


class ESH_OT_preset_from_asset(Edit):
    """Add a scatter with the preset that is selected in the asset browser, on the active mesh. Selected objects take the places of its classes"""  # noqa: E501

    bl_idname = "esh.preset_from_asset"
    bl_label = "Apply Selected Preset"
    _missing = "Select the ground in the 3D view first; it must be a mesh"

    assets: _assets()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not super().poll(context):
            return False
        # Elsewhere it is given its preset, or is tuned after it was pressed here.
        if context.area is not None and context.area.ui_type == "ASSETS" and not _presets(context):
            cls.poll_message_set(_SELECT_PRESET)
            return False
        return True

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return ground_in(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        from ..editing.dropped_presets import add_preset

        ground = ground_in(context)
        assert ground is not None
        try:
            given = assets_from_text(self.assets) if self.assets else _presets(context)[:1]
            self.assets = text_of_assets(given)
            group = bring_in(given[0]) if given else None
            if group is None or PRESET not in group:
                self.report({"ERROR"}, _SELECT_PRESET)
                return {"CANCELLED"}
            text = str(group[PRESET])
            if given[0].file and group.library is None:
                # Only its text counts.
                bpy.data.node_groups.remove(group)
            held = add_preset(context, text, given[0].name, ground)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if held:
            self.report({"WARNING"}, held)
        return {"FINISHED"}


class ESH_OT_presets_as_assets(Edit):
    """Show the presets in the asset browser, with their pictures: writes them as an asset library, and adds it to the preferences"""

    bl_idname = "esh.presets_as_assets"
    bl_label = "Show in Asset Browser"
    bl_options = {"REGISTER"}

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return context.scene

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write the library, and show it."""
        from ..editing.preset_library import library_folder, show_library, write_library

        try:
            folder = library_folder()
            write_library(folder)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        library = show_library(folder)
        _turn_to(context, library.name)
        self.report({"INFO"}, f'The presets are in the asset library "{library.name}". Drag one onto the ground')
        return {"FINISHED"}


def _place(context: bpy.types.Context, item: bpy.types.Object | bpy.types.Collection) -> None:
    """Have the selected class place something from now on."""
    body_class = selected_class(context)
    (body_class.active_size or body_class.add_size()).place(item)


def _placed(context: bpy.types.Context) -> list[Asset]:
    """Return the selected assets that can be placed."""
    return [one for one in selected_assets(context) if one.kind in PLACED]


def _presets(context: bpy.types.Context) -> list[Asset]:
    """Return the selected assets that may be presets."""
    return [one for one in selected_assets(context) if one.kind not in PLACED]


def _turn_to(context: bpy.types.Context, library: str) -> None:
    """Have asset browsers that are open show a library."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            parameters = getattr(area.spaces.active, "params", None) if area.ui_type == "ASSETS" else None
            if parameters is not None:
                parameters.asset_library_reference = library
                area.tag_redraw()


CLASSES = (
    ESH_OT_scatter_assets,
    ESH_OT_classes_from_assets,
    ESH_OT_source_from_asset,
    ESH_OT_source_from_shelf,
    ESH_OT_preset_from_asset,
    ESH_OT_presets_as_assets,
)
