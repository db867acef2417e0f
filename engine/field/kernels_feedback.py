"""Kernels that measure how dense charges stand over some spacings, and change their targets; see :mod:`.target_feedback`."""

from __future__ import annotations

import warp as wp

from ..space.kernels_mesh import Mesh
from ..space.kernels_space import wrap
from .kernels_gather import GivenCharges
from .kernels_splines import deposit

__all__ = [
    "Coarse",
    "add_to_asked",
    "blur_along",
    "change_factors",
    "deposit_given",
    "multiply",
    "read_factors",
]

wp.set_module_options({"enable_backward": False})

# Factors change where more than three fifths of what the Gaussian sees is ground of the density, and wholly where all of it is: beyond
# an edge there are no mirrors, and bodies that stand a little within it are no lack. From a half on, errors at 1 spacing on islands
# are a fifth larger than without; from three quarters on, clumps on a disc are off by a fifth more at 4 spacings.
PER_GROUND, LESS_GROUND = wp.constant(2.5), wp.constant(1.5)


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
    far = reach[group]
    if at - far > margin and at + far < intervals - margin:
        # No end is near.
        middle = begin + (at + margin) * inner
        inside = own[0] * values[middle]
        for t in range(1, far + 1):
            inside += own[t] * (values[middle - t * inner] + values[middle + t * inner])
        blurred[i] = inside
        return
    total = own[0] * mirrored_or_repeated(values, begin, inner, at, intervals, margin, repeats)
    for t in range(1, far + 1):
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

    Factors stay as they are where the density is ``sparse``, over its mean, where two fifths of what the Gaussian sees are no
    ``ground`` of it, and where bodies do not follow it; so do those of groups whose density was not blurred, which is 0 then.
    """
    i = first + wp.tid()
    counts = wp.clamp(asked[i] / (sparse * mean[i / nodes]) - 1.0, 0.0, 1.0)
    counts *= wp.clamp(PER_GROUND * ground[i] - LESS_GROUND, 0.0, 1.0)
    if counts > 0.0:
        off = surplus[i] / asked[i]
        counts *= wp.clamp((not_followed - wp.abs(off)) / (not_followed - followed), 0.0, 1.0)
        factor[i] = wp.clamp(factor[i] - counts * off, -most, most)


@wp.func
def node_below(at: int, margin: int, inverse_spacing: float, size: float, coarse_inverse: float):
    """Where node ``at`` along an axis of a mesh lies between coarse nodes: the number of the one below it, and how far from that."""
    place = wp.clamp(float(at - margin) / inverse_spacing, 0.0, size) * coarse_inverse
    low = int(place)
    return low, place - float(low)


@wp.func
def node_after(at: int, count: int, repeats: int):
    """The node after one; at an end that does not repeat, this one."""
    if repeats != 0:
        return wrap(at + 1, count)
    return wp.min(at + 1, count - 1)


@wp.func
def factor_between(base: int, across: wp.vec2i, share: float, up: wp.vec2i, share_up: float, coarse: Coarse):
    """Factor between two coarse nodes along either axis, linear."""
    below = base + up[0] * coarse.count_x
    above = base + up[1] * coarse.count_x
    low = (1.0 - share) * coarse.factor[below + across[0]] + share * coarse.factor[below + across[1]]
    high = (1.0 - share) * coarse.factor[above + across[0]] + share * coarse.factor[above + across[1]]
    return (1.0 - share_up) * low + share_up * high


@wp.kernel
def read_factors(
    first: int,
    mesh: Mesh,
    coarse: Coarse,
    block: int,
    blocks: int,
    # outputs
    factor: wp.array(dtype=float),
):
    """Factors at the nodes of another mesh, of all groups; an element is one of the ``blocks`` of nodes of a row."""
    b = first + wp.tid()
    row = b / blocks % mesh.count_y
    group = b / blocks / mesh.count_y
    base = group * coarse.count_x * coarse.count_y
    below, share_up = node_below(row, mesh.margin, mesh.inverse_spacing[1], coarse.size[1], coarse.inverse_spacing[1])
    if coarse.repeats != 0:
        below = wrap(below, coarse.count_y)
    up = wp.vec2i(below, node_after(below, coarse.count_y, coarse.repeats))
    begin = b % blocks * block
    for column in range(begin, wp.min(begin + block, mesh.count_x)):
        left, share = node_below(
            column, mesh.margin, mesh.inverse_spacing[0], coarse.size[0], coarse.inverse_spacing[0]
        )
        if coarse.repeats != 0:
            left = wrap(left, coarse.count_x)
        across = wp.vec2i(left, node_after(left, coarse.count_x, coarse.repeats))
        i = (group * mesh.count_y + row) * mesh.count_x + column
        factor[i] = factor_between(base, across, share, up, share_up, coarse)


@wp.kernel
def multiply(
    first: int,
    asked: wp.array(dtype=float),
    nodes: int,
    block: int,
    blocks: int,
    # outputs
    factor: wp.array(dtype=float),
    total: wp.array(dtype=wp.float64),
):
    """Multiply factors by what is asked for; and sum up each of the ``blocks`` of every group."""
    b = first + wp.tid()
    begin = b / blocks * nodes + b % blocks * block
    found = wp.float64(0.0)
    for i in range(begin, wp.min(begin + block, (b / blocks + 1) * nodes)):
        more = asked[i] * factor[i]
        factor[i] = more
        found += wp.float64(more)
    total[b] = found


@wp.kernel
def add_to_asked(
    first: int,
    asked: wp.array(dtype=float),
    mean_factor: wp.array(dtype=float),
    nodes: int,
    # outputs
    attraction: wp.array(dtype=float),
):
    """Add what is asked for to what there is more of it, less so that the sum of every group stays as it was."""
    i = first + wp.tid()
    attraction[i] += asked[i] * (1.0 - mean_factor[i / nodes])
