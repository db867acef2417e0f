"""Fourier transforms of mesh rows on a GPU, by Warp's tile transforms; columns are transposed into rows and back.

A tile's shape is part of its kernel, so :func:`row_kernels` makes one pair of kernels per length; they are compiled once
and cached by Warp.
"""

from __future__ import annotations

from functools import cache

import warp as wp

wp.set_module_options({"enable_backward": False})


@cache
def row_kernels(length: int) -> tuple[wp.Kernel, wp.Kernel]:
    """Return the kernels that transform rows of ``length`` (a power of two) in place, forward and inverse."""

    @wp.kernel(module="unique", enable_backward=False)
    def transform_rows_forward(rows: wp.array2d(dtype=wp.vec2)):
        row = wp.tid()
        tile = wp.tile_load(rows, shape=(1, length), offset=(row, 0))
        wp.tile_fft(tile)
        wp.tile_store(rows, tile, offset=(row, 0))

    @wp.kernel(module="unique", enable_backward=False)
    def transform_rows_inverse(rows: wp.array2d(dtype=wp.vec2)):
        row = wp.tid()
        tile = wp.tile_load(rows, shape=(1, length), offset=(row, 0))
        wp.tile_ifft(tile)
        wp.tile_store(rows, tile, offset=(row, 0))

    return transform_rows_forward, transform_rows_inverse


@wp.kernel
def pack_rows(
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
    column_count: int,
    # outputs
    rows: wp.array2d(dtype=wp.vec2),
):
    """Join two planes into complex rows, padded by zeros."""
    i, j = wp.tid()
    value = wp.vec2(0.0, 0.0)
    if j < column_count:
        k = i * column_count + j
        value = wp.vec2(real[k], imaginary[k])
    rows[i, j] = value


@wp.kernel
def unpack_rows(
    rows: wp.array2d(dtype=wp.vec2),
    column_count: int,
    # outputs
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
):
    """Split complex rows into two planes, without the padding."""
    i, j = wp.tid()
    value = rows[i, j]
    real[i * column_count + j] = value[0]
    imaginary[i * column_count + j] = value[1]


@wp.kernel
def transpose(
    source: wp.array2d(dtype=wp.vec2),
    # outputs
    result: wp.array2d(dtype=wp.vec2),
):
    """Transpose; what ``result`` has more of is filled with zeros, what it has less of is left out."""
    i, j = wp.tid()
    value = wp.vec2(0.0, 0.0)
    if j < source.shape[0]:
        value = source[j, i]
    result[i, j] = value


@wp.kernel
def multiply_influence(
    influence: wp.array(dtype=float),
    column_count: int,
    # outputs
    columns: wp.array2d(dtype=wp.vec2),
):
    """Multiply transposed columns by the influence function, folded in y."""
    i, j = wp.tid()
    length = columns.shape[1]
    folded = wp.min(j, length - j)
    columns[i, j] = columns[i, j] * influence[folded * column_count + i]
