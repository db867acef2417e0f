"""Fourier transforms of mesh rows and columns on a GPU.

As on the CPU (:mod:`.kernels_fft`), two real rows travel through one complex transform, of which half is kept. Columns are transposed
into rows, so every transform reads and writes whole rows.

A row is transformed by a group of threads, which hold 16 or 32 of its elements each in registers: thread t of T has those at t,
t + T, t + 2 T, ... Stockham's self-sorting algorithm with radix 16 finds all that a butterfly needs in one thread, and leaves the last
pass's results where the first pass's were. So rows go through shared memory only between passes, the real parts first and then the
imaginary ones; the longest rows half after half. Every length has a module of its own, which is compiled when it is first needed.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import warp as wp

wp.set_module_options({"enable_backward": False})

# Threads of a block, and the side of the square tiles that they transpose.
TILE_THREADS = wp.constant(256)
TILE_SIDE = wp.constant(16)
# The largest radix; and threads of a block: short rows share one, and those that are too long for the most hold more elements each.
RADIX = 16
FEWEST_THREADS, MOST_THREADS = 128, 512
# Elements that are passed on at once: 34 kB of shared memory of the 48 that any GPU has.
MOST_PASSED = 8192

# What all transforms share. On a CPU, where it is tested, one thread does what those of a row do, one after the other.
_COMMON = """
    constexpr int N = {length}, E = {elements}, T = N / E, PASSED = {passed};
    #ifdef __CUDA_ARCH__
        // Only the thread itself, one of several rows in a block.
        constexpr int HELD = 1, ROWS = {rows_per_block};
        const int row = thread / T, first_thread = thread % T;
        __shared__ float shared[ROWS][PASSED + PASSED / 16];
        float* passed = shared[row % ROWS];
        #define WAIT __syncthreads();
        #define UNROLL _Pragma("unroll")
    #else
        constexpr int HELD = T;
        const int row = thread, first_thread = 0;
        float passed[PASSED + PASSED / 16];
        #define WAIT
        #define UNROLL
    #endif
    #define EACH_THREAD UNROLL for (int h = 0; h < HELD; ++h)
    #define EACH_ELEMENT UNROLL for (int j = 0; j < E; ++j)
    #define COLUMN (first_thread + h + j * T)
    // One more place after every sixteen: threads that are a multiple of 16 apart do not wait for the same bank.
    #define PLACE(i) ((i) + (i) / 16)
    float real[HELD][E], imaginary[HELD][E];
    auto multiply = [](float& a, float& b, float c, float s)
    {{
        const float product = a * c - b * s;
        b = a * s + b * c;
        a = product;
    }};
    auto two = [](float* x, float* y, int i, int k)
    {{
        const float a = x[k], b = y[k];
        x[k] = x[i] - a; y[k] = y[i] - b;
        x[i] += a; y[i] += b;
    }};
    auto four = [&two](float* x, float* y, int i, int j, int k, int l)
    {{
        two(x, y, i, k);
        two(x, y, j, l);
        // By -i.
        const float a = x[l];
        x[l] = y[l]; y[l] = -a;
        two(x, y, i, j);
        two(x, y, k, l);
        // In the order of the frequencies: i, k, j, l.
        const float b = x[j], c = y[j];
        x[j] = x[k]; y[j] = y[k];
        x[k] = b; y[k] = c;
    }};
"""

# One pass over what `X` and `Y` name, the real and imaginary parts: radix R after passes of product L. Leaves frequency m of a
# butterfly at place (m % A) * B + m / A, where R = A B.
_PASS = """
    {{
        constexpr int R = {radix}, L = {done}, Q = E / R, B = {inner}, A = R / B;
        EACH_THREAD
        UNROLL for (int q = 0; q < Q; ++q)
        {{
            float x[R], y[R];
            UNROLL for (int m = 0; m < R; ++m) {{ x[m] = {X}[h][q + m * Q]; y[m] = {Y}[h][q + m * Q]; }}
            if (L > 1)
            {{
                const float turn = -2.0f / (float)(R * L) * (float)((first_thread + h + q * T) & (L - 1));
                // exp(pi i turn), and its powers: those up to 3 stay, those of 4 follow each other, and the others are their products.
                float c[4], s[4], of_fours_c = 1.0f, of_fours_s = 0.0f;
                #ifdef __CUDA_ARCH__
                    sincospif(turn, &s[1], &c[1]);
                #else
                    const double angle = 3.14159265358979 * (double)turn;
                    c[1] = (float)wp::cos(angle); s[1] = (float)wp::sin(angle);
                #endif
                c[2] = c[1]; s[2] = s[1];
                multiply(c[2], s[2], c[1], s[1]);
                c[3] = c[2]; s[3] = s[2];
                multiply(c[3], s[3], c[1], s[1]);
                float four_c = c[2], four_s = s[2];
                multiply(four_c, four_s, c[2], s[2]);
                UNROLL for (int fours = 0; fours < R / 4; ++fours)
                {{
                    if (fours > 0)
                    {{
                        multiply(of_fours_c, of_fours_s, four_c, four_s);
                        multiply(x[4 * fours], y[4 * fours], of_fours_c, of_fours_s);
                    }}
                    UNROLL for (int m = 1; m < 4; ++m)
                    {{
                        float factor_c = c[m], factor_s = s[m];
                        if (fours > 0) multiply(factor_c, factor_s, of_fours_c, of_fours_s);
                        multiply(x[4 * fours + m], y[4 * fours + m], factor_c, factor_s);
                    }}
                }}
            }}
            if (A == 4)
                UNROLL for (int b = 0; b < B; ++b) four(x, y, b, B + b, 2 * B + b, 3 * B + b);
            else
                two(x, y, 0, 1);
            if (B > 1)
            {{
                // exp(-2 pi i k / 16)
                constexpr float cosine[10] = {{ {cosines} }};
                constexpr float sine[10] = {{ {sines} }};
                UNROLL for (int a = 1; a < A; ++a)
                    UNROLL for (int b = 1; b < B; ++b)
                        multiply(x[a * B + b], y[a * B + b], cosine[a * b * 16 / R], sine[a * b * 16 / R]);
                UNROLL for (int a = 0; a < A; ++a)
                    if (B == 4) four(x, y, a * B, a * B + 1, a * B + 2, a * B + 3);
                    else two(x, y, a * B, a * B + 1);
            }}
            UNROLL for (int m = 0; m < R; ++m)
            {{
                {X}[h][q + m * Q] = x[m % A * B + m / A];
                {Y}[h][q + m * Q] = y[m % A * B + m / A];
            }}
        }}
        {exchange}
    }}
"""

# From where a pass leaves elements to where the next one looks for them.
_EXCHANGE = """
        EACH_THREAD
        UNROLL for (int q = 0; q < Q; ++q)
        {{
            const int butterfly = first_thread + h + q * T;
            const int begin = butterfly / L * (L * R) + butterfly % L;
            UNROLL for (int m = 0; m < R; ++m) passed[PLACE(begin + m * L)] = {X}[h][q + m * Q];
        }}
        WAIT
        EACH_THREAD EACH_ELEMENT {X}[h][j] = passed[PLACE(COLUMN)];
        WAIT
"""

# The same for rows of which only a half can be passed on at once. What comes of the first half waits until the second has gone.
_EXCHANGE_HALVES = """
        {{
            float first_half[HELD][E / 2];
            UNROLL for (int half = 0; half < 2; ++half)
            {{
                EACH_THREAD
                UNROLL for (int q = 0; q < Q; ++q)
                {{
                    const int butterfly = first_thread + h + q * T;
                    const int begin = butterfly / L * (L * R) + butterfly % L - half * PASSED;
                    UNROLL for (int m = 0; m < R; ++m)
                    {{
                        const int place = begin + m * L;
                        if (place >= 0 && place < PASSED) passed[PLACE(place)] = {X}[h][q + m * Q];
                    }}
                }}
                WAIT
                EACH_THREAD
                UNROLL for (int j = 0; j < E / 2; ++j)
                {{
                    if (half == 0) first_half[h][j] = passed[PLACE(COLUMN)];
                    else {X}[h][E / 2 + j] = passed[PLACE(COLUMN)];
                }}
                WAIT
            }}
            EACH_THREAD UNROLL for (int j = 0; j < E / 2; ++j) {X}[h][j] = first_half[h][j];
        }}
"""

_LOAD_ROWS = """
    const int even = 2 * row;
    EACH_THREAD EACH_ELEMENT
    {
        const bool there = COLUMN < rows.shape[1];
        const size_t at = (size_t)even * rows.shape[1] + COLUMN;
        real[h][j] = there && even < rows.shape[0] ? rows.data[at] : 0.0f;
        imaginary[h][j] = there && even + 1 < rows.shape[0] ? rows.data[at + rows.shape[1]] : 0.0f;
    }
"""

_STORE_ROWS = """
    const int even = 2 * row;
    EACH_THREAD EACH_ELEMENT if (COLUMN < rows.shape[1])
    {
        const size_t at = (size_t)even * rows.shape[1] + COLUMN;
        if (even < rows.shape[0]) rows.data[at] = real[h][j];
        if (even + 1 < rows.shape[0]) rows.data[at + rows.shape[1]] = imaginary[h][j];
    }
"""

# Of complex rows only `used` elements are read, the others being zero, and written.
_LOAD_COMPLEX = """
    EACH_THREAD EACH_ELEMENT
    {
        wp::vec2 value = wp::vec2(0.0f, 0.0f);
        if (row < complex.shape[0] && COLUMN < used) value = complex.data[(size_t)row * N + COLUMN];
        real[h][j] = value[0];
        imaginary[h][j] = value[1];
    }
"""

_STORE_COMPLEX = """
    EACH_THREAD EACH_ELEMENT if (row < complex.shape[0] && COLUMN < used)
        complex.data[(size_t)row * N + COLUMN] = wp::vec2(real[h][j], imaginary[h][j]);
"""

_ADD_COMPLEX = """
    EACH_THREAD EACH_ELEMENT if (row < complex.shape[0] && COLUMN < used)
    {
        wp::vec2& sum = sums.data[(size_t)row * N + COLUMN];
        sum = wp::vec2(sum[0] + real[h][j], sum[1] + imaginary[h][j]);
    }
"""

# The columns of one mesh come after those of another.
_MULTIPLY = """
    EACH_THREAD EACH_ELEMENT if (row < complex.shape[0])
    {
        const float factor = influence.data[(size_t)(row % influence.shape[0]) * N + COLUMN];
        real[h][j] *= factor;
        imaginary[h][j] *= factor;
    }
"""


def _transform(length: int, *, inverse: bool = False) -> str:
    """Code that transforms the rows that threads hold; the inverse, which is not divided by the length, with its parts swapped."""
    x, y = ("imaginary", "real") if inverse else ("real", "imaginary")
    turns = [-2.0 * math.pi * k / 16.0 for k in range(10)]
    cosines, sines = (", ".join(f"{function(turn):.9f}f" for turn in turns) for function in (math.cos, math.sin))
    code, done = "", 1
    while done < length:
        left = length // done
        # The odd one comes first, which has no factors.
        radix = RADIX if _is_power(left, RADIX) else left // RADIX ** int(math.log(left, RADIX))
        passing = _EXCHANGE if length <= MOST_PASSED else _EXCHANGE_HALVES
        exchange = "" if done * radix == length else "".join(passing.format(X=part) for part in (x, y))
        inner = max(1, radix // 4)
        code += _PASS.format(
            radix=radix, done=done, inner=inner, X=x, Y=y, cosines=cosines, sines=sines, exchange=exchange
        )
        done *= radix
    return code


def _is_power(number: int, base: int) -> bool:
    while number % base == 0:
        number //= base
    return number == 1


def threads_of(length: int) -> int:
    """Threads that a row is transformed by."""
    return min(length // RADIX, MOST_THREADS)


def block_of(length: int) -> int:
    """Threads of a block: those of a row, or of several short ones."""
    return max(FEWEST_THREADS, threads_of(length))


class TransformsOfLength(NamedTuple):
    """The kernels that transform rows of one length, which share a module. They want :func:`threads_of` threads for each.

    Attributes:
        forward: Pairs of real rows into complex ones; real rows that are shorter are padded by zeros.
        back: The inverse; real rows that are shorter are cut off.
        convolve: Transforms columns, transposed into rows, multiplies them by an influence function and transforms them back. Only
            their first ``used`` elements are there, and wanted.
        add_convolved: The same, but columns stay as they are, and what comes of them is added to sums.
    """

    forward: wp.Kernel
    back: wp.Kernel
    convolve: wp.Kernel
    add_convolved: wp.Kernel


@cache
def transforms_of(length: int) -> TransformsOfLength:
    """Return the kernels for rows of ``length``, a power of two from 64 to 16384."""
    module, block = f"{__name__}_{length}", block_of(length)
    # No thread gets more registers than let so many threads run side by side.
    bounds = (block, MOST_THREADS // block)
    threads = threads_of(length)
    common = _COMMON.format(
        length=length,
        elements=length // threads,
        passed=min(length, MOST_PASSED),
        rows_per_block=block // threads,
    )
    there, back_again = _transform(length), _transform(length, inverse=True)

    whole = "const int used = N;"

    @wp.func_native(common + whole + _LOAD_ROWS + there + _STORE_COMPLEX)
    def of_rows(thread: int, rows: wp.array2d(dtype=float), complex: wp.array2d(dtype=wp.vec2)): ...

    @wp.func_native(common + whole + _LOAD_COMPLEX + back_again + _STORE_ROWS)
    def to_rows(thread: int, complex: wp.array2d(dtype=wp.vec2), rows: wp.array2d(dtype=float)): ...

    @wp.func_native(common + _LOAD_COMPLEX + there + _MULTIPLY + back_again + _STORE_COMPLEX)
    def convolve_column(
        thread: int, used: int, influence: wp.array2d(dtype=float), complex: wp.array2d(dtype=wp.vec2)
    ): ...

    @wp.func_native(common + _LOAD_COMPLEX + there + _MULTIPLY + back_again + _ADD_COMPLEX)
    def add_convolved_column(
        thread: int,
        used: int,
        influence: wp.array2d(dtype=float),
        complex: wp.array2d(dtype=wp.vec2),
        sums: wp.array2d(dtype=wp.vec2),
    ): ...

    @wp.kernel(module=module, launch_bounds=bounds)
    def transform_pairs(rows: wp.array2d(dtype=float), pairs: wp.array2d(dtype=wp.vec2)):
        of_rows(wp.tid(), rows, pairs)

    @wp.kernel(module=module, launch_bounds=bounds)
    def transform_pairs_back(pairs: wp.array2d(dtype=wp.vec2), rows: wp.array2d(dtype=float)):
        to_rows(wp.tid(), pairs, rows)

    @wp.kernel(module=module, launch_bounds=bounds)
    def convolve(used: int, influence: wp.array2d(dtype=float), columns: wp.array2d(dtype=wp.vec2)):
        convolve_column(wp.tid(), used, influence, columns)

    @wp.kernel(module=module, launch_bounds=bounds)
    def add_convolved(
        used: int,
        influence: wp.array2d(dtype=float),
        columns: wp.array2d(dtype=wp.vec2),
        sums: wp.array2d(dtype=wp.vec2),
    ):
        add_convolved_column(wp.tid(), used, influence, columns, sums)

    wp.set_module_options({"enable_backward": False}, module)
    return TransformsOfLength(transform_pairs, transform_pairs_back, convolve, add_convolved)


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
    """Take the transforms of pairs of real rows apart, keep their first halves and transpose; what is beyond ``row_count`` stays.

    Meshes lie one after the other.

    With Z the transform of a + i b, that of a is (Z[k] + conj Z[-k]) / 2 and that of b (Z[k] - conj Z[-k]) / 2i.
    """
    i, row = tile_element(wp.tid(), row_count)
    if i < columns.shape[0] and row < row_count:
        half = pairs.shape[1] / 2 + 1
        mesh = i / half
        k = i - mesh * half
        mirror = int(0)
        if k > 0:
            mirror = pairs.shape[1] - k
        pair = (mesh * row_count + row) / 2
        p = pairs[pair, k]
        q = pairs[pair, mirror]
        if row % 2 == 0:
            columns[i, row] = wp.vec2(0.5 * (p[0] + q[0]), 0.5 * (p[1] - q[1]))
        else:
            columns[i, row] = wp.vec2(0.5 * (p[1] + q[1]), 0.5 * (q[0] - p[0]))


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
