"""The kernel that evaluates the field at every charge: near part over neighbours, far part from the mesh."""

from __future__ import annotations

import warp as wp

from .kernels_cells import CellGrid
from .kernels_mesh import Mesh, potential_gradient

wp.set_module_options({"enable_backward": False})

# Native code because this loop is most of the near field's time: written so, clang turns it into vector instructions on
# the CPU. exp(-s) is 2^-(s log2 e), split into a power of two (bits of the exponent) and a polynomial of degree 5 on
# [-1/2, 1/2], relative error below 3e-6; the mask leaves out the charge itself and everything beyond the cut-off.
_SUM_RANGE = """
    const float* __restrict__ xs = sorted_x.data;
    const float* __restrict__ ys = sorted_y.data;
    const float* __restrict__ qs = sorted_charge.data;
    const int* __restrict__ gs = sorted_group.data;
    const float* __restrict__ m = interaction.data + row;
    float sum_x = 0.0f;
    float sum_y = 0.0f;
#if !defined(__CUDA_ARCH__)
#pragma clang loop vectorize(enable)
#endif
    for (int j = begin; j < end; ++j)
    {
#if !defined(__CUDA_ARCH__)
        #pragma clang fp reassociate(on) contract(fast)
#endif
        const float dx = x - xs[j];
        const float dy = y - ys[j];
        const float r2 = dx * dx + dy * dy;
        const float inside = (r2 < cutoff2 && r2 > 0.0f) ? 1.0f : 0.0f;
        const float clipped = r2 < cutoff2 ? r2 : cutoff2;
        const float t = clipped * rate;
        const float whole = (float)(int)(t - 0.5f);
        const float f = t - whole;
        float e = 1.3333558e-3f;
        e = e * f + 9.6181291e-3f;
        e = e * f + 5.5504109e-2f;
        e = e * f + 2.4022651e-1f;
        e = e * f + 6.9314718e-1f;
        e = e * f + 1.0f;
        union { int i; float f; } power;
        power.i = ((int)whole + 127) << 23;
        const float strength = inside * m[gs[j]] * qs[j] * e * power.f / (r2 + (1.0f - inside));
        sum_x += strength * dx;
        sum_y += strength * dy;
    }
    return wp::vec2(sum_x, sum_y);
"""


@wp.func_native(_SUM_RANGE)
def sum_range(
    x: float,
    y: float,
    begin: int,
    end: int,
    row: int,
    cutoff2: float,
    rate: float,
    interaction: wp.array(dtype=float),
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
    sorted_charge: wp.array(dtype=float),
    sorted_group: wp.array(dtype=wp.int32),
) -> wp.vec2: ...


@wp.kernel
def evaluate_field(
    first: int,
    order: wp.array(dtype=wp.int32),
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
    sorted_charge: wp.array(dtype=float),
    sorted_group: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    cutoff2: float,
    rate: float,
    interaction: wp.array(dtype=float),
    group_count: int,
    mesh: Mesh,
    potential: wp.array(dtype=float),
    fine_mesh: Mesh,
    correction: wp.array(dtype=float),
    correction_row: wp.array(dtype=wp.int32),
    correction_scale: wp.array(dtype=float),
    # outputs
    field: wp.array(dtype=wp.vec2),
):
    """Force per unit charge on every charge, written in the order in which the charges were given."""
    i = first + wp.tid()
    x = sorted_x[i]
    y = sorted_y[i]
    group = sorted_group[i]
    row_start = group * group_count
    cx = wp.clamp(int(x * grid.inverse_size[0]), 0, grid.count_x - 1)
    cy = wp.clamp(int(y * grid.inverse_size[1]), 0, grid.count_y - 1)
    total = -potential_gradient(wp.vec2(x, y), group * mesh.count_x * mesh.count_y, mesh, potential)
    # The mesh carries charges minus targets; this is the rest of the targets, and so it attracts.
    base = correction_row[group] * fine_mesh.count_x * fine_mesh.count_y
    total += correction_scale[group] * potential_gradient(wp.vec2(x, y), base, fine_mesh, correction)
    for b in range(3):
        row = cy + b - 1
        shifted_y = y
        if grid.periodic != 0:
            if row < 0:
                row += grid.count_y
                shifted_y += grid.domain[1]
            elif row >= grid.count_y:
                row -= grid.count_y
                shifted_y -= grid.domain[1]
        if row >= 0 and row < grid.count_y:
            # Cells of a row are neighbours in memory: three of them are one range.
            left = wp.max(cx - 1, 0)
            right = wp.min(cx + 1, grid.count_x - 1)
            begin = cell_start[row * grid.count_x + left]
            end = cell_start[row * grid.count_x + right + 1]
            total += sum_range(
                x,
                shifted_y,
                begin,
                end,
                row_start,
                cutoff2,
                rate,
                interaction,
                sorted_x,
                sorted_y,
                sorted_charge,
                sorted_group,
            )
            if grid.periodic != 0 and (cx == 0 or cx == grid.count_x - 1):
                beyond = grid.count_x - 1
                shifted_x = x + grid.domain[0]
                if cx != 0:
                    beyond = 0
                    shifted_x = x - grid.domain[0]
                begin = cell_start[row * grid.count_x + beyond]
                end = cell_start[row * grid.count_x + beyond + 1]
                total += sum_range(
                    shifted_x,
                    shifted_y,
                    begin,
                    end,
                    row_start,
                    cutoff2,
                    rate,
                    interaction,
                    sorted_x,
                    sorted_y,
                    sorted_charge,
                    sorted_group,
                )
    field[order[i]] = total
