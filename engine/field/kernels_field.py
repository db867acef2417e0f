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
from .kernels_blur import level_of
from .kernels_splines import potential_gradient

__all__ = ["COLUMNS_PER_CUTOFF", "LANES", "ROWS_PER_CUTOFF", "evaluate_field"]

wp.set_module_options({"enable_backward": False})

# Neighbors that the CPU takes at once. Arrays of neighbors are longer by so many, since the last of them may read beyond.
LANES = 8
# Cells along the cut-off, from row to row and along a row: narrow cells follow its circle, high ones keep ranges long.
ROWS_PER_CUTOFF = 1
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


# Native code because this loop is most of the near field's time. A charge is at no distance from itself, and so its term vanishes;
# the tiny summand, far below the square of float32's smallest distance, only keeps it finite, and its square is still a normal number:
# some processors take a hundred times as long for others. Of a charge's unit share, what the split spreads farther out than the
# distance counts (a polynomial of v, which is 0 at the cut-off), less what the blur does, and the core is added.
def _add_ranges(variance: str) -> str:
    """C++ that goes through all ranges of neighbors; ``variance`` is that of a pair."""
    return f"""
    for (int range = 0; range < ranges; ++range)
    {{
        const int begin = begins[range], end = ends[range];
        const float own_x = from_x[range], own_y = from_y[range];
        for (int j = begin; j < end; j += L)
        {{
#if !defined(__CUDA_ARCH__)
            #pragma clang fp contract(fast)
#endif
            const V dx = own_x - *(const V*)(xs + j);
            const V dy = own_y - *(const V*)(ys + j);
            const V r2 = dx * dx + dy * dy + tiny;
            const V v = 1.0f - r2 * per_cutoff;
            // One division for the inverse of the pair's variance and that of r2.
            const V both = {variance};
            const V inverse = 1.0f / (r2 * both);
            V twice_q = r2 * r2 * inverse;
#if defined(__CUDA_ARCH__)
            twice_q = fminf(twice_q, {2.0 * LARGEST_Q}f);
#else
            twice_q = __builtin_elementwise_min(twice_q, (V){2.0 * LARGEST_Q}f);
#endif
            const V root = {_text_of(_eighth_root(), "twice_q")};
            const V square = root * root;
            const V fourth = square * square;
            const V share = v * {_text_of(splitting.outside_share()[1:], "v")} - fourth * fourth;
#if defined(__CUDA_ARCH__)
            const V close = fmaxf(1.0f - twice_q * half_per_core, 0.0f);
#else
            const V close = __builtin_elementwise_max(1.0f - twice_q * half_per_core, (V)0.0f);
#endif
            const V near = *(const V*)(ws + j) * (share + core * close * close) * (both * inverse);
#if defined(__CUDA_ARCH__)
            const V strength = r2 < cutoff2 ? near : 0.0f;
#else
            const V strength = ((r2 < cutoff2) & (lane < end - j)) ? near : (V)0.0f;
#endif
            sum_x += strength * dx;
            sum_y += strength * dy;
        }}
    }}
"""


_SUM_NEAR = f"""
    const float tiny = 1e-18f, narrower = 1.0f / sharper, half_per_core = 0.5f * per_core;
    const float* __restrict__ xs = sorted_x.data;
    const float* __restrict__ ys = sorted_y.data;
    const float* __restrict__ ws = weight.data + row_start;
    const float* __restrict__ vs = variance.data;
    const int* __restrict__ fs = family.data;
#if defined(__CUDA_ARCH__)
    enum {{ L = 1 }};
    typedef float V;
    typedef int I;
#else
    enum {{ L = {LANES} }};
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({LANES}), aligned(4)));
    const I lane = {{{", ".join(map(str, range(LANES)))}}};
#endif
    const float cutoff2 = cutoff * cutoff, per_cutoff = 1.0f / cutoff2;
    const float per_column = grid.inverse_size[0], per_row = grid.inverse_size[1];
    const float height = 1.0f / per_row;
    const int columns = grid.count_x, rows = grid.count_y;
    const bool repeats_x = period[0] > 0.0f, repeats_y = period[1] > 0.0f;
    // Cells of a row are neighbors in memory: those within the cut-off are one range, or two where it reaches round the domain.
    enum {{ MOST = 2 * {2 * ROWS_PER_CUTOFF + 1} }};
    int begins[MOST], ends[MOST], ranges = 0;
    float from_x[MOST], from_y[MOST];
    const int own_row = wp::min((int)(y * per_row), rows - 1);
    for (int row = own_row - {ROWS_PER_CUTOFF}; row <= own_row + {ROWS_PER_CUTOFF}; ++row)
    {{
        const int across = row < 0 ? -1 : row >= rows ? 1 : 0;
        if (across != 0 && !repeats_y) continue;
        const float beyond = wp::max(wp::max(row * height - y, y - (row + 1) * height), 0.0f);
        const float beside = sqrtf(wp::max(cutoff2 - beyond * beyond, 0.0f));
        const int* __restrict__ starts = cell_start.data + (size_t)(row - across * rows) * columns;
        // Rounded down: what is cut off is positive.
        const int left = (int)((x - beside) * per_column + (float)columns) - columns;
        const int right = (int)((x + beside) * per_column);
        begins[ranges] = starts[wp::max(left, 0)];
        ends[ranges] = starts[wp::min(right, columns - 1) + 1];
        from_x[ranges] = x;
        from_y[ranges++] = y - across * period[1];
        if (repeats_x && (left < 0 || right >= columns))
        {{
            begins[ranges] = starts[left < 0 ? left + columns : 0];
            ends[ranges] = starts[left < 0 ? columns : right - columns + 1];
            from_x[ranges] = left < 0 ? x + period[0] : x - period[0];
            from_y[ranges++] = y - across * period[1];
        }}
    }}
    V sum_x = (V)0.0f, sum_y = (V)0.0f;
    if (alike != 0)
    {{
        const V of_all = own_variance + own_variance;
        {_add_ranges("of_all")}
    }}
    else
    {{
        {_add_ranges("(own_variance + *(const V*)(vs + j)) * (*(const I*)(fs + j) == own_family ? (V)1.0f : (V)narrower)")}
    }}
#if defined(__CUDA_ARCH__)
    return wp::vec2(sum_x, sum_y);
#else
    float total_x = 0.0f, total_y = 0.0f;
    for (int l = 0; l < {LANES}; ++l)
    {{
        total_x += sum_x[l];
        total_y += sum_y[l];
    }}
    return wp::vec2(total_x, total_y);
#endif
"""


@wp.func_native(_SUM_NEAR)
def sum_near(
    x: float,
    y: float,
    row_start: wp.int64,
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    period: wp.vec2,
    cutoff: float,
    own_variance: float,
    own_family: int,
    alike: int,
    sharper: float,
    core: float,
    per_core: float,
    variance: wp.array(dtype=float),
    family: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=float),
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
) -> wp.vec2: ...


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


@wp.struct
class Correction:
    """What the charges' mesh lacks of the targets, on a finer one; see :class:`~.target_correction.TargetCorrection`."""

    mesh: Mesh
    potential: wp.array(dtype=float)
    row: wp.array(dtype=wp.int32)
    scale: wp.array(dtype=float)
    levels: wp.array(dtype=float)


@wp.func
def correction_at(at: wp.vec2, group: int, variance: float, correction: Correction):
    """What it adds to the force on a charge of a group; between two levels linear in the variance of the charge's blur."""
    nodes = correction.mesh.count_x * correction.mesh.count_y
    base = correction.row[group] * correction.levels.shape[0] * nodes
    scale = correction.scale[group]
    total = wp.vec2(0.0, 0.0)
    if correction.levels.shape[0] == 1:
        total = scale * potential_gradient(at, base, correction.mesh, correction.potential)
    else:
        level, place = level_of(variance, correction.levels)
        base += level * nodes
        below = potential_gradient(at, base, correction.mesh, correction.potential)
        above = potential_gradient(at, base + nodes, correction.mesh, correction.potential)
        total = scale * (below + place * (above - below))
    return total


@wp.kernel
def evaluate_field(
    first: int,
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
    """Force per unit charge on every charge, written in the order in which the charges were given."""
    i = first + wp.tid()
    x = charges.x[i]
    y = charges.y[i]
    group = charges.group[i]
    at = wp.vec2(x, y)
    total = -potential_gradient(at, group * mesh.count_x * mesh.count_y, mesh, potential)
    # The mesh carries charges minus targets; this is the rest of the targets, and so it attracts.
    total += correction_at(at, group, blurred.variance[i], correction)
    total += sum_near(
        x,
        y,
        wp.int64(group) * wp.int64(charges.weight_stride),
        charges.cell_start,
        grid,
        period(grid.space),
        cutoff,
        blurred.variance[i],
        blurred.family[i],
        blurred.alike,
        blurred.sharper,
        blurred.core,
        blurred.per_core,
        blurred.variance,
        blurred.family,
        charges.weight,
        charges.x,
        charges.y,
    )
    field[charges.order[i]] = total
