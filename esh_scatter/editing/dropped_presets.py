"""Presets that are dragged from the asset browser onto a mesh: what Blender makes of them becomes a scatter on that mesh.

Blender gives the mesh a modifier with the preset's node group, which does nothing. A moment later the modifier is gone, and the
preset applied. While nothing is brought in from another file, nothing of this runs.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...engine.errors import EshError
from ..result.refused import as_sentence
from ..solving import live, running
from ..targets.target import is_result
from .assets import PRESET

__all__ = ["add_preset", "attach", "detach", "take_dropped"]

# Seconds until it is tried again after a run.
PAUSE = 0.5


@persistent
def notice_dropped_presets(context: Any, *_arguments: object) -> None:
    """Look whether a preset is among what was brought in; Blender calls it, before the mesh has its modifier."""
    items = (one.id for one in context.import_items)
    if any(isinstance(item, bpy.types.NodeTree) and PRESET in item for item in items):
        _soon()


def _soon() -> None:
    if not bpy.app.timers.is_registered(_take):
        bpy.app.timers.register(_take, first_interval=0.0)


def _take() -> float | None:
    """Take what was dropped, as one step of the undo history, and begin to scatter; Blender calls it."""
    if running.session is not None:
        # Settings do not change while one runs.
        return PAUSE
    names = []
    try:
        names = take_dropped(bpy.context)
    except EshError as error:
        _say(as_sentence(error))
    if names:
        bpy.ops.ed.undo_push(message=f"Preset {names[-1]}")
        _scatter()
    return None


def take_dropped(context: bpy.types.Context) -> list[str]:
    """Make scatters of presets that stand as modifiers on meshes, and take these modifiers away; returns the presets' names.

    Raises:
        EshError: One is no preset that can be applied.
    """
    found = [
        (item, modifier)
        for item in context.scene.objects
        if item.type == "MESH" and not is_result(item)
        for modifier in item.modifiers
        if modifier.type == "NODES" and modifier.node_group is not None and PRESET in modifier.node_group
    ]
    made = []
    for ground, modifier in found:
        group = modifier.node_group
        name, text = group.name, str(group[PRESET])
        ground.modifiers.remove(modifier)
        if not group.users or (group.users == 1 and group.use_fake_user):
            bpy.data.node_groups.remove(group)
        held = add_preset(context, text, name, ground)
        if held:
            _say(held, "There Are Fewer Objects", "INFO")
        made.append(name)
    return made


def add_preset(
    context: bpy.types.Context, text: str, name: str, ground: bpy.types.Object | bpy.types.Collection
) -> str:
    """Add a scatter with a preset, given as its text, on a mesh or a collection; selected objects take the places of its classes.

    Returns:
        Which counts are held, as a sentence; empty where none is.

    Raises:
        EshError: It is no preset that can be applied. Nothing was added.
    """
    from .preset_files import parse_preset
    from .presets import add_scatter_of_preset, selected_for_preset

    preset = parse_preset(text, name)
    chosen = selected_for_preset(context, ground)
    return add_scatter_of_preset(context.scene.esh_scatter, preset, ground, chosen).held


def _scatter() -> None:
    """Press the button, in the first window with a 3D view."""
    areas = [(window, area) for window in bpy.context.window_manager.windows for area in window.screen.areas]
    found = next(((window, area) for window, area in areas if area.type == "VIEW_3D"), None)
    if found is None:
        return
    window, area = found
    region = next(one for one in area.regions if one.type == "WINDOW")
    with live.resting(), bpy.context.temp_override(window=window, area=area, region=region):
        if bpy.ops.esh.scatter.poll():
            bpy.ops.esh.scatter("INVOKE_DEFAULT")


def _say(text: str, title: str = "The Preset Cannot Be Used", icon: str = "ERROR") -> None:
    def draw(popup: bpy.types.UIPopupMenu, _context: bpy.types.Context) -> None:
        popup.layout.label(text=text, translate=False)

    if not bpy.app.background:
        bpy.context.window_manager.popup_menu(draw, title=title, icon=icon)


def attach() -> None:
    """Have presets taken that are dragged onto meshes from now on."""
    bpy.app.handlers.blend_import_post.append(notice_dropped_presets)


def detach() -> None:
    """Leave them to Blender."""
    if notice_dropped_presets in bpy.app.handlers.blend_import_post:
        bpy.app.handlers.blend_import_post.remove(notice_dropped_presets)
    if bpy.app.timers.is_registered(_take):
        bpy.app.timers.unregister(_take)
