"""Kernels that lay a placement on a grid, to be compared with its densities."""

from __future__ import annotations

import warp as wp

from ..space.kernels_space import Space, number_inside

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
    space: Space,
    # outputs
    grid: wp.array(dtype=wp.int64),
):
    """Share every charge of class ``one`` (or, below 0, of all classes) among the four nearest cells."""
    i = first + wp.tid()
    if one >= 0 and class_index[i] != one:
        return
    u = pose[i][0] / space.size[0] * float(columns) - 0.5
    v = pose[i][1] / space.size[1] * float(rows) - 0.5
    left = int(wp.floor(u))
    low = int(wp.floor(v))
    for b in range(2):
        row = low + b
        weight_y = 1.0 - wp.abs(v - float(row))
        for a in range(2):
            column = left + a
            weight = weight_y * (1.0 - wp.abs(u - float(column)))
            cell = number_inside(row, rows, space) * columns + number_inside(column, columns, space)
            add_at_once(grid, cell, wp.int64(wp.round(charge[i] * weight * CLOUD_SCALE)))


# A processor takes several cells at once.
_TAKE = """
    long long* cells = (long long*)grid.data;
    float* to = (float*)result.data;
    const int there = end < (int)grid.shape[0] ? end : (int)grid.shape[0];
    int i = begin;
    for (; i < there; ++i) to[i] = factor * (float)cells[i] + amount;
    for (; i < end; ++i) to[i] = 0.0f;
    for (i = begin; i < there; ++i) cells[i] = 0;
"""


@wp.func_native(_TAKE)
def take_cells(
    grid: wp.array(dtype=wp.int64),
    begin: int,
    end: int,
    factor: float,
    amount: float,
    result: wp.array(dtype=float),
): ...


@wp.kernel
def take_clouds(
    first: int,
    block: int,
    factor: float,
    amount: float,
    # outputs
    grid: wp.array(dtype=wp.int64),
    result: wp.array(dtype=float),
):
    """What lies in every cell of a block times a factor and an amount more, and 0 behind the last cell; leaves the cells empty."""
    b = first + wp.tid()
    take_cells(grid, b * block, wp.min((b + 1) * block, result.shape[0]), factor, amount, result)


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


# Of eight columns at once: a processor would wait for every sum before the next.
_SQUARES = """
    const float* values = (const float*)grid.data + begin;
    double sums[8] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 8 <= count; i += 8)
        for (int k = 0; k < 8; ++k) sums[k] += (double)values[i + k] * (double)values[i + k];
    for (; i < count; ++i) sums[i & 7] += (double)values[i] * (double)values[i];
    return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
"""


@wp.func_native(_SQUARES)
def sum_of_squares(grid: wp.array(dtype=float), begin: int, count: int) -> wp.float64: ...


@wp.kernel
def sum_squares(
    first: int,
    grid: wp.array(dtype=float),
    cells: int,
    block: int,
    # outputs
    squares: wp.array(dtype=wp.float64),
):
    """Sum of the squares of a block of the first so many cells."""
    b = first + wp.tid()
    squares[b] = sum_of_squares(grid, b * block, wp.min(block, cells - b * block))
