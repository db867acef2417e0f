"""Kernels of the targets' rest, which the charges' mesh is too coarse for; see :mod:`.target_correction`."""

from __future__ import annotations

import warp as wp

from ..space.kernels_mesh import Mesh
from ..space.kernels_space import wrap
from .kernels_blur import level_of
from .kernels_splines import potential_gradients

__all__ = [
    "BLOCK_OF_NODES",
    "Correction",
    "correction_at",
    "find_ranges",
    "mark_acting",
]

wp.set_module_options({"enable_backward": False})

# Nodes along a block, of which it is known whether the correction acts there.
BLOCK_OF_NODES = wp.constant(8)
# Potentials that differ by less than this share of the largest one are flat: the transforms round by a fifth of it. Bodies would
# not move by more than 1e-5 of their spacing for it.
FLAT = wp.constant(3e-6)


@wp.struct
class Correction:
    """What the charges' mesh lacks of the targets, on a finer one; see :class:`~.target_correction.TargetCorrection`.

    ``acts`` says of every row's blocks of nodes, one row after the other, whether there is more than rounding.
    """

    mesh: Mesh
    potential: wp.array(dtype=float)
    row: wp.array(dtype=wp.int32)
    scale: wp.array(dtype=float)
    levels: wp.array(dtype=float)
    acts: wp.array(dtype=wp.uint8)
    blocks_x: wp.int32
    blocks_y: wp.int32


@wp.func
def block_of(at: wp.vec2, correction: Correction):
    """Index of the block of nodes that a position inside the domain lies in."""
    column = int(at[0] * correction.mesh.inverse_spacing[0]) + correction.mesh.margin
    row = int(at[1] * correction.mesh.inverse_spacing[1]) + correction.mesh.margin
    x = wp.min(column / BLOCK_OF_NODES, correction.blocks_x - 1)
    y = wp.min(row / BLOCK_OF_NODES, correction.blocks_y - 1)
    return y * correction.blocks_x + x


@wp.func
def correction_at(at: wp.vec2, group: int, variance: float, correction: Correction):
    """What it adds to the force on a charge of a group; between two levels linear in the variance of the charge's blur."""
    row = correction.row[group]
    if correction.acts[row * correction.blocks_x * correction.blocks_y + block_of(at, correction)] == wp.uint8(0):
        return wp.vec2(0.0, 0.0)
    nodes = correction.mesh.count_x * correction.mesh.count_y
    base = row * correction.levels.shape[0] * nodes
    above = int(0)
    place = float(0.0)
    if correction.levels.shape[0] > 1:
        level, place = level_of(variance, correction.levels)
        base += level * nodes
        above = nodes
    both = potential_gradients(at, base, above, correction.mesh, correction.potential)
    below = wp.vec2(both[0], both[1])
    return correction.scale[group] * (below + place * (wp.vec2(both[2], both[3]) - below))


@wp.kernel
def find_ranges(
    first: int,
    potential: wp.array(dtype=float),
    levels: int,
    mesh: Mesh,
    blocks_x: int,
    blocks_y: int,
    # outputs
    spread: wp.array(dtype=float),
    largest: wp.array(dtype=float),
):
    """By how much a row's potentials differ among the nodes that the splines in a block reach, and the largest of them by amount.

    An element is a block; rows of blocks lie one after the other. Levels are looked at one by one.
    """
    i = first + wp.tid()
    row = i / (blocks_x * blocks_y)
    y = (i / blocks_x) % blocks_y * BLOCK_OF_NODES
    x = i % blocks_x * BLOCK_OF_NODES
    nodes = mesh.count_x * mesh.count_y
    difference = float(0.0)
    most = float(0.0)
    for level in range(levels):
        base = (row * levels + level) * nodes
        low = potential[base + y * mesh.count_x + x]
        high = low
        for b in range(y - 1, y + BLOCK_OF_NODES + 2):
            # Behind the end of an open mesh, where nothing is, the other side does no harm.
            line = base + wrap(b, mesh.count_y) * mesh.count_x
            for a in range(x - 1, x + BLOCK_OF_NODES + 2):
                value = potential[line + wrap(a, mesh.count_x)]
                low = wp.min(low, value)
                high = wp.max(high, value)
        difference = wp.max(difference, high - low)
        most = wp.max(most, wp.max(wp.abs(low), wp.abs(high)))
    spread[i] = difference
    largest[i] = most


@wp.kernel
def mark_acting(
    first: int,
    spread: wp.array(dtype=float),
    blocks: int,
    largest: wp.array(dtype=float),
    # outputs
    acts: wp.array(dtype=wp.uint8),
):
    """Mark the blocks in which there is more than rounding beside the largest potential of their row."""
    i = first + wp.tid()
    acts[i] = wp.uint8(0)
    if spread[i] > FLAT * largest[i / blocks]:
        acts[i] = wp.uint8(1)
