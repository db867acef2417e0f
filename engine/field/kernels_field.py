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
from .kernels_splines import potential_gradient, potential_gradients

__all__ = ["COLUMNS_PER_CUTOFF", "LANES", "ROWS_PER_CUTOFF", "evaluate_field"]

wp.set_module_options({"enable_backward": False})

# Neighbors that the CPU takes at once, and charges whose neighbors it looks up at once. Arrays of neighbors are longer by so many,
# since the last of them may read beyond.
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


# Where the neighbors of a few charges are is found for all of them at once; cells of a row are neighbors in memory: those within the
# cut-off are one range, or two where it reaches round the domain.
_SUM_NEAR = f"""
    const float tiny = 1e-18f, narrower = 1.0f / blurred.sharper, core = blurred.core, half_per_core = 0.5f * blurred.per_core;
    const float* __restrict__ xs = charges.x.data;
    const float* __restrict__ ys = charges.y.data;
    const float* __restrict__ vs = blurred.variance.data;
    const int* __restrict__ fs = blurred.family.data;
#if defined(__CUDA_ARCH__)
    enum {{ L = 1 }};
    typedef float V;
    typedef int I;
    auto whole = [](V v) -> I {{ return (int)v; }};
    auto real = [](I i) -> V {{ return (float)i; }};
    auto root_of = [](V v) -> V {{ return sqrtf(v); }};
    auto lesser = [](I i, I j) -> I {{ return i < j ? i : j; }};
    auto larger = [](V v, V w) -> V {{ return fmaxf(v, w); }};
#else
    enum {{ L = {LANES} }};
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({LANES}), aligned(4)));
    const I lane = {{{", ".join(map(str, range(LANES)))}}};
    auto whole = [](V v) -> I {{ return __builtin_convertvector(v, I); }};
    auto real = [](I i) -> V {{ return __builtin_convertvector(i, V); }};
    auto root_of = [](V v) -> V {{ return __builtin_elementwise_sqrt(v); }};
    auto lesser = [](I i, I j) -> I {{ return __builtin_elementwise_min(i, j); }};
    auto larger = [](V v, V w) -> V {{ return __builtin_elementwise_max(v, w); }};
#endif
    const float cutoff2 = cutoff * cutoff, per_cutoff = 1.0f / cutoff2;
    const float per_column = grid.inverse_size[0], per_row = grid.inverse_size[1];
    const float height = 1.0f / per_row;
    const int columns = grid.count_x, rows = grid.count_y;
    const float period_x = space_period[0], period_y = space_period[1];
    const bool repeats_x = period_x > 0.0f, repeats_y = period_y > 0.0f;
    enum {{ ROWS = {2 * ROWS_PER_CUTOFF + 1} }};
    I lefts[ROWS], rights[ROWS];
    const V all_x = *(const V*)(xs + start), all_y = *(const V*)(ys + start);
    const I own_rows = lesser(whole(all_y * per_row), (I)(rows - 1));
    for (int k = 0; k < ROWS; ++k)
    {{
        const V row = real(own_rows + (k - {ROWS_PER_CUTOFF}));
        const V below = row * height - all_y, above = all_y - (row + 1.0f) * height;
        const V beyond = larger(larger(below, above), (V)0.0f);
        const V beside = root_of(larger(cutoff2 - beyond * beyond, (V)0.0f));
        // Rounded down: what is cut off is positive.
        lefts[k] = whole((all_x - beside) * per_column + (float)columns) - columns;
        rights[k] = whole((all_x + beside) * per_column);
    }}
    for (int own = start; own < stop; ++own)
    {{
        const float x = xs[own], y = ys[own], own_variance = vs[own];
        const int own_family = fs[own];
        const float* __restrict__ ws = charges.weight.data + (size_t)charges.group.data[own] * charges.weight_stride;
        int begins[2 * ROWS], ends[2 * ROWS], ranges = 0;
        float from_x[2 * ROWS], from_y[2 * ROWS];
        for (int k = 0; k < ROWS; ++k)
        {{
            const int row = ((const int*)&own_rows)[own - start] + k - {ROWS_PER_CUTOFF};
            const int across = row < 0 ? -1 : row >= rows ? 1 : 0;
            if (across != 0 && !repeats_y) continue;
            const int* __restrict__ starts = charges.cell_start.data + (size_t)(row - across * rows) * columns;
            const int left = ((const int*)&lefts[k])[own - start], right = ((const int*)&rights[k])[own - start];
            begins[ranges] = starts[wp::max(left, 0)];
            ends[ranges] = starts[wp::min(right, columns - 1) + 1];
            from_x[ranges] = x;
            from_y[ranges++] = y - across * period_y;
            if (repeats_x && (left < 0 || right >= columns))
            {{
                begins[ranges] = starts[left < 0 ? left + columns : 0];
                ends[ranges] = starts[left < 0 ? columns : right - columns + 1];
                from_x[ranges] = left < 0 ? x + period_x : x - period_x;
                from_y[ranges++] = y - across * period_y;
            }}
        }}
        V sum_x = (V)0.0f, sum_y = (V)0.0f;
        if (blurred.alike != 0)
        {{
            const V of_all = own_variance + own_variance;
            {_add_ranges("of_all")}
        }}
        else
        {{
            {_add_ranges("(own_variance + *(const V*)(vs + j)) * (*(const I*)(fs + j) == own_family ? (V)1.0f : (V)narrower)")}
        }}
        float total_x = 0.0f, total_y = 0.0f;
        for (int l = 0; l < L; ++l)
        {{
            total_x += ((const float*)&sum_x)[l];
            total_y += ((const float*)&sum_y)[l];
        }}
        field.data[charges.order.data[own]] = wp::vec2(total_x, total_y);
    }}
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
    start: int,
    stop: int,
    charges: SortedCharges,
    blurred: Blurred,
    grid: CellGrid,
    space_period: wp.vec2,
    cutoff: float,
    field: wp.array(dtype=wp.vec2),
):
    """Write the near part of the field at the sorted charges ``start .. stop - 1``, to where they were given."""
    ...


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
        both = potential_gradients(at, base, nodes, correction.mesh, correction.potential)
        below = wp.vec2(both[0], both[1])
        total = scale * (below + place * (wp.vec2(both[2], both[3]) - below))
    return total


@wp.kernel
def evaluate_field(
    first: int,
    at_once: int,
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
    """Force per unit charge on ``at_once`` charges an element, written in the order in which the charges were given."""
    start = (first + wp.tid()) * at_once
    stop = wp.min(start + at_once, charges.group.shape[0])
    sum_near(start, stop, charges, blurred, grid, period(grid.space), cutoff, field)
    for i in range(start, stop):
        group = charges.group[i]
        at = wp.vec2(charges.x[i], charges.y[i])
        far = -potential_gradient(at, group * mesh.count_x * mesh.count_y, mesh, potential)
        # The mesh carries charges minus targets; this is the rest of the targets, and so it attracts.
        far += correction_at(at, group, blurred.variance[i], correction)
        to = charges.order[i]
        field[to] = far + field[to]
