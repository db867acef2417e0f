"""Kernels that push footprints in contact apart on a surface: discs, and capsules around half axes, in the planes that touch it."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell, slot_of
from ..surface.kernels_facets import carried, spot_at, tangential
from .kernels_contact import Capsule, Push, capsule, push_between, scale_of_pushes
from .kernels_descent import PINNED, Bodies
from .kernels_on_surface import Ground, walk

wp.set_module_options({"enable_backward": False})


@wp.struct
class Footprints:
    """What is known of footprints.

    Level, radius (half the thickness of a capsule), farthest reach and mass of every body; and of every level the largest reach and
    the inverse size of its cells.
    """

    level_count: wp.int32
    level: wp.array(dtype=wp.int32)
    radius: wp.array(dtype=float)
    reach: wp.array(dtype=float)
    mass: wp.array(dtype=float)
    level_reach: wp.array(dtype=float)
    inverse_cell: wp.array(dtype=float)


@wp.func
def slot_of_level(cell: wp.vec3i, level: int, mask: int):
    return slot_of(wp.vec3i(cell[0] + 7919 * level, cell[1], cell[2]), mask)


@wp.kernel
def contact_slots(
    first: int,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    footprints: Footprints,
    ground: Ground,
    mask: int,
    # outputs
    position: wp.array(dtype=wp.vec3),
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    at = spot_at(facet[i], weight[i], ground.facets).position
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


@wp.func
def in_plane(vector: wp.vec3, along: wp.vec3, beside: wp.vec3):
    return wp.vec2(wp.dot(vector, along), wp.dot(vector, beside))


@wp.func
def cell_of_block(number: int, counts: wp.vec3i):
    """Where in a block of so many cells along x, y and z one of them lies, counted along z first."""
    return wp.vec3i(number / (counts[1] * counts[2]), number / counts[2] % counts[1], number % counts[2])


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
    met = ground.facets.label[facet] == here.label and wp.dot(normal, here.normal) > 0.0
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


@wp.kernel
def push_apart(
    first: int,
    facet: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3),
    axis: wp.array(dtype=wp.vec3),
    sorted_at: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=wp.int32),
    slot_start: wp.array(dtype=wp.int32),
    mask: int,
    footprints: Footprints,
    ground: Ground,
    slack: float,
    damping: float,
    # outputs
    shift: wp.array(dtype=wp.vec3),
    turn: wp.array(dtype=float),
    pushes: wp.array(dtype=wp.int32),
    overlaps: wp.array(dtype=wp.int32),
):
    """The shift and turn that bring every body out of those that it overlaps; how many push it, and how many of them overlap it.

    Bodies are in the slots of where they were when these were sorted, ``sorted_at``.
    """
    i = first + wp.tid()
    here = stand(position[i], facet[i], axis[i], footprints.radius[i], footprints.mass[i], ground)
    reach = here.footprint.half + here.footprint.radius
    total = wp.vec2(0.0, 0.0)
    total_turn = float(0.0)
    pushed = float(0.0)
    overlapping = int(0)
    for m in range(footprints.level_count):
        most = (reach + footprints.level_reach[m]) * (1.0 + slack)
        inverse = footprints.inverse_cell[m]
        low = cell_at(here.position - wp.vec3(most, most, most), inverse)
        high = cell_at(here.position + wp.vec3(most, most, most), inverse)
        counts = high - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            cell = low + cell_of_block(number, counts)
            slot = slot_of_level(cell, m, mask)
            for s in range(slot_start[slot], slot_start[slot + 1]):
                j = order[s]
                if j != i and footprints.level[j] == m and same_cell(cell_at(sorted_at[j], inverse), cell):
                    push = pushed_by(i, j, here, facet[j], position[j], axis[j], footprints, ground, slack)
                    total += push.shift
                    total_turn += push.turn
                    pushed += push.count
                    if push.count > 0.0 and push.distance < here.footprint.radius + footprints.radius[j]:
                        overlapping += 1
    scale = scale_of_pushes(pushed, damping)
    shift[i] = scale * (total[0] * here.along + total[1] * here.beside)
    turn[i] = scale * total_turn
    pushes[i] = int(pushed)
    overlaps[i] = overlapping


@wp.kernel
def accept_push(
    first: int,
    shift: wp.array(dtype=wp.vec3),
    turn: wp.array(dtype=float),
    pushes: wp.array(dtype=wp.int32),
    bodies: Bodies,
    ground: Ground,
    # outputs
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    position: wp.array(dtype=wp.vec3),
    axis: wp.array(dtype=wp.vec3),
    displacement: wp.array(dtype=wp.vec3),
    turned: wp.array(dtype=wp.vec2),
    move: wp.array(dtype=wp.vec3),
):
    """Push bodies as far as they may go, and count that as part of the displacement."""
    i = first + wp.tid()
    if pushes[i] == 0 or (bodies.flags[i] & PINNED) != 0:
        return
    normal = ground.facets.normal[facet[i]]
    old = position[i]
    new = walk(facet[i], weight[i], shift[i], i, bodies.support[i], ground)
    new_normal = ground.facets.normal[new.facet]
    way = displacement[i] + tangential(new.position - old, normal)
    displacement[i] = carried(way, normal, new_normal)
    move[i] = carried(move[i], normal, new_normal)
    facet[i] = new.facet
    weight[i] = new.weight
    position[i] = new.position
    if wp.length_sq(axis[i]) > 0.0:
        c = wp.cos(turn[i])
        s = wp.sin(turn[i])
        axis[i] = carried(c * axis[i] + s * wp.cross(normal, axis[i]), normal, new_normal)
        turned[i] = turned[i] + wp.vec2(turn[i], 0.0)
