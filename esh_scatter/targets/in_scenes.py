"""Which scenes and view layers an object is in. Blender goes through all objects to find a name; what is seen is found at once."""

from __future__ import annotations

import bpy

__all__ = ["in_a_scene", "in_several_scenes", "is_in", "is_in_layer"]


def is_in(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    """Tell whether an object is in a scene, seen or not."""
    found: bool = (scene == bpy.context.scene and _is_found_here(item)) or scene.objects.get(item.name) == item
    return found


def is_in_layer(layer: bpy.types.ViewLayer, item: bpy.types.Object) -> bool:
    """Tell whether an object is in a view layer, hidden there or not."""
    found: bool = (layer == bpy.context.view_layer and _is_found_here(item)) or layer.objects.get(item.name) == item
    return found


def _is_found_here(item: bpy.types.Object) -> bool:
    """Tell whether the window's view layer shows an object, or hides it; it may be there all the same, hidden in another way.

    View layers of other scenes may be out of date, and would be brought up to date with the objects of this one.
    """
    layer = bpy.context.view_layer
    found: bool = layer is not None and (item.visible_get(view_layer=layer) or item.hide_get(view_layer=layer))
    return found


def in_a_scene(item: bpy.types.Object) -> bool:
    """Tell whether an object is in any scene."""
    here = bpy.context.scene
    return (here is not None and is_in(here, item)) or any(
        is_in(scene, item) for scene in bpy.data.scenes if scene != here
    )


def in_several_scenes(item: bpy.types.Object) -> bool:
    """Tell whether an object is in more than one scene."""
    return len(bpy.data.scenes) > 1 and sum(is_in(scene, item) for scene in bpy.data.scenes) > 1
