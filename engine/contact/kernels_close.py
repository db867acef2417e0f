"""A kernel that finds bodies which stand closer to another one than any should."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import CellGrid, column_and_row
from ..space.kernels_mesh import Mesh, nearest_node
from ..space.kernels_space import Space, difference, number_across, numbers_beside

wp.set_module_options({"enable_backward": False})


@wp.func
def anybody_within(
    i: int,
    nearest: float,
    start: int,
    end: int,
    position: wp.array(dtype=wp.vec2),
    share: wp.array(dtype=float),
    order: wp.array(dtype=wp.int32),
    space: Space,
):
    """Whether any of some bodies is nearer to body ``i``, by the smaller share of the two."""
    found = int(0)
    for s in range(start, end):
        j = order[s]
        away = wp.length(difference(position[i], position[j], space))
        if j != i and away < nearest * wp.min(share[i], share[j]):
            found = 1
    return found


@wp.kernel
def find_close(
    first: int,
    position: wp.array(dtype=wp.vec2),
    share: wp.array(dtype=float),
    limit: wp.array(dtype=float),
    per_limit: float,
    mesh: Mesh,
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    # outputs
    close: wp.array(dtype=wp.uint8),
):
    """Whether another body is nearer than ``per_limit`` times the ``limit`` of a step here, of which each has a ``share``.

    It is looked for in the cells around.
    """
    i = first + wp.tid()
    p = position[i]
    nearest = per_limit * limit[nearest_node(p, mesh)]
    cx, cy = column_and_row(p, grid)
    rows = numbers_beside(cy, grid.count_y, grid.space)
    columns = numbers_beside(cx, grid.count_x, grid.space)
    found = int(0)
    for y in range(rows[0], rows[1] + 1):
        row = number_across(y, grid.count_y, grid.space)
        for x in range(columns[0], columns[1] + 1):
            column = number_across(x, grid.count_x, grid.space)
            if row >= 0 and row < grid.count_y and column >= 0 and column < grid.count_x:
                cell = row * grid.count_x + column
                found = wp.max(
                    found,
                    anybody_within(
                        i, nearest, cell_start[cell], cell_start[cell + 1], position, share, order, grid.space
                    ),
                )
    close[i] = wp.uint8(found)
