"""The kernel that evaluates the field at every charge: near part over neighbors, far part from the mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..space.kernels_cells import CellGrid, SortedCharges
from ..space.kernels_mesh import Mesh
from ..space.kernels_space import period
from . import splitting
from .blur import LARGEST_Q
from .kernels_correction import Correction, correction_at
from .kernels_splines import fetch_ahead, potential_gradient

__all__ = [
    "COLUMNS_PER_CUTOFF",
    "PAIR_CONSTANTS",
    "ROWS_PER_CUTOFF",
    "Blurred",
    "SortedSums",
    "add_far_field",
    "evaluate_field",
    "pair_strength",
]

wp.set_module_options({"enable_backward": False})

# Cells along the cut-off, from row to row and along a row: narrow and low ones follow its circle, but make for short ranges.
ROWS_PER_CUTOFF = 2
COLUMNS_PER_CUTOFF = 4
# The blur between two charges is exp(-q), taken as the eighth power of a cubic that is wrong by 1e-4; it has ended
# where q is LARGEST_Q.


def _text_of(coefficients: Sequence[float], x: str) -> str:
    """C++ for a polynomial, coefficients lowest first."""
    text = f"{coefficients[-1]:.9e}f"
    for coefficient in coefficients[-2::-1]:
        text = f"({text} * {x} + {coefficient:.9e}f)"
    return text


def _eighth_root() -> list[float]:
    """Coefficients of the cubic of 2 q whose eighth power is exp(-q), exactly at 0."""
    q = np.linspace(0.0, LARGEST_Q, 2001)
    # An error of the root weighs as much as the seventh power of it; a little everywhere keeps the end near 0.
    weight = np.exp(-0.875 * q) + 2e-3
    basis = q[:, None] ** np.arange(1, 4)
    fitted = np.linalg.lstsq(basis * weight[:, None], np.expm1(-q / 8.0) * weight, rcond=None)[0]
    return [1.0, *(float(np.float32(fitted[k])) / 2.0 ** (k + 1) for k in range(3))]


# Of a charge's unit share, what the split spreads farther out than the distance counts (a polynomial of v, which is 0 at the cut-off),
# less what the blur does, and the core is added. A charge is at no distance from itself, and so its term vanishes; the tiny summand,
# far below the square of float32's smallest distance, only keeps it finite, and its square is still a normal number: some processors
# take a hundred times as long for others.
PAIR_CONSTANTS = """
    const float tiny = 1e-18f, narrower = 1.0f / blurred.sharper, core = blurred.core, half_per_core = 0.5f * blurred.per_core;
    const float cutoff2 = cutoff * cutoff, per_cutoff = 1.0f / cutoff2;
"""


def pair_strength(variance: str) -> str:
    """C++ for ``strength``, the force between two unit charges over their distance, from ``dx`` and ``dy``.

    Args:
        variance: C++ for that of the pair.
    """
    return f"""
            const V r2 = dx * dx + dy * dy + tiny;
            const V v = 1.0f - r2 * per_cutoff;
            // One division for the inverse of the pair's variance and that of r2.
            const V both = {variance};
            const V inverse = 1.0f / (r2 * both);
            const V twice_q = least(r2 * r2 * inverse, {2.0 * LARGEST_Q}f);
            const V root = {_text_of(_eighth_root(), "twice_q")};
            const V square = root * root;
            const V fourth = square * square;
            const V share = v * {_text_of(splitting.outside_share()[1:], "v")} - fourth * fourth;
            const V close = most(1.0f - twice_q * half_per_core, 0.0f);
            const V strength = (share + core * close * close) * (both * inverse);
"""


# For a GPU: every charge has a thread, which goes through all of its neighbors, or some threads of a warp that share them.
_SUM_NEAR = f"""
#if defined(__CUDA_ARCH__)
    typedef float V;
    auto least = [](V v, float w) -> V {{ return fminf(v, w); }};
    auto most = [](V v, float w) -> V {{ return fmaxf(v, w); }};
    {PAIR_CONSTANTS}
    const float* __restrict__ xs = charges.x.data;
    const float* __restrict__ ys = charges.y.data;
    const float* __restrict__ vs = blurred.variance.data;
    const int* __restrict__ fs = blurred.family.data;
    const float per_column = grid.inverse_size[0], per_row = grid.inverse_size[1];
    const float height = 1.0f / per_row;
    const int columns = grid.count_x, rows = grid.count_y;
    const float period_x = space_period[0], period_y = space_period[1];
    const bool repeats_x = period_x > 0.0f, repeats_y = period_y > 0.0f;
    const float x = xs[own], y = ys[own], own_variance = vs[own];
    const int own_family = fs[own];
    const int own_row = wp::min((int)(y * per_row), rows - 1);
    const float* __restrict__ ws = charges.weight.data + (size_t)charges.group.data[own] * charges.weight_stride;
    const float* __restrict__ qs = charges.charge.data;
    wp::vec2 sum(0.0f, 0.0f);
    auto add = [&](int j, float from_x, float from_y)
    {{
        const V dx = from_x - xs[j];
        const V dy = from_y - ys[j];
        {pair_strength("(own_variance + vs[j]) * (fs[j] == own_family ? 1.0f : narrower)")}
        const V weighted = r2 < cutoff2 ? ws[j] * qs[j] * strength : 0.0f;
        sum[0] += weighted * dx;
        sum[1] += weighted * dy;
    }};
    auto add_range = [&](int begin, int end, float from_x, float from_y)
    {{
        // Steps of one make for a quicker loop.
        if (parts == 1) for (int j = begin; j < end; ++j) add(j, from_x, from_y);
        else for (int j = begin + part; j < end; j += parts) add(j, from_x, from_y);
    }};
    for (int k = -{ROWS_PER_CUTOFF}; k <= {ROWS_PER_CUTOFF}; ++k)
    {{
        const int row = own_row + k;
        const int across = row < 0 ? -1 : row >= rows ? 1 : 0;
        if (across != 0 && !repeats_y) continue;
        const float beyond = fmaxf(fmaxf(row * height - y, y - (row + 1) * height), 0.0f);
        const float beside = sqrtf(fmaxf(cutoff2 - beyond * beyond, 0.0f));
        // Rounded down: what is cut off is positive.
        const int left = (int)((x - beside) * per_column + (float)columns) - columns;
        const int right = (int)((x + beside) * per_column);
        const int* __restrict__ starts = charges.cell_start.data + (size_t)(row - across * rows) * columns;
        const float from_y = y - across * period_y;
        add_range(starts[wp::max(left, 0)], starts[wp::min(right, columns - 1) + 1], x, from_y);
        if (repeats_x && left < 0) add_range(starts[left + columns], starts[columns], x + period_x, from_y);
        else if (repeats_x && right >= columns) add_range(starts[0], starts[right - columns + 1], x - period_x, from_y);
    }}
    if (parts > 1)
    {{
        const unsigned int all = ((1u << parts) - 1u) << (threadIdx.x % 32 - part);
        for (int apart = parts / 2; apart > 0; apart /= 2)
        {{
            sum[0] += __shfl_xor_sync(all, sum[0], apart);
            sum[1] += __shfl_xor_sync(all, sum[1], apart);
        }}
    }}
    return sum;
#else
    return wp::vec2(0.0f, 0.0f);
#endif
"""


@wp.struct
class Blurred:
    """How charges are blurred: variance and family of each, and by how much the variance between two families is divided.

    And the core of every charge: its strength, and 1 over the q at which it ends; see :mod:`.blur`. ``alike`` says whether all
    charges have one variance and one family.
    """

    variance: wp.array(dtype=float)
    family: wp.array(dtype=wp.int32)
    alike: wp.int32
    sharper: wp.float32
    core: wp.float32
    per_core: wp.float32


@wp.func_native(_SUM_NEAR)
def sum_near(
    own: int,
    part: int,
    parts: int,
    charges: SortedCharges,
    blurred: Blurred,
    grid: CellGrid,
    space_period: wp.vec2,
    cutoff: float,
) -> wp.vec2:
    """Near part of the field at a sorted charge, which a thread adds up for one of so many ``parts`` of the neighbors."""
    ...


@wp.struct
class SortedSums:
    """Sums of near forces per unit charge, of charges in the order of their cells; with room for a few more."""

    x: wp.array(dtype=float)
    y: wp.array(dtype=float)


@wp.func
def far_field(
    i: int,
    charges: SortedCharges,
    blurred: Blurred,
    mesh: Mesh,
    potential: wp.array(dtype=float),
    correction: Correction,
):
    """Far part of the field at a sorted charge, and all of the targets."""
    group = charges.group[i]
    at = wp.vec2(charges.x[i], charges.y[i])
    far = -potential_gradient(at, group * mesh.count_x * mesh.count_y, mesh, potential)
    # The mesh carries charges minus targets; this is the rest of the targets, and so it attracts.
    return far + correction_at(at, group, blurred.variance[i], correction)


@wp.kernel
def evaluate_field(
    first: int,
    parts: int,
    charges: SortedCharges,
    blurred: Blurred,
    grid: CellGrid,
    cutoff: float,
    mesh: Mesh,
    potential: wp.array(dtype=float),
    correction: Correction,
    # outputs
    field: wp.array(dtype=wp.vec2),
):
    """Force per unit charge, written in the order in which the charges were given; on a GPU, ``parts`` threads for each."""
    thread = first + wp.tid()
    i = thread / parts
    part = thread - i * parts
    near = sum_near(i, part, parts, charges, blurred, grid, period(grid.space), cutoff)
    if part == 0:
        field[charges.order[i]] = far_field(i, charges, blurred, mesh, potential, correction) + near


@wp.kernel
def add_far_field(
    first: int,
    charges: SortedCharges,
    blurred: Blurred,
    mesh: Mesh,
    potential: wp.array(dtype=float),
    correction: Correction,
    # outputs
    near: SortedSums,
    field: wp.array(dtype=wp.vec2),
):
    """The same, where the near part has been summed; on the CPU. The sums are 0 again, for the next time."""
    i = first + wp.tid()
    fetch_ahead(i, charges, mesh, potential)
    sum = wp.vec2(near.x[i], near.y[i])
    near.x[i] = 0.0
    near.y[i] = 0.0
    field[charges.order[i]] = far_field(i, charges, blurred, mesh, potential, correction) + sum
