"""Ground that an empty shows: it belongs to a collection, often of another file, and nothing can stand on that."""

from __future__ import annotations

import bpy

from .target import shown_collection

__all__ = ["instead_of_instance", "shown_by"]


def shown_by(item: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the empty of a scene that shows an object with its collection, or None."""
    # Of what was deleted nothing is shown; only for the others all objects of the scene are looked at.
    if not item.users_collection:
        return None
    shown = ((one, shown_collection(one)) for one in scene.objects)
    return next(
        (one for one, group in shown if group is not None and any(item == own for own in group.all_objects)), None
    )


def instead_of_instance(empty: bpy.types.Object) -> str:
    """Return what to do about ground that an empty shows, as one sentence."""
    collection = shown_collection(empty)
    if collection is not None and collection.library is not None:
        way = "Object > Library Override > Make"
    else:
        way = "Object > Apply > Make Instances Real"
    return f'"{empty.name}" only shows its objects: {way}, and select the ground among them'
