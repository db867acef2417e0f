"""Kernels that draw lines as they lie, on samples, and count how much of every cell is covered."""

from __future__ import annotations

import warp as wp

from ..space.kernels_space import Space, between_cells, number_repeated

wp.set_module_options({"enable_backward": False})

# Points along a line that its factor is the mean over.
POINTS = wp.constant(5)


@wp.struct
class Strokes:
    """Straight strokes with round ends from ``a`` to ``b``, and half their thickness; a disc has length 0. And whose they are."""

    a: wp.array(dtype=wp.vec2)
    b: wp.array(dtype=wp.vec2)
    radius: wp.array(dtype=float)
    body: wp.array(dtype=wp.int32)


@wp.struct
class Samples:
    """Rows and columns of samples over a space, from its lower left corner on, and their distances along x and y."""

    columns: wp.int32
    rows: wp.int32
    step: wp.vec2
    space: Space


@wp.kernel
def find_factors(
    first: int,
    middle: wp.array(dtype=wp.vec2),
    half_axis: wp.array(dtype=wp.vec2),
    adapts: wp.array(dtype=wp.uint8),
    of_cell: wp.array(dtype=float),
    rows: int,
    columns: int,
    space: Space,
    # outputs
    factor: wp.array(dtype=float),
):
    """Factor on the width of every body: the mean along its axis of those of the cells, linear between their middles."""
    i = first + wp.tid()
    total = float(0.0)
    for k in range(POINTS):
        p = middle[i] + (2.0 * (float(k) + 0.5) / float(POINTS) - 1.0) * half_axis[i]
        total += between_cells(p, of_cell, 0, rows, columns, space)
    factor[i] = 1.0
    if adapts[i] != wp.uint8(0):
        factor[i] = total / float(POINTS)


@wp.kernel
def draw_strokes(
    first: int,
    strokes: Strokes,
    factor: wp.array(dtype=float),
    samples: Samples,
    # outputs
    covered: wp.array(dtype=wp.uint8),
):
    """Mark the samples under every stroke, ``factor`` times as thick; whoever marks one marks it alike."""
    i = first + wp.tid()
    a = strokes.a[i]
    axis = strokes.b[i] - a
    radius = strokes.radius[i] * factor[strokes.body[i]]
    step = samples.step
    squared = wp.dot(axis, axis)
    low = wp.min(a[1], a[1] + axis[1]) - radius
    high = wp.max(a[1], a[1] + axis[1]) + radius
    for row in range(int(wp.ceil(low / step[1] - 0.5)), int(wp.floor(high / step[1] - 0.5)) + 1):
        y = (float(row) + 0.5) * step[1]
        inside = number_repeated(row, samples.rows, samples.space)
        # The part of the axis from which the stroke reaches to this row.
        start = float(0.0)
        end = float(1.0)
        if axis[1] != 0.0:
            one = (y - radius - a[1]) / axis[1]
            other = (y + radius - a[1]) / axis[1]
            start = wp.clamp(wp.min(one, other), 0.0, 1.0)
            end = wp.clamp(wp.max(one, other), 0.0, 1.0)
        x0 = a[0] + start * axis[0]
        x1 = a[0] + end * axis[0]
        left = int(wp.ceil((wp.min(x0, x1) - radius) / step[0] - 0.5))
        right = int(wp.floor((wp.max(x0, x1) + radius) / step[0] - 0.5))
        if inside >= 0:
            for column in range(left, right + 1):
                d = wp.vec2((float(column) + 0.5) * step[0], y) - a
                along = float(0.0)
                if squared > 0.0:
                    along = wp.clamp(wp.dot(d, axis) / squared, 0.0, 1.0)
                there = number_repeated(column, samples.columns, samples.space)
                if there >= 0 and wp.length_sq(d - along * axis) <= radius * radius:
                    covered[inside * samples.columns + there] = wp.uint8(1)


@wp.kernel
def count_covered(
    first: int,
    columns: int,
    samples_across: int,
    samples_up: int,
    # outputs
    covered: wp.array(dtype=wp.uint8),
    count: wp.array(dtype=wp.int32),
):
    """How many samples of every cell are covered; ``columns`` is that of cells. Leaves all samples bare."""
    i = first + wp.tid()
    row = i / columns
    column = i - row * columns
    found = int(0)
    for y in range(samples_up):
        start = ((row * samples_up + y) * columns + column) * samples_across
        for x in range(samples_across):
            found += int(covered[start + x])
            covered[start + x] = wp.uint8(0)
    count[i] = found
