"""Kernels that push footprints in contact apart on a surface: discs, and capsules around half axes, in the planes that touch it."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell
from ..motion.kernels_descent import PINNED, Bodies
from ..motion.kernels_lying import LEAST_COSINE, Slots, cell_of_block, in_plane, slot_of_level
from ..motion.kernels_on_surface import Ground, Motion, Poses, remembered, walk
from ..space.kernels_meeting import Meeting, keep_apart
from ..surface.kernels_facets import across, carried, spot_at, tangential
from ..surface.kernels_relations import see_each_other
from .kernels_contact import Capsule, Push, capsule, push_between, scale_of_pushes

wp.set_module_options({"enable_backward": False})

# Bodies are near whose axes are so much farther apart than where they touch, as a share of both radii; and the share of its radius
# from which on a body's middle and an end of its axis have moved too far since it was listed. What is left between these is for the
# rounds of a step. Measured on 100,000 discs that cover 27 % or 75 % of a surface: they are listed in 64 and 51 of 100 steps. With
# thrice as much for the former it is 34, but each time takes as much longer.
NEARBY, STRAY = wp.constant(0.5), wp.constant(0.2)


@wp.struct
class Footprints:
    """What is known of footprints.

    Level, radius (half the thickness of a capsule), farthest reach and mass of every body; and of every level the largest reach and
    radius, and the inverse sizes of its cells, and of those that larger bodies look for it in; and who keeps apart from whom.
    """

    level_count: wp.int32
    level: wp.array(dtype=wp.int32)
    radius: wp.array(dtype=float)
    reach: wp.array(dtype=float)
    mass: wp.array(dtype=float)
    level_reach: wp.array(dtype=float)
    level_radius: wp.array(dtype=float)
    inverse_cell: wp.array(dtype=float)
    inverse_coarse_cell: wp.array(dtype=float)
    meeting: Meeting


@wp.struct
class Nearby:
    """Whom every body may touch while none has moved far: how many, -1 where that is not known, and who; ``room`` for so many each.

    And where bodies were when they were listed, and their half axes; ``stale`` is 1 as soon as one has moved too far since.
    """

    count: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    room: wp.int32
    listed_at: wp.array(dtype=wp.vec3)
    listed_axis: wp.array(dtype=wp.vec3)
    stale: wp.array(dtype=wp.int32)


@wp.struct
class Pushes:
    """What every body is to do: a shift and a turn; and how many push it, and how many of these overlap it."""

    shift: wp.array(dtype=wp.vec3)
    turn: wp.array(dtype=float)
    count: wp.array(dtype=wp.int32)
    overlaps: wp.array(dtype=wp.int32)


@wp.struct
class Lanes:
    """Bodies around which so many others lie that several threads look after each: which, and how many threads these are.

    And of every body which of them it is, -1 for all others; and what every thread has found: a shift in the body's plane, a turn
    and how many push it, and how many of these overlap it.
    """

    body: wp.array(dtype=wp.int32)
    each: wp.int32
    number: wp.array(dtype=wp.int32)
    push: wp.array(dtype=wp.vec4)
    overlaps: wp.array(dtype=wp.int32)


@wp.struct
class Total:
    """What pushes a body so far: a shift in its plane and a turn; how many do, how many of these overlap it, and how many are near."""

    shift: wp.vec2
    turn: float
    count: float
    overlaps: wp.int32
    near: wp.int32


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
def coarse_slots(
    first: int,
    position: wp.array(dtype=wp.vec3),
    footprints: Footprints,
    mask: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """The slots where larger bodies look for every body."""
    i = first + wp.tid()
    m = footprints.level[i]
    key[i] = slot_of_level(cell_at(position[i], footprints.inverse_coarse_cell[m]), m, mask)
    order[i] = i


@wp.kernel
def find_stray(
    first: int,
    position: wp.array(dtype=wp.vec3),
    poses: Poses,
    footprints: Footprints,
    # outputs
    kept: wp.array(dtype=wp.vec3),
    nearby: Nearby,
):
    """Note where bodies are when they are sorted, and whether one has moved too far since it was listed."""
    i = first + wp.tid()
    at = position[i]
    kept[i] = at
    moved = wp.length(at - nearby.listed_at[i]) + wp.length(poses.axis[i] - nearby.listed_axis[i])
    if not moved <= STRAY * footprints.radius[i]:
        nearby.stale[0] = 1


@wp.kernel
def begin_list(
    first: int,
    position: wp.array(dtype=wp.vec3),
    poses: Poses,
    # outputs
    nearby: Nearby,
):
    """Where one has, nobody knows any more who is near."""
    i = first + wp.tid()
    if nearby.stale[0] != 0:
        nearby.listed_at[i] = position[i]
        nearby.listed_axis[i] = poses.axis[i]
        nearby.count[i] = -1


@wp.kernel
def end_list(
    first: int,
    # outputs
    nearby: Nearby,
):
    nearby.stale[first + wp.tid()] = 0


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
def stand(position: wp.vec3, facet: int, axis: wp.vec3, radius: float, mass: float, ground: Ground):
    """A body on a facet, seen in the plane along its axis."""
    half = wp.length(axis)
    here = Here()
    here.position = position
    here.label = ground.facets.label[facet]
    here.normal = ground.facets.normal[facet]
    here.along = axis / wp.max(half, 1.0e-12)
    if half == 0.0:
        here.along = across(here.normal)
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
def with_push(before: Total, push: Push, touching: float):
    """What pushes a body so far, and what one more does, which overlaps it where it is nearer than ``touching``."""
    total = before
    total.shift += push.shift
    total.turn += push.turn
    total.count += push.count
    if push.count > 0.0 and push.distance < touching:
        total.overlaps += 1
    return total


@wp.func
def add_pushes_of_cell(
    before: Total,
    i: int,
    lane: int,
    lanes: int,
    here: Here,
    cell: wp.vec3i,
    level: int,
    inverse_cell: float,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    nearby: Nearby,
):
    """What pushes body ``i`` so far, and what one in ``lanes`` bodies of a level in a cell adds; those that are near are noted."""
    total = before
    slot = slot_of_level(cell, level, slots.mask)
    for s in range(slots.start[slot] + lane, slots.start[slot + 1], lanes):
        j = slots.order[s]
        wanted = j != i and footprints.level[j] == level and keep_apart(i, j, footprints.meeting)
        if wanted and same_cell(cell_at(slots.sorted_at[j], inverse_cell), cell):
            facet = poses.facet[j]
            # Whoever is near may touch in another round.
            near = pushed_by(i, j, here, facet, position[j], poses.axis[j], footprints, ground, NEARBY)
            if near.count > 0.0:
                if total.near < nearby.room:
                    nearby.body[i * nearby.room + total.near] = j
                total.near += 1
                touching = here.footprint.radius + footprints.radius[j]
                if near.distance < touching * (1.0 + slack):
                    push = pushed_by(i, j, here, facet, position[j], poses.axis[j], footprints, ground, slack)
                    total = with_push(total, push, touching)
    return total


@wp.func
def add_pushes_of_level(
    before: Total,
    i: int,
    lane: int,
    lanes: int,
    here: Here,
    level: int,
    inverse_cell: float,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    nearby: Nearby,
):
    """What pushes body ``i`` so far, and what the bodies of a level in the cells around it add to it."""
    total = before
    own = here.footprint
    margin = NEARBY * (own.radius + footprints.level_radius[level])
    most = own.half + own.radius + footprints.level_reach[level] + margin
    around = wp.vec3(most, most, most)
    low = cell_at(here.position - around, inverse_cell)
    counts = cell_at(here.position + around, inverse_cell) - low + wp.vec3i(1, 1, 1)
    for number in range(counts[0] * counts[1] * counts[2]):
        cell = low + cell_of_block(number, counts)
        total = add_pushes_of_cell(
            total,
            i,
            lane,
            lanes,
            here,
            cell,
            level,
            inverse_cell,
            poses,
            position,
            slots,
            footprints,
            ground,
            slack,
            nearby,
        )
    return total


@wp.func
def pushes_of_cells(
    i: int,
    lane: int,
    lanes: int,
    here: Here,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    coarse: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    nearby: Nearby,
):
    """What pushes body ``i``: of the bodies in every cell around it one in ``lanes``, from number ``lane`` on."""
    total = Total()
    for m in range(footprints.level_count):
        if m <= footprints.level[i]:
            cell = footprints.inverse_cell[m]
            total = add_pushes_of_level(
                total, i, lane, lanes, here, m, cell, poses, position, slots, footprints, ground, slack, nearby
            )
        else:
            # Of far smaller ones there are many cells around it, and few bodies in most.
            cell = footprints.inverse_coarse_cell[m]
            total = add_pushes_of_level(
                total, i, lane, lanes, here, m, cell, poses, position, coarse, footprints, ground, slack, nearby
            )
    return total


@wp.kernel
def push_in_lanes(
    first: int,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    coarse: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    unlisted: Nearby,
    # outputs
    lanes: Lanes,
):
    """What every thread of a body finds that many others lie around; there is no room to list them."""
    t = first + wp.tid()
    i = lanes.body[t // lanes.each]
    here = stand(position[i], poses.facet[i], poses.axis[i], footprints.radius[i], footprints.mass[i], ground)
    total = pushes_of_cells(
        i, t % lanes.each, lanes.each, here, poses, position, slots, coarse, footprints, ground, slack, unlisted
    )
    lanes.push[t] = wp.vec4(total.shift[0], total.shift[1], total.turn, total.count)
    lanes.overlaps[t] = total.overlaps


@wp.kernel
def push_apart(
    first: int,
    poses: Poses,
    position: wp.array(dtype=wp.vec3),
    slots: Slots,
    coarse: Slots,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    damping: float,
    lanes: Lanes,
    # outputs
    nearby: Nearby,
    pushes: Pushes,
):
    """The shift and turn that bring every body out of those that it overlaps; how many push it, and how many of them overlap it.

    Where it is not known who is near it looks into cells, and notes them; or takes what several threads have found.
    """
    i = first + wp.tid()
    here = stand(position[i], poses.facet[i], poses.axis[i], footprints.radius[i], footprints.mass[i], ground)
    total = Total()
    if lanes.number[i] >= 0:
        begin = lanes.number[i] * lanes.each
        for t in range(begin, begin + lanes.each):
            found = lanes.push[t]
            total.shift += wp.vec2(found[0], found[1])
            total.turn += found[2]
            total.count += found[3]
            total.overlaps += lanes.overlaps[t]
    elif nearby.count[i] >= 0:
        begin = i * nearby.room
        for k in range(begin, begin + nearby.count[i]):
            j = nearby.body[k]
            push = pushed_by(i, j, here, poses.facet[j], position[j], poses.axis[j], footprints, ground, slack)
            total = with_push(total, push, here.footprint.radius + footprints.radius[j])
    else:
        total = pushes_of_cells(i, 0, 1, here, poses, position, slots, coarse, footprints, ground, slack, nearby)
        if total.near <= nearby.room:
            nearby.count[i] = total.near
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
