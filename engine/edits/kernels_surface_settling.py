"""Kernels of the steps after an edit on a surface; see :mod:`.settling`. Lines are not held there."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import Bodies
from ..motion.kernels_on_surface import Charges, Ground, Motion, Poses, put_charge, walk
from ..surface.kernels_facets import carried, tangential
from .kernels_settling import bin_of_way

wp.set_module_options({"enable_backward": False})


@wp.struct
class Start:
    """Where charges were before the first step, and the nodes that were their homes; which nodes are near a change: 1 for those.

    And how far bodies that are held may go: ``within``, and not farther than ``locally`` times the step limit at their node.
    """

    position: wp.array(dtype=wp.vec3)
    home: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.uint8)
    within: float
    locally: float


@wp.func
def reach_from(j: int, start: Start, ground: Ground):
    return wp.min(start.within, start.locally * ground.step_limit[start.home[j]])


@wp.kernel
def mark_new(
    first: int,
    source: wp.array(dtype=wp.int32),
    bodies: Bodies,
    home: wp.array(dtype=wp.int32),
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark the nodes where bodies are that were not there before; whoever else does so at the same time writes the same."""
    i = first + wp.tid()
    if source[i] < 0:
        marked[home[bodies.first_charge[i]]] = 1


@wp.kernel
def mark_places(
    first: int,
    tile: wp.array(dtype=wp.int32),
    home: wp.array(dtype=wp.int32),
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark the nodes that are homes of some tiles."""
    marked[home[tile[first + wp.tid()]]] = 1


@wp.kernel
def mark_beside(
    first: int,
    marked: wp.array(dtype=wp.int32),
    list_start: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    # outputs
    near: wp.array(dtype=wp.uint8),
):
    """Mark the nodes that have a marked one in their lists, or are one."""
    node = first + wp.tid()
    found = marked[node]
    for k in range(list_start[node], list_start[node + 1]):
        found = wp.max(found, marked[entry[k]])
    near[node] = wp.uint8(found)


@wp.kernel
def count_moved(
    first: int,
    thread: int,
    source: wp.array(dtype=wp.int32),
    bodies: Bodies,
    start: Start,
    ground: Ground,
    charges: Charges,
    # outputs
    moved: wp.array2d(dtype=wp.int32),
):
    """Count dots near a change that were there before it by how far they have moved, but those within their reach."""
    i = first + wp.tid()
    j = bodies.first_charge[i]
    if source[i] < 0 or bodies.kind[i] >= 0 or start.near[start.home[j]] == wp.uint8(0):
        return
    way = wp.length(charges.points.position[j] - start.position[j])
    bin = bin_of_way(way, reach_from(j, start, ground))
    if bin > 0:
        wp.atomic_add(moved, thread, bin, 1)


@wp.kernel
def bring_back(
    first: int,
    source: wp.array(dtype=wp.int32),
    bodies: Bodies,
    start: Start,
    ground: Ground,
    free_from: wp.array(dtype=wp.int32),
    # outputs
    charges: Charges,
    poses: Poses,
    motion: Motion,
):
    """Bring dots back into their reach, but new ones and those near a change whose ways are in bin ``free_from`` or longer."""
    i = first + wp.tid()
    j = bodies.first_charge[i]
    if source[i] < 0 or bodies.kind[i] >= 0:
        return
    here = charges.points.position[j]
    way = here - start.position[j]
    length = wp.length(way)
    most = reach_from(j, start, ground)
    bin = bin_of_way(length, most)
    if bin == 0 or not (length > 0.0):
        return
    if bin >= free_from[0] and start.near[start.home[j]] != wp.uint8(0):
        return
    normal = ground.facets.normal[poses.facet[i]]
    back = tangential(way * (most / length - 1.0), normal)
    new = walk(poses.facet[i], poses.weight[i], back, i, bodies.support[i], ground)
    poses.facet[i] = new.facet
    poses.weight[i] = new.weight
    new_normal = ground.facets.normal[new.facet]
    gone = motion.displacement[i] + tangential(new.position - here, normal)
    motion.displacement[i] = carried(gone, normal, new_normal)
    motion.move[i] = carried(motion.move[i], normal, new_normal)
    put_charge(j, new.facet, new.weight, ground, charges)
