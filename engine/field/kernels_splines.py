"""Kernels between charges and the mesh: deposit, mixing of groups, interpolation. Cubic B-splines throughout."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import CellGrid, SortedCharges
from ..space.kernels_mesh import Mesh
from ..space.kernels_space import wrap

wp.set_module_options({"enable_backward": False})

# Charges are deposited as integers in units of 2^-32 of the mean charge: integer sums do not depend on their order, so the
# same positions give the same bytes however many threads or GPU blocks deposit at once. 2^31 mean charges fit into a node.
FIXED_POINT_SCALE = wp.constant(4294967296.0)


@wp.func
def spline_weights(t: float):
    """Values of the four cubic B-splines that reach a point at fraction ``t`` of its mesh cell."""
    s = 1.0 - t
    t2 = t * t
    t3 = t2 * t
    return wp.vec4(
        s * s * s / 6.0, (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0, (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0, t3 / 6.0
    )


@wp.func
def spline_slopes(t: float):
    """Derivatives of :func:`spline_weights` with respect to ``t``."""
    s = 1.0 - t
    t2 = t * t
    return wp.vec4(-0.5 * s * s, 1.5 * t2 - 2.0 * t, -1.5 * t2 + t + 0.5, 0.5 * t2)


# Four nodes of a row at once; on the CPU no two threads write to the same rows.
_DEPOSIT = """
#if defined(__CUDA_ARCH__)
    for (int b = 0; b < 4; ++b)
        for (int a = 0; a < 4; ++a)
            atomicAdd(
                (unsigned long long*)node_charge.data + start + b * stride + a,
                (unsigned long long)__float2ll_rn(wy[b] * wx[a]));
#else
    typedef float V __attribute__((ext_vector_type(4)));
    typedef long long I __attribute__((ext_vector_type(4), aligned(8)));
    const V row = {wx[0], wx[1], wx[2], wx[3]};
    for (int b = 0; b < 4; ++b)
        *(I*)(node_charge.data + start + b * stride) += __builtin_convertvector(wy[b] * row, I);
#endif
"""


@wp.func_native(_DEPOSIT)
def add_to_rows(node_charge: wp.array(dtype=wp.int64), start: int, stride: int, wx: wp.vec4, wy: wp.vec4): ...


@wp.func
def deposit(
    position: wp.vec2,
    charge: float,
    group: int,
    mesh: Mesh,
    node_charge: wp.array(dtype=wp.int64),
):
    """Spread a charge onto the sixteen nodes around it."""
    u = position[0] * mesh.inverse_spacing[0] + float(mesh.margin)
    v = position[1] * mesh.inverse_spacing[1] + float(mesh.margin)
    iu = int(wp.floor(u))
    iv = int(wp.floor(v))
    wx = spline_weights(u - float(iu))
    wy = spline_weights(v - float(iv)) * (charge * FIXED_POINT_SCALE)
    base = group * mesh.count_x * mesh.count_y
    if iu >= 1 and iv >= 1 and iu + 2 < mesh.count_x and iv + 2 < mesh.count_y:
        add_to_rows(node_charge, base + (iv - 1) * mesh.count_x + iu - 1, mesh.count_x, wx, wy)
        return
    # Only splines on a periodic mesh reach round it.
    for b in range(4):
        row = wrap(iv + b - 1, mesh.count_y)
        for a in range(4):
            column = wrap(iu + a - 1, mesh.count_x)
            wp.atomic_add(node_charge, base + row * mesh.count_x + column, wp.int64(wy[b] * wx[a]))


@wp.kernel
def deposit_bands(
    first: int,
    first_band: int,
    bands: int,
    cells: CellGrid,
    charges: SortedCharges,
    mesh: Mesh,
    # outputs
    node_charge: wp.array(dtype=wp.int64),
):
    """Spread the charges of every other of ``bands`` bands of rows of cells; an element is a band."""
    band = first_band + 2 * (first + wp.tid())
    begin = charges.cell_start[cells.count_y * band / bands * cells.count_x]
    end = charges.cell_start[cells.count_y * (band + 1) / bands * cells.count_x]
    for i in range(begin, end):
        deposit(wp.vec2(charges.x[i], charges.y[i]), charges.charge[i], charges.group[i], mesh, node_charge)


# Nodes that the CPU mixes at once.
MIXED_AT_ONCE = 16

# The CPU reads the charges of a few nodes once, and adds them to what every group sees there; a GPU has a thread for every node.
_MIX = """
#if defined(__CUDA_ARCH__)
    for (int g = 0; g < group_count; ++g)
    {
        float total = -target.data[(size_t)g * node_count + start];
        for (int h = 0; h < group_count; ++h)
            total += interaction.data[g * group_count + h]
                * ((float)node_charge.data[(size_t)h * node_count + start] * inverse_scale);
        mixed.data[(size_t)g * node_count + start] = total;
    }
    for (int h = 0; h < group_count; ++h) node_charge.data[(size_t)h * node_count + start] = 0;
#else
    enum { L = 16 };
    const int last = node_count - start < L ? node_count - start : L;
    for (int g = 0; g < group_count; ++g)
        for (int k = 0; k < last; ++k)
            mixed.data[(size_t)g * node_count + start + k] = -target.data[(size_t)g * node_count + start + k];
    for (int h = 0; h < group_count; ++h)
    {
        long long* __restrict__ from = (long long*)node_charge.data + (size_t)h * node_count + start;
        float charge[L];
        for (int k = 0; k < last; ++k)
        {
            charge[k] = (float)from[k] * inverse_scale;
            from[k] = 0;
        }
        for (int g = 0; g < group_count; ++g)
        {
            const float factor = interaction.data[g * group_count + h];
            float* __restrict__ to = mixed.data + (size_t)g * node_count + start;
            if (last == L) for (int k = 0; k < L; ++k) to[k] += factor * charge[k];
            else for (int k = 0; k < last; ++k) to[k] += factor * charge[k];
        }
    }
#endif
"""


@wp.func_native(_MIX)
def mix_nodes(
    node_charge: wp.array(dtype=wp.int64),
    interaction: wp.array(dtype=float),
    target: wp.array(dtype=float),
    group_count: int,
    node_count: int,
    start: int,
    inverse_scale: float,
    mixed: wp.array(dtype=float),
): ...


@wp.kernel
def mix_groups(
    first: int,
    interaction: wp.array(dtype=float),
    target: wp.array(dtype=float),
    group_count: int,
    node_count: int,
    at_once: int,
    # outputs
    node_charge: wp.array(dtype=wp.int64),
    mixed: wp.array(dtype=float),
):
    """Sum of M[g, h] (rho_h - u_h) over h, for every group g; an element takes ``at_once`` nodes, and leaves them without charge."""
    start = (first + wp.tid()) * at_once
    mix_nodes(node_charge, interaction, target, group_count, node_count, start, 1.0 / FIXED_POINT_SCALE, mixed)


# The four splines and their slopes as polynomials, all at once; then four nodes of a row at once: their sum weighed for the value, and
# for the slope along x.
_GRADIENT = """
    const float* __restrict__ p = potential.data + start;
#if defined(__CUDA_ARCH__)
    typedef struct { float at[4]; } V;
    const V cubic = {{-1.0f / 6.0f, 0.5f, -0.5f, 1.0f / 6.0f}}, square = {{0.5f, -1.0f, 0.5f, 0.0f}};
    const V linear = {{-0.5f, 0.0f, 0.5f, 0.0f}}, constant = {{1.0f / 6.0f, 2.0f / 3.0f, 1.0f / 6.0f, 0.0f}};
    float wx[4], wy[4], dx[4], dy[4];
    for (int k = 0; k < 4; ++k)
    {
        wx[k] = ((cubic.at[k] * u + square.at[k]) * u + linear.at[k]) * u + constant.at[k];
        wy[k] = ((cubic.at[k] * v + square.at[k]) * v + linear.at[k]) * v + constant.at[k];
        dx[k] = (3.0f * cubic.at[k] * u + 2.0f * square.at[k]) * u + linear.at[k];
        dy[k] = (3.0f * cubic.at[k] * v + 2.0f * square.at[k]) * v + linear.at[k];
    }
    wp::vec4 result;
    for (int k = 0; k < 2; ++k)
    {
        const float* __restrict__ q = p + (size_t)k * above;
        float along = 0.0f, across = 0.0f;
        for (int b = 0; b < 4; ++b)
        {
            float value = 0.0f, slope = 0.0f;
            for (int a = 0; a < 4; ++a)
            {
                const float node = q[b * stride + a];
                value += wx[a] * node;
                slope += dx[a] * node;
            }
            along += slope * wy[b];
            across += value * dy[b];
        }
        result[2 * k] = along;
        result[2 * k + 1] = across;
        if (above == 0) break;
    }
    return result;
#else
    typedef float V __attribute__((ext_vector_type(4), aligned(4)));
    const V cubic = {-1.0f / 6.0f, 0.5f, -0.5f, 1.0f / 6.0f}, square = {0.5f, -1.0f, 0.5f, 0.0f};
    const V linear = {-0.5f, 0.0f, 0.5f, 0.0f}, constant = {1.0f / 6.0f, 2.0f / 3.0f, 1.0f / 6.0f, 0.0f};
    const V wx = ((cubic * u + square) * u + linear) * u + constant;
    const V wy = ((cubic * v + square) * v + linear) * v + constant;
    const V dx = (3.0f * cubic * u + 2.0f * square) * u + linear;
    const V dy = (3.0f * cubic * v + 2.0f * square) * v + linear;
    wp::vec4 result;
    for (int k = 0; k < 2; ++k)
    {
        const float* __restrict__ q = p + (size_t)k * above;
        V value = (V)0.0f, slope = (V)0.0f;
        for (int b = 0; b < 4; ++b)
        {
            const V row = *(const V*)(q + b * stride);
            value += dy[b] * row;
            slope += wy[b] * row;
        }
        const V weighed = value * wx;
        const V sloped = slope * dx;
        result[2 * k] = (sloped[0] + sloped[1]) + (sloped[2] + sloped[3]);
        result[2 * k + 1] = (weighed[0] + weighed[1]) + (weighed[2] + weighed[3]);
        if (above == 0) break;
    }
    return result;
#endif
"""


@wp.func_native(_GRADIENT)
def gradients_of_rows(
    potential: wp.array(dtype=float), start: int, stride: int, above: int, u: float, v: float
) -> wp.vec4: ...


# Charges of several groups that lie side by side reach for as many meshes, too many rows for a processor to foresee: a CPU asks for
# those of a charge so many ahead. Measured with 1,000,000 bodies in six groups: a third less time for the gradients.
AHEAD = wp.constant(16)

_FETCH = """
#if !defined(__CUDA_ARCH__)
    for (int b = 0; b < 4; ++b) __builtin_prefetch(potential.data + start + (size_t)b * stride);
#endif
"""


@wp.func_native(_FETCH)
def fetch_rows(potential: wp.array(dtype=float), start: int, stride: int): ...


@wp.func
def fetch_ahead(i: int, charges: SortedCharges, mesh: Mesh, potential: wp.array(dtype=float)):
    """Ask for the nodes around a charge to come; those that are not there are no error."""
    soon = wp.min(i + AHEAD, charges.group.shape[0] - 1)
    column = int(charges.x[soon] * mesh.inverse_spacing[0]) + mesh.margin - 1
    row = int(charges.y[soon] * mesh.inverse_spacing[1]) + mesh.margin - 1
    fetch_rows(potential, (charges.group[soon] * mesh.count_y + row) * mesh.count_x + column, mesh.count_x)


@wp.func
def potential_gradients(position: wp.vec2, base: int, above: int, mesh: Mesh, potential: wp.array(dtype=float)):
    """Gradients of the mesh potential that starts at element ``base``, and of the one that starts ``above`` elements later.

    Four numbers, along x and y of each; only the first where ``above`` is 0.
    """
    u = position[0] * mesh.inverse_spacing[0] + float(mesh.margin)
    v = position[1] * mesh.inverse_spacing[1] + float(mesh.margin)
    iu = int(wp.floor(u))
    iv = int(wp.floor(v))
    fu = u - float(iu)
    fv = v - float(iv)
    per = mesh.inverse_spacing
    of_both = wp.vec4(per[0], per[1], per[0], per[1])
    if iu >= 1 and iv >= 1 and iu + 2 < mesh.count_x and iv + 2 < mesh.count_y:
        start = base + (iv - 1) * mesh.count_x + iu - 1
        return wp.cw_mul(gradients_of_rows(potential, start, mesh.count_x, above, fu, fv), of_both)
    wx = spline_weights(fu)
    wy = spline_weights(fv)
    dx = spline_slopes(fu)
    dy = spline_slopes(fv)
    # Only splines on a periodic mesh reach round it.
    gradients = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for b in range(4):
        row = wrap(iv + b - 1, mesh.count_y)
        for a in range(4):
            at = base + row * mesh.count_x + wrap(iu + a - 1, mesh.count_x)
            p = potential[at]
            q = potential[at + above]
            gradients += wp.vec4(p * (dx[a] * wy[b]), p * (wx[a] * dy[b]), q * (dx[a] * wy[b]), q * (wx[a] * dy[b]))
    return wp.cw_mul(gradients, of_both)


@wp.func
def potential_gradient(position: wp.vec2, base: int, mesh: Mesh, potential: wp.array(dtype=float)):
    """Gradient of the mesh potential that starts at element ``base``."""
    both = potential_gradients(position, base, 0, mesh, potential)
    return wp.vec2(both[0], both[1])
