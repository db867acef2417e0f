"""Kernels that push footprints in contact apart on a surface: discs, and capsules around half axes, in the planes that touch it."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell
from ..motion.kernels_descent import PINNED, Bodies
from ..motion.kernels_lying import LEAST_COSINE, Slots, cell_of_block, in_plane, slot_of_level
from ..motion.kernels_on_surface import Ground, Motion, Poses, remembered, walk
from ..space.kernels_meeting import Meeting, keep_apart
from ..surface.kernels_facets import Facets, across, carried, spot_at, tangential
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
class SurfaceNeighbors:
    """What finds neighbors on a surface: how bodies lie, their footprints, the facets that they are on, and who is in which cell.

    ``slots`` are of cells as large as bodies of a level need them; in the larger ones of ``coarse`` larger bodies look for them.
    Positions are not among it: the loop of a kernel is faster on the CPU if one of its arguments is an array.
    """

    poses: Poses
    footprints: Footprints
    facets: Facets
    slots: Slots
    coarse: Slots


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
class Total:
    """What pushes a body so far: a shift in its plane and a turn; how many do, how many of these overlap it, and how many are near."""

    shift: wp.vec2
    turn: float
    count: float
    overlaps: wp.int32
    near: wp.int32


@wp.struct
class Lanes:
    """Bodies around which so many others lie that several threads look after each: which, and how many threads these are.

    And of every body which of them it is, -1 for all others; and what every thread has found.
    """

    body: wp.array(dtype=wp.int32)
    each: wp.int32
    number: wp.array(dtype=wp.int32)
    found: wp.array(dtype=Total)


@wp.kernel
def contact_slots(
    first: int,
    neighbors: SurfaceNeighbors,
    # outputs
    position: wp.array(dtype=wp.vec3),
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Where every body is, and the slot of its cell."""
    i = first + wp.tid()
    at = spot_at(neighbors.poses.facet[i], neighbors.poses.weight[i], neighbors.facets).position
    position[i] = at
    m = neighbors.footprints.level[i]
    key[i] = slot_of_level(cell_at(at, neighbors.footprints.inverse_cell[m]), m, neighbors.slots.mask)
    order[i] = i


@wp.kernel
def coarse_slots(
    first: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """The slots where larger bodies look for every body."""
    i = first + wp.tid()
    m = neighbors.footprints.level[i]
    cell = cell_at(position[i], neighbors.footprints.inverse_coarse_cell[m])
    key[i] = slot_of_level(cell, m, neighbors.coarse.mask)
    order[i] = i


@wp.kernel
def find_stray(
    first: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    # outputs
    nearby: Nearby,
):
    """Note where bodies are when they are sorted, and whether one has moved too far since it was listed."""
    i = first + wp.tid()
    at = position[i]
    neighbors.slots.sorted_at[i] = at
    moved = wp.length(at - nearby.listed_at[i]) + wp.length(neighbors.poses.axis[i] - nearby.listed_axis[i])
    if not moved <= STRAY * neighbors.footprints.radius[i]:
        nearby.stale[0] = 1


@wp.kernel
def begin_list(
    first: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    # outputs
    nearby: Nearby,
):
    """Where one has, nobody knows any more who is near."""
    i = first + wp.tid()
    if nearby.stale[0] != 0:
        nearby.listed_at[i] = position[i]
        nearby.listed_axis[i] = neighbors.poses.axis[i]
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

    body: wp.int32
    position: wp.vec3
    label: wp.int32
    normal: wp.vec3
    along: wp.vec3
    beside: wp.vec3
    footprint: Capsule


@wp.struct
class Search:
    """What a search around a body looks at: bodies of a level, in cells of a size, and of these one in ``lanes`` from ``lane`` on."""

    level: wp.int32
    inverse_cell: wp.float32
    slots: Slots
    lane: wp.int32
    lanes: wp.int32


@wp.func
def stand(i: int, position: wp.array(dtype=wp.vec3), neighbors: SurfaceNeighbors):
    """Body ``i``, seen in the plane along its axis."""
    facet = neighbors.poses.facet[i]
    axis = neighbors.poses.axis[i]
    half = wp.length(axis)
    here = Here()
    here.body = i
    here.position = position[i]
    here.label = neighbors.facets.label[facet]
    here.normal = neighbors.facets.normal[facet]
    here.along = axis / wp.max(half, 1.0e-12)
    if half == 0.0:
        here.along = across(here.normal)
    here.beside = wp.cross(here.normal, here.along)
    radius = neighbors.footprints.radius[i]
    here.footprint = capsule(wp.vec2(half, 0.0), half, radius, neighbors.footprints.mass[i])
    return here


@wp.func
def pushed_by(j: int, here: Here, position: wp.array(dtype=wp.vec3), neighbors: SurfaceNeighbors, slack: float):
    """What body ``j`` does to the one here. What lies on another part, or looks to the other side, is not met."""
    way = position[j] - here.position
    distance = wp.length(way)
    own = here.footprint
    touching = own.radius + neighbors.footprints.radius[j]
    facet = neighbors.poses.facet[j]
    normal = neighbors.facets.normal[facet]
    label = neighbors.facets.label[facet]
    met = see_each_other(label, here.label, neighbors.facets.label, neighbors.facets.relations)
    met = met and wp.dot(normal, here.normal) >= LEAST_COSINE
    if not (met and distance < own.half + own.radius + neighbors.footprints.reach[j] + slack * touching):
        return Push()
    # Into the plane here, as far off as they are.
    flat = in_plane(way, here.along, here.beside)
    length = wp.length(flat)
    if length > 1.0e-6 * touching:
        flat = flat * (distance / length)
    carried_axis = carried(neighbors.poses.axis[j], normal, here.normal)
    reach = neighbors.footprints.reach[j]
    other = Capsule()
    other.half_axis = in_plane(carried_axis, here.along, here.beside)
    other.half = wp.length(other.half_axis)
    other.radius = neighbors.footprints.radius[j]
    other.mass = neighbors.footprints.mass[j]
    other.inertia = other.mass * reach * reach / 3.0
    return push_between(here.body, j, flat, own, other, touching * (1.0 + slack))


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
    here: Here,
    cell: wp.vec3i,
    search: Search,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    slack: float,
    nearby: Nearby,
):
    """What pushes a body so far, and what those that are searched for in a cell add; those that are near are noted."""
    total = before
    i = here.body
    slots = search.slots
    slot = slot_of_level(cell, search.level, slots.mask)
    for s in range(slots.start[slot] + search.lane, slots.start[slot + 1], search.lanes):
        j = slots.order[s]
        wanted = (
            j != i and neighbors.footprints.level[j] == search.level and keep_apart(i, j, neighbors.footprints.meeting)
        )
        if wanted and same_cell(cell_at(slots.sorted_at[j], search.inverse_cell), cell):
            # Whoever is near may touch in another round.
            near = pushed_by(j, here, position, neighbors, NEARBY)
            if near.count > 0.0:
                if total.near < nearby.room:
                    nearby.body[i * nearby.room + total.near] = j
                total.near += 1
                touching = here.footprint.radius + neighbors.footprints.radius[j]
                if near.distance < touching * (1.0 + slack):
                    total = with_push(total, pushed_by(j, here, position, neighbors, slack), touching)
    return total


@wp.func
def add_pushes_of_level(
    before: Total,
    here: Here,
    search: Search,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    slack: float,
    nearby: Nearby,
):
    """What pushes a body so far, and what those that are searched for in the cells around it add to it."""
    total = before
    own = here.footprint
    margin = NEARBY * (own.radius + neighbors.footprints.level_radius[search.level])
    most = own.half + own.radius + neighbors.footprints.level_reach[search.level] + margin
    around = wp.vec3(most, most, most)
    low = cell_at(here.position - around, search.inverse_cell)
    counts = cell_at(here.position + around, search.inverse_cell) - low + wp.vec3i(1, 1, 1)
    for number in range(counts[0] * counts[1] * counts[2]):
        cell = low + cell_of_block(number, counts)
        total = add_pushes_of_cell(total, here, cell, search, position, neighbors, slack, nearby)
    return total


@wp.func
def pushes_of_cells(
    here: Here,
    lane: int,
    lanes: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    slack: float,
    nearby: Nearby,
):
    """What pushes a body: of the bodies in every cell around it one in ``lanes``, from number ``lane`` on."""
    total = Total()
    search = Search()
    search.lane = lane
    search.lanes = lanes
    for m in range(neighbors.footprints.level_count):
        search.level = m
        search.slots = neighbors.slots
        search.inverse_cell = neighbors.footprints.inverse_cell[m]
        if m > neighbors.footprints.level[here.body]:
            # Of far smaller ones there are many cells around it, and few bodies in most.
            search.slots = neighbors.coarse
            search.inverse_cell = neighbors.footprints.inverse_coarse_cell[m]
        total = add_pushes_of_level(total, here, search, position, neighbors, slack, nearby)
    return total


@wp.kernel
def push_in_lanes(
    first: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
    slack: float,
    unlisted: Nearby,
    # outputs
    lanes: Lanes,
):
    """What every thread of a body finds that many others lie around; there is no room to list them."""
    t = first + wp.tid()
    here = stand(lanes.body[t // lanes.each], position, neighbors)
    lanes.found[t] = pushes_of_cells(here, t % lanes.each, lanes.each, position, neighbors, slack, unlisted)


@wp.kernel
def push_apart(
    first: int,
    position: wp.array(dtype=wp.vec3),
    neighbors: SurfaceNeighbors,
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
    here = stand(i, position, neighbors)
    total = Total()
    if lanes.number[i] >= 0:
        begin = lanes.number[i] * lanes.each
        for t in range(begin, begin + lanes.each):
            found = lanes.found[t]
            total.shift += found.shift
            total.turn += found.turn
            total.count += found.count
            total.overlaps += found.overlaps
    elif nearby.count[i] >= 0:
        begin = i * nearby.room
        for k in range(begin, begin + nearby.count[i]):
            j = nearby.body[k]
            touching = here.footprint.radius + neighbors.footprints.radius[j]
            total = with_push(total, pushed_by(j, here, position, neighbors, slack), touching)
    else:
        total = pushes_of_cells(here, 0, 1, position, neighbors, slack, nearby)
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
