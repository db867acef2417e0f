"""Kernels that find how wide charges and targets are blurred, place by place; see :mod:`.blur`."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import SortedCharges
from ..space.kernels_mesh import Mesh
from ..space.kernels_space import wrap

wp.set_module_options({"enable_backward": False})

# Where less of a node's surroundings than this lies in the domain, no charge ever is.
LEAST_INSIDE = wp.constant(1.0e-3)


@wp.kernel
def find_variances(
    first: int,
    number: wp.array(dtype=float),
    inside: wp.array(dtype=float),
    inside_most: float,
    dense: float,
    usual: float,
    exponent: float,
    lowest: float,
    highest: float,
    # outputs
    variance: wp.array(dtype=float),
):
    """``usual`` where the smoothed number density is ``dense``; elsewhere a power of it, between bounds.

    ``number`` and ``inside`` are charges and area of the domain per node, smoothed alike: their ratio is the density
    inside. ``inside`` is ``inside_most`` at an inner node.
    """
    i = first + wp.tid()
    result = highest
    if inside[i] > LEAST_INSIDE * inside_most and number[i] > 0.0:
        result = wp.clamp(usual * wp.pow(number[i] / (inside[i] * dense), -exponent), lowest, highest)
    variance[i] = result


@wp.func
def level_of(variance: float, levels: wp.array(dtype=float)):
    """Level below ``variance``, and how far it is from there to the next, 0..1; there are two levels at least."""
    level = int(0)
    for above in range(1, levels.shape[0] - 1):
        if variance >= levels[above]:
            level = above
    low = levels[level]
    return level, wp.clamp((variance - low) / (levels[level + 1] - low), 0.0, 1.0)


@wp.kernel
def take_level(
    first: int,
    images: wp.array(dtype=float),
    node_count: int,
    variance: wp.array(dtype=float),
    of_target: float,
    levels: wp.array(dtype=float),
    level: int,
    # outputs
    result: wp.array(dtype=float),
):
    """What of the images is blurred by the variance of ``level``: shares between two levels add up to the whole."""
    i = first + wp.tid()
    below, place = level_of(of_target * variance[i - i / node_count * node_count], levels)
    share = float(0.0)
    if level == below:
        share = 1.0 - place
    elif level == below + 1:
        share = place
    result[i] = share * images[i]


@wp.func
def variance_at(x: float, y: float, mesh: Mesh, variance: wp.array(dtype=float)):
    """Variance at a place inside the domain, bilinear between the nodes."""
    u = x * mesh.inverse_spacing[0] + float(mesh.margin)
    v = y * mesh.inverse_spacing[1] + float(mesh.margin)
    left = int(u)
    low = int(v)
    right = wrap(left + 1, mesh.count_x)
    high = wrap(low + 1, mesh.count_y)
    fu = u - float(left)
    fv = v - float(low)
    left = wrap(left, mesh.count_x)
    low = wrap(low, mesh.count_y)
    lower = (1.0 - fu) * variance[low * mesh.count_x + left] + fu * variance[low * mesh.count_x + right]
    upper = (1.0 - fu) * variance[high * mesh.count_x + left] + fu * variance[high * mesh.count_x + right]
    return (1.0 - fv) * lower + fv * upper


@wp.kernel
def gather_variances(
    first: int,
    charges: SortedCharges,
    own_sizes: int,
    size: wp.array(dtype=float),
    mesh: Mesh,
    variance: wp.array(dtype=float),
    least: float,
    # outputs
    sorted_variance: wp.array(dtype=float),
):
    """Variance of every charge's blur: that of its place, less where it is a small one; by ``size`` where charges fade."""
    i = first + wp.tid()
    share = charges.charge[i]
    if own_sizes != 0:
        share = size[charges.order[i]]
    share = wp.clamp(share, least, 1.0)
    sorted_variance[i] = share * variance_at(charges.x[i], charges.y[i], mesh, variance)


@wp.kernel
def gather_families(
    first: int,
    charges: SortedCharges,
    family_of_group: wp.array(dtype=wp.int32),
    # outputs
    family: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    family[i] = family_of_group[charges.group[i]]
