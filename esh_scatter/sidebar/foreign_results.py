"""What is said of an active result that no scatter of the scene has, as a copy."""

import bpy

from ..editing.copied_results import copied_from
from ..properties.kept_settings import kept_of
from ..properties.scatter import ESH_PG_scatter
from ..result.display import followed_targets, is_in_world, our_modifier
from ..result.node_group_contents import target_inputs
from ..result.result import find_result
from ..targets.target import is_result
from .panel_parts import draw_inputs, write_text

__all__ = ["draw_foreign"]


def draw_foreign(context: bpy.types.Context, column: bpy.types.UILayout) -> None:
    """Say of an active result that is no scatter's of the scene whose copy it is, or where its settings are."""
    item, scatters = context.view_layer.objects.active, context.scene.esh_scatter.scatters
    if item is None or not is_result(item) or any(scatter.result == item for scatter in scatters):
        return
    scatter = copied_from(context)
    if scatter is not None:
        _draw_copy(context, column, item, scatter)
    elif kept_of(item) is not None:
        said = f'"{item.name}" belongs to no scatter of this scene, but has the settings of its last run with it'
        write_text(context, column, said, icon="INFO")
        column.operator("esh.scatter_of_copy", icon="DUPLICATE")
    else:
        write_text(context, column, _where_settings_are(item), icon="INFO")
    column.separator()


def _draw_copy(
    context: bpy.types.Context, column: bpy.types.UILayout, item: bpy.types.Object, scatter: ESH_PG_scatter
) -> None:
    """Say of a copy of a scatter's result that runs do not change it, and let it be moved; or that the next run takes it."""
    original, modifier = scatter.result_in(context.scene), our_modifier(item)
    if original is None and find_result(context.scene, scatter.chosen_target, scatter.name) == item:
        text = f'"{item.name}" is a copy of the result that is no longer there. Scatter takes it in its place'
        write_text(context, column, text, icon="INFO")
        return
    said = f'"{item.name}" is a copy of what "{scatter.name}" has placed. Update leaves it as it is'
    write_text(context, column, said, icon="INFO")
    column.operator("esh.scatter_of_copy", icon="DUPLICATE")
    if modifier is not None:
        ground = next((one.target for one in followed_targets(modifier) if one.target is not None), None)
        if ground is not None and is_in_world(item):
            write_text(context, column, f'It goes with "{ground.name}". Switch Follow off to move it by itself')
        draw_inputs(column, modifier, ("Follow", *target_inputs(1)))


def _where_settings_are(item: bpy.types.Object) -> str:
    """Say of a result that is no scatter's of its scene where its settings are, as far as that is known."""
    said = f'"{item.name}" belongs to no scatter of this scene'
    for scene in bpy.data.scenes:
        if any(scatter.result == item for scatter in scene.esh_scatter.scatters):
            return f'{said}. Its settings are in the scene "{scene.name}"'
    return f"{said}. If it is of another file, its settings are there: append that scene, or import a preset of it"
