"""The kernel that finds every body's nearest neighbour."""

from __future__ import annotations

import warp as wp

from .kernels_cells import CellGrid
from .kernels_mesh import wrap

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_nearest(
    first: int,
    position: wp.array(dtype=wp.vec2),
    inverse_spacing: wp.array(dtype=float),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    # outputs
    nearest: wp.array(dtype=float),
):
    """Find each body's nearest neighbour in units of its own spacing."""
    i = first + wp.tid()
    p = position[i]
    cx = wp.clamp(int(p[0] * grid.inverse_size[0]), 0, grid.count_x - 1)
    cy = wp.clamp(int(p[1] * grid.inverse_size[1]), 0, grid.count_y - 1)
    closest = float(1.0e6)
    # Fewer than three cells along a periodic axis would be visited twice.
    low_x = wp.where(grid.periodic != 0 and grid.count_x < 3, -cx, -1)
    high_x = wp.where(grid.periodic != 0 and grid.count_x < 3, grid.count_x - 1 - cx, 1)
    low_y = wp.where(grid.periodic != 0 and grid.count_y < 3, -cy, -1)
    high_y = wp.where(grid.periodic != 0 and grid.count_y < 3, grid.count_y - 1 - cy, 1)
    for b in range(low_y, high_y + 1):
        row = cy + b
        if grid.periodic != 0:
            row = wrap(row, grid.count_y)
        if row >= 0 and row < grid.count_y:
            for a in range(low_x, high_x + 1):
                column = cx + a
                if grid.periodic != 0:
                    column = wrap(column, grid.count_x)
                if column >= 0 and column < grid.count_x:
                    cell = row * grid.count_x + column
                    for s in range(cell_start[cell], cell_start[cell + 1]):
                        j = order[s]
                        if j != i:
                            d = position[j] - p
                            if grid.periodic != 0:
                                d = wp.vec2(
                                    d[0] - grid.domain[0] * wp.round(d[0] / grid.domain[0]),
                                    d[1] - grid.domain[1] * wp.round(d[1] / grid.domain[1]),
                                )
                            distance = wp.length(d)
                            closest = wp.min(closest, distance * inverse_spacing[i])
    nearest[i] = closest
