"""Kernels that find footprints in contact, and push them apart. Footprints are discs, or capsules around the axis of a line."""

from __future__ import annotations

import warp as wp

from .kernels_update import Bodies, Images, confine, shortest, slide

wp.set_module_options({"enable_backward": False})


@wp.struct
class ContactGrid:
    """Grids of cells, one per level; bodies of a level have a reach within a factor of two.

    Per level: the largest reach (from the centre to the farthest point), cells along x and y, index of the first cell.
    """

    level_count: wp.int32
    reach: wp.array(dtype=float)
    count_x: wp.array(dtype=wp.int32)
    count_y: wp.array(dtype=wp.int32)
    first_cell: wp.array(dtype=wp.int32)
    domain: wp.vec2
    periodic: wp.int32


@wp.struct
class Footprints:
    """Level, radius (half the thickness of a capsule) and mass (area) of every body."""

    level: wp.array(dtype=wp.int32)
    radius: wp.array(dtype=float)
    mass: wp.array(dtype=float)


@wp.kernel
def contact_keys(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    footprints: Footprints,
    grid: ContactGrid,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    m = footprints.level[i]
    x = wp.clamp(int(pose[i][0] / grid.domain[0] * float(grid.count_x[m])), 0, grid.count_x[m] - 1)
    y = wp.clamp(int(pose[i][1] / grid.domain[1] * float(grid.count_y[m])), 0, grid.count_y[m] - 1)
    key[i] = grid.first_cell[m] + y * grid.count_x[m] + x
    order[i] = i


@wp.func
def closest_places(difference: wp.vec2, axis_i: wp.vec2, axis_j: wp.vec2):
    """Places -1..1 along two axes (half vectors) where they are nearest, their middles being ``difference`` apart."""
    # Minimise |difference + v axis_j - u axis_i| over the square by clamping in turns, which ends after few rounds.
    ii = wp.dot(axis_i, axis_i)
    jj = wp.dot(axis_j, axis_j)
    ij = wp.dot(axis_i, axis_j)
    di = wp.dot(difference, axis_i)
    dj = wp.dot(difference, axis_j)
    u = float(0.0)
    v = float(0.0)
    if ii > 0.0 and jj > 0.0:
        determinant = ii * jj - ij * ij
        if determinant > 1.0e-6 * ii * jj:
            u = wp.clamp((di * jj - dj * ij) / determinant, -1.0, 1.0)
        v = wp.clamp((u * ij - dj) / jj, -1.0, 1.0)
        u = wp.clamp((v * ij + di) / ii, -1.0, 1.0)
        v = wp.clamp((u * ij - dj) / jj, -1.0, 1.0)
    elif ii > 0.0:
        u = wp.clamp(di / ii, -1.0, 1.0)
    elif jj > 0.0:
        v = wp.clamp(-dj / jj, -1.0, 1.0)
    return wp.vec2(u, v)


@wp.func
def uncrossed(axis: wp.vec2, crossed: wp.vec2, place: float):
    """Direction across the axis ``crossed`` in which the nearer end of ``axis`` comes back, and how far that is."""
    normal = wp.normalize(wp.vec2(-crossed[1], crossed[0]))
    beyond = wp.dot(normal, axis) * (wp.sign(place) - place)
    if beyond > 0.0:
        normal = -normal
    return wp.vec3(normal[0], normal[1], wp.abs(beyond))


@wp.func
def half_axis(pose: wp.vec4):
    return wp.vec2(0.5 * pose[3] * wp.cos(pose[2]), 0.5 * pose[3] * wp.sin(pose[2]))


@wp.func
def cells_within(position: float, reach: float, domain: float, count: int, periodic: int):
    """First and last cell (unwrapped) of those that come within ``reach`` of ``position`` along one axis."""
    scale = float(count) / domain
    low = int(wp.floor((position - reach) * scale))
    high = int(wp.floor((position + reach) * scale))
    if periodic != 0:
        if high - low >= count:
            low = 0
            high = count - 1
    else:
        # Bodies on the far edge are in the last cell.
        low = wp.clamp(low, 0, count - 1)
        high = wp.clamp(high, 0, count - 1)
    return wp.vec2i(low, high)


@wp.func
def wrapped(cell: int, count: int):
    rest = cell % count
    if rest < 0:
        rest += count
    return rest


@wp.kernel
def push_apart(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    footprints: Footprints,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: Images,
    slack: float,
    damping: float,
    # outputs
    pushed: wp.array(dtype=wp.vec4),
    contacts: wp.array(dtype=wp.int32),
):
    """Move every body out of those that it overlaps, each pair sharing the way by mass and moment of inertia.

    Gives the new pose and the number of overlaps of the old one; ``slack`` is how much farther than touching, as a share of the radii,
    bodies are pushed.
    """
    i = first + wp.tid()
    own = pose[i]
    radius = footprints.radius[i]
    mass = footprints.mass[i]
    axis = half_axis(own)
    half = 0.5 * own[3]
    reach = half + radius
    # Of a rod as long as the capsule.
    inertia = mass * reach * reach / 3.0
    shift = wp.vec2(0.0, 0.0)
    turn = float(0.0)
    count = int(0)
    pushes = int(0)
    for m in range(grid.level_count):
        distance_most = (reach + grid.reach[m]) * (1.0 + slack)
        columns = cells_within(own[0], distance_most, grid.domain[0], grid.count_x[m], grid.periodic)
        rows = cells_within(own[1], distance_most, grid.domain[1], grid.count_y[m], grid.periodic)
        for row in range(rows[0], rows[1] + 1):
            base = grid.first_cell[m] + wrapped(row, grid.count_y[m]) * grid.count_x[m]
            for column in range(columns[0], columns[1] + 1):
                cell = base + wrapped(column, grid.count_x[m])
                for s in range(cell_start[cell], cell_start[cell + 1]):
                    j = order[s]
                    if j != i:
                        other = pose[j]
                        between = shortest(wp.vec2(other[0] - own[0], other[1] - own[1]), grid.domain, grid.periodic)
                        touching = radius + footprints.radius[j]
                        wanted = touching * (1.0 + slack)
                        if wp.length(between) < half + 0.5 * other[3] + wanted:
                            other_axis = half_axis(other)
                            places = closest_places(between, axis, other_axis)
                            gap = between + places[1] * other_axis - places[0] * axis
                            distance = wp.length(gap)
                            if distance < touching:
                                count += 1
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
    contacts[i] = count
    new = own
    if pushes > 0:
        scale = damping
        if pushes > 2:
            scale = damping * 2.0 / float(pushes)
        shift = shift * scale
        turn = turn * scale
        k = bodies.class_index[i]
        if bodies.line[i] < 0:
            p = wp.vec2(own[0], own[1])
            q = slide(p, p + shift, k, images, grid.domain, grid.periodic)
            new = wp.vec4(q[0], q[1], 0.0, 0.0)
        else:
            new = confine(
                own,
                wp.vec4(own[0] + shift[0], own[1] + shift[1], own[2] + turn, own[3]),
                bodies.first_charge[i],
                bodies.first_charge[i + 1],
                bodies,
                bend,
                k,
                images,
                grid.domain,
                grid.periodic,
            )
    pushed[i] = new


@wp.kernel
def accept_push(
    first: int,
    pushed: wp.array(dtype=wp.vec4),
    domain: wp.vec2,
    periodic: int,
    # outputs
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
):
    """Take over pushed poses, and count the push as part of the displacement."""
    i = first + wp.tid()
    old = pose[i]
    new = pushed[i]
    way = shortest(wp.vec2(new[0] - old[0], new[1] - old[1]), domain, periodic)
    displacement[i] = displacement[i] + wp.vec4(way[0], way[1], new[2] - old[2], new[3] - old[3])
    pose[i] = new


@wp.kernel
def count_overlaps(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    footprints: Footprints,
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    touch: float,
    most: int,
    # outputs
    overlaps: wp.array(dtype=wp.int32),
):
    """Count the footprints that overlap each body's; a body is left as soon as ``most`` do."""
    i = first + wp.tid()
    own = pose[i]
    radius = footprints.radius[i]
    axis = half_axis(own)
    half = 0.5 * own[3]
    count = int(0)
    for m in range(grid.level_count):
        distance_most = half + radius + grid.reach[m]
        columns = cells_within(own[0], distance_most, grid.domain[0], grid.count_x[m], grid.periodic)
        rows = cells_within(own[1], distance_most, grid.domain[1], grid.count_y[m], grid.periodic)
        for row in range(rows[0], rows[1] + 1):
            base = grid.first_cell[m] + wrapped(row, grid.count_y[m]) * grid.count_x[m]
            for column in range(columns[0], columns[1] + 1):
                if count < most:
                    cell = base + wrapped(column, grid.count_x[m])
                    for s in range(cell_start[cell], cell_start[cell + 1]):
                        j = order[s]
                        if j != i:
                            other = pose[j]
                            between = shortest(
                                wp.vec2(other[0] - own[0], other[1] - own[1]), grid.domain, grid.periodic
                            )
                            touching = (radius + footprints.radius[j]) * touch
                            if wp.length(between) < half + 0.5 * other[3] + touching:
                                other_axis = half_axis(other)
                                places = closest_places(between, axis, other_axis)
                                gap = between + places[1] * other_axis - places[0] * axis
                                if wp.length(gap) < touching:
                                    count += 1
                                    if count >= most:
                                        break
    overlaps[i] = count
