"""Objects with their origin in the middle, as new shapes have it: standing on their origins, they are half in the ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from .placed_boxes import placed_boxes

__all__ = ["is_sunk", "sunk_share_of_class"]

# What is not further below the origin than this share of the height is meant to be in the ground, such as roots.
BELOW_ORIGIN = 0.35


def is_sunk(low: float, high: float) -> bool:
    """Tell whether an object has its origin in its middle and not at its foot, by its lowest and highest point from there [m]."""
    return -low > BELOW_ORIGIN * (high - low)


def sunk_share_of_class(body_class: Any) -> float:
    """Return which share of their height the objects of a class have in the ground; 0 where that is meant to be so."""
    if body_class.offset or body_class.stand_on != "ORIGIN":
        return 0.0
    return max((_sunk_share(box) for size in body_class.sizes for box in placed_boxes(size)), default=0.0)


def _sunk_share(box: np.ndarray) -> float:
    low, high = float(box[:, 2].min()), float(box[:, 2].max())
    # What is below its origin as a whole hangs from there, as lamps do; what is flat is told of as such.
    return -low / (high - low) if high > 0.0 and is_sunk(low, high) else 0.0
