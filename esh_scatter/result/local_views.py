"""Local views, in which a viewport shows only some objects: what is made or drawn shows in those that show its ground."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..targets.in_scenes import is_in_layer
from ..targets.references import Reference
from ..targets.target import members_of

__all__ = ["is_left_out", "join_local_views", "shows_any"]


def join_local_views(
    scene: bpy.types.Scene, item: bpy.types.Object, ground: bpy.types.Object | bpy.types.Collection | None
) -> None:
    """Show a new object in every local view of a scene that shows what it stands on, and in no other.

    What is linked by a script is in all local views of some Blenders, and in none of others.
    """
    for space, view_layer in _local_views(scene):
        # Until then, what is new is not in the layer's list.
        view_layer.update()
        shown = (one for one in members_of(ground) if is_in_layer(view_layer, one))
        if is_in_layer(view_layer, item):
            item.local_view_set(space, any(one.visible_get(view_layer=view_layer, viewport=space) for one in shown))


def is_left_out(item: bpy.types.Object, context: bpy.types.Context) -> bool:
    """Tell whether the viewport is in a local view that does not show an object."""
    space, layer = context.space_data, context.view_layer
    if not isinstance(space, bpy.types.SpaceView3D) or space.local_view is None or not is_in_layer(layer, item):
        return False
    # What `local_view_get` answers lags behind in Blender 4.5.
    hidden = item.hide_viewport or item.hide_get(view_layer=layer)
    return not hidden and not item.visible_get(view_layer=layer, viewport=space)


def shows_any(ground: Iterable[Reference], context: bpy.types.Context) -> bool:
    """Tell whether the viewport that is drawn may show any of some objects: those of its scene, and of its local view."""
    layer = context.view_layer
    found = (one.find() for one in ground)
    there = (item for item in found if item is not None and is_in_layer(layer, item))
    return any(not is_left_out(item, context) for item in there)


def _local_views(scene: bpy.types.Scene) -> Iterator[tuple[bpy.types.SpaceView3D, bpy.types.ViewLayer]]:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas if window.scene == scene else ():
            space = area.spaces.active
            if area.type == "VIEW_3D" and space.local_view is not None:
                yield space, window.view_layer
