"""Kernels that push footprints in contact apart on a surface: discs, and capsules around half axes, in the planes that touch it."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell
from ..space.kernels_meeting import Meeting, keep_apart
from ..surface.kernels_facets import carried, spot_at, tangential
from ..surface.kernels_relations import see_each_other
from .kernels_contact import Capsule, Push, capsule, push_between, scale_of_pushes
from .kernels_descent import PINNED, Bodies
from .kernels_lying import LEAST_COSINE, Slots, cell_of_block, in_plane, slot_of_level
from .kernels_on_surface import Ground, Motion, Poses, remembered, walk

wp.set_module_options({"enable_backward": False})


@wp.struct
class Footprints:
    """What is known of footprints.

    Level, radius (half the thickness of a capsule), farthest reach and mass of every body; and of every level the largest reach and
    the inverse size of its cells; and who keeps apart from whom.
    """

    level_count: wp.int32
    level: wp.array(dtype=wp.int32)
    radius: wp.array(dtype=float)
    reach: wp.array(dtype=float)
    mass: wp.array(dtype=float)
    level_reach: wp.array(dtype=float)
    inverse_cell: wp.array(dtype=float)
    meeting: Meeting


@wp.struct
class Pushes:
    """What every body is to do: a shift and a turn; and how many push it, and how many of these overlap it."""

    shift: wp.array(dtype=wp.vec3)
    turn: wp.array(dtype=float)
    count: wp.array(dtype=wp.int32)
    overlaps: wp.array(dtype=wp.int32)


@wp.struct
class Total:
    """What pushes a body so far: a shift in its plane and a turn; how many do, and how many of these overlap it."""

    shift: wp.vec2
    turn: float
    count: float
    overlaps: wp.int32


@wp.kernel
def contact_slots(
    first: int,
    poses: Poses,
    footprints: Footprints,
    ground: Ground,
    mask: int,
    # outputs
    position: wp.array(dtype=wp.vec3),
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    at = spot_at(poses.facet[i], poses.weight[i], ground.facets).position
    position[i] = at
    m = footprints.level[i]
    key[i] = slot_of_level(cell_at(at, footprints.inverse_cell[m]), m, mask)
    order[i] = i


@wp.kernel
def keep_positions(
    first: int,
    position: wp.array(dtype=wp.vec3),
    # outputs
    kept: wp.array(dtype=wp.vec3),
):
    i = first + wp.tid()
    kept[i] = position[i]


@wp.struct
class Here:
    """A body as others meet it: where, on which part, the plane that touches the surface there, and its footprint in that plane."""

    position: wp.vec3
    label: wp.int32
    normal: wp.vec3
    along: wp.vec3
    beside: wp.vec3
    footprint: Capsule


@wp.func
def direction_in_plane(normal: wp.vec3):
    """Any direction across ``normal``."""
    across = wp.vec3(-normal[2], 0.0, normal[0])
    if wp.abs(normal[0]) < 0.6:
        across = wp.vec3(0.0, -normal[2], normal[1])
    return wp.normalize(across)


@wp.func
def stand(position: wp.vec3, facet: int, axis: wp.vec3, radius: float, mass: float, ground: Ground):
    """A body on a facet, seen in the plane along its axis."""
    half = wp.length(axis)
    here = Here()
    here.position = position
    here.label = ground.facets.label[facet]
    here.normal = ground.facets.normal[facet]
    here.along = axis / wp.max(half, 1.0e-12)
    if half == 0.0:
        here.along = direction_in_plane(here.normal)
    here.beside = wp.cross(here.normal, here.along)
    here.footprint = capsule(wp.vec2(half, 0.0), half, radius, mass)
    return here


@wp.func
def pushed_by(
    i: int,
    j: int,
    here: Here,
    facet: int,
    position: wp.vec3,
    axis: wp.vec3,
    footprints: Footprints,
    ground: Ground,
    slack: float,
):
    """What body ``j`` does to body ``i``. What lies on another part, or looks to the other side, is not met."""
    way = position - here.position
    distance = wp.length(way)
    own = here.footprint
    touching = own.radius + footprints.radius[j]
    normal = ground.facets.normal[facet]
    facets = ground.facets
    met = see_each_other(facets.label[facet], here.label, facets.label, facets.relations)
    met = met and wp.dot(normal, here.normal) >= LEAST_COSINE
    if not (met and distance < own.half + own.radius + footprints.reach[j] + slack * touching):
        return Push()
    # Into the plane here, as far off as they are.
    flat = in_plane(way, here.along, here.beside)
    length = wp.length(flat)
    if length > 1.0e-6 * touching:
        flat = flat * (distance / length)
    carried_axis = carried(axis, normal, here.normal)
    reach = footprints.reach[j]
    other = Capsule()
    other.half_axis = in_plane(carried_axis, here.along, here.beside)
    other.half = wp.length(other.half_axis)
    other.radius = footprints.radius[j]
    other.mass = footprints.mass[j]
    other.inertia = other.mass * reach * reach / 3.0
    return push_between(i, j, flat, own, other, touching * (1.0 + slack))


@wp.func
def add_pushes_of_cell(
    before: Total,
    i: int,
    here: Here,
    cell: wp.vec3i,
    level: int,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
):
    """What pushes body ``i`` so far, and what the bodies of a level in a cell add to it."""
    total = Total()
    total.shift = before.shift
    total.turn = before.turn
    total.count = before.count
    total.overlaps = before.overlaps
    inverse = footprints.inverse_cell[level]
    slot = slot_of_level(cell, level, slots.mask)
    for s in range(slots.start[slot], slots.start[slot + 1]):
        j = slots.order[s]
        wanted = j != i and footprints.level[j] == level and keep_apart(i, j, footprints.meeting)
        if wanted and same_cell(cell_at(slots.sorted_at[j], inverse), cell):
            push = pushed_by(i, j, here, poses.facet[j], position[j], poses.axis[j], footprints, ground, slack)
            total.shift += push.shift
            total.turn += push.turn
            total.count += push.count
            if push.count > 0.0 and push.distance < here.footprint.radius + footprints.radius[j]:
                total.overlaps += 1
    return total


@wp.kernel
def push_apart(
    first: int,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    damping: float,
    # outputs
    pushes: Pushes,
):
    """The shift and turn that bring every body out of those that it overlaps; how many push it, and how many of them overlap it."""
    i = first + wp.tid()
    here = stand(position[i], poses.facet[i], poses.axis[i], footprints.radius[i], footprints.mass[i], ground)
    reach = here.footprint.half + here.footprint.radius
    total = Total()
    for m in range(footprints.level_count):
        most = (reach + footprints.level_reach[m]) * (1.0 + slack)
        inverse = footprints.inverse_cell[m]
        low = cell_at(here.position - wp.vec3(most, most, most), inverse)
        high = cell_at(here.position + wp.vec3(most, most, most), inverse)
        counts = high - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            cell = low + cell_of_block(number, counts)
            total = add_pushes_of_cell(total, i, here, cell, m, poses, position, slots, footprints, ground, slack)
    scale = scale_of_pushes(total.count, damping)
    pushes.shift[i] = scale * (total.shift[0] * here.along + total.shift[1] * here.beside)
    pushes.turn[i] = scale * total.turn
    pushes.count[i] = int(total.count)
    pushes.overlaps[i] = total.overlaps


@wp.kernel
def accept_push(
    first: int,
    pushes: Pushes,
    bodies: Bodies,
    ground: Ground,
    # outputs
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    motion: Motion,
):
    """Push bodies as far as they may go, and count that as part of the displacement."""
    i = first + wp.tid()
    if pushes.count[i] == 0 or (bodies.flags[i] & PINNED) != 0:
        return
    normal = ground.facets.normal[poses.facet[i]]
    old = position[i]
    new = walk(poses.facet[i], poses.weight[i], pushes.shift[i], i, bodies.support[i], ground)
    new_normal = ground.facets.normal[new.facet]
    remembered(i, motion.displacement[i] + tangential(new.position - old, normal), normal, new_normal, motion)
    poses.facet[i] = new.facet
    poses.weight[i] = new.weight
    position[i] = new.position
    axis = poses.axis[i]
    if wp.length_sq(axis) > 0.0:
        turn = pushes.turn[i]
        poses.axis[i] = carried(wp.cos(turn) * axis + wp.sin(turn) * wp.cross(normal, axis), normal, new_normal)
        motion.turned[i] = motion.turned[i] + wp.vec2(turn, 0.0)
