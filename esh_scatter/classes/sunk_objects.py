"""Objects with their origin in the middle, as new shapes have it: standing on their origins, they are half in the ground."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..targets.target import head_of, members_of, shown_collection
from .placed_boxes import box_around, box_of_one, placed_items

__all__ = ["is_sunk", "own_heights", "sunk_share_of_class"]

# What is not further below the origin than this share of the height is meant to be in the ground, such as roots.
BELOW_ORIGIN = 0.35


def is_sunk(low: float, high: float) -> bool:
    """Tell whether an object has its origin in its middle and not at its foot, by its lowest and highest point from there [m]."""
    return -low > BELOW_ORIGIN * (high - low)


def sunk_share_of_class(body_class: Any) -> float:
    """Return which share of their height the objects of a class have in the ground; 0 where that is meant to be so."""
    if body_class.offset or body_class.stand_on != "ORIGIN":
        return 0.0
    return max((_sunk_share(item) for size in body_class.sizes for item in placed_items(size)), default=0.0)


def own_heights(item: bpy.types.Object | bpy.types.Collection) -> tuple[float, float] | None:
    """Return the lowest and highest point of what others hang on, from its origin [m]; None where nothing does, or it has no shape.

    A trunk with its origin in its middle has it below the middle of the tree.
    """
    head = head_of(item)
    if head is None or shown_collection(head) is not None or not members_of(head):
        return None
    return _heights(box_of_one(head))


def _sunk_share(item: bpy.types.Object | bpy.types.Collection) -> float:
    box = box_around(item)
    if not len(box):
        return 0.0
    low, high = _heights(box)
    # What is below its origin as a whole hangs from there, as lamps do; what is flat is told of as such.
    return -low / (high - low) if high > 0.0 and is_sunk(*(own_heights(item) or (low, high))) else 0.0


def _heights(box: np.ndarray) -> tuple[float, float]:
    return float(box[:, 2].min()), float(box[:, 2].max())
