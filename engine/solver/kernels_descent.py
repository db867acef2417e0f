"""Kernels that move the bodies.

A body's pose is (x, y, angle, length of its axis); a dot has angle and length 0.
"""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images, density_pixel, is_full, pixel_at
from ..space.kernels_mesh import Mesh, nearest_node
from ..space.kernels_space import Space, along_border, confine, difference, overhang
from .body_flags import BodyFlags
from .kernels_direction import LENGTHS, add, add_products

wp.set_module_options({"enable_backward": False})

PINNED = wp.constant(int(BodyFlags.PINNED))
# Times that a line is pushed back from empty pixels before its move is given up.
PUSHES = wp.constant(3)
SHORTEST_LINE = wp.constant(0.01)
LONGEST_LINE = wp.constant(2.0)
LARGEST_TURN = wp.constant(0.5)
SIDE_BY_SIDE = wp.constant(1.0)
# Forces on lines are weighed against their wishes as so large a share of the moves that the inverse curvature gives.
WEIGHING_SHARE = wp.constant(0.5)


@wp.struct
class Bodies:
    """What bodies are: class, group, kind of line (-1: a dot) and :class:`~.model.BodyFlags` of each, and its charges."""

    class_index: wp.array(dtype=wp.int32)
    group: wp.array(dtype=wp.int32)
    line: wp.array(dtype=wp.int32)
    flags: wp.array(dtype=wp.int32)
    first_charge: wp.array(dtype=wp.int32)
    place: wp.array(dtype=float)
    charge: wp.array(dtype=float)


@wp.struct
class Lines:
    """Rules of every kind of line.

    Weights of forces and wishes in turns and stretches, the share of a bend that is taken back (below 0: no bends), the factor on the
    desired length that makes up for the pressure of the charges; and images of the desired direction, (cos 2a, sin 2a) times its
    weight, and length.
    """

    turn_by_force: wp.array(dtype=float)
    turn_by_wish: wp.array(dtype=float)
    stretch_by_force: wp.array(dtype=float)
    stretch_by_wish: wp.array(dtype=float)
    straightness: wp.array(dtype=float)
    length_factor: wp.array(dtype=float)
    direction: wp.array(dtype=wp.vec2)
    direction_start: wp.array(dtype=wp.int32)
    direction_height: wp.array(dtype=wp.int32)
    direction_width: wp.array(dtype=wp.int32)
    length: wp.array(dtype=float)
    length_start: wp.array(dtype=wp.int32)
    length_height: wp.array(dtype=wp.int32)
    length_width: wp.array(dtype=wp.int32)


@wp.func
def charge_at(pose: wp.vec4, place: float, bend: float):
    """Position of a charge at ``place`` along a body's axis and ``bend`` beside it."""
    c = wp.cos(pose[2])
    s = wp.sin(pose[2])
    along = 0.5 * pose[3] * place
    return wp.vec2(pose[0] + along * c - bend * s, pose[1] + along * s + bend * c)


@wp.func
def nearest_vector(
    position: wp.vec2, vectors: wp.array(dtype=wp.vec2), start: int, height: int, width: int, domain: wp.vec2
):
    """Image of vectors, interpolated bilinearly between the centres of its pixels."""
    u = wp.clamp(position[0] / domain[0] * float(width) - 0.5, 0.0, float(width - 1))
    v = wp.clamp((1.0 - position[1] / domain[1]) * float(height) - 0.5, 0.0, float(height - 1))
    left = wp.clamp(int(u), 0, width - 1)
    top = wp.clamp(int(v), 0, height - 1)
    right = wp.min(left + 1, width - 1)
    bottom = wp.min(top + 1, height - 1)
    fu = u - float(left)
    fv = v - float(top)
    upper = (1.0 - fu) * vectors[start + top * width + left] + fu * vectors[start + top * width + right]
    lower = (1.0 - fu) * vectors[start + bottom * width + left] + fu * vectors[start + bottom * width + right]
    return (1.0 - fv) * upper + fv * lower


@wp.func
def slide(old: wp.vec2, wanted: wp.vec2, k: int, images: Images, space: Space):
    """Where a dot ends that moves from ``old`` to ``wanted``: it never enters an empty pixel, but slides along its edge."""
    new = confine(wanted, space)
    if not is_full(new, k, images, space.size):
        along_x = confine(wp.vec2(wanted[0], old[1]), space)
        along_y = confine(wp.vec2(old[0], wanted[1]), space)
        new = old
        if is_full(along_x, k, images, space.size):
            new = along_x
        elif is_full(along_y, k, images, space.size):
            new = along_y
    return new


@wp.func
def way_back(
    pose: wp.vec4,
    begin: int,
    end: int,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    k: int,
    images: Images,
    space: Space,
):
    """(x, y, 1) by which a line must move so that its farthest charge outside stands on a full pixel; (0, 0, 0) if all do."""
    # How far charges reach over the edges of an open domain.
    low = wp.vec2(0.0, 0.0)
    high = wp.vec2(0.0, 0.0)
    farthest = wp.vec2(0.0, 0.0)
    away = float(0.0)
    outside = float(0.0)
    for j in range(begin, end):
        p = charge_at(pose, bodies.place[j], bend[j])
        over = overhang(p, space)
        low = wp.max(low, wp.vec2(over[0], over[1]))
        high = wp.max(high, wp.vec2(over[2], over[3]))
        pixel = density_pixel(confine(p, space), k, images, space.size)
        if images.pixel[pixel] <= 0.0:
            outside = 1.0
            way = images.way[pixel]
            if wp.length_sq(way) > away:
                away = wp.length_sq(way)
                farthest = way
    back = low - high
    if wp.length_sq(back) > 0.0:
        outside = 1.0
    return wp.vec3(farthest[0] + back[0], farthest[1] + back[1], outside)


@wp.func
def middle_confined(pose: wp.vec4, space: Space):
    """A pose whose middle is wrapped into a periodic space; an open one holds it by its charges."""
    if space.periodic == 0:
        return pose
    middle = confine(wp.vec2(pose[0], pose[1]), space)
    return wp.vec4(middle[0], middle[1], pose[2], pose[3])


@wp.func
def confine_line(
    old: wp.vec4,
    wanted: wp.vec4,
    begin: int,
    end: int,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    k: int,
    images: Images,
    space: Space,
):
    """Where a line ends that moves from ``old``, where it stands on full pixels alone, to ``wanted``: on such again.

    Its middle stays inside a periodic space, too.
    """
    new = middle_confined(wanted, space)
    for _attempt in range(PUSHES):
        way = way_back(new, begin, end, bodies, bend, k, images, space)
        if way[2] == 0.0:
            return new
        new = middle_confined(wp.vec4(new[0] + way[0], new[1] + way[1], new[2], new[3]), space)
    if way_back(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    # A shift without the turn, then a turn without the shift.
    new = middle_confined(wp.vec4(wanted[0], wanted[1], old[2], old[3]), space)
    if way_back(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    new = wp.vec4(old[0], old[1], wanted[2], wanted[3])
    if way_back(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    return old


@wp.func
def limited(move: wp.vec2, limit: float):
    length = wp.length(move)
    if length > limit:
        return move * (limit / length)
    return move


@wp.func
def unsettled(squared_move: float, squared_way: float, limit: float, in_contact: int):
    """Squared move over squared spacing; what presses against others and does not get away has settled, too."""
    squared = squared_move
    if in_contact != 0:
        squared = wp.min(squared_move, squared_way)
    return squared / (4.0 * limit * limit)


@wp.kernel
def propose_dots(
    first: int,
    thread: int,
    charge_position: wp.array(dtype=wp.vec2),
    field: wp.array(dtype=wp.vec2),
    bodies: Bodies,
    step_length: wp.array(dtype=float),
    step_limit: wp.array(dtype=float),
    mesh: Mesh,
    space: Space,
    in_contact: int,
    displacement: wp.array(dtype=wp.vec4),
    # outputs
    move: wp.array(dtype=wp.vec4),
    change: wp.array(dtype=wp.vec4),
    sums: wp.array3d(dtype=wp.int64),
):
    """The move that the force on every dot asks for, and what it changed by since the last step."""
    i = first + wp.tid()
    if bodies.line[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    charge = bodies.first_charge[i]
    at = charge_position[charge]
    force = along_border(field[charge], at, space)
    node = nearest_node(at, mesh)
    length = step_length[bodies.group[i] * mesh.count_x * mesh.count_y + node]
    limit = step_limit[node]
    # Beyond a spacing no move is more than a direction.
    wanted = limited(force * length, 2.0 * limit)
    new = wp.vec4(wanted[0], wanted[1], 0.0, 0.0)
    changed = move[i] - new
    way = displacement[i]
    move[i] = new
    change[i] = changed
    weight = bodies.charge[charge] / length
    rest = unsettled(wp.length_sq(wanted), wp.length_sq(way), limit, in_contact)
    add_products(sums, thread, i, wp.vec4(weight, weight, 0.0, 0.0), way, changed, new, rest)


@wp.kernel
def propose_lines(
    first: int,
    thread: int,
    pose: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
    field: wp.array(dtype=wp.vec2),
    bodies: Bodies,
    lines: Lines,
    step_length: wp.array(dtype=float),
    step_limit: wp.array(dtype=float),
    mesh: Mesh,
    space: Space,
    in_contact: int,
    displacement: wp.array(dtype=wp.vec4),
    # outputs
    move: wp.array(dtype=wp.vec4),
    change: wp.array(dtype=wp.vec4),
    bend: wp.array(dtype=float),
    sums: wp.array3d(dtype=wp.int64),
):
    """The shift, turn and stretch that the forces on every line and its wishes ask for, and what they changed by."""
    i = first + wp.tid()
    kind = bodies.line[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    start = pose[i]
    begin = bodies.first_charge[i]
    end = bodies.first_charge[i + 1]
    group_base = bodies.group[i] * mesh.count_x * mesh.count_y
    centre = wp.vec2(start[0], start[1])
    middle = nearest_node(centre, mesh)
    limit = step_limit[middle]

    # Figure 9 (a): the charges' moves as one shift, one turn about the middle and one stretch, which fit them best.
    along = wp.vec2(wp.cos(start[2]), wp.sin(start[2]))
    across = wp.vec2(-along[1], along[0])
    total = float(0.0)
    inertia = float(0.0)
    # Lines much longer than their spacing lie side by side, nearer than the mean density tells, and so the energy is steeper.
    step = WEIGHING_SHARE / (1.0 + SIDE_BY_SIDE * 0.5 * start[3] / limit)
    shift = wp.vec2(0.0, 0.0)
    turn = float(0.0)
    stretch = float(0.0)
    for j in range(begin, end):
        node = nearest_node(charge_position[j], mesh)
        pull = limited(field[j] * (step * step_length[group_base + node]), step_limit[node])
        q = bodies.charge[j]
        s = bodies.place[j]
        total += q
        inertia += q * s * s
        shift += q * pull
        turn += q * s * wp.dot(pull, across)
        stretch += q * s * wp.dot(pull, along)
    shift = shift / total
    half = 0.5 * start[3]
    desired_length = lines.length[
        pixel_at(centre, lines.length_start[kind], lines.length_height[kind], lines.length_width[kind], space.size)
    ]
    wish = nearest_vector(
        centre,
        lines.direction,
        lines.direction_start[kind],
        lines.direction_height[kind],
        lines.direction_width[kind],
        space.size,
    )
    weight = wp.length(wish)
    turn = lines.turn_by_force[kind] * turn / (inertia * wp.max(half, 0.05 * desired_length))
    # Difference of the doubled angles, since a line has no front.
    c2 = along[0] * along[0] - along[1] * along[1]
    s2 = 2.0 * along[0] * along[1]
    if weight > 0.0:
        turn += (
            lines.turn_by_wish[kind] * weight * 0.5 * wp.atan2(c2 * wish[1] - s2 * wish[0], c2 * wish[0] + s2 * wish[1])
        )
    turn = wp.clamp(turn, -LARGEST_TURN, LARGEST_TURN)
    wanted_length = desired_length * lines.length_factor[kind]
    growth = lines.stretch_by_force[kind] * 2.0 * stretch / inertia
    growth += lines.stretch_by_wish[kind] * (wanted_length - start[3])
    shift = limited(shift, limit)
    straightness = lines.straightness[kind]
    if straightness >= 0.0:
        # What the shift and the turn leave of the moves across the axis bends it; part of every bend is taken back.
        spin = turn * half
        for j in range(begin, end):
            node = nearest_node(charge_position[j], mesh)
            pull = limited(field[j] * (step * step_length[group_base + node]), step_limit[node])
            rest = wp.dot(pull - shift, across) - spin * bodies.place[j]
            bend[j] = wp.clamp((1.0 - straightness) * (bend[j] + rest), -0.25 * start[3], 0.25 * start[3])
        # Whatever of the bends is a shift or a turn belongs to the pose.
        mean = float(0.0)
        slope = float(0.0)
        for j in range(begin, end):
            mean += bodies.charge[j] * bend[j] / total
            slope += bodies.charge[j] * bodies.place[j] * bend[j] / inertia
        for j in range(begin, end):
            bend[j] = bend[j] - mean - slope * bodies.place[j]
    new = wp.vec4(shift[0], shift[1], turn, growth) / WEIGHING_SHARE
    changed = move[i] - new
    way = displacement[i]
    move[i] = new
    change[i] = changed
    # The mean square of the ways of its charges.
    weight = total / step_length[group_base + middle]
    of_turn = inertia / total * half * half
    of_stretch = 0.25 * inertia / total
    metric = wp.vec4(1.0, 1.0, of_turn, of_stretch)
    squared_move = wp.dot(wp.cw_mul(metric, new), new)
    squared_way = wp.dot(wp.cw_mul(metric, way), way)
    rest = unsettled(squared_move, squared_way, limit, in_contact)
    add_products(sums, thread, i, weight * metric, way, changed, new, rest)
    add(sums, thread, LENGTHS + kind, i, start[3] / desired_length)


@wp.kernel
def move_dots(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    step_limit: wp.array(dtype=float),
    mesh: Mesh,
    images: Images,
    space: Space,
    move: wp.array(dtype=wp.vec4),
    change: wp.array(dtype=wp.vec4),
    # outputs
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
):
    """Move every dot in the direction that :func:`decide_direction` found; it never enters empty pixels."""
    i = first + wp.tid()
    if bodies.line[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = wp.vec2(pose[i][0], pose[i][1])
    d = direction[0] * move[i] + direction[1] * displacement[i] + direction[2] * change[i]
    wanted = old + limited(wp.vec2(d[0], d[1]), step_limit[nearest_node(old, mesh)])
    new = slide(old, wanted, bodies.class_index[i], images, space)
    way = difference(old, new, space)
    pose[i] = wp.vec4(new[0], new[1], 0.0, 0.0)
    displacement[i] = wp.vec4(way[0], way[1], 0.0, 0.0)
    charge_position[bodies.first_charge[i]] = new


@wp.kernel
def move_lines(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    lines: Lines,
    step_limit: wp.array(dtype=float),
    mesh: Mesh,
    images: Images,
    space: Space,
    move: wp.array(dtype=wp.vec4),
    change: wp.array(dtype=wp.vec4),
    # outputs
    pose: wp.array(dtype=wp.vec4),
    bend: wp.array(dtype=float),
    displacement: wp.array(dtype=wp.vec4),
):
    """Move every line in the direction that :func:`decide_direction` found; its charges never enter empty pixels."""
    i = first + wp.tid()
    kind = bodies.line[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = pose[i]
    k = bodies.class_index[i]
    begin = bodies.first_charge[i]
    end = bodies.first_charge[i + 1]
    centre = wp.vec2(old[0], old[1])
    d = direction[0] * move[i] + direction[1] * displacement[i] + direction[2] * change[i]
    shift = limited(wp.vec2(d[0], d[1]), step_limit[nearest_node(centre, mesh)])
    turn = wp.clamp(d[2], -LARGEST_TURN, LARGEST_TURN)
    desired_length = lines.length[
        pixel_at(centre, lines.length_start[kind], lines.length_height[kind], lines.length_width[kind], space.size)
    ]
    length = wp.clamp(old[3] + d[3], SHORTEST_LINE * desired_length, LONGEST_LINE * desired_length)
    wanted = wp.vec4(old[0] + shift[0], old[1] + shift[1], old[2] + turn, length)
    line = confine_line(old, wanted, begin, end, bodies, bend, k, images, space)
    if lines.straightness[kind] >= 0.0 and way_back(line, begin, end, bodies, bend, k, images, space)[2] != 0.0:
        # The old pose with a new bend: straight, a line always fits where it stood.
        for j in range(begin, end):
            bend[j] = 0.0
    new_centre = confine(wp.vec2(line[0], line[1]), space)
    way = difference(centre, new_centre, space)
    pose[i] = wp.vec4(new_centre[0], new_centre[1], line[2], line[3])
    displacement[i] = wp.vec4(way[0], way[1], line[2] - old[2], line[3] - old[3])


@wp.kernel
def place_charges(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    bodies: Bodies,
    bend: wp.array(dtype=float),
    space: Space,
    # outputs
    charge_position: wp.array(dtype=wp.vec2),
):
    i = first + wp.tid()
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        charge_position[j] = confine(charge_at(pose[i], bodies.place[j], bend[j]), space)


@wp.kernel
def find_step_lengths(
    first: int,
    attraction: wp.array(dtype=float),
    node_count: int,
    inverse_node_area: float,
    least: wp.array(dtype=float),
    # outputs
    step_length: wp.array(dtype=float),
):
    """Inverse of the energy's curvature, 2 pi times the attracting density, which counts as ``least`` of its group at least."""
    i = first + wp.tid()
    density = wp.max(attraction[i] * inverse_node_area, least[i / node_count])
    step_length[i] = 1.0 / (2.0 * wp.pi * density)


@wp.kernel
def find_step_limits(
    first: int,
    number: wp.array(dtype=float),
    inverse_node_area: float,
    least: float,
    share: float,
    # outputs
    step_limit: wp.array(dtype=float),
):
    """A share of the spacing of bodies where so many are asked for."""
    i = first + wp.tid()
    step_limit[i] = share / wp.sqrt(wp.max(number[i] * inverse_node_area, least))
