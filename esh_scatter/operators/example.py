"""The button that adds the example."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ...engine.errors import EshError
from ..properties.scatter import ESH_PG_scatter
from ..result.scene_units import sentence
from ..solving import live
from .edit import settings_editable
from .run_operator import RunOperator, in_background

__all__ = ["CLASSES"]


class ESH_OT_example(RunOperator):
    """Add hills with a mixed forest of simple shapes on them, to see how it works. Put your own objects in their places"""

    bl_idname = "esh.example"
    bl_label = "Add Example"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only in Object Mode."""
        if not settings_editable(cls, context):
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to Object Mode first")
        return context.mode == "OBJECT"

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        from ..editing.example import add_example

        try:
            scatter = add_example(context)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return None
        self._made = scatter.name
        _frame_selected(context)
        return scatter

    def _undo(self, context: bpy.types.Context) -> None:
        from ..editing.example import remove_example

        scatters = context.scene.esh_scatter.scatters
        # After Ctrl+Z it is gone already.
        if scatters and scatters[-1].name == getattr(self, "_made", None) and not scatters[-1].report_json:
            remove_example(scatters[-1])


def _frame_selected(context: bpy.types.Context) -> None:
    """Bring what is selected into view, where there is a 3D view."""
    areas = [] if in_background() or context.screen is None else [context.area, *context.screen.areas]
    area = next((one for one in areas if one is not None and one.type == "VIEW_3D"), None)
    if area is not None:
        region = next(one for one in area.regions if one.type == "WINDOW")
        with live.resting(), context.temp_override(area=area, region=region):
            bpy.ops.view3d.view_selected()


CLASSES = (ESH_OT_example,)
