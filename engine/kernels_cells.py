"""Kernels that sort charges into square cells, so that neighbours lie next to each other in memory."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class CellGrid:
    """Cells of the near field: ``count`` along x and y, their inverse size, the domain, and whether it wraps."""

    count_x: wp.int32
    count_y: wp.int32
    inverse_size: wp.vec2
    domain: wp.vec2
    periodic: wp.int32


@wp.func
def cell_of(position: wp.vec2, grid: CellGrid):
    """Index of the cell that holds ``position``; row by row, from below."""
    x = wp.clamp(int(position[0] * grid.inverse_size[0]), 0, grid.count_x - 1)
    y = wp.clamp(int(position[1] * grid.inverse_size[1]), 0, grid.count_y - 1)
    return y * grid.count_x + x


@wp.kernel
def compute_cell_keys(
    first: int,
    charge_position: wp.array(dtype=wp.vec2),
    grid: CellGrid,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    key[i] = cell_of(charge_position[i], grid)
    order[i] = i


@wp.kernel
def find_cell_starts(
    first: int,
    key: wp.array(dtype=wp.int32),
    charge_count: int,
    cell_count: int,
    # outputs
    cell_start: wp.array(dtype=wp.int32),
):
    """Fill ``cell_start[c]`` with the first sorted charge of cell c; ``cell_start[cell_count]`` is the charge count."""
    i = first + wp.tid()
    cell = key[i]
    previous = int(-1)
    if i > 0:
        previous = key[i - 1]
    for c in range(previous + 1, cell + 1):
        cell_start[c] = i
    if i == charge_count - 1:
        for c in range(cell + 1, cell_count + 1):
            cell_start[c] = charge_count


@wp.kernel
def gather_charges(
    first: int,
    order: wp.array(dtype=wp.int32),
    charge_position: wp.array(dtype=wp.vec2),
    charge: wp.array(dtype=float),
    charge_group: wp.array(dtype=wp.int32),
    interaction: wp.array(dtype=float),
    group_count: int,
    weight_stride: int,
    # outputs
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
    sorted_charge: wp.array(dtype=float),
    sorted_group: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=float),
):
    """Copy charges into the order of their cells, and weigh them with the interaction matrix, once for every group that sees them."""
    i = first + wp.tid()
    source = order[i]
    p = charge_position[source]
    sorted_x[i] = p[0]
    sorted_y[i] = p[1]
    q = charge[source]
    group = charge_group[source]
    sorted_charge[i] = q
    sorted_group[i] = group
    for g in range(group_count):
        weight[wp.int64(g) * wp.int64(weight_stride) + wp.int64(i)] = interaction[g * group_count + group] * q
