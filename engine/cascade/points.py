"""Points of a surface on a device: cells of them, subsets that keep a distance, and lists of neighbors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.running_sum import running_sum
from ..space.cell_sort import CellSort
from . import kernels_points

__all__ = [
    "Lists",
    "alike",
    "chosen",
    "empty_points",
    "flagged",
    "grid_of",
    "joined",
    "lists_of",
    "nearest_of",
    "places_where",
    "runs_of",
    "same",
    "taken",
    "thinned",
]

# Slots of a table for every point in it.
SLOTS_PER_POINT = 2
# Points that are far denser than they are to be kept are first made as few as there are cells of this share of the distance.
CELLS_OF_RADIUS = 4.0
CROWDED = 0.5
# Such points look into the same direction where their normals, times this, are the same whole numbers: to one of 27 sides.
TURNS_OF_CELL = 1.49
# The same where copies are looked for.
TURNS_OF_SAME = 8.0
# Entries that most lists of neighbors have room for; those of other surfaces are made once more.
ROOM = 64
# Numbers that a run takes in rather than end.
MOST_BETWEEN = 6


@dataclass(frozen=True, eq=False)
class Lists:
    """Lists one after the other: where each starts, ``wp.int32``, shape ``[n + 1]``, and what is in them.

    Numbers, ``wp.int32``; or runs of them, ``wp.vec2i``: the first, and the one behind the last.
    """

    start: wp.array
    entry: wp.array


def empty_points(launcher: Launcher, count: int) -> kernels_points.Points:
    """Points that are still to be written."""
    points = kernels_points.Points()
    points.position = launcher.empty(count, wp.vec3)
    points.normal = launcher.empty(count, wp.vec3)
    points.label = launcher.empty(count, wp.int32)
    return points


def chosen(launcher: Launcher, points: kernels_points.Points, index: wp.array) -> kernels_points.Points:
    """Some of the points, by their numbers, ``wp.int32``."""
    result = empty_points(launcher, len(index))
    launcher.launch(kernels_points.choose_points, len(index), [index, points], [result])
    return result


def taken(launcher: Launcher, index: wp.array, values: wp.array) -> wp.array:
    """Some of some numbers, ``float`` or ``wp.int32``, by their places, ``wp.int32``."""
    kernel = kernels_points.take_amounts if values.dtype == wp.float32 else kernels_points.take_numbers
    result = launcher.empty(len(index), values.dtype)
    launcher.launch(kernel, len(index), [index, values], [result])
    return result


def places_where(launcher: Launcher, mask: np.ndarray) -> wp.array:
    """Where a mask is true, ``wp.int32``, from the first to the last."""
    return launcher.array(np.flatnonzero(mask).astype(np.int32), wp.int32)


def flagged(launcher: Launcher, flag: wp.array) -> wp.array:
    """Places of all ones among zeros and ones, ``wp.int32``, from the first to the last."""
    start, total = running_sum(launcher, flag)
    return _listed(launcher, flag, start, total)


def joined(launcher: Launcher, one: kernels_points.Points, other: kernels_points.Points) -> kernels_points.Points:
    """Some points, and others behind them."""
    count, more = len(one.position), len(other.position)
    result = empty_points(launcher, count + more)
    for to, first, second in (
        (result.position, one.position, other.position),
        (result.normal, one.normal, other.normal),
        (result.label, one.label, other.label),
    ):
        wp.copy(to, first)
        wp.copy(to, second, dest_offset=count)
    return result


def grid_of(launcher: Launcher, position: wp.array, cell: float) -> kernels_points.PointGrid:
    """Sort points into cells of a size."""
    count = len(position)
    slots = _slots_for(count)
    sort = CellSort(launcher, count, slots)
    sort.sort(kernels_points.find_slots, [position, 1.0 / cell, slots - 1])
    grid = kernels_points.PointGrid()
    grid.inverse_size = 1.0 / cell
    grid.mask = slots - 1
    grid.order = sort.order
    grid.start = sort.cell_start
    return grid


def thinned(launcher: Launcher, points: kernels_points.Points, radius: float, *, crowded: bool = True) -> wp.array:
    """Numbers of points that keep a distance: as many that no further one fits in; sheets that look apart do not see each other.

    ``crowded`` is whether most of them may lie nearer to others than a fraction of it.
    """
    few = _one_of_each_cell(launcher, points, radius / CELLS_OF_RADIUS) if crowded else None
    if few is not None:
        return taken(launcher, thinned(launcher, chosen(launcher, points, few), radius), few)
    count = len(points.position)
    grid = grid_of(launcher, points.position, radius)
    kept = launcher.array(np.broadcast_to(np.int32(-1), count), wp.int32)
    kept_count, is_kept = launcher.zeros(grid.mask + 1, wp.int32), launcher.zeros(count, wp.int32)
    for phase in range(8):
        launcher.launch(
            kernels_points.thin_out,
            grid.mask + 1,
            [phase, points, grid, radius],
            [kept, kept_count, is_kept],
            grain=GRAIN_OF_NEIGHBORS,
        )
    return flagged(launcher, is_kept)


def alike(
    launcher: Launcher, points: kernels_points.Points, low: np.ndarray, cell: float, turns: float
) -> tuple[wp.array, wp.array]:
    """Return the first of all points that are alike, and which of these each point is like; both ``wp.int32``.

    Args:
        launcher: Where to run.
        points: The points. They are alike where they lie in one cell, on one part and look into the same direction.
        low: Where cells begin, shape ``[3]``.
        cell: Size of a cell.
        turns: Directions are the same where normals times this are the same whole numbers.
    """
    first, is_first = _first_alike(launcher, points, low, cell, turns)
    start, total = running_sum(launcher, is_first)
    return _listed(launcher, is_first, start, total), taken(launcher, first, start)


def same(launcher: Launcher, points: kernels_points.Points, low: np.ndarray, cell: float) -> tuple[wp.array, wp.array]:
    """Return points of which all others are copies, and which of these each point is the same as; both ``wp.int32``.

    Copies are found among those that are alike (:func:`alike`) in cells of a size that begin at ``low``.
    """
    count = len(points.position)
    first, which = alike(launcher, points, low, cell, TURNS_OF_SAME)
    is_own = launcher.empty(count, wp.int32)
    launcher.launch(kernels_points.mark_own, count, [points, first, which], [is_own])
    start, total = running_sum(launcher, is_own)
    launcher.launch(kernels_points.find_same, count, [first, is_own, start], [which])
    return _listed(launcher, is_own, start, total), which


def _one_of_each_cell(launcher: Launcher, points: kernels_points.Points, cell: float) -> wp.array | None:
    """Numbers of points of which no two are alike (:func:`alike`), from the first to the last; None if nearly all do not."""
    is_first = _first_alike(launcher, points, np.zeros(3), cell, TURNS_OF_CELL)[1]
    start, total = running_sum(launcher, is_first)
    return _listed(launcher, is_first, start, total) if total < CROWDED * len(is_first) else None


def _first_alike(
    launcher: Launcher, points: kernels_points.Points, low: np.ndarray, cell: float, turns: float
) -> tuple[wp.array, wp.array]:
    """For every point the first one that it is like, see :func:`alike`, and whether it is that itself."""
    count = len(points.position)
    slots = _slots_for(count)
    likeness = kernels_points.Likeness()
    likeness.low, likeness.cell, likeness.turns = wp.vec3(*low.tolist()), cell, turns
    sort = CellSort(launcher, count, slots)
    sort.sort(kernels_points.find_slots_of_alike, [points, likeness, slots - 1])
    first, is_first = launcher.empty(count, wp.int32), launcher.empty(count, wp.int32)
    inputs = [points, likeness, slots - 1, sort.order, sort.cell_start]
    launcher.launch(kernels_points.find_first_alike, count, inputs, [first, is_first])
    return first, is_first


def _listed(launcher: Launcher, flag: wp.array, start: wp.array, total: int) -> wp.array:
    """Places of all ones among zeros and ones, of which the running sum is known."""
    result = launcher.empty(total, wp.int32)
    launcher.launch(kernels_points.list_flagged, len(flag), [flag, start], [result])
    return result


def _slots_for(count: int) -> int:
    """Slots of a table of so many points: a power of two."""
    return 1 << max(4, (SLOTS_PER_POINT * count - 1).bit_length())


def nearest_of(
    launcher: Launcher, points: kernels_points.Points, others: kernels_points.Points, reach: float, turn: float
) -> wp.array:
    """Nearest of ``others`` for every point; see :func:`.kernels_points.find_nearest`."""
    result = launcher.empty(len(points.position), wp.int32)
    launcher.launch(
        kernels_points.find_nearest,
        len(points.position),
        [points, others, grid_of(launcher, others.position, reach), reach, turn],
        [result],
        grain=GRAIN_OF_NEIGHBORS,
    )
    return result


def lists_of(
    launcher: Launcher,
    points: kernels_points.Points,
    others: kernels_points.Points,
    reach: float,
    least_cosine: float = -2.0,
    related: tuple[wp.array, int] | None = None,
) -> Lists:
    """The ``others`` within ``reach`` of every point, on its part.

    And on those that have to do with it, by an array and where in it that begins; see :mod:`esh.engine.surface.kernels_relations`.
    """
    n = len(points.position)
    numbers, relations = (launcher.zeros(1, wp.int32), 0) if related is None else related
    inputs = [points, others, grid_of(launcher, others.position, reach), numbers, relations, reach, least_cosine]
    count = launcher.empty(n, wp.int32)

    def fill(start: wp.array, entry: wp.array) -> None:
        launcher.launch(kernels_points.list_near, n, [*inputs, start], [entry, count], grain=GRAIN_OF_NEIGHBORS)

    roomy = launcher.empty(ROOM * n, wp.int32)
    fill(launcher.array(np.arange(0, ROOM * n + 1, ROOM, dtype=np.int32), wp.int32), roomy)
    start, total = running_sum(launcher, count)
    entry = launcher.empty(max(total, 1), wp.int32)
    if n and int(count.numpy().max()) <= ROOM:
        launcher.launch(kernels_points.close_up, n, [ROOM, roomy, start], [entry])
    else:
        fill(start, entry)
    return Lists(start, entry)


def runs_of(launcher: Launcher, lists: Lists, others: kernels_points.Points) -> Lists:
    """Lists of numbers of ``others`` as runs of them; with a few more, so that the CPU, which takes several at once, has fewer."""
    between = 0 if launcher.device.is_cuda else MOST_BETWEEN
    n = len(lists.start) - 1
    count = launcher.empty(n, wp.int32)
    launcher.launch(
        kernels_points.count_runs,
        n,
        [lists.start, others.label, between],
        [lists.entry, count],
        grain=GRAIN_OF_NEIGHBORS,
    )
    start, total = running_sum(launcher, count)
    run = launcher.empty(max(total, 1), wp.vec2i)
    inputs = [lists.start, others.label, between, lists.entry, start]
    launcher.launch(kernels_points.list_runs, n, inputs, [run], grain=GRAIN_OF_NEIGHBORS)
    return Lists(start, run)
