"""Kernels that find the pixel of the support, where the density is above zero, that is nearest to every pixel.

First along every column, then, of what was found there, along every row: the square of a distance is a sum (Meijster, Roerdink and
Hesselink, A General Algorithm for Computing Distance Transforms in Linear Time, 2000, doi:10.1007/0-306-47025-X_36).
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_nearest_rows(
    first: int,
    height: int,
    width: int,
    image: wp.array(dtype=float),
    # outputs
    nearest: wp.array(dtype=wp.int32),
):
    """Row of the nearest pixel of the support in the same column; -1 where the column has none. For every column."""
    column = first + wp.tid()
    last = int(-1)
    for row in range(height):
        i = row * width + column
        if image[i] > 0.0:
            last = row
        nearest[i] = last
    last = int(-1)
    for up in range(height):
        row = height - 1 - up
        i = row * width + column
        above = nearest[i]
        if above == row:
            last = row
        elif last >= 0 and (above < 0 or last - row < row - above):
            nearest[i] = last


@wp.func
def squared(row: int, column: int, to_row: int, to_column: int, size: wp.vec2d) -> wp.float64:
    """Square of the distance between two pixels."""
    x = wp.float64(to_column - column) * size[0]
    y = wp.float64(to_row - row) * size[1]
    return x * x + y * y


@wp.kernel
def find_vectors(
    first: int,
    width: int,
    size: wp.vec2d,
    nearest: wp.array(dtype=wp.int32),
    # outputs
    vector: wp.array(dtype=wp.vec2),
):
    """Vector from every pixel's center to that of the nearest of the support: x to the right, y up; 0 where there is none.

    Until the vectors are known, what is to hold them holds a stack: the columns that are nearest to some pixel of the row, as y, each
    with the first pixel that it is nearest to, as x. There are never more of them than pixels up to that one, so that the vectors,
    written from the end, overwrite none that is still to be read.
    """
    row = first + wp.tid()
    begin = row * width
    top = int(-1)
    for column in range(width):
        own = nearest[begin + column]
        if own < 0:
            continue
        # Those that it is nearer than to the first pixel of theirs are nearest to none.
        start = int(0)
        searching = int(1)
        while top >= 0 and searching == 1:
            entry = vector[begin + top]
            at, other = int(entry[0]), int(entry[1])
            row_of_other = nearest[begin + other]
            if squared(row, at, own, column, size) < squared(row, at, row_of_other, other, size):
                top -= 1
            else:
                searching = 0
                # The last pixel that the other one is as near to, or nearer.
                apart = wp.float64(column - other) * size[0]
                rise = wp.float64(own - row) * size[1]
                rise_of_other = wp.float64(row_of_other - row) * size[1]
                middle = wp.float64(column + other) * size[0]
                tie = (apart * middle + rise * rise - rise_of_other * rise_of_other) / (
                    wp.float64(2.0) * apart * size[0]
                )
                # Not less by rounding.
                start = wp.max(int(wp.min(wp.floor(tie), wp.float64(width))), at) + 1
        if start < width:
            top += 1
            vector[begin + top] = wp.vec2(float(start), float(column))
    for back in range(width):
        column = width - 1 - back
        way = wp.vec2()
        if top >= 0:
            entry = vector[begin + top]
            to = int(entry[1])
            to_row = nearest[begin + to]
            way = wp.vec2(float(wp.float64(to - column) * size[0]), float(wp.float64(row - to_row) * size[1]))
            if column == int(entry[0]):
                top -= 1
        vector[begin + column] = way
