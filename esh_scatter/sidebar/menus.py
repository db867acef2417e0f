"""Menus: what is done with classes and scatters, and all of it in a menu of every mode of the viewport, where F3 finds it."""

from collections.abc import Sequence

import bpy

from .. import operators
from ..editing.painting import PAINTED_IN
from ..editing.preset_files import built_in_presets
from ..operators.edit import MoveEntry
from ..properties.layer import KINDS
from ..properties.scene import active_scatter
from . import preset_pictures
from .preset_pictures import draw_pictures, picture_of

__all__ = ["CLASSES", "attach", "detach"]

# What is no entry of the Object menu: it needs to be told which class or scatter.
_ELSEWHERE = {
    "esh.class_overlap",
    # In menus of their own: those of the scatters and of the presets.
    "esh.scatter_choose",
    "esh.preset_apply",
    "esh.preset_import",
    "esh.preset_export",
    "esh.presets_as_assets",
    # In the menus of the asset browser.
    "esh.scatter_assets",
    "esh.classes_from_assets",
    "esh.source_from_asset",
    "esh.preset_from_asset",
}
# Menus of the viewport that F3 looks through: points are picked in Edit Mode, and what is painted is scattered while it is.
_MENUS_OF_MODES = (
    "VIEW3D_MT_object",
    "VIEW3D_MT_edit_mesh",
    "VIEW3D_MT_paint_weight",
    "VIEW3D_MT_paint_vertex",
    "VIEW3D_MT_sculpt",
)
# The asset browser's own, and the one that a right click opens.
_MENUS_OF_ASSETS = ("ASSETBROWSER_MT_asset", "ASSETBROWSER_MT_context_menu")
# How large the picture in the menu of the presets is, in units of its lines.
PICTURE_SCALE = 5.0
# Where groups of layers begin in the menu.
_GROUPS = tuple(list(KINDS).index(name) for name in ("SLOPE", "DISTANCE"))


class ESH_MT_classes(bpy.types.Menu):
    """What is done with classes."""

    bl_label = "Classes"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the menu."""
        layout = self.layout
        # Dialogs ask, operators that need no answer do it.
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("esh.classes_from_selection", icon="RESTRICT_SELECT_OFF")
        layout.operator("esh.classes_from_collection", icon="OUTLINER_COLLECTION")
        layout.operator("esh.classes_from_image", icon="IMAGE_RGB")
        layout.separator()
        layout.operator("esh.class_duplicate", icon="DUPLICATE")
        layout.operator("esh.class_copy", icon="PASTEDOWN")
        layout.separator()
        layout.operator("esh.classes_sort", text="Sort by Name", icon="SORTALPHA").by = "NAME"
        layout.operator("esh.classes_sort", text="Sort by Count", icon="SORTSIZE").by = "COUNT"


class ESH_MT_layer_add(bpy.types.Menu):
    """What a new layer of a density can read."""

    bl_label = "Add Layer"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the menu, in groups: painted, of the ground, of the scene."""
        layout = self.layout
        for number, (name, kind) in enumerate(KINDS.items()):
            if number in _GROUPS:
                layout.separator()
            layout.operator("esh.layer_add", text=kind.label, icon=kind.icon).kind = name


class ESH_MT_layer_paint(bpy.types.Menu):
    """What a class without layers can be painted on."""

    bl_label = "Paint"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the menu."""
        for kind in PAINTED_IN:
            # Of all attributes only colors are painted.
            label, icon = (
                ("Color Attribute", "GROUP_VCOL") if kind == "ATTRIBUTE" else (KINDS[kind].label, KINDS[kind].icon)
            )
            self.layout.operator("esh.layer_paint", text=f"New {label}", icon=icon).kind = kind


class ESH_MT_presets(bpy.types.Menu):
    """Scatters to begin with."""

    bl_label = "Presets"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("esh.preset_import", icon="IMPORT")
        layout.operator("esh.preset_export", icon="EXPORT")
        layout.operator("esh.presets_as_assets", icon="ASSET_MANAGER")
        layout.separator()
        draw_pictures(layout, PICTURE_SCALE)
        for path, name in built_in_presets().items():
            layout.operator("esh.preset_apply", text=name, icon_value=picture_of(path)).filepath = path


class ESH_MT_scatters(bpy.types.Menu):
    """The scene's scatters, to choose one."""

    bl_label = "Scatters"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        active = active_scatter(context)
        scatters = context.scene.esh_scatter.scatters
        for number, scatter in enumerate(scatters):
            icon = "RADIOBUT_ON" if scatter == active else "RADIOBUT_OFF"
            # Of a single one the panel tells.
            text = f"{scatter.name} (changed)" if len(scatters) > 1 and scatter.outdated else scatter.name
            layout.operator("esh.scatter_choose", text=text, icon=icon).index = number
        layout.separator()
        if len(scatters) > 1:
            layout.operator("esh.scatter_all", icon="FILE_REFRESH")
        layout.operator("esh.scatter_selection", icon="PLAY")
        layout.operator("esh.scatter_add", icon="ADD")
        layout.menu("ESH_MT_presets", icon="PRESET")


class ESH_MT_object(bpy.types.Menu):
    """Everything that ESH Scatter does."""

    bl_label = "ESH Scatter"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        scatter = active_scatter(context)
        updates = scatter is not None and scatter.result_in(context.scene) is not None
        for cls in operators.CLASSES:
            if cls.bl_idname == "esh.scatter" and updates:
                # F3 finds it by the name that its button has.
                layout.operator(cls.bl_idname, text="Update Scatter")
            elif issubclass(cls, MoveEntry):
                for direction in ("UP", "DOWN"):
                    layout.operator(cls.bl_idname, text=f"{cls.bl_label} {direction.title()}").direction = direction
            elif cls.bl_idname not in _ELSEWHERE:
                layout.operator(cls.bl_idname)
        layout.separator()
        if scatter is not None:
            layout.menu("ESH_MT_scatters")
        layout.menu("ESH_MT_presets", icon="PRESET")


class ESH_MT_assets(bpy.types.Menu):
    """What is done with the selected assets."""

    bl_label = "ESH Scatter"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("esh.scatter_assets", icon="PLAY")
        layout.operator("esh.classes_from_assets", icon="ADD")
        layout.operator("esh.source_from_asset", icon="OBJECT_DATA")
        layout.separator()
        layout.operator("esh.preset_from_asset", icon="PRESET")


def _draw_of_assets(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu("ESH_MT_assets")


def _draw_entry(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu("ESH_MT_object")


def attach() -> None:
    """Add the menus to those of the viewport's modes, and of the asset browser."""
    preset_pictures.attach()
    for menu in _menus(_MENUS_OF_MODES):
        menu.append(_draw_entry)
    for menu in _menus(_MENUS_OF_ASSETS):
        menu.append(_draw_of_assets)


def detach() -> None:
    """Take them out again."""
    for menu in _menus(_MENUS_OF_MODES):
        menu.remove(_draw_entry)
    for menu in _menus(_MENUS_OF_ASSETS):
        menu.remove(_draw_of_assets)
    preset_pictures.detach()


def _menus(names: Sequence[str]) -> list[type[bpy.types.Menu]]:
    """Return Blender's menus of some names; it may be quitting without them."""
    return [getattr(bpy.types, name) for name in names if hasattr(bpy.types, name)]


CLASSES = (
    ESH_MT_classes,
    ESH_MT_layer_add,
    ESH_MT_layer_paint,
    ESH_MT_presets,
    ESH_MT_scatters,
    ESH_MT_object,
    ESH_MT_assets,
)
