"""The boxes around what a class places, as it is turned and scaled where it stands: cheap enough for whenever the sidebar is drawn."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..targets.target import shown_collection, world_matrix

__all__ = ["placed_boxes"]


def placed_boxes(size: Any) -> list[np.ndarray]:
    """Return the corners of the boxes around the objects of a size, seen from their origins [m], each of shape ``[8, 3]``.

    Collections that are placed as one, and empties that show one, are not looked into.
    """
    items = {"OBJECT": [size.source], "COLLECTION": size.choices()[0]}.get(size.source_kind, ())
    return [_corners(item) for item in items if item is not None and shown_collection(item) is None]


def _corners(item: bpy.types.Object) -> np.ndarray:
    corners: np.ndarray = np.array(item.bound_box) @ world_matrix(item, bpy.context)[:3, :3].T
    return corners
