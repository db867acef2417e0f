"""Kernels that make influence functions: what a mesh's transform is multiplied by."""

from __future__ import annotations

import warp as wp

from . import splitting

wp.set_module_options({"enable_backward": False})

BETA = wp.constant(wp.float64(splitting.BETA))
INVERSE_HEIGHT = wp.constant(wp.float64(1.0 / splitting.height_of_transform()))
# Bessel's function by its series up to here, by Hankel's expansion above: both are right to 1e-8.
SERIES_BELOW = wp.constant(wp.float64(12.0))
SERIES_TERMS = wp.constant(40)
# S of the split's potential, see :mod:`.splitting`, as a polynomial that kernels evaluate.
POTENTIAL = splitting.smoothed_potential()
Potential = wp.types.vector(len(POTENTIAL), wp.float64)
POTENTIAL_TERMS = wp.constant(len(POTENTIAL))


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


@wp.func
def wave_square(row: int, column: int, waves: Waves):
    """Squared wave number."""
    kx = wp.float64(column) * waves.step_x
    ky = wp.float64(row) * waves.step_y
    return kx * kx + ky * ky


@wp.func
def transform_of_split(square: wp.float64):
    """Transform of the split's density at ``square``, the squared wave number in inverse cut-offs: J1(z) / z, z² = square - beta²."""
    z2 = square - BETA * BETA
    if z2 > SERIES_BELOW * SERIES_BELOW:
        z = wp.sqrt(z2)
        phase = z - wp.float64(0.75) * wp.float64(wp.pi)
        even = wp.float64(1.0) + (wp.float64(15.0 / 128.0) - wp.float64(4725.0 / 32768.0) / z2) / z2
        odd = (wp.float64(3.0 / 8.0) - wp.float64(105.0 / 1024.0) / z2) / z
        wave = even * wp.cos(phase) - odd * wp.sin(phase)
        return wp.sqrt(wp.float64(2.0) / (wp.float64(wp.pi) * z)) * wave / z * INVERSE_HEIGHT
    term = wp.float64(0.5)
    total = wp.float64(0.0)
    for k in range(1, SERIES_TERMS + 1):
        total += term
        term *= wp.float64(-0.25) * z2 / wp.float64(k * (k + 1))
    return total * INVERSE_HEIGHT


@wp.kernel
def transform_of_far_part(
    first: int,
    waves: Waves,
    cutoff: wp.float64,
    # outputs
    influence: wp.array(dtype=float),
):
    """Transform of the split's far part, 2 pi / k² times that of its density, times the window; 0 at wave number 0."""
    row, column, index = wave_at(first + wp.tid(), waves)
    square = wave_square(row, column, waves)
    value = wp.float64(0.0)
    if square > wp.float64(0.0):
        value = wp.float64(2.0 * wp.pi) / square * transform_of_split(square * cutoff * cutoff)
    influence[index] = float(value * waves.window_x[column] * waves.window_y[row])


@wp.kernel
def transform_of_blurred_rests(
    first: int,
    waves: Waves,
    variance: wp.array(dtype=wp.float64),
    at_zero: wp.array(dtype=wp.float64),
    cutoff: wp.float64,
    size: int,
    # outputs
    influence: wp.array(dtype=wp.uint64),
):
    """Transforms of -log r blurred by Gaussians, less the split's far part, times the window; ``at_zero`` at wave number 0.

    ``influence`` has the addresses of arrays of a ``size``, one for each variance: what they share is most of the work.
    """
    row, column, index = wave_at(first + wp.tid(), waves)
    square = wave_square(row, column, waves)
    inverse = wp.float64(0.0)
    split = wp.float64(0.0)
    if square > wp.float64(0.0):
        inverse = wp.float64(2.0 * wp.pi) / square
        split = transform_of_split(square * cutoff * cutoff)
    for k in range(variance.shape[0]):
        value = at_zero[k]
        if square > wp.float64(0.0):
            blurred = wp.exp(wp.float64(-0.5) * variance[k] * square)
            value = inverse * (blurred - split)
        result = wp.array(ptr=influence[k], shape=(size,), dtype=float)
        result[index] = float(value * waves.window_x[column] * waves.window_y[row])


@wp.kernel
def multiply_window(
    first: int,
    waves: Waves,
    # outputs
    influence: wp.array(dtype=float),
):
    row, column, index = wave_at(first + wp.tid(), waves)
    influence[index] = float(wp.float64(influence[index]) * waves.window_x[column] * waves.window_y[row])


@wp.kernel
def product_of_windows(
    first: int,
    waves: Waves,
    # outputs
    influence: wp.array(dtype=float),
):
    row, column, index = wave_at(first + wp.tid(), waves)
    influence[index] = float(waves.window_x[column] * waves.window_y[row])


@wp.kernel
def sample_far_part(
    first: int,
    columns: int,
    step: wp.float64,
    cutoff: wp.float64,
    constant: wp.float64,
    potential: Potential,
    # outputs
    quarter: wp.array(dtype=float),
):
    """The split's far part plus ``constant`` around node 0: -log r beyond the cut-off, -log(cutoff) + S(v) / 2 within."""
    i = first + wp.tid()
    row = i / columns
    column = i - row * columns
    y = wp.float64(row) * step
    x = wp.float64(wp.min(column, columns - column)) * step
    square = (x * x + y * y) / (cutoff * cutoff)
    value = constant - wp.log(cutoff)
    if square >= wp.float64(1.0):
        value -= wp.float64(0.5) * wp.log(square)
    else:
        v = wp.float64(1.0) - square
        total = wp.float64(0.0)
        for k in range(POTENTIAL_TERMS):
            total = total * v + potential[POTENTIAL_TERMS - 1 - k]
        value += wp.float64(0.5) * total
    quarter[i] = float(value)
