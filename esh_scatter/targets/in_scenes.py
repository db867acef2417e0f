"""Which scenes an object is in. Blender finds a name in a scene by going through all its objects; what is seen is found at once."""

from __future__ import annotations

import bpy

__all__ = ["in_a_scene", "in_several_scenes", "is_in"]


def is_in(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    """Tell whether an object is in a scene, seen or not."""
    context = bpy.context
    # View layers of other scenes may be out of date, and would be brought up to date with the objects of this one.
    if scene == context.scene and context.view_layer is not None:
        layer = context.view_layer
        if item.visible_get(view_layer=layer) or item.hide_get(view_layer=layer):
            return True
    found: bool = scene.objects.get(item.name) == item
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
