"""Kernels that measure a placement."""

from __future__ import annotations

import warp as wp

from .kernels_cells import CellGrid, cell_of
from .kernels_mesh import wrap
from .kernels_update import Images, density_pixel

wp.set_module_options({"enable_backward": False})


# Charges are added as integers in units of 2^-30 of the mean charge, so that the sum depends on no order.
CLOUD_SCALE = wp.constant(1073741824.0)


# wp.atomic_add is not atomic on the CPU, where several threads add to a cell.
_ADD = """
#if defined(__CUDA_ARCH__)
    atomicAdd((unsigned long long*)grid.data + cell, (unsigned long long)amount);
#else
    __atomic_fetch_add((long long*)grid.data + cell, (long long)amount, __ATOMIC_RELAXED);
#endif
"""


@wp.func_native(_ADD)
def add_at_once(grid: wp.array(dtype=wp.int64), cell: int, amount: wp.int64): ...


@wp.kernel
def deposit_clouds(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    charge: wp.array(dtype=float),
    class_index: wp.array(dtype=wp.int32),
    one: int,
    rows: int,
    columns: int,
    domain: wp.vec2,
    periodic: int,
    # outputs
    grid: wp.array(dtype=wp.int64),
):
    """Share every charge of class ``one`` (or, below 0, of all classes) among the four nearest cells."""
    i = first + wp.tid()
    if one >= 0 and class_index[i] != one:
        return
    u = pose[i][0] / domain[0] * float(columns) - 0.5
    v = pose[i][1] / domain[1] * float(rows) - 0.5
    left = int(wp.floor(u))
    low = int(wp.floor(v))
    for b in range(2):
        row = low + b
        weight_y = 1.0 - wp.abs(v - float(row))
        for a in range(2):
            column = left + a
            weight = weight_y * (1.0 - wp.abs(u - float(column)))
            r = wp.clamp(row, 0, rows - 1)
            c = wp.clamp(column, 0, columns - 1)
            if periodic != 0:
                r = wrap(row, rows)
                c = wrap(column, columns)
            add_at_once(grid, r * columns + c, wp.int64(wp.round(charge[i] * weight * CLOUD_SCALE)))


@wp.kernel
def empty_cells(
    first: int,
    # outputs
    grid: wp.array(dtype=wp.int64),
):
    grid[first + wp.tid()] = wp.int64(0)


@wp.kernel
def take_clouds(
    first: int,
    factor: float,
    # outputs
    grid: wp.array(dtype=wp.int64),
    result: wp.array(dtype=float),
):
    """What lies in every cell times a factor, and 0 behind the last of them; leaves the cells empty."""
    i = first + wp.tid()
    if i >= grid.shape[0]:
        result[i] = 0.0
        return
    result[i] = factor * float(grid[i])
    grid[i] = wp.int64(0)


@wp.kernel
def add_shares(
    first: int,
    share: wp.array(dtype=float),
    factor: float,
    # outputs
    result: wp.array(dtype=float),
):
    i = first + wp.tid()
    result[i] = result[i] + factor * share[i]


@wp.kernel
def sum_squares(
    first: int,
    grid: wp.array(dtype=float),
    columns: int,
    # outputs
    squares: wp.array(dtype=wp.float64),
):
    """Sum of the squares of every row."""
    row = first + wp.tid()
    total = wp.float64(0.0)
    for column in range(columns):
        value = wp.float64(grid[row * columns + column])
        total += value * value
    squares[row] = total


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
def compute_cell_keys(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    grid: CellGrid,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    key[i] = cell_of(wp.vec2(pose[i][0], pose[i][1]), grid)
    order[i] = i


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
):
    """Find each body's nearest neighbour in units of its own spacing."""
    i = first + wp.tid()
    p = wp.vec2(pose[i][0], pose[i][1])
    inverse_spacing = wp.sqrt(number_density[i])
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
                            d = wp.vec2(pose[j][0], pose[j][1]) - p
                            if grid.periodic != 0:
                                d = wp.vec2(
                                    d[0] - grid.domain[0] * wp.round(d[0] / grid.domain[0]),
                                    d[1] - grid.domain[1] * wp.round(d[1] / grid.domain[1]),
                                )
                            distance = wp.length(d)
                            closest = wp.min(closest, distance * inverse_spacing)
    nearest[i] = closest
