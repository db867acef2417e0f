"""Presets: scatters made from one, and written as one."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ...engine.errors import EshError
from ..properties.scene import selected_scatter
from ..result.scene_units import sentence
from .edit import Edit, ground_in

__all__ = ["CLASSES"]


class _Preset(Edit):
    _missing = "Select the ground, which must be a mesh"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return ground_in(context)

    def _apply(self, context: bpy.types.Context, path: str) -> set[str]:
        from ..editing.preset_files import read_preset
        from ..editing.presets import add_scatter_of_preset, selected_for_preset

        ground = ground_in(context)
        assert ground is not None
        chosen = selected_for_preset(context, ground)
        try:
            added = add_scatter_of_preset(context.scene.esh_scatter, read_preset(path), ground, chosen)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if added.held:
            self.report({"WARNING"}, added.held)
        return {"FINISHED"}


class ESH_OT_preset_apply(_Preset):
    """Add a scatter with the settings of a preset on the ground. Selected objects that are not scattered there yet take the places of its classes, in the order of their names; simple shapes stand in for the rest"""  # noqa: E501

    bl_idname = "esh.preset_apply"
    bl_label = "Apply Preset"

    filepath: StringProperty(name="File", description="The preset: a JSON file", subtype="FILE_PATH")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        return self._apply(context, self.filepath)


class ESH_OT_preset_import(ImportHelper, _Preset):
    """Add a scatter with the settings of an exported preset"""

    bl_idname = "esh.preset_import"
    bl_label = "Import Preset"

    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        return self._apply(context, self.filepath)


class ESH_OT_preset_export(ExportHelper, Edit):
    """Write the settings of this scatter as a preset. Objects and images are not part of it"""

    bl_idname = "esh.preset_export"
    bl_label = "Export Preset"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write it."""
        from ..editing.preset_files import write_preset
        from ..editing.presets import preset_of

        try:
            write_preset(self.filepath, preset_of(selected_scatter(context)))
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {self.filepath}")
        return {"FINISHED"}


CLASSES = (
    ESH_OT_preset_apply,
    ESH_OT_preset_import,
    ESH_OT_preset_export,
)
