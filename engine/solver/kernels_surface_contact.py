"""Kernels that push footprints in contact apart on a surface: discs, and capsules around half axes, in the planes that touch it."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell, slot_of
from ..space.kernels_neighbourhood import closest_places
from ..surface.kernels_facets import carried, spot_at, tangential
from .kernels_contact import uncrossed
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

    What lies on another part, or looks to the other side, is not met. Bodies are in the slots of where they were when these were
    sorted, ``sorted_at``.
    """
    i = first + wp.tid()
    at = position[i]
    normal = ground.facets.normal[facet[i]]
    label = ground.facets.label[facet[i]]
    radius = footprints.radius[i]
    mass = footprints.mass[i]
    own_axis = axis[i]
    half = wp.length(own_axis)
    along = own_axis / wp.max(half, 1.0e-12)
    if half == 0.0:
        away = wp.vec3(-normal[2], 0.0, normal[0])
        if wp.abs(normal[0]) < 0.6:
            away = wp.vec3(0.0, -normal[2], normal[1])
        along = wp.normalize(away)
    beside = wp.cross(normal, along)
    flat_axis = wp.vec2(half, 0.0)
    reach = half + radius
    inertia = mass * reach * reach / 3.0
    total = wp.vec2(0.0, 0.0)
    total_turn = float(0.0)
    pushed = int(0)
    overlapping = int(0)
    for m in range(footprints.level_count):
        most = (reach + footprints.level_reach[m]) * (1.0 + slack)
        inverse = footprints.inverse_cell[m]
        low = cell_at(at - wp.vec3(most, most, most), inverse)
        high = cell_at(at + wp.vec3(most, most, most), inverse)
        for x in range(low[0], high[0] + 1):
            for y in range(low[1], high[1] + 1):
                for z in range(low[2], high[2] + 1):
                    cell = wp.vec3i(x, y, z)
                    slot = slot_of_level(cell, m, mask)
                    for s in range(slot_start[slot], slot_start[slot + 1]):
                        j = order[s]
                        if j != i and footprints.level[j] == m and same_cell(cell_at(sorted_at[j], inverse), cell):
                            way = position[j] - at
                            distance = wp.length(way)
                            touching = radius + footprints.radius[j]
                            wanted = touching * (1.0 + slack)
                            other = facet[j]
                            if (
                                distance < reach + footprints.reach[j] + slack * touching
                                and ground.facets.label[other] == label
                                and wp.dot(ground.facets.normal[other], normal) > 0.0
                            ):
                                # Into the plane here, as far off as they are.
                                flat = in_plane(way, along, beside)
                                length = wp.length(flat)
                                if length > 1.0e-6 * touching:
                                    flat = flat * (distance / length)
                                carried_axis = carried(axis[j], ground.facets.normal[other], normal)
                                other_axis = in_plane(carried_axis, along, beside)
                                places = closest_places(flat, flat_axis, other_axis)
                                gap = flat + places[1] * other_axis - places[0] * flat_axis
                                between = wp.length(gap)
                                if between < wanted:
                                    # Bodies on one another part in a direction of their own, opposite for the two.
                                    angle = float(i + j)
                                    out = wp.vec2(wp.cos(angle), wp.sin(angle))
                                    if i > j:
                                        out = -out
                                    if between > 1.0e-6 * touching:
                                        out = -gap / between
                                    elif half > 0.0 and wp.length_sq(other_axis) > 0.0:
                                        own_end = uncrossed(flat_axis, other_axis, places[0])
                                        other_end = uncrossed(other_axis, flat_axis, places[1])
                                        if own_end[2] < other_end[2]:
                                            out = wp.vec2(own_end[0], own_end[1])
                                            between = -own_end[2]
                                            places = wp.vec2(wp.sign(places[0]), places[1])
                                        else:
                                            out = -wp.vec2(other_end[0], other_end[1])
                                            between = -other_end[2]
                                            places = wp.vec2(places[0], wp.sign(places[1]))
                                    lever = places[0] * (flat_axis[0] * out[1] - flat_axis[1] * out[0])
                                    other_lever = places[1] * (other_axis[0] * out[1] - other_axis[1] * out[0])
                                    other_mass = footprints.mass[j]
                                    other_reach = footprints.reach[j]
                                    other_inertia = other_mass * other_reach * other_reach / 3.0
                                    ease = 1.0 / mass + lever * lever / inertia
                                    other_ease = 1.0 / other_mass + other_lever * other_lever / other_inertia
                                    push = (wanted - between) / (ease + other_ease)
                                    total += out * (push / mass)
                                    total_turn += push * lever / inertia
                                    pushed += 1
                                    if between < touching:
                                        overlapping += 1
    scale = damping
    if pushed > 2:
        scale = damping * 2.0 / float(pushed)
    shift[i] = scale * (total[0] * along + total[1] * beside)
    turn[i] = scale * total_turn
    pushes[i] = pushed
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
    new = walk(facet[i], weight[i], shift[i], bodies.support[i], ground)
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
