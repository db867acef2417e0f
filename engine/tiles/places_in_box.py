"""Where bodies of a tile or of a window may be: where there is something of their density, and rounded as files hold it."""

from __future__ import annotations

import math

import numpy as np

from ..model.model import Model
from ..space.density import move_into_support
from .layout import Box, within
from .plan import Plan

__all__ = ["rounded_places", "within_support"]

# Positions are rounded to this share of a spacing, less than float32 holds of them in a window: files are smaller.
ROUNDING = 2.0**-18


def within_support(model: Model, local: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Positions from a box's corner [m], of which the chosen ones are brought to where they may be."""
    result = local.copy()
    for k, support in enumerate(model.supports):
        if (support > 0.0).all() or not support.any():
            continue
        own = chosen & (model.body.support == k)
        result[own] = move_into_support(support, result[own], model.problem.rectangle.size)
    return result


def rounded_places(plan: Plan, box: Box, model: Model, local: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Positions in the domain [m] of bodies of a box, shape ``[n, 2]``: rounded, inside it, and the chosen ones where they may be.

    Args:
        plan: What is solved in tiles.
        box: Where they are.
        model: Made of these bodies.
        local: Positions from the box's lower left corner [m], shape ``[n, 2]``.
        chosen: Which of them are to be where their densities are above 0, bool, shape ``[n]``.
    """
    grain = 2.0 ** math.floor(math.log2(plan.spacing * ROUNDING))
    rounded = np.empty_like(local)
    for axis in (0, 1):
        rounded[:, axis] = np.rint((local[:, axis] + box.low[axis]) / grain)
    rounded *= grain
    rounded = box.confine(rounded)
    if all((support > 0.0).all() for support in model.supports):
        return rounded
    low = np.array(box.low)
    inside = within(rounded - low, (0.0, 0.0), box.size)
    result = within_support(model, inside, chosen & (model.body.kind < 0))
    return box.confine(np.where(result == inside, rounded, result + low))
