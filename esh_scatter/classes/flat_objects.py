"""Objects without thickness: they lie in the ground's own plane, where both show through each other in patches that flicker."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .placed_boxes import placed_boxes

__all__ = ["lift_for", "lift_of_class"]

# What is thinner than this share of its longer side has no thickness.
FLAT = 1e-3
# How far it is lifted, as a share of its longer side: as much as a hill bends away below a leaf, and too little for a gap to be seen.
LIFT = 0.02


def lift_for(length: float, thickness: float) -> float:
    """Return how far above the ground an object is to lie, so that it shows whole; 0 where it is thick enough [m].

    Args:
        length: Its longer side, seen from above [m].
        thickness: Its height [m].
    """
    return LIFT * length if thickness < FLAT * length else 0.0


def lift_of_class(body_class: Any) -> float:
    """Return how far the objects of a class are to be lifted [m]; 0 where none is flat, or where they are off the ground already."""
    if body_class.offset:
        return 0.0
    lifts = (_lift_of_size(size) for size in body_class.sizes if size.source is not None)
    return float(body_class.scale) * max(lifts, default=0.0)


def _lift_of_size(size: Any) -> float:
    extents = [np.ptp(box, axis=0) for box in placed_boxes(size)]
    if size.area_kind != "MESH":
        # They are as large as it takes to cover this.
        area = size.area if size.area_kind == "VALUE" else size.area_largest
        extents = [_fitted(extent, area) for extent in extents]
    return max((lift_for(float(extent[:2].max()), float(extent[2])) for extent in extents), default=0.0)


def _fitted(extent: np.ndarray, area: float) -> np.ndarray:
    covered = float(extent[0] * extent[1])
    fitted: np.ndarray = extent * math.sqrt(area / covered) if covered > 0.0 else extent
    return fitted
