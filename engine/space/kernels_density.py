"""Kernels that put target densities onto meshes, and make of them what each group sees."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def apply_band(
    first: int,
    source: wp.array(dtype=float),
    source_rows: int,
    source_columns: int,
    band_first: wp.array(dtype=wp.int32),
    band_weight: wp.array(dtype=float),
    reach: int,
    fold: int,
    along_columns: int,
    rows: int,
    columns: int,
    # outputs
    result: wp.array(dtype=float),
):
    """Weigh the rows of ``source`` (or its columns) into those of ``result``, each row's few pixels by a band of weights.

    The band has ``fold`` entries more at either end, which on a periodic mesh belong to the nodes one period further on.
    """
    i = first + wp.tid()
    row = i / columns
    column = i - row * columns
    node = row
    count = rows
    pixels = source_rows
    if along_columns != 0:
        node = column
        count = columns
        pixels = source_columns
    total = float(0.0)
    for period in range(3):
        entry = node + fold + (period - 1) * count
        if entry >= 0 and entry < count + 2 * fold:
            start = band_first[entry]
            for k in range(reach):
                weight = band_weight[entry * reach + k]
                if weight != 0.0:
                    pixel = wp.clamp(start + k, 0, pixels - 1)
                    if along_columns != 0:
                        total += weight * source[row * source_columns + pixel]
                    else:
                        total += weight * source[pixel * source_columns + column]
    result[i] = total


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
