"""Kernels that find every body's nearest neighbour."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import CellGrid
from ..space.kernels_images import Images, density_pixel
from ..space.kernels_space import difference, wrap

wp.set_module_options({"enable_backward": False})

# Farther than any neighbour.
NONE = wp.constant(1.0e6)


@wp.kernel
def find_number_density(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    per_pixel: wp.array(dtype=float),
    images: Images,
    domain: wp.vec2,
    # outputs
    number_density: wp.array(dtype=float),
):
    """Sum of what all classes ask for at every body: their pixels times the number that a pixel stands for."""
    i = first + wp.tid()
    at = wp.vec2(pose[i][0], pose[i][1])
    total = float(0.0)
    for k in range(per_pixel.shape[0]):
        total += per_pixel[k] * images.pixel[density_pixel(at, k, images, domain)]
    number_density[i] = total


@wp.kernel
def find_nearest(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    number_density: wp.array(dtype=float),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    # outputs
    nearest: wp.array(dtype=float),
    share: wp.array(dtype=float),
):
    """How far each body's nearest neighbour is, and that over the spacing that is asked for where it is; 1e6 where none is in sight.

    Where nothing is asked for there is no spacing, either: a share of 1e6.
    """
    i = first + wp.tid()
    p = wp.vec2(pose[i][0], pose[i][1])
    cx = wp.clamp(int(p[0] * grid.inverse_size[0]), 0, grid.count_x - 1)
    cy = wp.clamp(int(p[1] * grid.inverse_size[1]), 0, grid.count_y - 1)
    closest = float(NONE)
    # Fewer than three cells along a periodic axis would be visited twice.
    low_x = wp.where(grid.space.periodic != 0 and grid.count_x < 3, -cx, -1)
    high_x = wp.where(grid.space.periodic != 0 and grid.count_x < 3, grid.count_x - 1 - cx, 1)
    low_y = wp.where(grid.space.periodic != 0 and grid.count_y < 3, -cy, -1)
    high_y = wp.where(grid.space.periodic != 0 and grid.count_y < 3, grid.count_y - 1 - cy, 1)
    for b in range(low_y, high_y + 1):
        row = cy + b
        if grid.space.periodic != 0:
            row = wrap(row, grid.count_y)
        if row >= 0 and row < grid.count_y:
            for a in range(low_x, high_x + 1):
                column = cx + a
                if grid.space.periodic != 0:
                    column = wrap(column, grid.count_x)
                if column >= 0 and column < grid.count_x:
                    cell = row * grid.count_x + column
                    for s in range(cell_start[cell], cell_start[cell + 1]):
                        j = order[s]
                        if j != i:
                            d = difference(p, wp.vec2(pose[j][0], pose[j][1]), grid.space)
                            closest = wp.min(closest, wp.length(d))
    nearest[i] = closest
    share[i] = NONE
    if closest < NONE and number_density[i] > 0.0:
        share[i] = closest * wp.sqrt(number_density[i])
