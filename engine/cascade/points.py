"""Points of a surface on a device: cells of them, subsets that keep a distance, and lists of neighbors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from . import kernels_points

__all__ = [
    "Lists",
    "chosen",
    "empty_points",
    "grid_of",
    "joined",
    "lists_of",
    "nearest_of",
    "running_sum",
    "runs_of",
    "thinned",
]

# Slots of a table for every point in it.
SLOTS_PER_POINT = 2
# Points that are far denser than they are to be kept are first made as few as there are cells of this share of the distance.
CELLS_OF_RADIUS = 4.0
CROWDED = 0.5
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


def chosen(launcher: Launcher, points: kernels_points.Points, index: np.ndarray) -> kernels_points.Points:
    """Some of the points."""
    result = empty_points(launcher, len(index))
    numbers = wp.array(index.astype(np.int32), dtype=wp.int32, device=launcher.device)
    launcher.launch(kernels_points.choose_points, len(index), [numbers, points], [result])
    return result


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
    slots = 1 << max(4, (SLOTS_PER_POINT * count - 1).bit_length())
    sort = CellSort(launcher, count, slots)
    sort.sort(kernels_points.find_slots, [position, 1.0 / cell, slots - 1])
    grid = kernels_points.PointGrid()
    grid.inverse_size = 1.0 / cell
    grid.mask = slots - 1
    grid.order = sort.order
    grid.start = sort.cell_start
    return grid


def thinned(launcher: Launcher, points: kernels_points.Points, radius: float) -> np.ndarray:
    """Numbers of points that keep a distance: as many that no further one fits in; sheets that look apart do not see each other."""
    few = _one_of_each_cell(points, radius / CELLS_OF_RADIUS)
    if few is not None:
        return few[thinned(launcher, chosen(launcher, points, few), radius)]
    count = len(points.position)
    grid = grid_of(launcher, points.position, radius)
    kept = wp.array(np.full(count, -1, np.int32), dtype=wp.int32, device=launcher.device)
    kept_count = launcher.zeros(grid.mask + 1, wp.int32)
    for phase in range(8):
        launcher.launch(
            kernels_points.thin_out,
            grid.mask + 1,
            [phase, points, grid, radius],
            [kept, kept_count],
            grain=GRAIN_OF_NEIGHBORS,
        )
    numbers = kept.numpy()
    return np.sort(numbers[numbers >= 0])


def _one_of_each_cell(points: kernels_points.Points, cell: float) -> np.ndarray | None:
    """Numbers of points of which no two lie in one cell, on one part and look into the same direction; None if nearly all do not."""
    position, normal = points.position.numpy(), points.normal.numpy()
    key = points.label.numpy().astype(np.int64)
    # Where numbers grow beyond 64 bits, they go round: cells that then share one lose a point, no more.
    for axis in range(3):
        place = np.floor(position[:, axis] / cell).astype(np.int64)
        place -= place.min()
        key = key * (int(place.max()) + 1) + place
    for axis in range(3):
        key = 3 * key + np.round(normal[:, axis] * 1.49).astype(np.int64) + 1
    few = np.unique(key, return_index=True)[1]
    return np.sort(few) if len(few) < CROWDED * len(key) else None


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
) -> Lists:
    """The ``others`` within ``reach`` of every point."""
    n = len(points.position)
    inputs = [points, others, grid_of(launcher, others.position, reach), reach, least_cosine]
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


def runs_of(launcher: Launcher, lists: Lists) -> Lists:
    """Lists of numbers as runs of them; with a few more numbers, so that the CPU, which takes several at once, has fewer runs."""
    between = 0 if launcher.device.is_cuda else MOST_BETWEEN
    n = len(lists.start) - 1
    count = launcher.empty(n, wp.int32)
    launcher.launch(
        kernels_points.count_runs, n, [lists.start, between], [lists.entry, count], grain=GRAIN_OF_NEIGHBORS
    )
    start, total = running_sum(launcher, count)
    run = launcher.empty(max(total, 1), wp.vec2i)
    inputs = [lists.start, between, lists.entry, start]
    launcher.launch(kernels_points.list_runs, n, inputs, [run], grain=GRAIN_OF_NEIGHBORS)
    return Lists(start, run)


def running_sum(launcher: Launcher, count: wp.array) -> tuple[wp.array, int]:
    """Where lists of so many entries start, and how many entries there are."""
    start = np.zeros(len(count) + 1, np.int64)
    np.cumsum(count.numpy(), out=start[1:])
    return wp.array(start.astype(np.int32), dtype=wp.int32, device=launcher.device), int(start[-1])
