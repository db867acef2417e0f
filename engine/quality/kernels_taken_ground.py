"""Kernels that look for the ground that large bodies take."""

from __future__ import annotations

import warp as wp

from .kernels_sheets import on_one_sheet

wp.set_module_options({"enable_backward": False})


@wp.struct
class Capsules:
    """Bodies as what is within a radius of a segment: its middle, half of it as a vector, and the radius; in space."""

    middle: wp.array(dtype=wp.vec3)
    half: wp.array(dtype=wp.vec3)
    radius: wp.array(dtype=float)


@wp.func
def is_within(place: wp.vec3, capsules: Capsules, j: int):
    """Whether a place lies in a capsule."""
    half = capsules.half[j]
    way = place - capsules.middle[j]
    square = wp.dot(half, half)
    along = float(0.0)
    if square > 0.0:
        along = wp.clamp(wp.dot(way, half) / square, -1.0, 1.0)
    return wp.length(way - along * half) < capsules.radius[j]


@wp.kernel
def take_cells(
    first: int,
    capsules: Capsules,
    lanes: int,
    rows: int,
    columns: int,
    width: float,
    height: float,
    repeats: int,
    # outputs
    free: wp.array(dtype=float),
):
    """Write 0 for every cell of a rectangle whose middle a capsule covers; row 0 lies at the bottom.

    Each capsule has so many ``lanes``, which take its rows in turns.
    """
    j = (first + wp.tid()) // lanes
    lane = (first + wp.tid()) - lanes * j
    middle = capsules.middle[j]
    half = capsules.half[j]
    reach_x = wp.abs(half[0]) + capsules.radius[j]
    reach_y = wp.abs(half[1]) + capsules.radius[j]
    cell_x = width / float(columns)
    cell_y = height / float(rows)
    left = int(wp.floor((middle[0] - reach_x) / cell_x))
    right = int(wp.floor((middle[0] + reach_x) / cell_x))
    low = int(wp.floor((middle[1] - reach_y) / cell_y))
    high = int(wp.floor((middle[1] + reach_y) / cell_y))
    if repeats == 0:
        left = wp.max(left, 0)
        right = wp.min(right, columns - 1)
        low = wp.max(low, 0)
        high = wp.min(high, rows - 1)
    for row in range(low + lane, high + 1, lanes):
        for column in range(left, right + 1):
            place = wp.vec3((float(column) + 0.5) * cell_x, (float(row) + 0.5) * cell_y, 0.0)
            if is_within(place, capsules, j):
                inside_row = row - rows * int(wp.floor(float(row) / float(rows)))
                inside_column = column - columns * int(wp.floor(float(column) / float(columns)))
                free[inside_row * columns + inside_column] = 0.0


@wp.kernel
def find_free(
    first: int,
    grid: wp.uint64,
    place: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    sheet: wp.array(dtype=wp.int32),
    capsules: Capsules,
    facing: wp.array(dtype=wp.vec3),
    stands_on: wp.array(dtype=wp.int32),
    reach: float,
    # outputs
    free: wp.array(dtype=float),
):
    """Write which points of a surface no capsule covers that stands on the same sheet of it; none reaches farther than ``reach``."""
    i = first + wp.tid()
    result = float(1.0)
    up = wp.vec3d(normal[i])
    for j in wp.hash_grid_query(grid, place[i], reach):
        if result > 0.0 and sheet[i] == stands_on[j] and is_within(place[i], capsules, j):
            way = wp.vec3d(capsules.middle[j] - place[i])
            if on_one_sheet(way, wp.length(way), up, wp.vec3d(facing[j])):
                result = float(0.0)
    free[i] = result
