"""Fourier transforms of mesh rows and columns on a GPU, by Warp's tile transforms.

As on the CPU (:mod:`.kernels_fft`), two real rows travel through one complex transform, of which half is kept. Columns are transposed
into rows, so every transform reads and writes whole rows. A tile's shape is part of its kernel, so kernels are made per length; they
are compiled once and cached by Warp.
"""

from __future__ import annotations

from functools import cache

import warp as wp

wp.set_module_options({"enable_backward": False})

# Threads of a block, and the side of the square tiles that they transpose.
TILE_THREADS = wp.constant(256)
TILE_SIDE = wp.constant(16)


@wp.func
def join(real: float, imaginary: float) -> wp.vec2:
    return wp.vec2(real, imaginary)


@wp.func
def real_part(value: wp.vec2) -> float:
    return value[0]


@wp.func
def imaginary_part(value: wp.vec2) -> float:
    return value[1]


@wp.func
def scaled(value: wp.vec2, factor: float) -> wp.vec2:
    return factor * value


@cache
def row_kernels(length: int) -> tuple[wp.Kernel, wp.Kernel]:
    """Return the kernels that transform pairs of real rows into complex ones of ``length`` (a power of two), and back.

    Real rows are padded by zeros, and cut off, where they are shorter.
    """

    @wp.kernel(module="unique", enable_backward=False)
    def transform_pairs(rows: wp.array2d(dtype=float), pairs: wp.array2d(dtype=wp.vec2)):
        pair = wp.tid()
        even = wp.tile_load(rows, shape=(1, length), offset=(2 * pair, 0))
        odd = wp.tile_load(rows, shape=(1, length), offset=(2 * pair + 1, 0))
        tile = wp.tile_map(join, even, odd)
        wp.tile_fft(tile)
        wp.tile_store(pairs, tile, offset=(pair, 0))

    @wp.kernel(module="unique", enable_backward=False)
    def transform_pairs_back(pairs: wp.array2d(dtype=wp.vec2), rows: wp.array2d(dtype=float)):
        pair = wp.tid()
        tile = wp.tile_load(pairs, shape=(1, length), offset=(pair, 0))
        wp.tile_ifft(tile)
        wp.tile_store(rows, wp.tile_map(real_part, tile), offset=(2 * pair, 0))
        wp.tile_store(rows, wp.tile_map(imaginary_part, tile), offset=(2 * pair + 1, 0))

    return transform_pairs, transform_pairs_back


@cache
def column_kernel(length: int) -> wp.Kernel:
    """Return the kernel that transforms columns, transposed into rows, multiplies them by ``influence`` and transforms them back."""

    @wp.kernel(module="unique", enable_backward=False)
    def convolve(influence: wp.array2d(dtype=float), columns: wp.array2d(dtype=wp.vec2)):
        column = wp.tid()
        tile = wp.tile_load(columns, shape=(1, length), offset=(column, 0))
        wp.tile_fft(tile)
        # The columns of one mesh after those of another.
        factor = wp.tile_load(influence, shape=(1, length), offset=(column % influence.shape[0], 0))
        product = wp.tile_map(scaled, tile, factor)
        wp.tile_ifft(product)
        wp.tile_store(columns, product, offset=(column, 0))

    return convolve


@wp.func
def tile_element(thread: int, columns: int):
    """Row and column of a thread's element, where blocks of threads are square tiles of a matrix of so many columns.

    A block then reads and writes whole lines of memory, transposing or not.
    """
    block = thread / TILE_THREADS
    within = thread - block * TILE_THREADS
    across = (columns + TILE_SIDE - 1) / TILE_SIDE
    tile_row = block / across
    row = tile_row * TILE_SIDE + within / TILE_SIDE
    column = (block - tile_row * across) * TILE_SIDE + within % TILE_SIDE
    return row, column


@wp.kernel
def split_pairs(
    pairs: wp.array2d(dtype=wp.vec2),
    row_count: int,
    # outputs
    columns: wp.array2d(dtype=wp.vec2),
):
    """Take the transforms of pairs of real rows apart, keep their first halves and transpose; rows beyond ``row_count`` are zero.

    Meshes lie one after the other.

    With Z the transform of a + i b, that of a is (Z[k] + conj Z[-k]) / 2 and that of b (Z[k] - conj Z[-k]) / 2i.
    """
    i, row = tile_element(wp.tid(), columns.shape[1])
    if i < columns.shape[0] and row < columns.shape[1]:
        half = pairs.shape[1] / 2 + 1
        mesh = i / half
        k = i - mesh * half
        value = wp.vec2(0.0, 0.0)
        if row < row_count:
            mirror = int(0)
            if k > 0:
                mirror = pairs.shape[1] - k
            pair = (mesh * row_count + row) / 2
            p = pairs[pair, k]
            q = pairs[pair, mirror]
            if row % 2 == 0:
                value = wp.vec2(0.5 * (p[0] + q[0]), 0.5 * (p[1] - q[1]))
            else:
                value = wp.vec2(0.5 * (p[1] + q[1]), 0.5 * (q[0] - p[0]))
        columns[i, row] = value


@wp.kernel
def join_pairs(
    columns: wp.array2d(dtype=wp.vec2),
    row_count: int,
    # outputs
    pairs: wp.array2d(dtype=wp.vec2),
):
    """The inverse of :func:`split_pairs`."""
    pair, k = tile_element(wp.tid(), pairs.shape[1])
    if pair < pairs.shape[0] and k < pairs.shape[1]:
        mesh = 2 * pair / row_count
        row = 2 * pair - mesh * row_count
        folded = wp.min(k, pairs.shape[1] - k)
        column = mesh * (pairs.shape[1] / 2 + 1) + folded
        a = columns[column, row]
        b = columns[column, row + 1]
        if k == folded:
            pairs[pair, k] = wp.vec2(a[0] - b[1], a[1] + b[0])
        else:
            pairs[pair, k] = wp.vec2(a[0] + b[1], b[0] - a[1])


@wp.kernel
def unfold_columns(
    columns: wp.array2d(dtype=wp.vec2),
    # outputs
    rows: wp.array2d(dtype=float),
):
    """Columns of a mesh that is even along them, of which the first halves are there: their real parts, whole."""
    k, j = wp.tid()
    rows[k, j] = columns[k, wp.min(j, rows.shape[1] - j)][0]


@wp.kernel
def separate_pairs(
    pairs: wp.array2d(dtype=wp.vec2),
    # outputs
    influence: wp.array2d(dtype=float),
):
    """Transforms of pairs of real and even rows, which are real: those of the first are the real part, of the second the other."""
    k, j = wp.tid()
    influence[k, j] = pairs[k / 2, j][k % 2]


@wp.kernel
def add_to(
    first: int,
    added: wp.array(dtype=float),
    # outputs
    total: wp.array(dtype=float),
):
    i = first + wp.tid()
    total[i] = total[i] + added[i]
