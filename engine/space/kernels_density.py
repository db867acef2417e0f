"""Kernels that put target densities onto meshes, and make of them what each group sees."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Band:
    """Which pixels make up every node along an axis: the first one of each, and the weights of ``reach`` of them.

    There are ``fold`` entries more at either end, which on a periodic mesh belong to the nodes one period further on.
    """

    first: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=float)
    reach: wp.int32
    fold: wp.int32


@wp.func
def weigh_pixels(
    before: float, entry: int, band: Band, source: wp.array(dtype=float), start: int, step: int, pixels: int
):
    """What was weighed before, and the pixels of an entry of a band, of ``pixels`` that lie ``step`` apart from ``start`` on."""
    total = before
    for k in range(band.reach):
        weight = band.weight[entry * band.reach + k]
        if weight != 0.0:
            pixel = wp.clamp(band.first[entry] + k, 0, pixels - 1)
            total += weight * source[start + pixel * step]
    return total


# A processor takes several columns at once.
_ADD_ROW = """
    float* to = (float*)result.data + (long long)row * columns;
    const float* from = (const float*)source.data + (long long)source_row * columns;
    for (int column = 0; column < columns; ++column) to[column] += weight * from[column];
"""


@wp.func_native(_ADD_ROW)
def add_row(
    weight: float,
    source: wp.array(dtype=float),
    source_row: int,
    columns: int,
    result: wp.array(dtype=float),
    row: int,
): ...


@wp.kernel
def add_rows(
    first: int,
    source: wp.array(dtype=float),
    source_rows: int,
    band: Band,
    rows: int,
    columns: int,
    # outputs
    result: wp.array(dtype=float),
):
    """What :func:`apply_band` does along y, for a whole row of the result at a time."""
    row = first + wp.tid()
    for column in range(columns):
        result[row * columns + column] = 0.0
    for period in range(-1, 2):
        entry = row + band.fold + period * rows
        if entry >= 0 and entry < rows + 2 * band.fold and (period == 0 or band.fold > 0):
            for k in range(band.reach):
                weight = band.weight[entry * band.reach + k]
                if weight != 0.0:
                    pixel = wp.clamp(band.first[entry] + k, 0, source_rows - 1)
                    add_row(weight, source, pixel, columns, result, row)


@wp.kernel
def apply_band(
    first: int,
    at_once: int,
    source: wp.array(dtype=float),
    source_rows: int,
    source_columns: int,
    band: Band,
    along_columns: int,
    rows: int,
    columns: int,
    # outputs
    result: wp.array(dtype=float),
):
    """Weigh the rows of ``source`` (or its columns) into those of ``result``, each row's few pixels by a band of weights.

    An element is ``at_once`` nodes of a row: all of them on the CPU, where it costs to find out which node this is.
    """
    to = (first + wp.tid()) * at_once
    row = to / columns
    begin = to - row * columns
    node = row
    count = rows
    pixels = source_rows
    step = source_columns
    if along_columns != 0:
        count = columns
        pixels = source_columns
        step = 1
    for column in range(begin, begin + at_once):
        start = column
        if along_columns != 0:
            node = column
            start = row * source_columns
        total = float(0.0)
        if band.fold == 0:
            total = weigh_pixels(total, node, band, source, start, step, pixels)
        else:
            for period in range(3):
                entry = node + band.fold + (period - 1) * count
                if entry >= 0 and entry < count + 2 * band.fold:
                    total = weigh_pixels(total, entry, band, source, start, step, pixels)
        result[row * columns + column] = total


@wp.kernel
def mix_images(
    first: int,
    deposited: wp.array(dtype=float),
    weight: wp.array(dtype=float),
    image_count: int,
    node_count: int,
    # outputs
    result: wp.array(dtype=float),
):
    """Sum of the images on a mesh, weighed for every row of ``weight``, one after the other."""
    i = first + wp.tid()
    row = i / node_count
    node = i - row * node_count
    total = float(0.0)
    for k in range(image_count):
        total += weight[row * image_count + k] * deposited[k * node_count + node]
    result[i] = total
