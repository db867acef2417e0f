"""Steps after an edit: all bodies settle for a while; then those that have moved least are held near where they were.

Wherever bodies came or went, their neighbors have to make room, or to close a gap. The flow that makes up for one body falls with the
distance from it, so that most others need less than a tenth of a spacing: held there, they lose little, and an edit leaves alone what
it does not need to change. Who needs more is seen from how far bodies have moved, after every step anew; what is far from all changes
never does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from . import kernels_settling
from .carried_over import CarriedInPlane
from .descent import STEP_LIMIT, Descent

__all__ = ["settle"]

# Bodies settle for so many steps, the fewer the more of them there are, and are held in a few more before those that an edit is asked
# for. Measured on strokes over a twentieth of a photograph that leave a fifth or half of its density, and the count as it was, by the
# coverage error at a spacing after 5 more steps over that after 100 more: 8 steps 1.21 to 1.29, 12 steps 1.16 to 1.24.
FEWEST_SETTLING, MOST_SETTLING = 8, 12
BODIES_TO_SETTLE = 2_000_000
HELD_STEPS = 2
# How far bodies that are held are from where they were, at most, in mean spacings, or in as many times the local spacing as the second
# number where that is less: nobody sees a tenth of a spacing.
HELD_WITHIN, LOCALLY = 0.098, 1.5
# Share of all bodies that may move farther; and where more than a tenth of all came or went, how many may for each of these. Measured:
# with a share of 0.24 the errors above are 0.02 less, and a twentieth more of the bodies move that are far from the stroke. Where a
# density of hills becomes an even one a quarter of all go, and errors are 1.5 times the later ones; with a fifth that is free 2.7 to
# 3.4.
MOST_FREE, FREE_FOR_EACH = 0.2, 2.2
# Width of a cell in mean spacings; who is in a cell beside one with a change is near it, which is two to four spacings.
CELL_OVER_SPACING = 2.0


def settle(descent: Descent, carried: CarriedInPlane, steps: int) -> None:
    """Take the steps after an edit.

    Args:
        descent: Of a rectangle.
        carried: Who its bodies are.
        steps: How many to take behind those in which bodies settle; where nothing came, went or was moved, there are no others.
    """
    if not any(len(places) for places in carried.changes):
        descent.step.play(steps)
        return
    launcher, count, (width, height) = descent.launcher, descent.model.body_count, descent.model.size
    spacing = math.sqrt(width * height / count)
    reach = kernels_settling.Reach()
    reach.mesh, reach.limit = descent.field.mesh, descent.step_limit
    reach.within, reach.locally = HELD_WITHIN * spacing, HELD_WITHIN * LOCALLY / STEP_LIMIT
    most_free = max(MOST_FREE * count, FREE_FOR_EACH * max(len(carried.came), len(carried.went)))
    start, pose = wp.clone(descent.state.pose), descent.state.pose
    cells = _near(descent, carried.changes, CELL_OVER_SPACING * spacing)
    where = [start, carried.sources, cells, reach, descent.model.space.for_kernels()]
    moved = launcher.empty((launcher.thread_count, kernels_settling.BINS), wp.int32)
    descent.step.play(min(max(BODIES_TO_SETTLE // count, FEWEST_SETTLING), MOST_SETTLING))
    for _ in range(HELD_STEPS + steps):
        descent.step.play()
        moved.zero_()
        launcher.launch(kernels_settling.count_moved, count, [*where, pose], [moved], per_thread=True)
        launcher.launch(
            kernels_settling.hold,
            count,
            [*where, _free_from(moved.numpy(), most_free), descent.bodies, descent.images, descent.state.bend],
            [pose, descent.state.displacement],
        )
        descent.place_charges()


def _near(descent: Descent, changes: Sequence[wp.array], width: float) -> kernels_settling.Cells:
    """The cells of the domain, of about this width, that are beside one with a change."""
    launcher, size = descent.launcher, descent.model.size
    cells = kernels_settling.Cells()
    cells.rows, cells.columns = (max(1, math.ceil(length / width)) for length in size[::-1])
    cells.size = wp.vec2(*size)
    cells.near = launcher.empty(cells.rows * cells.columns, wp.uint8)
    marked = launcher.zeros(cells.rows * cells.columns, wp.int32)
    for places in changes:
        launcher.launch(kernels_settling.mark_places, len(places), [places, cells], [marked])
    space = descent.model.space.for_kernels()
    launcher.launch(kernels_settling.mark_beside, len(marked), [marked, space], [cells])
    return cells


def _free_from(moved: np.ndarray, most_free: float) -> int:
    """From which bin on bodies are free, where threads have counted ``moved`` in all but the first.

    Those in the first one never are, and those in the last one always.
    """
    # How many moved at least as far as where every bin begins.
    farther = np.cumsum(moved.sum(axis=0)[::-1])[::-1]
    return min(1 + int((farther[1:] > most_free).sum()), kernels_settling.BINS - 1)
