"""What was deleted in the viewport: Blender keeps it in the file for as long as settings point to it, where it would go on acting."""

import bpy

from ..targets.in_scenes import in_a_scene

__all__ = ["deleted_name"]


def deleted_name(item: bpy.types.ID | None) -> str:
    """Return the name of an object that was deleted, or an empty text.

    It is in no scene and no collection then. What is hidden, excluded or in another scene is not deleted, nor is what belongs to a
    library.
    """
    if not isinstance(item, bpy.types.Object) or item.library is not None or in_a_scene(item):
        return ""
    return "" if item.users_collection else item.name
