"""What acts no longer: what was deleted in the viewport, and what a library lacks.

Blender keeps the one in the file for as long as settings point to it, where it would go on acting, and has an empty in place of the
other.
"""

import bpy

from ..targets.in_scenes import in_a_scene

__all__ = ["gone", "not_found"]


def gone(item: bpy.types.ID | None) -> str:
    """Say what has become of an object or a collection that acts no longer, as the beginning of a sentence; an empty text of others.

    What was deleted is in no scene and no collection. What is only hidden, excluded or in another scene is not deleted, nor is what
    belongs to a library.
    """
    if lacks := not_found(item):
        return lacks
    if not isinstance(item, bpy.types.Object) or item.library is not None or in_a_scene(item):
        return ""
    return "" if item.users_collection else f'"{item.name}" was deleted'


def not_found(item: bpy.types.ID | None) -> str:
    """Say in which file an object or a collection was not found, or what it shows, as the beginning of a sentence."""
    shown = (item, *(getattr(item, name, None) for name in ("data", "instance_collection")))
    lacks = next((one for one in shown if one is not None and one.is_missing), None)
    if lacks is None:
        return ""
    linked = lacks if lacks.library is not None else lacks.override_library.reference
    return f'"{lacks.name}" was not found in {bpy.path.basename(linked.library.filepath)}'
