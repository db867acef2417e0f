"""A different body for each of some points: the nearest that is left, whoever comes first."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.cell_sort import CellSort
from . import kernels_nearest
from .kernels_edit import Around

__all__ = ["nearest_free"]

# A point that has not asked yet.
NOT_ASKED = -2
# Turns of a GPU between two looks at whether any point still asks.
TURNS_AT_ONCE = 8


def nearest_free(
    launcher: Launcher, points: wp.array, body: wp.array, pose: wp.array, around: Around, cells: int
) -> wp.array:
    """Return a place in ``body`` for every point, each another one: the nearest that is left of those in the cells around it.

    Args:
        launcher: Where to run.
        points: In the unit of the poses, ``wp.vec2``, shape ``[m]``.
        body: Bodies to choose from, ``wp.int32``.
        pose: Poses of all bodies, ``wp.vec4``.
        around: A rectangle that holds all of them.
        cells: How many there are along either side of it.

    Returns:
        ``wp.int32``, shape ``[m]``, or as many as there are bodies where those are fewer: then all of them.
    """
    if len(points) >= len(body) or not len(points):
        return launcher.array(np.arange(len(body) if len(points) else 0, dtype=np.int32), wp.int32)
    sort = CellSort(launcher, len(body), cells * cells, spread=True)
    sort.sort(kernels_nearest.find_cells, [body, pose, cells, around])
    candidates = kernels_nearest.Candidates()
    candidates.body, candidates.pose, candidates.cells, candidates.around = body, pose, cells, around
    candidates.order, candidates.cell_start = sort.order, sort.cell_start
    on_device, any_missed = _first_come(launcher, points, candidates)
    if not any_missed:
        return on_device
    # Points far from all bodies.
    chosen, free = on_device.numpy().copy(), np.ones(len(body), bool)
    missed = np.flatnonzero(chosen < 0)
    free[chosen[chosen >= 0]] = False
    left = np.flatnonzero(free)
    chosen[missed] = left[np.linspace(0, len(left) - 1, len(missed)).astype(np.int64)]
    return launcher.array(chosen, wp.int32)


def _first_come(launcher: Launcher, point: wp.array, candidates: kernels_nearest.Candidates) -> tuple[wp.array, bool]:
    """Which candidate every point gets, -1 for none, ``wp.int32``, shape ``[m]``; and whether any has none."""
    count = len(point)
    chosen, holder = launcher.empty(count, wp.int32), launcher.empty(len(candidates.body), wp.int32)
    last_turn = launcher.zeros(2, wp.int32)
    chosen.fill_(NOT_ASKED)
    holder.fill_(count)
    # On a GPU all ask at once, and who is turned away asks for the next: whoever comes first gets it in the end, in whatever order
    # they ask. On the CPU one thread lets them ask one after the other, and none is turned away.
    at_once = TURNS_AT_ONCE if launcher.device.is_cuda else 1
    turn = 0
    while True:
        for _ in range(at_once):
            turn += 1
            arguments = [point, candidates, turn]
            launcher.launch(kernels_nearest.ask_nearest, count, arguments, [chosen, holder, last_turn], grain=count)
        got, missed = last_turn.numpy().tolist()
        if not launcher.device.is_cuda or got < turn:
            return chosen, missed > 0
