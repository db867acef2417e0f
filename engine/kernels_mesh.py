"""Kernels between charges and the mesh: deposit, mixing of groups, interpolation. Cubic B-splines throughout."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Charges are deposited as integers in units of 2^-32 of the mean charge: integer sums do not depend on their order, so the
# same positions give the same bytes however many threads or GPU blocks deposit at once. 2^31 mean charges fit into a node.
FIXED_POINT_SCALE = wp.constant(4294967296.0)


@wp.struct
class Mesh:
    """Mesh of one potential per group: ``count`` nodes, their inverse spacing, the index of the node at the origin."""

    count_x: wp.int32
    count_y: wp.int32
    inverse_spacing: wp.vec2
    margin: wp.int32
    periodic: wp.int32


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


@wp.func
def wrap(i: int, count: int):
    """``i`` modulo ``count``, for ``i`` at most one period outside."""
    if i < 0:
        return i + count
    if i >= count:
        return i - count
    return i


@wp.kernel
def deposit_charges(
    first: int,
    sorted_x: wp.array(dtype=float),
    sorted_y: wp.array(dtype=float),
    sorted_charge: wp.array(dtype=float),
    sorted_group: wp.array(dtype=wp.int32),
    mesh: Mesh,
    # outputs
    node_charge: wp.array(dtype=wp.int64),
):
    i = first + wp.tid()
    u = sorted_x[i] * mesh.inverse_spacing[0] + float(mesh.margin)
    v = sorted_y[i] * mesh.inverse_spacing[1] + float(mesh.margin)
    iu = int(wp.floor(u))
    iv = int(wp.floor(v))
    wx = spline_weights(u - float(iu))
    wy = spline_weights(v - float(iv))
    base = sorted_group[i] * mesh.count_x * mesh.count_y
    q = sorted_charge[i]
    for b in range(4):
        row = iv + b - 1
        if mesh.periodic != 0:
            row = wrap(row, mesh.count_y)
        qy = q * wy[b]
        for a in range(4):
            column = iu + a - 1
            if mesh.periodic != 0:
                column = wrap(column, mesh.count_x)
            amount = wp.int64(wp.round(qy * wx[a] * FIXED_POINT_SCALE))
            wp.atomic_add(node_charge, base + row * mesh.count_x + column, amount)


@wp.kernel
def mix_groups(
    first: int,
    node_charge: wp.array(dtype=wp.int64),
    interaction: wp.array(dtype=float),
    target: wp.array(dtype=float),
    group_count: int,
    group: int,
    node_count: int,
    # outputs
    real: wp.array(dtype=float),
    imaginary: wp.array(dtype=float),
):
    """Sum of M[g, h] (rho_h - u_h) over h, for g = group (real part) and g = group + 1 (imaginary part)."""
    i = first + wp.tid()
    sum_real = float(0.0)
    sum_imaginary = float(0.0)
    paired = int(0)
    if group + 1 < group_count:
        paired = 1
    for h in range(group_count):
        c = float(node_charge[h * node_count + i]) / FIXED_POINT_SCALE
        sum_real += interaction[group * group_count + h] * c
        if paired != 0:
            sum_imaginary += interaction[(group + 1) * group_count + h] * c
    real[i] = sum_real - target[group * node_count + i]
    if paired != 0:
        sum_imaginary -= target[(group + 1) * node_count + i]
    imaginary[i] = sum_imaginary


@wp.func
def potential_gradient(position: wp.vec2, base: int, mesh: Mesh, potential: wp.array(dtype=float)):
    """Gradient of the mesh potential that starts at element ``base``."""
    u = position[0] * mesh.inverse_spacing[0] + float(mesh.margin)
    v = position[1] * mesh.inverse_spacing[1] + float(mesh.margin)
    iu = int(wp.floor(u))
    iv = int(wp.floor(v))
    wx = spline_weights(u - float(iu))
    wy = spline_weights(v - float(iv))
    dx = spline_slopes(u - float(iu))
    dy = spline_slopes(v - float(iv))
    gradient = wp.vec2(0.0, 0.0)
    for b in range(4):
        row = iv + b - 1
        if mesh.periodic != 0:
            row = wrap(row, mesh.count_y)
        value = float(0.0)
        slope = float(0.0)
        for a in range(4):
            column = iu + a - 1
            if mesh.periodic != 0:
                column = wrap(column, mesh.count_x)
            p = potential[base + row * mesh.count_x + column]
            value += wx[a] * p
            slope += dx[a] * p
        gradient += wp.vec2(slope * wy[b], value * dy[b])
    return wp.cw_mul(gradient, mesh.inverse_spacing)


@wp.func
def nearest_node(position: wp.vec2, mesh: Mesh):
    """Index of the mesh node nearest to ``position``."""
    column = int(wp.round(position[0] * mesh.inverse_spacing[0])) + mesh.margin
    row = int(wp.round(position[1] * mesh.inverse_spacing[1])) + mesh.margin
    if mesh.periodic != 0:
        column = wrap(column, mesh.count_x)
        row = wrap(row, mesh.count_y)
    return row * mesh.count_x + column
