"""The scene's scatters: added, removed, chosen, and given another seed."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import random

import bpy
from bpy.props import IntProperty

from ..editing.copied_results import copied_from, make_scatter_of
from ..properties.kept_settings import kept_of
from ..properties.scene import selected_scatter
from .edit import BOUNDARY, REGULARITY, Edit, ground_in, remove_at

__all__ = ["CLASSES"]


class ESH_OT_scatter_add(Edit):
    """Add a scatter on the active mesh, or on what the active result stands on; otherwise on the target of this scatter"""

    bl_idname = "esh.scatter_add"
    bl_label = "Add Scatter"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return context.scene

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        scatter = context.scene.esh_scatter.add_scatter(ground_in(context))
        scatter.boundary, scatter.regularity = BOUNDARY, REGULARITY
        return {"FINISHED"}


class ESH_OT_scatter_remove(Edit):
    """Remove the settings of this scatter. What it has placed stays in the scene"""

    bl_idname = "esh.scatter_remove"
    bl_label = "Remove Scatter"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        settings = context.scene.esh_scatter
        result = selected_scatter(context).result_in(context.scene)
        if result is not None:
            self.report({"INFO"}, f'"{result.name}" stays in the scene. Delete it, too, to be rid of what was placed')
        settings.scatter_index = remove_at(settings.scatters, settings.scatter_index)
        return {"FINISHED"}


class ESH_OT_scatter_choose(Edit):
    """Show this scatter in the sidebar"""

    bl_idname = "esh.scatter_choose"
    bl_label = "Choose Scatter"

    index: IntProperty(name="Number", description="Which of the scene's scatters, counted from 0", min=0)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show it."""
        settings = context.scene.esh_scatter
        settings.scatter_index = min(self.index, len(settings.scatters) - 1)
        return {"FINISHED"}


class ESH_OT_scatter_of_copy(Edit):
    """Make a scatter of the active copy of a result, or of an appended one, with its settings. It stays as it is until Update"""

    bl_idname = "esh.scatter_of_copy"
    bl_label = "Make Own Scatter"
    _missing = "Select a copy of a result first, or one that was appended from another file"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return copied_from(context) or kept_of(context.view_layer.objects.active)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make it."""
        item, settings, source = context.view_layer.objects.active, context.scene.esh_scatter, copied_from(context)
        made = make_scatter_of(item, settings, None if source is None else list(settings.scatters).index(source))
        self.report({"INFO"}, f'"{made.name}" has settings of its own now')
        return {"FINISHED"}


class ESH_OT_seed_roll(Edit):
    """Choose another seed. The result is another placement of the same quality"""

    bl_idname = "esh.seed_roll"
    bl_label = "Randomize Seed"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        scatter = selected_scatter(context)
        scatter.seed = random.choice([seed for seed in range(10_000) if seed != scatter.seed])
        return {"FINISHED"}


CLASSES = (
    ESH_OT_scatter_add,
    ESH_OT_scatter_remove,
    ESH_OT_scatter_choose,
    ESH_OT_scatter_of_copy,
    ESH_OT_seed_roll,
)
