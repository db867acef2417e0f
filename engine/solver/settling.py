"""Steps after an edit in which only bodies near a change move: those that came find their places among those that were there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

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


def settle_near(descent: Descent, places: Sequence[wp.array], steps: int) -> None:
    """Take steps in which bodies far from some places hardly move.

    Args:
        descent: Of a rectangle.
        places: Where bodies came, went or were moved, in the model's unit, each ``wp.vec2``.
        steps: How many.
    """
    launcher, layout, size = descent.launcher, descent.field.layout, descent.model.size
    cell = CELL_OVER_SPACING * math.sqrt(size[0] * size[1] / descent.model.body_count)
    columns, rows = (max(1, math.ceil(length / cell)) for length in size)
    cells = [rows, columns, wp.vec2(*size)]
    near, share = _cells_near(descent, places, cells)
    if not 0.0 < share <= MOST_NEAR:
        return
    whole = wp.clone(descent.step_length)
    launcher.launch(
        kernels_settling.hold_far_away,
        len(whole),
        [layout.for_kernels(), near, *cells, LEAST],
        [descent.step_length],
    )
    descent.step.play(steps)
    wp.copy(descent.step_length, whole)


def _cells_near(descent: Descent, places: Sequence[wp.array], cells: list[Any]) -> tuple[wp.array, float]:
    """Which cells of the domain are near a place, ``wp.uint8``, row 0 at the bottom, and their share.

    ``cells`` are how many rows and columns there are, and the extent of the domain.
    """
    launcher, (rows, columns, _) = descent.launcher, cells
    marked = launcher.zeros(rows * columns, wp.int32)
    for place in places:
        launcher.launch(kernels_settling.mark_places, len(place), [place, *cells], [marked])
    near = launcher.empty(rows * columns, wp.uint8)
    count = launcher.zeros(launcher.thread_count, wp.int32)
    launcher.launch(
        kernels_settling.mark_beside,
        rows * columns,
        [marked, rows, columns, descent.model.space.for_kernels()],
        [near, count],
        per_thread=True,
    )
    return near, int(count.numpy().sum()) / (rows * columns)
