"""Notes in the dialogs of Blender's own exporters that lose scatters, and the warning of the one that can be told to give one."""

import sys
from typing import Any

import bpy

from ..result.other_exporters import EXPORTERS, exported_results
from .panel_parts import write_text

__all__ = ["CLASSES", "attach", "detach"]

# What the exporter of glTF looks for in the module of every add-on.
_CALLED_BEFORE = "glTF2_pre_export_callback"


class ESH_PT_export_notes(bpy.types.Panel):
    """What happens to scatters in this export."""

    bl_label = "Scatters"
    bl_space_type = "FILE_BROWSER"
    bl_region_type = "TOOL_PROPS"
    bl_parent_id = "FILE_PT_operator"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Where an exporter loses scatters unless it is told, and would see one."""
        operator = context.space_data.active_operator
        exporter = EXPORTERS.get(operator.bl_idname) if operator is not None else None
        if exporter is None:
            return False
        selected = getattr(_settings_of(operator), exporter.selected, False)
        return bool(exported_results(context.view_layer, selected))

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what happens, and the switch."""
        operator = context.space_data.active_operator
        exporter, settings = EXPORTERS[operator.bl_idname], _settings_of(operator)
        layout = self.layout
        if exporter.loses(settings):
            write_text(context, layout, exporter.loss, icon="ERROR")
        else:
            write_text(context, layout, "Kept as instances", icon="CHECKMARK")
        if exporter.switch and hasattr(settings, exporter.switch):
            layout.prop(settings, exporter.switch)


def _settings_of(operator: Any) -> Any:
    """What an operator's properties are read from: one in Python has them itself."""
    return operator if hasattr(operator, "execute") else operator.properties


def _before_gltf_export(settings: dict[str, Any]) -> None:
    """Have the exporter of glTF say that it leaves scatters out; a collection's exporter and scripts show no dialog."""
    lost = exported_results(bpy.context.view_layer, settings.get("gltf_selected", False))
    if lost and not settings.get("gltf_gn_mesh", True):
        settings["log"].warning(f"{lost[0].name}: {EXPORTERS['EXPORT_SCENE_OT_gltf'].loss}", popup=True)


def _module() -> Any:
    """The add-on's own module, as Blender has enabled it."""
    return sys.modules[__package__.rpartition(".esh_scatter.")[0]]


def attach() -> None:
    """Have the exporter of glTF call us."""
    setattr(_module(), _CALLED_BEFORE, _before_gltf_export)


def detach() -> None:
    """Have it call us no more."""
    if hasattr(_module(), _CALLED_BEFORE):
        delattr(_module(), _CALLED_BEFORE)


CLASSES = (ESH_PT_export_notes,)
