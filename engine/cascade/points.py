"""Points of a surface on a device: cells of them, subsets that keep a distance, and lists of neighbors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.running_sum import running_sum
from ..space.cell_sort import CellSort
from . import kernels_points
from .native_lanes import LANES

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
    "room_for",
    "runs_of",
    "same",
    "taken",
    "thinned",
]

# Slots of a hash table per point in it.
SLOTS_PER_POINT = 2
# Before points are thinned out to a distance, one is taken of every cell with this fraction of it as its side, if that leaves less
# than CROWDED of them.
CELLS_OF_RADIUS = 4.0
CROWDED = 0.5
# Normals count as alike if they round to the same whole numbers after they are multiplied by this. Here that makes 27 directions.
TURNS_OF_CELL = 1.49
# The same where exact copies are looked for.
TURNS_OF_SAME = 8.0
# Lists of neighbors are first made with room for this many entries each. If one needs more, all are made again.
ROOM = 64
# A run of numbers goes on over a gap of up to this many.
MOST_BETWEEN = 6


@dataclass(frozen=True, eq=False)
class Lists:
    """Lists in one array, as the rows of a sparse matrix.

    Attributes:
        start: Where each list starts, ``wp.int32``, shape ``[n + 1]``.
        entry: What is in them: numbers, ``wp.int32``, or runs of numbers, ``wp.vec2i``, each from its first number up to the second,
            which is not in it.
    """

    start: wp.array
    entry: wp.array


def empty_points(launcher: Launcher, count: int) -> kernels_points.Points:
    """Return arrays for points."""
    points = kernels_points.Points()
    points.position = launcher.empty(count, wp.vec3)
    points.normal = launcher.empty(count, wp.vec3)
    points.label = launcher.empty(count, wp.int32)
    return points


def room_for(launcher: Launcher, count: int, dtype: type) -> wp.array:
    """Return an array for what lists hold, one element at least; kernels may read several at once, beyond the last one."""
    return launcher.empty(count + LANES, dtype)[: max(count, 1)]


def chosen(launcher: Launcher, points: kernels_points.Points, index: wp.array) -> kernels_points.Points:
    """Return the points with these numbers, ``wp.int32``."""
    result = empty_points(launcher, len(index))
    launcher.launch(kernels_points.choose_points, len(index), [index, points], [result])
    return result


def taken(launcher: Launcher, index: wp.array, values: wp.array) -> wp.array:
    """Return the values, ``float`` or ``wp.int32``, at these indices, ``wp.int32``."""
    kernel = kernels_points.take_amounts if values.dtype == wp.float32 else kernels_points.take_numbers
    result = launcher.empty(len(index), values.dtype)
    launcher.launch(kernel, len(index), [index, values], [result])
    return result


def places_where(launcher: Launcher, mask: np.ndarray) -> wp.array:
    """Return the indices at which a mask is true, ascending, ``wp.int32``."""
    return launcher.array(np.flatnonzero(mask).astype(np.int32), wp.int32)


def flagged(launcher: Launcher, flag: wp.array) -> wp.array:
    """Return the indices of all ones in an array of zeros and ones, ascending, ``wp.int32``."""
    start, total = running_sum(launcher, flag)
    return _listed(launcher, flag, start, total)


def joined(launcher: Launcher, one: kernels_points.Points, other: kernels_points.Points) -> kernels_points.Points:
    """Return the points of one, followed by those of the other."""
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
    """Sort points into cells of a size, in a hash table."""
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
    """Return the numbers of points that keep a distance, so many that none of the others fits between them.

    Only distances within one sheet count: points on the two sides of a thin wall may be close.

    Args:
        launcher: Where to run.
        points: The points.
        radius: The distance.
        crowded: Whether most points may be much closer to each other than that, so that it is worth taking one of each cell first.
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
    """Group points that are alike: that lie in one cell, on one part of the surface, and have about the same normal.

    Args:
        launcher: Where to run.
        points: The points.
        low: Lowest corner of the cells, shape ``[3]``.
        cell: Size of a cell.
        turns: Normals are about the same if they round to the same whole numbers after they are multiplied by this.

    Returns:
        The first point of every group, and the group of every point; both ``wp.int32``.
    """
    first, is_first = _first_alike(launcher, points, low, cell, turns)
    start, total = running_sum(launcher, is_first)
    return _listed(launcher, is_first, start, total), taken(launcher, first, start)


def same(launcher: Launcher, points: kernels_points.Points, low: np.ndarray, cell: float) -> tuple[wp.array, wp.array]:
    """Find exact copies among points that are alike; for the arguments see :func:`alike`.

    Returns:
        Points of which all others are copies, and which of these each point is the same as; both ``wp.int32``.
    """
    count = len(points.position)
    first, which = alike(launcher, points, low, cell, TURNS_OF_SAME)
    is_own = launcher.empty(count, wp.int32)
    launcher.launch(kernels_points.mark_own, count, [points, first, which], [is_own])
    start, total = running_sum(launcher, is_own)
    launcher.launch(kernels_points.find_same, count, [first, is_own, start], [which])
    return _listed(launcher, is_own, start, total), which


def _one_of_each_cell(launcher: Launcher, points: kernels_points.Points, cell: float) -> wp.array | None:
    """Return the numbers of points of which no two are alike (:func:`alike`), ascending; None if these are most of the points."""
    is_first = _first_alike(launcher, points, np.zeros(3), cell, TURNS_OF_CELL)[1]
    start, total = running_sum(launcher, is_first)
    return _listed(launcher, is_first, start, total) if total < CROWDED * len(is_first) else None


def _first_alike(
    launcher: Launcher, points: kernels_points.Points, low: np.ndarray, cell: float, turns: float
) -> tuple[wp.array, wp.array]:
    """Return for every point the first one of its group, see :func:`alike`, and whether it is that point itself."""
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
    """Return the indices of all ones in an array of zeros and ones, whose running sum is known."""
    result = launcher.empty(total, wp.int32)
    launcher.launch(kernels_points.list_flagged, len(flag), [flag, start], [result])
    return result


def _slots_for(count: int) -> int:
    """Return the number of slots of a hash table for so many points, a power of two."""
    return 1 << max(4, (SLOTS_PER_POINT * count - 1).bit_length())


def nearest_of(
    launcher: Launcher, points: kernels_points.Points, others: kernels_points.Points, reach: float, turn: float
) -> wp.array:
    """Return the nearest of ``others`` within ``reach`` for every point, or -1; see :func:`.kernels_points.find_nearest`."""
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
    """List for every point the ``others`` near it that it sees.

    Args:
        launcher: Where to run.
        points: The points.
        others: The points that are listed.
        reach: Greatest distance.
        least_cosine: Least cosine between the two normals.
        related: Which parts of the surface see each other, and where in that array this begins, see
            :mod:`esh.engine.surface.kernels_relations`. None: a point sees its own part only.
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
    entry = room_for(launcher, total, wp.int32)
    if n and int(count.numpy().max()) <= ROOM:
        launcher.launch(kernels_points.close_up, n, [ROOM, roomy, start], [entry])
    else:
        fill(start, entry)
    return Lists(start, entry)


def runs_of(launcher: Launcher, lists: Lists, others: kernels_points.Points) -> Lists:
    """Turn lists of numbers of ``others`` into lists of runs of them.

    On a CPU, which takes several points at once, small gaps are filled so that there are fewer runs: these list a few points more.
    """
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
