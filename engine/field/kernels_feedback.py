"""Kernels that measure how dense charges stand over some spacings, and change their targets; see :mod:`.target_feedback`."""

from __future__ import annotations

import warp as wp

from ..space.kernels_mesh import Mesh
from ..space.kernels_space import wrap
from .kernels_gather import GivenCharges
from .kernels_splines import deposit

__all__ = [
    "Coarse",
    "add_what_factors_add",
    "blur_along",
    "change_factors",
    "change_targets",
    "deposit_given",
    "read_factors",
]

wp.set_module_options({"enable_backward": False})


@wp.struct
class Coarse:
    """Factors at the nodes of a coarse mesh over a domain, one group after the other.

    ``count`` nodes along either axis, ``inverse_spacing`` apart, the first in the domain's corner; they repeat themselves or not.
    """

    factor: wp.array(dtype=float)
    count_x: wp.int32
    count_y: wp.int32
    inverse_spacing: wp.vec2
    size: wp.vec2
    repeats: wp.int32


@wp.kernel
def deposit_given(
    first: int,
    position: wp.array(dtype=wp.vec2),
    given: GivenCharges,
    mesh: Mesh,
    # outputs
    node_charge: wp.array(dtype=wp.int64),
):
    """Spread charges onto the nodes around them, on a GPU."""
    i = first + wp.tid()
    at = position[i] - given.origin
    inside = wp.vec2(wp.clamp(at[0], 0.0, given.extent[0]), wp.clamp(at[1], 0.0, given.extent[1]))
    deposit(inside, given.charge[i], given.group[i], mesh, node_charge)


@wp.func
def mirrored_or_repeated(
    values: wp.array(dtype=float), begin: int, inner: int, k: int, intervals: int, margin: int, repeats: int
):
    """Value at node ``k`` of an axis of a domain that repeats itself, or that begins and ends with mirrors."""
    if repeats != 0:
        return values[begin + wrap(k, intervals) * inner]
    # What lies beyond an end, as splines of charges near it do, is seen in the mirror, and what is mirrored lies beyond it.
    total = float(0.0)
    if k >= -margin and k <= intervals + margin:
        total += values[begin + (k + margin) * inner]
    if k <= margin and k >= -intervals - margin:
        total += values[begin + (margin - k) * inner]
    if k >= intervals - margin and k <= 2 * intervals + margin:
        total += values[begin + (2 * intervals - k + margin) * inner]
    return total


@wp.kernel
def blur_along(
    first: int,
    values: wp.array(dtype=float),
    weight: wp.array2d(dtype=float),
    reach: wp.array(dtype=wp.int32),
    others: int,
    nodes_given: int,
    nodes: int,
    inner: int,
    intervals: int,
    margin: int,
    repeats: int,
    # outputs
    blurred: wp.array(dtype=float),
):
    """Weigh values along the third of four axes, of which the first counts groups, each with weights of its own.

    There are ``others`` along the second axis and ``inner`` along the last one; ``nodes_given`` along the third become ``nodes``.
    """
    i = first + wp.tid()
    row = i / (inner * nodes)
    begin = row * inner * nodes_given + i % inner
    at = i / inner % nodes
    group = row / others
    own = weight[group]
    total = own[0] * mirrored_or_repeated(values, begin, inner, at, intervals, margin, repeats)
    for t in range(1, reach[group] + 1):
        both = mirrored_or_repeated(values, begin, inner, at - t, intervals, margin, repeats)
        both += mirrored_or_repeated(values, begin, inner, at + t, intervals, margin, repeats)
        total += own[t] * both
    blurred[i] = total


@wp.kernel
def change_factors(
    first: int,
    surplus: wp.array(dtype=float),
    asked: wp.array(dtype=float),
    mean: wp.array(dtype=float),
    ground: wp.array(dtype=float),
    nodes: int,
    sparse: float,
    followed: float,
    not_followed: float,
    most: float,
    # outputs
    factor: wp.array(dtype=float),
):
    """Ask for less where charges are denser than asked for, and for more where they are sparser.

    Factors stay as they are where the density is ``sparse``, over its mean, where a quarter of what the Gaussian sees is no ``ground``
    of it, and where bodies do not follow it; so do those of groups whose density was not blurred, which is 0 then.
    """
    i = first + wp.tid()
    counts = wp.clamp(asked[i] / (sparse * mean[i / nodes]) - 1.0, 0.0, 1.0)
    counts *= wp.clamp(4.0 * ground[i] - 3.0, 0.0, 1.0)
    if counts > 0.0:
        off = surplus[i] / asked[i]
        counts *= wp.clamp((not_followed - wp.abs(off)) / (not_followed - followed), 0.0, 1.0)
        factor[i] = wp.clamp(factor[i] - counts * off, -most, most)


@wp.func
def factor_at(i: int, mesh: Mesh, coarse: Coarse):
    """Factor at node ``i`` of the charges' mesh, of all groups: linear between the coarse nodes around it."""
    nodes = mesh.count_x * mesh.count_y
    column = float(i % mesh.count_x - mesh.margin) / mesh.inverse_spacing[0]
    row = float(i % nodes / mesh.count_x - mesh.margin) / mesh.inverse_spacing[1]
    u = wp.clamp(column, 0.0, coarse.size[0]) * coarse.inverse_spacing[0]
    v = wp.clamp(row, 0.0, coarse.size[1]) * coarse.inverse_spacing[1]
    left = int(u)
    below = int(v)
    s = u - float(left)
    t = v - float(below)
    right = left + 1
    above = below + 1
    if coarse.repeats != 0:
        left = wrap(left, coarse.count_x)
        below = wrap(below, coarse.count_y)
        right = wrap(right, coarse.count_x)
        above = wrap(above, coarse.count_y)
    else:
        left = wp.min(left, coarse.count_x - 1)
        below = wp.min(below, coarse.count_y - 1)
        right = wp.min(right, coarse.count_x - 1)
        above = wp.min(above, coarse.count_y - 1)
    base = i / nodes * coarse.count_x * coarse.count_y
    low = (1.0 - s) * coarse.factor[base + below * coarse.count_x + left]
    low += s * coarse.factor[base + below * coarse.count_x + right]
    high = (1.0 - s) * coarse.factor[base + above * coarse.count_x + left]
    high += s * coarse.factor[base + above * coarse.count_x + right]
    return (1.0 - t) * low + t * high


@wp.kernel
def read_factors(
    first: int,
    mesh: Mesh,
    coarse: Coarse,
    # outputs
    factor: wp.array(dtype=float),
):
    """Factors of a coarse mesh at the nodes of another one."""
    i = first + wp.tid()
    factor[i] = factor_at(i, mesh, coarse)


@wp.kernel
def add_what_factors_add(
    first: int,
    asked: wp.array(dtype=float),
    mesh: Mesh,
    coarse: Coarse,
    block: int,
    blocks: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sums of charge that the factors add to the targets, of each of the ``blocks`` of every group."""
    b = first + wp.tid()
    nodes = mesh.count_x * mesh.count_y
    begin = b % blocks * block
    found = wp.float64(0.0)
    for k in range(begin, wp.min(begin + block, nodes)):
        i = b / blocks * nodes + k
        found += wp.float64(asked[i] * factor_at(i, mesh, coarse))
    total[b] = found


@wp.kernel
def change_targets(
    first: int,
    asked: wp.array(dtype=float),
    mesh: Mesh,
    coarse: Coarse,
    mean_factor: wp.array(dtype=float),
    # outputs
    attraction: wp.array(dtype=float),
):
    """Targets with their factors, which leave the sum of every group as it was."""
    i = first + wp.tid()
    nodes = mesh.count_x * mesh.count_y
    attraction[i] = asked[i] * (1.0 + factor_at(i, mesh, coarse) - mean_factor[i / nodes])
