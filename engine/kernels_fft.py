"""Fast Fourier transforms of mesh rows and columns on the CPU (see :mod:`.kernels_fft_gpu` for GPUs).

Every kernel handles blocks of :data:`LANES` rows or columns at once. A block is held in scratch memory as
``[element][lane]``, real and imaginary parts apart, and transformed by Stockham's self-sorting algorithm with radix 4, 3
and 2; the innermost loop runs over the lanes, which is what turns it into vector instructions.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

LANES = 16

# Transforms `length` elements of LANES lanes in scratch, forward; swapping the two parts before and after is the
# inverse. Returns 0 when the result lies in the first half of scratch, 1 for the second.
_TRANSFORM = """
    enum { L = 16 };
    const size_t half = (size_t)length * L * 2;
    const float* __restrict__ cosine = twiddle.data;
    const float* __restrict__ sine = twiddle.data + length;
    int n = length;
    int s = 1;
    int parity = 0;
    while (n > 1)
    {
        const float* __restrict__ xr = scratch.data + offset + (size_t)parity * half + (inverse ? (size_t)length * L : 0);
        const float* __restrict__ xi = scratch.data + offset + (size_t)parity * half + (inverse ? 0 : (size_t)length * L);
        float* __restrict__ yr = scratch.data + offset + (size_t)(1 - parity) * half + (inverse ? (size_t)length * L : 0);
        float* __restrict__ yi = scratch.data + offset + (size_t)(1 - parity) * half + (inverse ? 0 : (size_t)length * L);
        const int step = length / n;
        if (n % 4 == 0)
        {
            const int m = n / 4;
            for (int p = 0; p < m; ++p)
            {
                const float c1 = cosine[p * step], s1 = sine[p * step];
                const float c2 = cosine[2 * p * step], s2 = sine[2 * p * step];
                const float c3 = cosine[3 * p * step], s3 = sine[3 * p * step];
                const size_t a = (size_t)s * p * L, b = (size_t)s * m * L, o = (size_t)s * 4 * p * L, d = (size_t)s * L;
                #pragma clang loop vectorize(enable)
                for (int k = 0; k < s * L; ++k)
                {
                    const float ar = xr[a + k], ai = xi[a + k];
                    const float br = xr[a + b + k], bi = xi[a + b + k];
                    const float cr = xr[a + 2 * b + k], ci = xi[a + 2 * b + k];
                    const float dr = xr[a + 3 * b + k], di = xi[a + 3 * b + k];
                    const float pr = ar + cr, pi = ai + ci, qr = ar - cr, qi = ai - ci;
                    const float rr = br + dr, ri = bi + di, tr = bi - di, ti = dr - br;
                    yr[o + k] = pr + rr;
                    yi[o + k] = pi + ri;
                    const float ur = qr + tr, ui = qi + ti;
                    yr[o + d + k] = ur * c1 - ui * s1;
                    yi[o + d + k] = ur * s1 + ui * c1;
                    const float vr = pr - rr, vi = pi - ri;
                    yr[o + 2 * d + k] = vr * c2 - vi * s2;
                    yi[o + 2 * d + k] = vr * s2 + vi * c2;
                    const float wr = qr - tr, wi = qi - ti;
                    yr[o + 3 * d + k] = wr * c3 - wi * s3;
                    yi[o + 3 * d + k] = wr * s3 + wi * c3;
                }
            }
            n = m;
            s *= 4;
        }
        else if (n % 3 == 0)
        {
            const int m = n / 3;
            const float h = -0.86602540378443865f;
            for (int p = 0; p < m; ++p)
            {
                const float c1 = cosine[p * step], s1 = sine[p * step];
                const float c2 = cosine[2 * p * step], s2 = sine[2 * p * step];
                const size_t a = (size_t)s * p * L, b = (size_t)s * m * L, o = (size_t)s * 3 * p * L, d = (size_t)s * L;
                #pragma clang loop vectorize(enable)
                for (int k = 0; k < s * L; ++k)
                {
                    const float ar = xr[a + k], ai = xi[a + k];
                    const float br = xr[a + b + k], bi = xi[a + b + k];
                    const float cr = xr[a + 2 * b + k], ci = xi[a + 2 * b + k];
                    const float pr = br + cr, pi = bi + ci;
                    const float qr = ar - 0.5f * pr, qi = ai - 0.5f * pi;
                    const float tr = -h * (bi - ci), ti = h * (br - cr);
                    yr[o + k] = ar + pr;
                    yi[o + k] = ai + pi;
                    const float ur = qr + tr, ui = qi + ti;
                    yr[o + d + k] = ur * c1 - ui * s1;
                    yi[o + d + k] = ur * s1 + ui * c1;
                    const float vr = qr - tr, vi = qi - ti;
                    yr[o + 2 * d + k] = vr * c2 - vi * s2;
                    yi[o + 2 * d + k] = vr * s2 + vi * c2;
                }
            }
            n = m;
            s *= 3;
        }
        else
        {
            const int m = n / 2;
            for (int p = 0; p < m; ++p)
            {
                const float c1 = cosine[p * step], s1 = sine[p * step];
                const size_t a = (size_t)s * p * L, b = (size_t)s * m * L, o = (size_t)s * 2 * p * L, d = (size_t)s * L;
                #pragma clang loop vectorize(enable)
                for (int k = 0; k < s * L; ++k)
                {
                    const float ar = xr[a + k], ai = xi[a + k];
                    const float br = xr[a + b + k], bi = xi[a + b + k];
                    yr[o + k] = ar + br;
                    yi[o + k] = ai + bi;
                    const float ur = ar - br, ui = ai - bi;
                    yr[o + d + k] = ur * c1 - ui * s1;
                    yi[o + d + k] = ur * s1 + ui * c1;
                }
            }
            n = m;
            s *= 2;
        }
        parity = 1 - parity;
    }
    return parity;
"""


@wp.func_native(_TRANSFORM)
def transform(
    scratch: wp.array(dtype=float), offset: wp.int64, length: int, twiddle: wp.array(dtype=float), inverse: int
) -> int: ...


# Copies a block between planes and scratch. Lane l, element k lies at start + l * lane_stride + k * element_stride.
_LOAD = """
    enum { L = 16 };
    float* __restrict__ re = scratch.data + offset;
    float* __restrict__ im = re + (size_t)length * L;
    const float* __restrict__ a = real.data + start;
    const float* __restrict__ b = imaginary.data + start;
    for (int k = 0; k < used; ++k)
        for (int l = 0; l < L; ++l)
        {
            const bool there = l < lanes;
            re[k * L + l] = there ? a[l * lane_stride + k * element_stride] : 0.0f;
            im[k * L + l] = there ? b[l * lane_stride + k * element_stride] : 0.0f;
        }
    for (size_t k = (size_t)used * L; k < (size_t)length * L; ++k) { re[k] = 0.0f; im[k] = 0.0f; }
"""

_STORE = """
    enum { L = 16 };
    const float* __restrict__ re = scratch.data + offset + (size_t)parity * length * L * 2;
    const float* __restrict__ im = re + (size_t)length * L;
    float* __restrict__ a = real.data + start;
    float* __restrict__ b = imaginary.data + start;
    for (int k = 0; k < used; ++k)
        for (int l = 0; l < lanes; ++l)
        {
            a[l * lane_stride + k * element_stride] = re[k * L + l];
            b[l * lane_stride + k * element_stride] = im[k * L + l];
        }
"""

_MULTIPLY = """
    enum { L = 16 };
    float* __restrict__ re = scratch.data + offset + (size_t)parity * length * L * 2;
    float* __restrict__ im = re + (size_t)length * L;
    const int folded = length / 2;
    for (int k = 0; k < length; ++k)
    {
        const float* __restrict__ g = influence.data + (size_t)(k <= folded ? k : length - k) * width + column;
        for (int l = 0; l < lanes; ++l) { re[k * L + l] *= g[l]; im[k * L + l] *= g[l]; }
    }
    if (parity != 0)
    {
        float* __restrict__ to = scratch.data + offset;
        for (size_t k = 0; k < (size_t)length * L * 2; ++k) to[k] = re[k];
    }
"""


@wp.func_native(_LOAD)
def load_block(
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
    start: wp.int64,
    lane_stride: wp.int64,
    element_stride: wp.int64,
    lanes: int,
    used: int,
    length: int,
    scratch: wp.array(dtype=float),
    offset: wp.int64,
): ...


@wp.func_native(_STORE)
def store_block(
    scratch: wp.array(dtype=float),
    offset: wp.int64,
    parity: int,
    length: int,
    start: wp.int64,
    lane_stride: wp.int64,
    element_stride: wp.int64,
    lanes: int,
    used: int,
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
): ...


@wp.func_native(_MULTIPLY)
def multiply_block(
    influence: wp.array(dtype=float),
    column: int,
    width: int,
    lanes: int,
    length: int,
    parity: int,
    scratch: wp.array(dtype=float),
    offset: wp.int64,
): ...


@wp.kernel
def transform_rows(
    first: int,
    scratch: wp.array(dtype=float),
    twiddle: wp.array(dtype=float),
    row_count: int,
    length: int,
    read_count: int,
    write_count: int,
    inverse: int,
    in_real: wp.array(dtype=float),
    in_imaginary: wp.array(dtype=float),
    # outputs
    out_real: wp.array(dtype=float),
    out_imaginary: wp.array(dtype=float),
):
    """Transform rows of ``read_count`` elements, padded by zeros to ``length``; keep ``write_count`` of the result."""
    row = (first + wp.tid()) * 16
    lanes = wp.min(16, row_count - row)
    zero = wp.int64(0)
    one = wp.int64(1)
    load_block(
        in_real,
        in_imaginary,
        wp.int64(row) * wp.int64(read_count),
        wp.int64(read_count),
        one,
        lanes,
        read_count,
        length,
        scratch,
        zero,
    )
    parity = transform(scratch, zero, length, twiddle, inverse)
    store_block(
        scratch,
        zero,
        parity,
        length,
        wp.int64(row) * wp.int64(write_count),
        wp.int64(write_count),
        one,
        lanes,
        write_count,
        out_real,
        out_imaginary,
    )


@wp.kernel
def convolve_columns(
    first: int,
    scratch: wp.array(dtype=float),
    twiddle: wp.array(dtype=float),
    column_count: int,
    length: int,
    used: int,
    influence: wp.array(dtype=float),
    # outputs
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
):
    """Transform columns of ``used`` elements padded to ``length``, multiply by the influence function, transform back."""
    column = (first + wp.tid()) * 16
    lanes = wp.min(16, column_count - column)
    zero = wp.int64(0)
    one = wp.int64(1)
    load_block(real, imaginary, wp.int64(column), one, wp.int64(column_count), lanes, used, length, scratch, zero)
    parity = transform(scratch, zero, length, twiddle, 0)
    multiply_block(influence, column, column_count, lanes, length, parity, scratch, zero)
    parity = transform(scratch, zero, length, twiddle, 1)
    store_block(
        scratch, zero, parity, length, wp.int64(column), one, wp.int64(column_count), lanes, used, real, imaginary
    )
