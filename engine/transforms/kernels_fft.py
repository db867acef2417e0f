"""Fast Fourier transforms of mesh rows and columns on the CPU (see :mod:`.kernels_fft_gpu` for GPUs).

A row of real numbers has a transform whose second half mirrors the first. So two rows travel through one complex transform, as its
real and imaginary parts, and only the halves of their transforms are kept: *half rows*, padded to whole blocks of lanes.

Every kernel handles :data:`LANES` pairs of rows, or columns, at once. A block is held in scratch memory as ``[element][lane]``,
real and imaginary parts apart, and transformed by Stockham's self-sorting algorithm with radix 8, 4, 3, 5 and 2. What is done to an
element is done to all of its lanes, as one vector.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

LANES = 16


def _compiled_once(body: str) -> str:
    """Keep a function out of its callers, every kernel of which has two variants that would each compile it again.

    Where a processor has vectors of 64 bytes, they are used, too; compilers leave them alone unless told so.
    """
    return f"""
    auto run = [&]() __attribute__((always_inline)) {{ {body} }};
    struct Once
    {{
        static __attribute__((noinline, min_vector_width(512))) auto call(decltype(run)& of) {{ return of(); }}
    }};
    return Once::call(run);
"""


def _zip_mask(first: int) -> str:
    """Indices that interleave two vectors from lane ``first`` on."""
    return ", ".join(f"{first + k // 2 + (k % 2) * LANES}" for k in range(LANES))


# Vectors of all lanes, and the two parts of one of scratch memory's two halves. Zipping the first half of a tile's rows with the
# second rotates an element's address (row, column) by one bit; when all bits of the row have gone round, the tile is transposed.
_VECTORS = f"""
    enum {{ L = {LANES} }};
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef struct {{ V lane[L]; }} Tile;
    #define VECTOR(p) (*(V*)(p))
    #define REAL(parity) ((V*)scratch.data + (size_t)(parity) * length * 2)
    #define IMAGINARY(parity) (REAL(parity) + length)
    auto transpose = [](Tile& t)
    {{
        for (int round = 1; round < L; round *= 2)
        {{
            Tile z;
            #pragma clang loop unroll(full)
            for (int i = 0; i < L / 2; ++i)
            {{
                z.lane[2 * i] = __builtin_shufflevector(t.lane[i], t.lane[i + L / 2], {_zip_mask(0)});
                z.lane[2 * i + 1] = __builtin_shufflevector(t.lane[i], t.lane[i + L / 2], {_zip_mask(LANES // 2)});
            }}
            t = z;
        }}
    }};
"""

# Transforms the block in half `parity` of scratch, forward; with the two parts swapped it is the inverse. Returns the half that the
# result lies in.
_TRANSFORM = (
    _VECTORS
    + """
    const float* __restrict__ cosine = twiddle.data;
    const float* __restrict__ sine = twiddle.data + length;
    int n = length;
    int s = 1;
    while (n > 1)
    {
        const V* __restrict__ xr = inverse ? IMAGINARY(parity) : REAL(parity);
        const V* __restrict__ xi = inverse ? REAL(parity) : IMAGINARY(parity);
        V* __restrict__ yr = inverse ? IMAGINARY(1 - parity) : REAL(1 - parity);
        V* __restrict__ yi = inverse ? REAL(1 - parity) : IMAGINARY(1 - parity);
        const int step = length / n;
        // A pass goes through memory of the second level. So as few as it takes: 16 are better two fours than an eight and a two.
        const bool eight = n % 8 == 0 && (n % 16 != 0 || n % 32 == 0);
        const int radix = eight ? 8 : n % 4 == 0 ? 4 : n % 3 == 0 ? 3 : n % 5 == 0 ? 5 : 2;
        const int m = n / radix;
        const int b = s * m;
        for (int p = 0; p < m; ++p)
        {
            const float c1 = cosine[p * step], s1 = sine[p * step];
            const float c2 = cosine[2 * p * step], s2 = sine[2 * p * step];
            const float c3 = radix > 3 ? cosine[3 * p * step] : 0.0f, s3 = radix > 3 ? sine[3 * p * step] : 0.0f;
            #define TURN(to, re, im, c, d) { const V u = re, v = im; yr[to] = u * c - v * d; yi[to] = u * d + v * c; }
            if (radix == 8)
            {
                float c[8], d[8];
                for (int k = 1; k < 8; ++k) c[k] = cosine[k * p * step], d[k] = sine[k * p * step];
                for (int q = 0; q < s; ++q)
                {
                    const float h = 0.70710678118654752f;
                    const int a = s * p + q, o = 8 * s * p + q;
                    // Sums and differences of those half a period apart: even elements of the result come of the sums.
                    V sr[4], si[4], er[4], ei[4];
                    #pragma clang loop unroll(full)
                    for (int k = 0; k < 4; ++k)
                    {
                        const V br = xr[a + k * b], bi = xi[a + k * b], cr = xr[a + (k + 4) * b], ci = xi[a + (k + 4) * b];
                        sr[k] = br + cr;
                        si[k] = bi + ci;
                        er[k] = br - cr;
                        ei[k] = bi - ci;
                    }
                    // The differences, turned by 0, 1, 2 and 3 eighths of a circle.
                    const V fr = h * (er[1] + ei[1]), fi = h * (ei[1] - er[1]);
                    const V gr = h * (ei[3] - er[3]), gi = -h * (er[3] + ei[3]);
                    {
                        const V pr = sr[0] + sr[2], pi = si[0] + si[2], qr = sr[0] - sr[2], qi = si[0] - si[2];
                        const V rr = sr[1] + sr[3], ri = si[1] + si[3], tr = si[1] - si[3], ti = sr[3] - sr[1];
                        yr[o] = pr + rr;
                        yi[o] = pi + ri;
                        TURN(o + 2 * s, qr + tr, qi + ti, c[2], d[2])
                        TURN(o + 4 * s, pr - rr, pi - ri, c[4], d[4])
                        TURN(o + 6 * s, qr - tr, qi - ti, c[6], d[6])
                    }
                    {
                        const V pr = er[0] + ei[2], pi = ei[0] - er[2], qr = er[0] - ei[2], qi = ei[0] + er[2];
                        const V rr = fr + gr, ri = fi + gi, tr = fi - gi, ti = gr - fr;
                        TURN(o + s, pr + rr, pi + ri, c[1], d[1])
                        TURN(o + 3 * s, qr + tr, qi + ti, c[3], d[3])
                        TURN(o + 5 * s, pr - rr, pi - ri, c[5], d[5])
                        TURN(o + 7 * s, qr - tr, qi - ti, c[7], d[7])
                    }
                }
            }
            else if (radix == 4)
                for (int q = 0; q < s; ++q)
                {
                    const int a = s * p + q, o = 4 * s * p + q;
                    const V ar = xr[a], ai = xi[a], br = xr[a + b], bi = xi[a + b];
                    const V cr = xr[a + 2 * b], ci = xi[a + 2 * b], dr = xr[a + 3 * b], di = xi[a + 3 * b];
                    const V pr = ar + cr, pi = ai + ci, qr = ar - cr, qi = ai - ci;
                    const V rr = br + dr, ri = bi + di, tr = bi - di, ti = dr - br;
                    yr[o] = pr + rr;
                    yi[o] = pi + ri;
                    TURN(o + s, qr + tr, qi + ti, c1, s1)
                    TURN(o + 2 * s, pr - rr, pi - ri, c2, s2)
                    TURN(o + 3 * s, qr - tr, qi - ti, c3, s3)
                }
            else if (radix == 3)
                for (int q = 0; q < s; ++q)
                {
                    const float h = 0.86602540378443865f;
                    const int a = s * p + q, o = 3 * s * p + q;
                    const V ar = xr[a], ai = xi[a], br = xr[a + b], bi = xi[a + b];
                    const V cr = xr[a + 2 * b], ci = xi[a + 2 * b];
                    const V pr = br + cr, pi = bi + ci;
                    const V qr = ar - 0.5f * pr, qi = ai - 0.5f * pi;
                    const V tr = h * (bi - ci), ti = h * (cr - br);
                    yr[o] = ar + pr;
                    yi[o] = ai + pi;
                    TURN(o + s, qr + tr, qi + ti, c1, s1)
                    TURN(o + 2 * s, qr - tr, qi - ti, c2, s2)
                }
            else if (radix == 5)
                for (int q = 0; q < s; ++q)
                {
                    const float e1 = 0.30901699437494742f, e2 = -0.80901699437494742f;
                    const float f1 = 0.95105651629515357f, f2 = 0.58778525229247313f;
                    const float c4 = cosine[4 * p * step], s4 = sine[4 * p * step];
                    const int a = s * p + q, o = 5 * s * p + q;
                    const V ar = xr[a], ai = xi[a];
                    const V br = xr[a + b] + xr[a + 4 * b], bi = xi[a + b] + xi[a + 4 * b];
                    const V cr = xr[a + 2 * b] + xr[a + 3 * b], ci = xi[a + 2 * b] + xi[a + 3 * b];
                    const V dr = xr[a + b] - xr[a + 4 * b], di = xi[a + b] - xi[a + 4 * b];
                    const V er = xr[a + 2 * b] - xr[a + 3 * b], ei = xi[a + 2 * b] - xi[a + 3 * b];
                    const V pr = ar + e1 * br + e2 * cr, pi = ai + e1 * bi + e2 * ci;
                    const V qr = ar + e2 * br + e1 * cr, qi = ai + e2 * bi + e1 * ci;
                    const V tr = f1 * di + f2 * ei, ti = -(f1 * dr + f2 * er);
                    const V ur = f2 * di - f1 * ei, ui = -(f2 * dr - f1 * er);
                    yr[o] = ar + br + cr;
                    yi[o] = ai + bi + ci;
                    TURN(o + s, pr + tr, pi + ti, c1, s1)
                    TURN(o + 2 * s, qr + ur, qi + ui, c2, s2)
                    TURN(o + 3 * s, qr - ur, qi - ui, c3, s3)
                    TURN(o + 4 * s, pr - tr, pi - ti, c4, s4)
                }
            else
                for (int q = 0; q < s; ++q)
                {
                    const int a = s * p + q, o = 2 * s * p + q;
                    const V ar = xr[a], ai = xi[a], br = xr[a + b], bi = xi[a + b];
                    yr[o] = ar + br;
                    yi[o] = ai + bi;
                    TURN(o + s, ar - br, ai - bi, c1, s1)
                }
        }
        n = m;
        s *= radix;
        parity = 1 - parity;
    }
    return parity;
"""
)


@wp.func_native(_compiled_once(_TRANSFORM))
def transform(
    scratch: wp.array(dtype=float), parity: int, length: int, twiddle: wp.array(dtype=float), inverse: int
) -> int: ...


@wp.struct
class HalfRows:
    """Halves of transforms, real and imaginary parts apart.

    Of every mesh :data:`LANES` columns after :data:`LANES` columns, and of these row after row: a block of columns is one piece of
    memory, and so is what a block of rows has of it.
    """

    real: wp.array(dtype=float)
    imaginary: wp.array(dtype=float)


@wp.struct
class Block:
    """Rows ``row`` to ``end``, or columns from ``column`` on, whose elements are transformed at once.

    Their mesh has the rows ``begin`` to ``end``. ``used`` elements of them are there, padded by zeros to ``length``; half rows are
    ``stride`` long.
    """

    begin: int
    row: int
    end: int
    column: int
    used: int
    length: int
    stride: int


# What the snippets below call the parts of their block.
_BLOCK = (
    _VECTORS
    + """
    const int begin = block.begin, row = block.row, end = block.end, column = block.column;
    const int used = block.used, length = block.length, stride = block.stride;
    // Where half rows have columns k to k + L of row r.
    #define PLACE(r, k) ((size_t)begin * stride + (size_t)(k) * (end - begin) + (size_t)((r) - begin) * L)
"""
)

# Lane l holds the real rows row + 2 l (as real part) and row + 2 l + 1 (as imaginary part); rows that are not there count as zeros.
_LOAD_ROWS = (
    _BLOCK
    + """
    for (int part = 0; part < 2; ++part)
    {
        V* __restrict__ to = REAL(0) + (size_t)part * length;
        int k = 0;
        for (; k + L <= used; k += L)
        {
            Tile t;
            for (int l = 0; l < L; ++l)
            {
                const int r = row + 2 * l + part;
                t.lane[l] = r < end ? VECTOR(real.data + (size_t)r * used + k) : (V)0.0f;
            }
            transpose(t);
            for (int e = 0; e < L; ++e) to[k + e] = t.lane[e];
        }
        for (; k < used; ++k)
            for (int l = 0; l < L; ++l)
            {
                const int r = row + 2 * l + part;
                to[k][l] = r < end ? real.data[(size_t)r * used + k] : 0.0f;
            }
        for (; k < length; ++k) to[k] = (V)0.0f;
    }
"""
)

_STORE_ROWS = (
    _BLOCK
    + """
    for (int part = 0; part < 2; ++part)
    {
        const V* __restrict__ from = REAL(parity) + (size_t)part * length;
        for (int k = 0; k < used; k += L)
        {
            Tile t;
            // Scratch is longer than what is used of it, so that reading a whole tile stays inside.
            for (int e = 0; e < L; ++e) t.lane[e] = from[k + e];
            transpose(t);
            for (int l = 0; l < L; ++l)
            {
                const int r = row + 2 * l + part;
                if (r >= end) continue;
                float* __restrict__ to = real.data + (size_t)r * used + k;
                if (k + L <= used) VECTOR(to) = t.lane[l];
                else for (int e = 0; e < used - k; ++e) to[e] = t.lane[l][e];
            }
        }
    }
"""
)

# With Z the transform of a + i b, that of a is (Z[k] + conj Z[-k]) / 2 and that of b (Z[k] - conj Z[-k]) / 2i.
_STORE_HALF_ROWS = (
    _BLOCK
    + """
    const V* __restrict__ re = REAL(parity);
    const V* __restrict__ im = IMAGINARY(parity);
    for (int k = 0; k < stride; k += L)
    {
        Tile t[4];
        for (int e = 0; e < L; ++e)
        {
            const int j = k + e;
            const bool there = j <= length / 2;
            const int mirror = there && j > 0 ? length - j : 0;
            const V pr = re[there ? j : 0], pi = im[there ? j : 0], qr = re[mirror], qi = im[mirror];
            t[0].lane[e] = there ? 0.5f * (pr + qr) : (V)0.0f;
            t[1].lane[e] = there ? 0.5f * (pi - qi) : (V)0.0f;
            t[2].lane[e] = there ? 0.5f * (pi + qi) : (V)0.0f;
            t[3].lane[e] = there ? 0.5f * (qr - pr) : (V)0.0f;
        }
        for (int i = 0; i < 4; ++i)
        {
            transpose(t[i]);
            float* __restrict__ to = i % 2 == 0 ? half.real.data : half.imaginary.data;
            for (int l = 0; l < L; ++l)
            {
                const int r = row + 2 * l + i / 2;
                if (r < end) VECTOR(to + PLACE(r, k)) = t[i].lane[l];
            }
        }
    }
"""
)

_LOAD_HALF_ROWS = (
    _BLOCK
    + """
    V* __restrict__ re = REAL(0);
    V* __restrict__ im = IMAGINARY(0);
    // Wave numbers beyond the stride are 0.
    for (int k = stride; k <= length - stride; ++k) re[k] = im[k] = (V)0.0f;
    for (int k = 0; k <= length / 2 && k < stride; k += L)
    {
        Tile t[4];
        for (int i = 0; i < 4; ++i)
        {
            const float* __restrict__ from = i % 2 == 0 ? half.real.data : half.imaginary.data;
            for (int l = 0; l < L; ++l)
            {
                const int r = row + 2 * l + i / 2;
                t[i].lane[l] = r < end ? VECTOR(from + PLACE(r, k)) : (V)0.0f;
            }
            transpose(t[i]);
        }
        for (int e = 0; e < L; ++e)
        {
            const int j = k + e;
            if (j > length / 2) break;
            const V ar = t[0].lane[e], ai = t[1].lane[e], br = t[2].lane[e], bi = t[3].lane[e];
            if (j > 0)
            {
                re[length - j] = ar + bi;
                im[length - j] = br - ai;
            }
            re[j] = ar - bi;
            im[j] = ai + br;
        }
    }
"""
)

_LOAD_COLUMNS = (
    _BLOCK
    + """
    V* __restrict__ re = REAL(0);
    V* __restrict__ im = IMAGINARY(0);
    for (int k = 0; k < used; ++k)
    {
        re[k] = VECTOR(half.real.data + PLACE(row + k, column));
        im[k] = VECTOR(half.imaginary.data + PLACE(row + k, column));
    }
    for (int k = used; k < length; ++k) re[k] = im[k] = (V)0.0f;
"""
)

_STORE_COLUMNS = (
    _BLOCK
    + """
    const V* __restrict__ re = REAL(parity);
    const V* __restrict__ im = IMAGINARY(parity);
    for (int k = 0; k < used; ++k)
    {
        VECTOR(half.real.data + PLACE(row + k, column)) = re[k];
        VECTOR(half.imaginary.data + PLACE(row + k, column)) = im[k];
    }
"""
)

_MULTIPLY = (
    _BLOCK
    + """
    V* __restrict__ re = REAL(parity);
    V* __restrict__ im = IMAGINARY(parity);
    for (int k = 0; k < length; ++k)
    {
        const int folded = k <= length / 2 ? k : length - k;
        const V g = VECTOR(influence.data + (size_t)folded * stride + column);
        re[k] *= g;
        im[k] *= g;
    }
"""
)

# Sums over meshes lie in scratch memory behind the two halves of the block, real and imaginary parts of each one after the other.
_ADD_PRODUCTS = (
    _BLOCK
    + """
    const V* __restrict__ re = REAL(parity);
    const V* __restrict__ im = IMAGINARY(parity);
    for (int sum = 0; sum < sums; ++sum)
    {
        const float* __restrict__ values = (const float*)influences.data[sum * meshes + mesh];
        V* __restrict__ sum_re = REAL(2 + sum);
        V* __restrict__ sum_im = IMAGINARY(2 + sum);
        for (int k = 0; k < length; ++k)
        {
            const int folded = k <= length / 2 ? k : length - k;
            const V g = VECTOR(values + (size_t)folded * stride + column);
            sum_re[k] = mesh == 0 ? re[k] * g : sum_re[k] + re[k] * g;
            sum_im[k] = mesh == 0 ? im[k] * g : sum_im[k] + im[k] * g;
        }
    }
"""
)

_TAKE_SUM = (
    _BLOCK
    + """
    for (int k = 0; k < length; ++k)
    {
        REAL(0)[k] = REAL(2 + sum)[k];
        IMAGINARY(0)[k] = IMAGINARY(2 + sum)[k];
    }
"""
)

# Columns of a mesh that is even in y, of which rows 0 .. length / 2 are there: their transforms are real and even again.
_LOAD_EVEN_COLUMNS = (
    _BLOCK
    + """
    for (int k = 0; k < length; ++k)
    {
        REAL(0)[k] = VECTOR(half.real.data + PLACE(k <= length / 2 ? k : length - k, column));
        IMAGINARY(0)[k] = (V)0.0f;
    }
"""
)

_STORE_EVEN_COLUMNS = (
    _BLOCK
    + """
    for (int k = 0; k <= length / 2; ++k) VECTOR(influence.data + (size_t)k * stride + column) = REAL(parity)[k];
"""
)


@wp.func_native(_compiled_once(_LOAD_ROWS))
def load_rows(real: wp.array(dtype=float), block: Block, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_STORE_ROWS))
def store_rows(scratch: wp.array(dtype=float), parity: int, block: Block, real: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_LOAD_HALF_ROWS))
def load_half_rows(half: HalfRows, block: Block, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_STORE_HALF_ROWS))
def store_half_rows(scratch: wp.array(dtype=float), parity: int, block: Block, half: HalfRows): ...


@wp.func_native(_compiled_once(_LOAD_COLUMNS))
def load_columns(half: HalfRows, block: Block, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_STORE_COLUMNS))
def store_columns(scratch: wp.array(dtype=float), parity: int, block: Block, half: HalfRows): ...


@wp.func_native(_compiled_once(_MULTIPLY))
def multiply(influence: wp.array(dtype=float), block: Block, parity: int, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_ADD_PRODUCTS))
def add_products(
    influences: wp.array(dtype=wp.uint64),
    mesh: int,
    meshes: int,
    sums: int,
    block: Block,
    parity: int,
    scratch: wp.array(dtype=float),
): ...


@wp.func_native(_compiled_once(_TAKE_SUM))
def take_sum(sum: int, block: Block, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_LOAD_EVEN_COLUMNS))
def load_even_columns(half: HalfRows, block: Block, scratch: wp.array(dtype=float)): ...


@wp.func_native(_compiled_once(_STORE_EVEN_COLUMNS))
def store_even_columns(scratch: wp.array(dtype=float), parity: int, block: Block, influence: wp.array(dtype=float)): ...


@wp.func
def block_of_rows(number: int, row_count: int, used: int, length: int, stride: int):
    """A block of rows of meshes of ``row_count`` rows, which lie one after the other."""
    blocks = (row_count + 2 * LANES - 1) / (2 * LANES)
    mesh = number / blocks
    block = Block()
    block.begin = mesh * row_count
    block.row = block.begin + (number - mesh * blocks) * 2 * LANES
    block.end = (mesh + 1) * row_count
    block.used = used
    block.length = length
    block.stride = stride
    return block


@wp.func
def block_of_columns(number: int, used: int, length: int, stride: int):
    """A block of columns of meshes of ``used`` rows, which lie one after the other."""
    blocks = stride / LANES
    block = Block()
    block.begin = number / blocks * used
    block.row = block.begin
    block.end = block.row + used
    block.column = number % blocks * LANES
    block.used = used
    block.length = length
    block.stride = stride
    return block


@wp.kernel
def transform_rows(
    first: int,
    thread: int,
    scratch: wp.array2d(dtype=float),
    twiddle: wp.array(dtype=float),
    row_count: int,
    used: int,
    length: int,
    stride: int,
    real: wp.array(dtype=float),
    # outputs
    half: HalfRows,
):
    """Transform real rows of ``used`` elements, padded by zeros to ``length``, into half rows of ``stride``, or as much of them."""
    block = block_of_rows(first + wp.tid(), row_count, used, length, stride)
    own = scratch[thread]
    load_rows(real, block, own)
    parity = transform(own, 0, length, twiddle, 0)
    store_half_rows(own, parity, block, half)


@wp.kernel
def convolve_columns(
    first: int,
    thread: int,
    scratch: wp.array2d(dtype=float),
    twiddle: wp.array(dtype=float),
    used: int,
    length: int,
    stride: int,
    influence: wp.array(dtype=float),
    # outputs
    half: HalfRows,
):
    """Transform columns of ``used`` elements padded to ``length``, multiply by the influence function, transform back."""
    block = block_of_columns(first + wp.tid(), used, length, stride)
    own = scratch[thread]
    load_columns(half, block, own)
    parity = transform(own, 0, length, twiddle, 0)
    multiply(influence, block, parity, own)
    parity = transform(own, parity, length, twiddle, 1)
    store_columns(own, parity, block, half)


@wp.kernel
def convolve_columns_to_sums(
    first: int,
    thread: int,
    scratch: wp.array2d(dtype=float),
    twiddle: wp.array(dtype=float),
    used: int,
    length: int,
    stride: int,
    influences: wp.array(dtype=wp.uint64),
    meshes: int,
    sums: int,
    # outputs
    half: HalfRows,
):
    """The same of a block of columns of ``meshes``, added up: what becomes of mesh j in sum k has element k * meshes + j.

    ``influences`` are addresses. Sums take the place of the first meshes; there are no more of them.
    """
    number = first + wp.tid()
    blocks = stride / LANES
    own = scratch[thread]
    for mesh in range(meshes):
        block = block_of_columns(mesh * blocks + number, used, length, stride)
        load_columns(half, block, own)
        there = transform(own, 0, length, twiddle, 0)
        add_products(influences, mesh, meshes, sums, block, there, own)
    for sum in range(sums):
        block = block_of_columns(sum * blocks + number, used, length, stride)
        take_sum(sum, block, own)
        there = transform(own, 0, length, twiddle, 1)
        store_columns(own, there, block, half)


@wp.kernel
def transform_rows_back(
    first: int,
    thread: int,
    scratch: wp.array2d(dtype=float),
    twiddle: wp.array(dtype=float),
    row_count: int,
    used: int,
    length: int,
    stride: int,
    half: HalfRows,
    # outputs
    real: wp.array(dtype=float),
):
    """The inverse of :func:`transform_rows`, times ``length``; the padding is left out, and wave numbers from ``stride`` on are 0."""
    block = block_of_rows(first + wp.tid(), row_count, used, length, stride)
    own = scratch[thread]
    load_half_rows(half, block, own)
    parity = transform(own, 0, length, twiddle, 1)
    store_rows(own, parity, block, real)


@wp.kernel
def transform_even_columns(
    first: int,
    thread: int,
    scratch: wp.array2d(dtype=float),
    twiddle: wp.array(dtype=float),
    length: int,
    stride: int,
    half: HalfRows,
    # outputs
    influence: wp.array(dtype=float),
):
    """Transform the columns of an even mesh, whose rows are transformed: its real and even transform."""
    block = block_of_columns(first + wp.tid(), length / 2 + 1, length, stride)
    own = scratch[thread]
    load_even_columns(half, block, own)
    parity = transform(own, 0, length, twiddle, 0)
    store_even_columns(own, parity, block, influence)
