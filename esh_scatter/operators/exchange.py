"""The File menu's entries: results to files of other programs, and back."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ...engine.errors import EshError
from ...engine.files.body_formats import FORMATS
from ...engine.files.placement_reader import READABLE
from ..properties.scene import active_scatter
from ..result.exchange import export_result, import_placement
from ..result.scene_units import sentence
from ..targets.target import RESULT_TAG

__all__ = ["CLASSES", "attach", "detach"]


# Endings of the formats that are offered; others can be typed.
_CHOICES = (
    (".usdc", "USD", "Point instancer for Houdini, Unreal, Omniverse; objects in a folder beside it"),
    (".glb", "glTF", "Instances for three.js, Babylon.js and engines; objects in the file"),
    (".ply", "PLY", "Points with attributes"),
    (".geojson", "GeoJSON", "Points with properties, for small results"),
)


class ESH_OT_export(bpy.types.Operator, ExportHelper):
    """Export the active result, or that of the active scatter, as instances, together with the objects that it places"""

    bl_idname = "esh.export"
    bl_label = "Export Scatter"
    bl_options = {"PRESET"}

    filename_ext = ".usdc"
    if TYPE_CHECKING:
        filepath: str
    filter_glob: StringProperty(default=";".join(f"*{ending}" for ending in FORMATS), options={"HIDDEN"})
    format: EnumProperty(
        name="Format",
        description="What the file is for",
        items=_CHOICES,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the menu's tooltip why it is gray."""
        if _result_in(context) is None:
            cls.poll_message_set("Scatter first, or select the result of a scatter")
            return False
        return context.mode == "OBJECT"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for a name; begin with glTF in a Blender that was built without USD."""
        if self.format == ".usdc" and not bpy.app.build_options.usd:
            self.format = ".glb"
        self.filename_ext = self.format
        return super().invoke(context, event)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the format, and what is exported."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "format")
        item = _result_in(context)
        if item is not None:
            layout.label(
                text=f"{item.name}: {len(item.data.vertices):,} instances", icon="POINTCLOUD_DATA", translate=False
            )

    def check(self, context: bpy.types.Context) -> bool:
        """Keep the ending of the name that of the format, and the format that of an ending that was typed."""
        before: str = self.filepath
        chosen, typed = self.format, Path(before).suffix.lower()
        if chosen == self.filename_ext and typed in FORMATS:
            # There are several endings of USD.
            named = ".usdc" if typed.startswith(".usd") else typed
            if named in (ending for ending, _, _ in _CHOICES):
                self.format = self.filename_ext = named
            return self.format != chosen
        self.filename_ext = chosen
        self.filepath = str(Path(before).with_suffix(chosen))
        return self.filepath != before

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write it."""
        item = _result_in(context)
        assert item is not None
        if Path(self.filepath).suffix.lower().startswith(".usd") and not bpy.app.build_options.usd:
            self.report({"ERROR"}, "This Blender was built without USD. Choose another format")
            return {"CANCELLED"}
        try:
            export_result(self.filepath, item)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {len(item.data.vertices):,} instances")
        return {"FINISHED"}


class ESH_OT_import(bpy.types.Operator, ImportHelper):
    """Make a scatter result from a placement in a file. Objects in the scene that are named like its classes are placed"""

    bl_idname = "esh.import"
    bl_label = "Import Scatter"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default=";".join(f"*{ending}" for ending in READABLE), options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make it."""
        named = {item.name: item for item in context.scene.objects if item.type == "MESH" and not item.get(RESULT_TAG)}
        try:
            item = import_placement(self.filepath, named)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Placed {len(item.data.vertices):,}")
        return {"FINISHED"}


def _result_in(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the result to export: one that is selected, or that of the scatter that the sidebar shows."""
    item = context.active_object
    active = item if item is not None and item.get(RESULT_TAG) and item.type == "MESH" else None
    scatter = active_scatter(context)
    shown = scatter.result_in(context.scene) if scatter is not None else None
    return active if active is not None and (shown is None or active.select_get()) else shown


def _draw_export(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(ESH_OT_export.bl_idname, text="ESH Scatter (.usdc, .glb, .ply, .geojson)")


def _draw_import(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(ESH_OT_import.bl_idname, text="ESH Scatter (.usdc, .glb, .ply, .npz, .csv, ...)")


def attach() -> None:
    """Add the entries of the File menu."""
    bpy.types.TOPBAR_MT_file_export.append(_draw_export)
    bpy.types.TOPBAR_MT_file_import.append(_draw_import)


def detach() -> None:
    """Take them away."""
    bpy.types.TOPBAR_MT_file_export.remove(_draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(_draw_import)


CLASSES = (ESH_OT_export, ESH_OT_import)
