"""The kernel that evaluates the field at every charge: near part over neighbours, far part from the mesh."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..space.kernels_cells import CellGrid
from ..space.kernels_mesh import Mesh
from ..space.kernels_space import goes_across, number_across, shift_across
from .kernels_splines import potential_gradient

__all__ = ["CUTOFF_OVER_SPLIT", "LANES", "evaluate_field"]

wp.set_module_options({"enable_backward": False})

# Neighbours that the CPU takes at once. Arrays of neighbours are longer by so many, since the last of them may read beyond.
LANES = 8
# Distance over split width beyond which the near part is left out; there it has fallen to 2e-3 of the whole.
CUTOFF_OVER_SPLIT = 3.5
# Cells along the cut-off: smaller ones follow its circle better, but are more ranges to go through.
CELLS_PER_CUTOFF = 2
# Rows of cells that hold neighbours, from so many below to so many above.
ROWS = wp.constant(2 * CELLS_PER_CUTOFF + 1)
BESIDE = wp.constant(CELLS_PER_CUTOFF)
Ranges = wp.types.vector(ROWS, wp.int32)
Heights = wp.types.vector(ROWS, wp.float32)


def _near_strength() -> str:
    """C++ for exp(-u) / u, u = r²/2s²: 1/u and a polynomial for the rest, which is smooth; the argument is v = 2 u / u_max - 1."""
    largest = 0.5 * CUTOFF_OVER_SPLIT**2

    def rest(v: np.ndarray) -> np.ndarray:
        u = 0.5 * largest * (v + 1.0)
        return np.expm1(-u) / u

    # Of degree 6 it is wrong by 2e-4 of the force between two charges alone.
    power = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebinterpolate(rest, 6))
    text = f"{power[-1]:.9e}f"
    for coefficient in power[-2::-1]:
        text = f"({text} * v + {coefficient:.9e}f)"
    return text


# Native code because this loop is most of the near field's time. A charge is at no distance from itself, and so its term vanishes;
# the tiny summand, far below the square of float32's smallest distance, only keeps it finite.
_SUM_NEAR = f"""
    const float tiny = 1e-30f;
    const float scale = 2.0f / cutoff2;
    const float per_split = {0.5 * CUTOFF_OVER_SPLIT**2:.9f}f / cutoff2;
    const float* __restrict__ xs = sorted_x.data;
    const float* __restrict__ ys = sorted_y.data;
    const float* __restrict__ ws = weight.data + row;
#if defined(__CUDA_ARCH__)
    float sum_x = 0.0f, sum_y = 0.0f;
#else
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({LANES})));
    const I lane = {{{", ".join(map(str, range(LANES)))}}};
    V sum_x = (V)0.0f, sum_y = (V)0.0f;
#endif
    for (int range = 0; range < {2 * CELLS_PER_CUTOFF + 1}; ++range)
    {{
        const int begin = begins[range], end = ends[range];
        const float y = at_y[range];
#if defined(__CUDA_ARCH__)
        for (int j = begin; j < end; ++j)
        {{
            const float dx = x - xs[j];
            const float dy = y - ys[j];
            const float r2 = dx * dx + dy * dy + tiny;
            if (r2 >= cutoff2) continue;
            const float v = r2 * scale - 1.0f;
            const float strength = ws[j] * (1.0f / r2 + per_split * {_near_strength()});
#else
        for (int j = begin; j < end; j += {LANES})
        {{
            #pragma clang fp contract(fast)
            const V dx = x - *(const V*)(xs + j);
            const V dy = y - *(const V*)(ys + j);
            const V r2 = dx * dx + dy * dy + tiny;
            const V v = r2 * scale - 1.0f;
            const V near = *(const V*)(ws + j) * (1.0f / r2 + per_split * {_near_strength()});
            const V strength = ((r2 < cutoff2) & (lane < end - j)) ? near : (V)0.0f;
#endif
            sum_x += strength * dx;
            sum_y += strength * dy;
        }}
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
    at_y: Heights,
    begins: Ranges,
    ends: Ranges,
    row: wp.int64,
    cutoff2: float,
    weight: wp.array(dtype=float),
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
) -> wp.vec2: ...


@wp.kernel
def evaluate_field(
    first: int,
    order: wp.array(dtype=wp.int32),
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
    sorted_group: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=float),
    weight_stride: int,
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    cutoff2: float,
    mesh: Mesh,
    potential: wp.array(dtype=float),
    fine_mesh: Mesh,
    correction: wp.array(dtype=float),
    correction_row: wp.array(dtype=wp.int32),
    correction_scale: wp.array(dtype=float),
    # outputs
    field: wp.array(dtype=wp.vec2),
):
    """Force per unit charge on every charge, written in the order in which the charges were given.

    ``weight`` holds, for every group, the charges as that group sees them; see :func:`~esh.engine.space.kernels_cells.gather_charges`.
    """
    i = first + wp.tid()
    x = sorted_x[i]
    y = sorted_y[i]
    group = sorted_group[i]
    row_start = wp.int64(group) * wp.int64(weight_stride)
    cx = wp.clamp(int(x * grid.inverse_size[0]), 0, grid.count_x - 1)
    cy = wp.clamp(int(y * grid.inverse_size[1]), 0, grid.count_y - 1)
    total = -potential_gradient(wp.vec2(x, y), group * mesh.count_x * mesh.count_y, mesh, potential)
    # The mesh carries charges minus targets; this is the rest of the targets, and so it attracts.
    base = correction_row[group] * fine_mesh.count_x * fine_mesh.count_y
    total += correction_scale[group] * potential_gradient(wp.vec2(x, y), base, fine_mesh, correction)
    # Cells of a row are neighbours in memory: those near the charge's are one range.
    left = cx - BESIDE
    right = cx + BESIDE
    at_y = Heights()
    rows = Ranges()
    begins = Ranges()
    ends = Ranges()
    for b in range(ROWS):
        beside = cy + b - BESIDE
        row = number_across(beside, grid.count_y, grid.space)
        at_y[b] = y + shift_across(beside, grid.count_y, grid.space.size[1], grid.space)
        rows[b] = row
        if row >= 0 and row < grid.count_y:
            begins[b] = cell_start[row * grid.count_x + wp.max(left, 0)]
            ends[b] = cell_start[row * grid.count_x + wp.min(right, grid.count_x - 1) + 1]
    total += sum_near(x, at_y, begins, ends, row_start, cutoff2, weight, sorted_x, sorted_y)
    if goes_across(left, right, grid.count_x, grid.space):
        # The columns of cells on the other side.
        low = left + grid.count_x
        high = grid.count_x - 1
        if left >= 0:
            low = 0
            high = right - grid.count_x
        beyond = wp.where(left < 0, left, right)
        shifted = x + shift_across(beyond, grid.count_x, grid.space.size[0], grid.space)
        for b in range(ROWS):
            begins[b] = cell_start[rows[b] * grid.count_x + low]
            ends[b] = cell_start[rows[b] * grid.count_x + high + 1]
        total += sum_near(shifted, at_y, begins, ends, row_start, cutoff2, weight, sorted_x, sorted_y)
    field[order[i]] = total
