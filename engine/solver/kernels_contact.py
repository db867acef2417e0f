"""Kernels that push footprints in contact apart."""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images
from ..space.kernels_neighbourhood import (
    LANES,
    SAFELY,
    ContactGrid,
    Footprints,
    Sorted,
    cells_of_period,
    cells_within,
    closest_places,
    lowest_bit,
    may_touch,
    set_sorted,
)
from ..space.kernels_space import Space, confine, difference, wrap
from .kernels_descent import PINNED, Bodies, confine_line, slide

wp.set_module_options({"enable_backward": False})


@wp.func
def uncrossed(axis: wp.vec2, crossed: wp.vec2, place: float):
    """Direction across the axis ``crossed`` in which the nearer end of ``axis`` comes back, and how far that is."""
    normal = wp.normalize(wp.vec2(-crossed[1], crossed[0]))
    beyond = wp.dot(normal, axis) * (wp.sign(place) - place)
    if beyond > 0.0:
        normal = -normal
    return wp.vec3(normal[0], normal[1], wp.abs(beyond))


@wp.kernel
def push_apart(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    near: Sorted,
    footprints: Footprints,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    slack: float,
    damping: float,
    body_count: int,
    at_once: int,
    # outputs
    push_of_body: wp.array(dtype=wp.vec4),
):
    """The shift and turn that bring every body out of those that it overlaps, and how many these are.

    A pair shares the way by mass and moment of inertia. ``slack`` is how much farther than touching, as a share of the radii, bodies
    are pushed. An element is ``at_once`` bodies.
    """
    block = (first + wp.tid()) * at_once
    for i in range(block, wp.min(block + at_once, body_count)):
        own = pose[i]
        radius = footprints.radius[i]
        mass = footprints.mass[i]
        axis = near.half_axis[near.place[i]]
        half = 0.5 * own[3]
        reach = half + radius
        # Of a rod as long as the capsule.
        inertia = mass * reach * reach / 3.0
        shift = wp.vec2(0.0, 0.0)
        turn = float(0.0)
        pushes = int(0)
        wrapping = wp.where(grid.space.periodic != 0, 1, 0)
        for m in range(grid.level_count):
            distance_most = (reach + grid.reach[m]) * (1.0 + slack)
            columns = cells_within(own[0], distance_most, grid.space.size[0], grid.count_x[m], grid.space.periodic)
            rows = cells_within(own[1], distance_most, grid.space.size[1], grid.count_y[m], grid.space.periodic)
            for unwrapped in range(rows[0], rows[1] + 1):
                row = wrap(unwrapped, grid.count_y[m])
                base = grid.first_cell[m] + row * grid.count_x[m]
                # Cells of a row are neighbours in memory: they are one range, or two where they lie on both sides of a wrap.
                for period in range(1 - wrapping, 2 + wrapping):
                    cells = cells_of_period(columns, period, grid.count_x[m])
                    begin = int(0)
                    end = int(0)
                    if cells[0] <= cells[1]:
                        begin = cell_start[base + cells[0]]
                        end = cell_start[base + cells[1] + 1]
                    for start in range(begin, end, LANES):
                        found = may_touch(
                            own[0],
                            own[1],
                            reach,
                            (1.0 + slack) * SAFELY,
                            grid.space.size,
                            grid.space.periodic,
                            start,
                            end,
                            near.x,
                            near.y,
                            near.reach,
                        )
                        while found != 0:
                            s = start + lowest_bit(found)
                            found = found & (found - 1)
                            j = near.body[s]
                            if j != i:
                                other = pose[j]
                                between = difference(wp.vec2(own[0], own[1]), wp.vec2(other[0], other[1]), grid.space)
                                touching = radius + footprints.radius[j]
                                wanted = touching * (1.0 + slack)
                                if wp.length(between) < half + 0.5 * other[3] + wanted:
                                    other_axis = near.half_axis[s]
                                    places = closest_places(between, axis, other_axis)
                                    gap = between + places[1] * other_axis - places[0] * axis
                                    distance = wp.length(gap)
                                    if distance < wanted:
                                        # Bodies on one another part in a direction of their own, opposite for the two.
                                        away = wp.vec2(wp.cos(float(i + j)), wp.sin(float(i + j)))
                                        if i > j:
                                            away = -away
                                        if distance > 1.0e-6 * touching:
                                            away = -gap / distance
                                        elif half > 0.0 and other[3] > 0.0:
                                            # Axes that cross: the end that reaches less far beyond the other axis goes back.
                                            own_end = uncrossed(axis, other_axis, places[0])
                                            other_end = uncrossed(other_axis, axis, places[1])
                                            if own_end[2] < other_end[2]:
                                                away = wp.vec2(own_end[0], own_end[1])
                                                distance = -own_end[2]
                                                places = wp.vec2(wp.sign(places[0]), places[1])
                                            else:
                                                away = -wp.vec2(other_end[0], other_end[1])
                                                distance = -other_end[2]
                                                places = wp.vec2(places[0], wp.sign(places[1]))
                                        lever = places[0] * (axis[0] * away[1] - axis[1] * away[0])
                                        other_lever = places[1] * (other_axis[0] * away[1] - other_axis[1] * away[0])
                                        other_mass = footprints.mass[j]
                                        other_reach = 0.5 * other[3] + footprints.radius[j]
                                        other_inertia = other_mass * other_reach * other_reach / 3.0
                                        ease = 1.0 / mass + lever * lever / inertia
                                        other_ease = 1.0 / other_mass + other_lever * other_lever / other_inertia
                                        push = (wanted - distance) / (ease + other_ease)
                                        shift += away * (push / mass)
                                        turn += push * lever / inertia
                                        pushes += 1
        scale = damping
        if pushes > 2:
            scale = damping * 2.0 / float(pushes)
        push_of_body[i] = wp.vec4(shift[0] * scale, shift[1] * scale, turn * scale, float(pushes))


@wp.kernel
def accept_push(
    first: int,
    push_of_body: wp.array(dtype=wp.vec4),
    footprints: Footprints,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    images: Images,
    space: Space,
    # outputs
    near: Sorted,
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
):
    """Push bodies as far as they may go, and count that as part of the displacement."""
    i = first + wp.tid()
    push = push_of_body[i]
    if push[3] == 0.0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = pose[i]
    new = old
    k = bodies.support[i]
    if bodies.line[i] < 0:
        p = wp.vec2(old[0], old[1])
        q = slide(p, p + wp.vec2(push[0], push[1]), k, images, space)
        new = wp.vec4(q[0], q[1], 0.0, 0.0)
    else:
        new = confine_line(
            old,
            wp.vec4(old[0] + push[0], old[1] + push[1], old[2] + push[2], old[3]),
            bodies.first_charge[i],
            bodies.first_charge[i + 1],
            bodies,
            bend,
            k,
            images,
            space,
        )
        # Lines that left a periodic domain come in again: nobody looks for them farther out than a period.
        inside = confine(wp.vec2(new[0], new[1]), space)
        new = wp.vec4(inside[0], inside[1], new[2], new[3])
    way = difference(wp.vec2(old[0], old[1]), wp.vec2(new[0], new[1]), space)
    displacement[i] = displacement[i] + wp.vec4(way[0], way[1], new[2] - old[2], new[3] - old[3])
    pose[i] = new
    set_sorted(near.place[i], new, footprints.radius[i], near)
