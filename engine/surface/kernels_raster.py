"""Kernels that draw a mesh seen from above on a grid: which triangle is topmost at every point.

Everything is in float64. Where an edge meets a row is worked out from its lower end, whichever triangle asks: two that share it
leave no gap.
"""

from __future__ import annotations

import warp as wp

from .kernels_chart import blend, weights_at

wp.set_module_options({"enable_backward": False})

NONE = wp.constant(wp.float64(1.0e300))


@wp.struct
class Grid:
    """Points that lie evenly along x and y: the first one, the steps to the next (along x above 0), and their numbers."""

    origin: wp.vec2d
    step: wp.vec2d
    rows: wp.int32
    columns: wp.int32


@wp.func
def first_at(value: wp.float64, origin: wp.float64, step: wp.float64, count: int):
    """The first of ``count`` points of an axis at ``value`` or beyond."""
    return int(wp.clamp(wp.ceil((value - origin) / step), wp.float64(0.0), wp.float64(count)))


@wp.func
def last_at(value: wp.float64, origin: wp.float64, step: wp.float64, count: int):
    """The last of ``count`` points of an axis at ``value`` or before; -1 for none."""
    return int(wp.clamp(wp.floor((value - origin) / step), wp.float64(-1.0), wp.float64(count - 1)))


@wp.kernel
def find_rows(
    first: int,
    number: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    grid: Grid,
    # outputs
    rows: wp.array(dtype=wp.vec2i),
):
    """Find the first and the last row that every triangle of ``number`` reaches; the last is before the first where there is none."""
    i = first + wp.tid()
    corner = triangle[number[i]]
    a, b, c = position[corner[0]][1], position[corner[1]][1], position[corner[2]][1]
    low, high = wp.min(a, wp.min(b, c)), wp.max(a, wp.max(b, c))
    if grid.step[1] < wp.float64(0.0):
        low, high = high, low
    rows[i] = wp.vec2i(
        first_at(low, grid.origin[1], grid.step[1], grid.rows), last_at(high, grid.origin[1], grid.step[1], grid.rows)
    )


@wp.func
def meeting(a: wp.vec3d, b: wp.vec3d, y: wp.float64, beside: wp.float64):
    """X where an edge is at ``y``: ``beside`` where it is not, or lies along it."""
    low, high = a, b
    if b[1] < a[1] or (b[1] == a[1] and b[0] < a[0]):
        low, high = b, a
    if y < low[1] or y > high[1] or low[1] == high[1]:
        return beside
    return low[0] + (high[0] - low[0]) * ((y - low[1]) / (high[1] - low[1]))


@wp.func
def draw_triangle(
    number: int,
    a: wp.vec3d,
    b: wp.vec3d,
    c: wp.vec3d,
    begin: int,
    end: int,
    grid: Grid,
    height: wp.array(dtype=wp.float64),
    topmost: wp.array(dtype=wp.int32),
):
    """Write a triangle where it is above all that were drawn before, in the rows ``begin`` to ``end - 1``."""
    normal = wp.cross(b - a, c - a)
    low, high = wp.min(a[2], wp.min(b[2], c[2])), wp.max(a[2], wp.max(b[2], c[2]))
    for row in range(begin, end):
        y = grid.origin[1] + wp.float64(row) * grid.step[1]
        left = wp.min(meeting(a, b, y, NONE), wp.min(meeting(b, c, y, NONE), meeting(c, a, y, NONE)))
        right = wp.max(meeting(a, b, y, -NONE), wp.max(meeting(b, c, y, -NONE), meeting(c, a, y, -NONE)))
        if left <= right:
            column = first_at(left, grid.origin[0], grid.step[0], grid.columns)
            last = last_at(right, grid.origin[0], grid.step[0], grid.columns)
            while column <= last:
                x = grid.origin[0] + wp.float64(column) * grid.step[0]
                z = a[2] - (normal[0] * (x - a[0]) + normal[1] * (y - a[1])) / normal[2]
                z = wp.clamp(z, low, high)
                i = row * grid.columns + column
                if topmost[i] < 0 or z > height[i]:
                    height[i] = z
                    topmost[i] = number
                column += 1


@wp.kernel
def draw_bands(
    first: int,
    number: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.vec2i),
    listed: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    rows_per_band: int,
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    grid: Grid,
    # outputs
    height: wp.array(dtype=wp.float64),
    topmost: wp.array(dtype=wp.int32),
):
    """Draw what is ``listed`` for some rows of the grid, band after band; of equally high triangles the first one is seen."""
    band = first + wp.tid()
    begin = band * rows_per_band
    end = wp.min(begin + rows_per_band, grid.rows)
    for i in range(begin * grid.columns, end * grid.columns):
        topmost[i] = -1
    for k in range(start[band], start[band + 1]):
        one = number[listed[k]]
        reach = rows[listed[k]]
        corner = triangle[one]
        a, b, c = position[corner[0]], position[corner[1]], position[corner[2]]
        draw_triangle(one, a, b, c, wp.max(begin, reach[0]), wp.min(end, reach[1] + 1), grid, height, topmost)


@wp.kernel
def lift_grid(
    first: int,
    topmost: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    grid: Grid,
    # outputs
    weight: wp.array(dtype=wp.vec3),
    lifted: wp.array(dtype=wp.vec3d),
):
    """Find the weights of the corners of what is topmost at every point of the grid, and where the point lies on it."""
    i = first + wp.tid()
    if topmost[i] >= 0:
        row = i / grid.columns
        x = grid.origin[0] + wp.float64(i - row * grid.columns) * grid.step[0]
        y = grid.origin[1] + wp.float64(row) * grid.step[1]
        corner = triangle[topmost[i]]
        a, b, c = position[corner[0]], position[corner[1]], position[corner[2]]
        own = weights_at(a, b, c, x, y)
        weight[i] = wp.vec3(own)
        lifted[i] = blend(a, b, c, own)
