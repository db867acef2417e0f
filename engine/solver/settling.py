"""Steps after an edit in which only bodies near a change move: those that came find their places among those that were there."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from . import kernels_settling
from .descent import Descent

__all__ = ["settle_near"]

# Width of a cell in mean spacings; who is in a cell beside one with a change is near it, which is two to four spacings. Measured on
# strokes that leave a fifth of a density: with one to two spacings, steps hardly help.
CELL_OVER_SPACING = 2.0
# Where changes are near more than this share of the domain, all bodies have to move, which they do in the steps that follow.
MOST_NEAR = 0.5
# What counts of the forces farther away: a share of 0 would divide by 0.
LEAST = 1e-4


def settle_near(descent: Descent, places: np.ndarray, steps: int) -> None:
    """Take steps in which bodies far from some places hardly move.

    Args:
        descent: Of a rectangle.
        places: Where bodies came, went or were moved, in the model's unit, shape ``[m, 2]``.
        steps: How many.
    """
    near = _cells_near(descent, places)
    if not near.any() or near.mean() > MOST_NEAR:
        return
    launcher, layout = descent.launcher, descent.field.layout
    whole = wp.clone(descent.step_length)
    launcher.launch(
        kernels_settling.hold_far_away,
        len(whole),
        [
            layout.for_kernels(),
            launcher.array(near.ravel(), wp.uint8),
            near.shape[0],
            near.shape[1],
            wp.vec2(*descent.model.size),
            LEAST,
        ],
        [descent.step_length],
    )
    descent.step.play(steps)
    wp.copy(descent.step_length, whole)


def _cells_near(descent: Descent, places: np.ndarray) -> np.ndarray:
    """Which cells of the domain are near a place, shape ``[rows, columns]``, bool, row 0 at the bottom."""
    model = descent.model
    size = np.array(model.size)
    cell = CELL_OVER_SPACING * math.sqrt(size[0] * size[1] / model.body_count)
    columns, rows = np.maximum(1, np.ceil(size / cell)).astype(int).tolist()
    column, row = (
        np.clip((places[:, axis] * (count / size[axis])).astype(int), 0, count - 1)
        for axis, count in enumerate((columns, rows))
    )
    marked = np.zeros((rows, columns), bool)
    marked[row, column] = True
    around = np.pad(marked, 1, mode="constant" if model.space.has_edges else "wrap")
    wide = around[:, :-2] | around[:, 1:-1] | around[:, 2:]
    return wide[:-2] | wide[1:-1] | wide[2:]
