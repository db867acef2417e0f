"""What Blender's own exporters make of scatters, which they do not say by themselves."""

from __future__ import annotations

from typing import Any, NamedTuple

import bpy

from ..targets.target import RESULT_TAG

__all__ = ["EXPORTERS", "Exporter", "exported_results"]


class Exporter(NamedTuple):
    """An exporter that keeps scatters only by a switch, or not at all.

    Attributes:
        switch: The property of its operator that keeps them, which is off by default; empty where there is none.
        selected: The property by which it exports what is selected alone.
        loss: What it makes of scatters otherwise, and what helps.
    """

    switch: str
    selected: str
    loss: str

    def loses(self, settings: Any) -> bool:
        """Whether scatters are lost with the settings of the operator."""
        return not self.switch or not getattr(settings, self.switch, False)


# By the names that operators have in the file browser.
EXPORTERS = {
    "EXPORT_SCENE_OT_gltf": Exporter(
        "export_gn_mesh",
        "use_selection",
        "glTF leaves scatters out. Switch on Geometry Nodes Instances, or use File › Export › ESH Scatter",
    ),
    "WM_OT_usd_export": Exporter(
        "use_instancing",
        "selected_objects_only",
        "USD makes a copy of every object of a scatter. Switch on Instancing, or use File › Export › ESH Scatter",
    ),
    "EXPORT_SCENE_OT_fbx": Exporter(
        "",
        "use_selection",
        "FBX leaves scatters out. Use Make Real before, or File › Export › ESH Scatter for USD and glTF",
    ),
}


def exported_results(view_layer: bpy.types.ViewLayer, selected_only: bool) -> list[bpy.types.Object]:
    """Return the results of scatters that an exporter sees."""
    return [
        item
        for item in view_layer.objects
        if item.get(RESULT_TAG)
        and item.type == "MESH"
        and item.visible_get(view_layer=view_layer)
        and (not selected_only or item.select_get(view_layer=view_layer))
    ]
