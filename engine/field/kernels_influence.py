"""Kernels that make influence functions: what a mesh's transform is multiplied by."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

EULER_GAMMA = wp.constant(wp.float64(0.5772156649015329))
# E1(z) < 1e-18 beyond: the plain logarithm.
FARTHEST = wp.constant(wp.float64(38.0))
# The power series of E1 below, its continued fraction above.
SERIES_BELOW = wp.constant(wp.float64(2.0))
SERIES_TERMS = wp.constant(40)
FRACTION_TERMS = wp.constant(120)


@wp.struct
class Waves:
    """Wave numbers of an influence function: how many along x and y, their steps, how far apart their elements lie.

    Rows beyond the middle of ``period_y`` stand for negative wave numbers. ``window`` corrects for depositing and interpolating.
    """

    count_x: wp.int32
    count_y: wp.int32
    step_x: wp.float64
    step_y: wp.float64
    stride_x: wp.int32
    stride_y: wp.int32
    period_y: wp.int32
    window_x: wp.array(dtype=wp.float64)
    window_y: wp.array(dtype=wp.float64)


@wp.func
def wave_at(i: int, waves: Waves):
    """Row and column of a wave number, folded, and its index in the influence function."""
    row = i / waves.count_x
    column = i - row * waves.count_x
    return wp.min(row, waves.period_y - row), column, row * waves.stride_y + column * waves.stride_x


@wp.kernel
def transform_of_smoothed(
    first: int,
    waves: Waves,
    narrow: wp.float64,
    wide: wp.float64,
    at_zero: wp.float64,
    # outputs
    influence: wp.array(dtype=float),
):
    """Transform of -log r * (gauss(narrow) - gauss(wide)), 2 pi / k² (exp(-narrow² k² / 2) - exp(-wide² k² / 2)), times the window."""
    row, column, index = wave_at(first + wp.tid(), waves)
    kx = wp.float64(column) * waves.step_x
    ky = wp.float64(row) * waves.step_y
    half = wp.float64(0.5) * (kx * kx + ky * ky)
    value = at_zero
    if half > wp.float64(0.0):
        value = wp.float64(wp.pi) / half * (wp.exp(-narrow * narrow * half) - wp.exp(-wide * wide * half))
    influence[index] = float(value * waves.window_x[column] * waves.window_y[row])


@wp.kernel
def multiply_window(
    first: int,
    waves: Waves,
    # outputs
    influence: wp.array(dtype=float),
):
    row, column, index = wave_at(first + wp.tid(), waves)
    influence[index] = float(wp.float64(influence[index]) * waves.window_x[column] * waves.window_y[row])


@wp.func
def log_plus_e1(z: wp.float64):
    """Return log z + E1(z), finite at 0."""
    if z < SERIES_BELOW:
        total = -EULER_GAMMA
        term = wp.float64(-1.0)
        for k in range(1, SERIES_TERMS):
            term *= -z / wp.float64(k)
            total += term / wp.float64(k)
        return total
    if z > FARTHEST:
        return wp.log(z)
    fraction = wp.float64(0.0)
    for k in range(FRACTION_TERMS):
        term = wp.float64(FRACTION_TERMS - k)
        fraction = term / (wp.float64(1.0) + term / (z + fraction))
    return wp.log(z) + wp.exp(-z) / (z + fraction)


@wp.kernel
def sample_smoothed(
    first: int,
    columns: int,
    step: wp.float64,
    split: wp.float64,
    constant: wp.float64,
    # outputs
    quarter: wp.array(dtype=float),
):
    """-log r convolved with a Gaussian of deviation ``split``, -(log r² + E1(r² / 2s²)) / 2, plus ``constant``, around node 0."""
    i = first + wp.tid()
    row = i / columns
    column = i - row * columns
    y = wp.float64(row) * step
    x = wp.float64(wp.min(column, columns - column)) * step
    twice = wp.float64(2.0) * split * split
    quarter[i] = float(constant - wp.float64(0.5) * (log_plus_e1((x * x + y * y) / twice) + wp.log(twice)))
