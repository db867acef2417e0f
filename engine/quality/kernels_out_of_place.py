"""Kernels that find outlines in obstacles of an image and across the border: in double precision, with nothing taken from contact."""

from __future__ import annotations

import warp as wp

from .kernels_overlaps import Shapes

wp.set_module_options({"enable_backward": False})

ZERO = wp.constant(wp.float64(0.0))
HALF = wp.constant(wp.float64(0.5))
HUGE = wp.constant(wp.float64(1.0e300))


@wp.kernel
def find_beyond_border(
    first: int,
    shapes: Shapes,
    size: wp.vec2d,
    tolerance: wp.float64,
    # outputs
    depth: wp.array(dtype=wp.float64),
):
    """How far every outline that is not fixed reaches across the border [m]; 0 within ``tolerance`` widths."""
    i = first + wp.tid()
    at = shapes.position[i]
    farthest = -HUGE
    for k in range(shapes.first_corner[i], shapes.first_corner[i + 1]):
        x = at[0] + shapes.corner[k][0]
        y = at[1] + shapes.corner[k][1]
        across = wp.max(wp.max(-x, x - size[0]), wp.max(-y, y - size[1]))
        farthest = wp.max(farthest, across + shapes.rounding[i])
    if shapes.fixed[i] != 0 or farthest <= tolerance * shapes.width[i]:
        farthest = ZERO
    depth[i] = farthest


@wp.struct
class Drawn:
    """An obstacle that is an image: how many pixels of every row, row 0 below, are obstacles before each column; and its margin.

    Its rows and columns, and the extent of the domain that it covers.
    """

    before: wp.array(dtype=wp.int32)
    rows: wp.int32
    columns: wp.int32
    size: wp.vec2d
    periodic: wp.int32
    margin: wp.float64


@wp.func
def obstacles_before(row: int, column: int, drawn: Drawn):
    """How many pixels of a row are obstacles before a column; columns and rows go on round a periodic domain."""
    wrapped = ((row % drawn.rows) + drawn.rows) % drawn.rows
    start = wrapped * (drawn.columns + 1)
    if drawn.periodic == 0:
        return drawn.before[start + wp.clamp(column, 0, drawn.columns)]
    turns = int(wp.floor(wp.float64(column) / wp.float64(drawn.columns)))
    return turns * drawn.before[start + drawn.columns] + drawn.before[start + column - turns * drawn.columns]


@wp.func
def depth_of_point(i: int, begin: int, end: int, p: wp.vec2d, shapes: Shapes):
    """How far inside a core, whose corners are these, a point lies; below 0 outside."""
    beyond = -HUGE
    square = HUGE
    for e in range(begin, end):
        following = e + 1
        if following == end:
            following = begin
        v = shapes.corner[e]
        u = shapes.corner[following]
        way = wp.vec2d(p[0] - v[0], p[1] - v[1])
        along = wp.vec2d(u[0] - v[0], u[1] - v[1])
        beyond = wp.max(beyond, v[2] * way[0] + v[3] * way[1])
        share = ZERO
        if wp.dot(along, along) > ZERO:
            share = wp.clamp(wp.dot(way, along) / wp.dot(along, along), ZERO, wp.float64(1.0))
        gap = way - along * share
        square = wp.min(square, wp.dot(gap, gap))
    if end - begin > 2 and beyond <= ZERO:
        return -beyond
    return -wp.sqrt(square)


@wp.func
def depth_in_outline(i: int, p: wp.vec2d, shapes: Shapes):
    """How far inside an outline a point lies, seen from its position; of bent lines, inside the piece that it lies deepest in."""
    begin = shapes.first_corner[i]
    depth = -HUGE
    if shapes.pieces[i] == 0:
        depth = depth_of_point(i, begin, shapes.first_corner[i + 1], p, shapes)
    for k in range(shapes.pieces[i]):
        depth = wp.max(depth, depth_of_point(i, begin + 2 * k, begin + 2 * k + 2, p, shapes))
    return depth + shapes.rounding[i]


@wp.func
def part_of_row(i: int, y: wp.float64, around: wp.float64, shapes: Shapes):
    """From where to where along x, seen from the position, what is within ``around`` of a core may lie at a height ``y``."""
    low = HUGE
    high = -HUGE
    begin = shapes.first_corner[i]
    end = shapes.first_corner[i + 1]
    for k in range(begin, end):
        low = wp.min(low, shapes.corner[k][0] - around)
        high = wp.max(high, shapes.corner[k][0] + around)
    if shapes.pieces[i] == 0 and end - begin > 1:
        for k in range(begin, end):
            v = shapes.corner[k]
            left = around - v[3] * (y - v[1])
            if v[2] > wp.float64(1.0e-9):
                high = wp.min(high, v[0] + left / v[2])
            if v[2] < wp.float64(-1.0e-9):
                low = wp.max(low, v[0] + left / v[2])
    return wp.vec2d(low, high)


@wp.func
def deepest_of_row(i: int, row: int, shapes: Shapes, drawn: Drawn, tolerance: wp.float64):
    """How deep the middle of a pixel of a row that is an obstacle, or its margin, lies in an outline; 0 if none does."""
    at = shapes.position[i]
    wide = drawn.size[0] / wp.float64(drawn.columns)
    y = (wp.float64(row) + HALF) * drawn.size[1] / wp.float64(drawn.rows) - at[1]
    part = part_of_row(i, y, shapes.rounding[i] + drawn.margin, shapes)
    left = int(wp.floor((at[0] + part[0]) / wide))
    right = wp.max(int(wp.ceil((at[0] + part[1]) / wide)), left)
    if obstacles_before(row, right, drawn) == obstacles_before(row, left, drawn):
        right = left
    deepest = wp.float64(0.0)
    for column in range(left, right):
        if obstacles_before(row, column + 1, drawn) > obstacles_before(row, column, drawn):
            x = (wp.float64(column) + HALF) * wide - at[0]
            found = depth_in_outline(i, wp.vec2d(x, y), shapes) + drawn.margin
            if found > tolerance * shapes.width[i]:
                deepest = wp.max(deepest, found)
    return deepest


@wp.kernel
def find_in_image(
    first: int,
    shapes: Shapes,
    drawn: Drawn,
    tolerance: wp.float64,
    # outputs
    depth: wp.array(dtype=wp.float64),
):
    """How deep the middle of a pixel that is an obstacle, or its margin, lies in every outline that is not fixed [m]; 0 if none does.

    What there is already stays where it is more.
    """
    i = first + wp.tid()
    at = shapes.position[i]
    high = drawn.size[1] / wp.float64(drawn.rows)
    reach = shapes.reach[i] + drawn.margin
    below = int(wp.floor((at[1] - reach) / high))
    above = int(wp.ceil((at[1] + reach) / high))
    if drawn.periodic == 0:
        below = wp.max(below, 0)
        above = wp.min(above, drawn.rows)
    if shapes.fixed[i] != 0:
        above = below
    deepest = depth[i]
    for row in range(below, above):
        deepest = wp.max(deepest, deepest_of_row(i, row, shapes, drawn, tolerance))
    depth[i] = deepest
