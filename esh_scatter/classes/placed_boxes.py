"""The boxes around what a class places, as it is turned and scaled where it stands: cheap enough for whenever the sidebar is drawn."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..targets.target import corners_of, members_of, origin_of, shown_collection, world_matrix

__all__ = ["box_around", "box_of_one", "placed_boxes", "placed_items"]

# Of what is shown together, more parts than this are not looked at: drawing would take long.
MOST_PARTS = 30


def placed_boxes(size: Any) -> list[np.ndarray]:
    """Return the corners of the boxes around what a size places, and around the parts of it, seen from its origins [m]."""
    return [box for box in map(box_around, placed_items(size)) if len(box)]


def placed_items(size: Any) -> list[bpy.types.Object | bpy.types.Collection]:
    """Return the objects that a size places, or the collection that it places as one."""
    items = size.choices()[0] if size.source_kind == "COLLECTION" else [size.source]
    return [item for item in items if item is not None]


def box_around(item: bpy.types.Object | bpy.types.Collection) -> np.ndarray:
    """Return the corners of the boxes around all that an object or a collection as one shows, seen from its origin [m]: ``[n, 3]``."""
    context = bpy.context
    if isinstance(item, bpy.types.Collection):
        together, origin = item, origin_of(item, context) - np.array(item.instance_offset)
    elif (together := shown_collection(item)) is None:
        return box_of_one(item)
    else:
        origin = world_matrix(item, context)[:3, 3]
    if len(members_of(together)) > MOST_PARTS:
        return np.empty((0, 3))
    return corners_of(item, np.eye(4), context) - origin


def box_of_one(item: bpy.types.Object) -> np.ndarray:
    """Return the corners of the box around an object's own geometry, seen from its origin [m], shape ``[8, 3]``."""
    corners: np.ndarray = np.array(item.bound_box) @ world_matrix(item, bpy.context)[:3, :3].T
    return corners
