"""Kernels that move the bodies.

A body's pose is (x, y, angle, length of its axis); a dot has angle and length 0. The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images, density_pixel, in_support, pixel_at
from ..space.kernels_mesh import Mesh, nearest_node
from ..space.kernels_space import Space, between_cells, confine, difference, overhang, wrapped
from .body_flags import BodyFlags
from .kernels_direction import LENGTHS, add, add_length, add_products

wp.set_module_options({"enable_backward": False})

PINNED = wp.constant(int(BodyFlags.PINNED))
# Times that a line is pushed back into the support before its move is given up. Measured on lines along the edges of bands: once
# leaves a coverage error 5 % larger, eight times change no digit.
PUSHES = wp.constant(3)
# Points at most that are looked at between two charges.
MOST_PIECES = wp.constant(64)
# Bounds on a line's length over the preferred one, far from where lines settle: they start at line_rules.FIRST_LENGTH, and their mean
# becomes the preferred one. Measured: 0.001 and 1.5 or 4 change no digit.
SHORTEST_LINE = wp.constant(0.01)
LONGEST_LINE = wp.constant(2.0)
# Largest turn of a line in a step [rad], so that its shift and its turn stay independent. Measured: from 0.1 to 1 coverage errors
# differ by 3 %, mean angles by 0.03 degrees.
LARGEST_TURN = wp.constant(0.5)
# Largest bend over the length, to either side: a line stays longer than it is wide. Measured: 0.1 and 0.5 change coverage errors by
# less than 4 %.
LARGEST_BEND = wp.constant(0.25)
# Half a length that torques turn at least, over the preferred length: what is still a point would be turned without end. Measured:
# from 0.01 to 0.2 coverage errors differ by 1 %.
SHORTEST_LEVER = wp.constant(0.05)
# How much steeper the energy is for lines side by side, per length over twice the step limit. Measured on 900 lines along a flow: with
# 0, 16 cross and angles are wrong by 1.2 degrees, with 1 6 and 0.9; with 2 3, and coverage errors are 1 % larger.
SIDE_BY_SIDE = wp.constant(1.0)
# Forces on lines are weighed against preferred directions and lengths as so large a share of the moves that the inverse curvature
# gives. Measured: 0.25 and 1 change coverage errors by 2 % along a flow, by 6 % where lines bend, and angles by 0.15 degrees.
WEIGHING_SHARE = wp.constant(0.5)


@wp.struct
class Bodies:
    """What bodies are: support, group, kind of line (-1: a dot) and :class:`~.body_flags.BodyFlags` of each, and its charges."""

    support: wp.array(dtype=wp.int32)
    group: wp.array(dtype=wp.int32)
    kind: wp.array(dtype=wp.int32)
    flags: wp.array(dtype=wp.int32)
    first_charge: wp.array(dtype=wp.int32)
    axial: wp.array(dtype=float)
    charge: wp.array(dtype=float)


@wp.struct
class Lines:
    """Rules of every kind of line.

    Weights of forces and preferences in turns and stretches, the share of a bend that is taken back (below 0: no bends), the factor
    on the preferred length that makes up for the pressure of the charges; and images of the preferred direction, (cos 2a, sin 2a)
    times its weight, and length. Kinds whose preferred length is an image have such a factor for every block of the domain, behind
    those of the kinds; others have no blocks.
    """

    turn_by_force: wp.array(dtype=float)
    turn_by_preference: wp.array(dtype=float)
    stretch_by_force: wp.array(dtype=float)
    stretch_by_preference: wp.array(dtype=float)
    straightness: wp.array(dtype=float)
    length_factor: wp.array(dtype=float)
    block_start: wp.array(dtype=wp.int32)
    block_rows: wp.array(dtype=wp.int32)
    block_columns: wp.array(dtype=wp.int32)
    direction: wp.array(dtype=wp.vec2)
    direction_start: wp.array(dtype=wp.int32)
    direction_height: wp.array(dtype=wp.int32)
    direction_width: wp.array(dtype=wp.int32)
    length: wp.array(dtype=float)
    length_start: wp.array(dtype=wp.int32)
    length_height: wp.array(dtype=wp.int32)
    length_width: wp.array(dtype=wp.int32)


@wp.struct
class Charges:
    """Positions of all charges, and the field at each."""

    position: wp.array(dtype=wp.vec2)
    field: wp.array(dtype=wp.vec2)


@wp.struct
class Steps:
    """How far the forces move bodies: inverse curvature at every node for every group, the limit at every node, and the mesh."""

    length: wp.array(dtype=float)
    limit: wp.array(dtype=float)
    mesh: Mesh


@wp.struct
class Motion:
    """Of every body: what the last step changed of its pose, the move that the forces ask for, and what that changed by."""

    displacement: wp.array(dtype=wp.vec4)
    move: wp.array(dtype=wp.vec4)
    change: wp.array(dtype=wp.vec4)


@wp.struct
class Axis:
    """A line: its charges, center, unit vectors along and across, and length.

    And what its forces are weighed by: index of its group's first step length, node nearest to the center, and the share of the moves
    that is weighed against its preferences.
    """

    begin: int
    end: int
    center: wp.vec2
    along: wp.vec2
    across: wp.vec2
    length: float
    first_step: int
    node: int
    share: float


@wp.struct
class RigidMove:
    """A line's move without a bend: shift, and the moments that turn and stretch it; beside its charge and moment of inertia."""

    shift: wp.vec2
    torque: float
    tension: float
    charge: float
    inertia: float


@wp.func
def charge_at(pose: wp.vec4, axial: float, bend: float):
    """Position of a charge at ``axial`` (-1..1) along a body's axis and ``bend`` beside it."""
    c = wp.cos(pose[2])
    s = wp.sin(pose[2])
    along = 0.5 * pose[3] * axial
    return wp.vec2(pose[0] + along * c - bend * s, pose[1] + along * s + bend * c)


@wp.func
def nearest_vector(
    position: wp.vec2, vectors: wp.array(dtype=wp.vec2), start: int, height: int, width: int, domain: wp.vec2
):
    """Image of vectors, interpolated bilinearly between the centers of its pixels."""
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
    """Where a dot ends that moves from ``old`` to ``wanted``: it stays in the support, and slides along its edge."""
    new = confine(wanted, space)
    if not in_support(new, k, images, space.size):
        along_x = confine(wp.vec2(wanted[0], old[1]), space)
        along_y = confine(wp.vec2(old[0], wanted[1]), space)
        new = old
        if in_support(along_x, k, images, space.size):
            new = along_x
        elif in_support(along_y, k, images, space.size):
            new = along_y
    return new


@wp.func
def vector_into_support(
    pose: wp.vec4,
    begin: int,
    end: int,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    k: int,
    images: Images,
    space: Space,
):
    """(x, y, 1) by which a line must move so that the farthest of it outside is in the support; (0, 0, 0) if all of it is.

    Its charges count, and where there are obstacles what lies between them, too.
    """
    # How far charges reach over the edges of an open domain.
    low = wp.vec2(0.0, 0.0)
    high = wp.vec2(0.0, 0.0)
    farthest = wp.vec2(0.0, 0.0)
    away = float(0.0)
    outside = float(0.0)
    last = wp.vec2(0.0, 0.0)
    for j in range(begin, end):
        p = charge_at(pose, bodies.axial[j], bend[j])
        over = overhang(p, space)
        low = wp.max(low, wp.vec2(over[0], over[1]))
        high = wp.max(high, wp.vec2(over[2], over[3]))
        pieces = int(1)
        if images.step > 0.0 and j > begin:
            pieces = wp.clamp(int(wp.length(p - last) / images.step) + 1, 1, MOST_PIECES)
        for piece in range(1, pieces + 1):
            q = p
            if piece < pieces:
                q = last + (p - last) * (float(piece) / float(pieces))
            pixel = density_pixel(confine(q, space), k, images, space.size)
            if images.pixel[pixel] <= 0.0:
                outside = 1.0
                back = images.to_support[pixel]
                if wp.length_sq(back) > away:
                    away = wp.length_sq(back)
                    farthest = back
        last = p
    inwards = low - high
    if wp.length_sq(inwards) > 0.0:
        outside = 1.0
    return wp.vec3(farthest[0] + inwards[0], farthest[1] + inwards[1], outside)


@wp.func
def middle_confined(pose: wp.vec4, space: Space):
    """A pose whose middle is wrapped into a periodic space; an open one holds it by its charges."""
    middle = wrapped(wp.vec2(pose[0], pose[1]), space)
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
    """Where a line ends that moves from ``old``, in the support, to ``wanted``: in the support again.

    Its middle stays inside a periodic space, too.
    """
    new = middle_confined(wanted, space)
    for _attempt in range(PUSHES):
        back = vector_into_support(new, begin, end, bodies, bend, k, images, space)
        if back[2] == 0.0:
            return new
        new = middle_confined(wp.vec4(new[0] + back[0], new[1] + back[1], new[2], new[3]), space)
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    # A shift without the turn, then a turn without the shift.
    new = middle_confined(wp.vec4(wanted[0], wanted[1], old[2], old[3]), space)
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    new = wp.vec4(old[0], old[1], wanted[2], wanted[3])
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    return old


@wp.func
def limited(move: wp.vec2, limit: float):
    length = wp.length(move)
    if length > limit:
        return move * (limit / length)
    return move


@wp.func
def squared_residual(squared_move: float, squared_displacement: float, limit: float, in_contact: int):
    """Squared move over squared spacing; what presses against others and does not get away has settled, too."""
    squared = squared_move
    if in_contact != 0:
        squared = wp.min(squared_move, squared_displacement)
    return squared / (4.0 * limit * limit)


@wp.func
def first_step(group: int, steps: Steps):
    """Index of a group's first step length."""
    return group * steps.mesh.count_x * steps.mesh.count_y


@wp.func
def axis_of(i: int, pose: wp.vec4, bodies: Bodies, steps: Steps):
    """The axis of line ``i``, and what its forces are weighed with."""
    axis = Axis()
    axis.begin = bodies.first_charge[i]
    axis.end = bodies.first_charge[i + 1]
    axis.center = wp.vec2(pose[0], pose[1])
    axis.along = wp.vec2(wp.cos(pose[2]), wp.sin(pose[2]))
    axis.across = wp.vec2(-axis.along[1], axis.along[0])
    axis.length = pose[3]
    axis.first_step = first_step(bodies.group[i], steps)
    axis.node = nearest_node(axis.center, steps.mesh)
    # Lines much longer than their spacing lie side by side, nearer than the mean density tells, and so the energy is steeper.
    axis.share = WEIGHING_SHARE / (1.0 + SIDE_BY_SIDE * 0.5 * axis.length / steps.limit[axis.node])
    return axis


@wp.func
def pull_on(j: int, axis: Axis, charges: Charges, steps: Steps):
    """The share of the move that the force on a line's charge asks for which is weighed with the line's preferences."""
    node = nearest_node(charges.position[j], steps.mesh)
    return limited(charges.field[j] * (axis.share * steps.length[axis.first_step + node]), steps.limit[node])


@wp.func
def fit_rigid_move(axis: Axis, charges: Charges, bodies: Bodies, steps: Steps):
    """The one shift, turn about the middle and stretch that fit the moves of a line's charges best (figure 9 a of the paper)."""
    fit = RigidMove()
    for j in range(axis.begin, axis.end):
        pull = pull_on(j, axis, charges, steps)
        q = bodies.charge[j]
        s = bodies.axial[j]
        fit.charge += q
        fit.inertia += q * s * s
        fit.shift += q * pull
        fit.torque += q * s * wp.dot(pull, axis.across)
        fit.tension += q * s * wp.dot(pull, axis.along)
    fit.shift = fit.shift / fit.charge
    return fit


@wp.func
def preferred_length_at(center: wp.vec2, kind: int, lines: Lines, space: Space):
    """The length that a kind of line prefers at ``center``."""
    return lines.length[
        pixel_at(center, lines.length_start[kind], lines.length_height[kind], lines.length_width[kind], space.size)
    ]


@wp.func
def preferred_direction_at(center: wp.vec2, kind: int, lines: Lines, space: Space):
    """The direction that a kind of line prefers at ``center``: (cos 2a, sin 2a) times its weight."""
    return nearest_vector(
        center,
        lines.direction,
        lines.direction_start[kind],
        lines.direction_height[kind],
        lines.direction_width[kind],
        space.size,
    )


@wp.func
def angle_between(along: wp.vec2, preferred: wp.vec2):
    """Angle from a line's direction to the preferred one, which is given by its doubled angle: a line has no front."""
    c2 = along[0] * along[0] - along[1] * along[1]
    s2 = 2.0 * along[0] * along[1]
    return 0.5 * wp.atan2(c2 * preferred[1] - s2 * preferred[0], c2 * preferred[0] + s2 * preferred[1])


@wp.func
def weigh_turn(kind: int, axis: Axis, fit: RigidMove, preferred_length: float, lines: Lines, space: Space):
    """The turn that the forces and the preferred direction ask for together."""
    lever = wp.max(0.5 * axis.length, SHORTEST_LEVER * preferred_length)
    turn = lines.turn_by_force[kind] * fit.torque / (fit.inertia * lever)
    preferred = preferred_direction_at(axis.center, kind, lines, space)
    weight = wp.length(preferred)
    if weight > 0.0:
        turn += lines.turn_by_preference[kind] * weight * angle_between(axis.along, preferred)
    return wp.clamp(turn, -LARGEST_TURN, LARGEST_TURN)


@wp.func
def length_factor_at(center: wp.vec2, kind: int, lines: Lines, space: Space):
    """What a kind's preferred length is multiplied by at ``center``: linear between the middles of blocks."""
    rows = lines.block_rows[kind]
    factor = lines.length_factor[kind]
    if rows > 0:
        factor = between_cells(
            center, lines.length_factor, lines.block_start[kind], rows, lines.block_columns[kind], space
        )
    return factor


@wp.func
def block_at(center: wp.vec2, kind: int, lines: Lines, space: Space):
    """The block that ``center`` lies in, counted from the first of all kinds' blocks."""
    columns = lines.block_columns[kind]
    column = wp.clamp(int(center[0] / space.size[0] * float(columns)), 0, columns - 1)
    row = wp.clamp(int(center[1] / space.size[1] * float(lines.block_rows[kind])), 0, lines.block_rows[kind] - 1)
    return lines.block_start[kind] - lines.block_start.shape[0] + row * columns + column


@wp.func
def weigh_stretch(kind: int, axis: Axis, fit: RigidMove, preferred_length: float, lines: Lines, space: Space):
    """The change of length that the forces and the preferred length ask for together."""
    stretch = lines.stretch_by_force[kind] * 2.0 * fit.tension / fit.inertia
    wanted = preferred_length * length_factor_at(axis.center, kind, lines, space)
    stretch += lines.stretch_by_preference[kind] * (wanted - axis.length)
    return stretch


@wp.func
def bent_by(rest: float, bend: float, straightness: float, largest: float):
    """How far a charge stands beside its line's axis next, which the forces want to move by ``rest`` from it."""
    return wp.clamp((1.0 - straightness) * (bend + rest), -largest, largest)


@wp.func
def take_rigid_part(begin: int, end: int, charge: float, inertia: float, bodies: Bodies, bend: wp.array(dtype=float)):
    """Take from bends whatever is a shift or a turn: it belongs to the pose. Charge and moment of inertia are the line's."""
    mean = float(0.0)
    slope = float(0.0)
    for j in range(begin, end):
        mean += bodies.charge[j] * bend[j] / charge
        slope += bodies.charge[j] * bodies.axial[j] * bend[j] / inertia
    for j in range(begin, end):
        bend[j] = bend[j] - mean - slope * bodies.axial[j]


@wp.func
def bend_line(
    axis: Axis,
    fit: RigidMove,
    shift: wp.vec2,
    turn: float,
    straightness: float,
    charges: Charges,
    bodies: Bodies,
    steps: Steps,
    bend: wp.array(dtype=float),
):
    """Bend a line by what its shift and its turn leave of the moves across the axis; part of every bend is taken back."""
    spin = turn * (0.5 * axis.length)
    largest = LARGEST_BEND * axis.length
    for j in range(axis.begin, axis.end):
        rest = wp.dot(pull_on(j, axis, charges, steps) - shift, axis.across) - spin * bodies.axial[j]
        bend[j] = bent_by(rest, bend[j], straightness, largest)
    take_rigid_part(axis.begin, axis.end, fit.charge, fit.inertia, bodies, bend)


@wp.kernel
def propose_lines(
    first: int,
    thread: int,
    pose: wp.array(dtype=wp.vec4),
    charges: Charges,
    bodies: Bodies,
    lines: Lines,
    steps: Steps,
    space: Space,
    in_contact: int,
    # outputs
    motion: Motion,
    bend: wp.array(dtype=float),
    sums: wp.array3d(dtype=wp.int64),
    sums_of_blocks: wp.array2d(dtype=wp.int64),
):
    """The shift, turn and stretch that forces and preferences ask for on every line, and what they changed by."""
    i = first + wp.tid()
    kind = bodies.kind[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    axis = axis_of(i, pose[i], bodies, steps)
    limit = steps.limit[axis.node]
    fit = fit_rigid_move(axis, charges, bodies, steps)
    preferred_length = preferred_length_at(axis.center, kind, lines, space)
    shift = limited(fit.shift, limit)
    turn = weigh_turn(kind, axis, fit, preferred_length, lines, space)
    stretch = weigh_stretch(kind, axis, fit, preferred_length, lines, space)
    if lines.straightness[kind] >= 0.0:
        bend_line(axis, fit, shift, turn, lines.straightness[kind], charges, bodies, steps, bend)

    new = wp.vec4(shift[0], shift[1], turn, stretch) / WEIGHING_SHARE
    changed = motion.move[i] - new
    last = motion.displacement[i]
    motion.move[i] = new
    motion.change[i] = changed
    # The mean square of the displacements of its charges.
    weight = fit.charge / steps.length[axis.first_step + axis.node]
    half = 0.5 * axis.length
    of_turn = fit.inertia / fit.charge * half * half
    of_stretch = 0.25 * fit.inertia / fit.charge
    metric = wp.vec4(1.0, 1.0, of_turn, of_stretch)
    squared_move = wp.dot(wp.cw_mul(metric, new), new)
    squared_displacement = wp.dot(wp.cw_mul(metric, last), last)
    rest = squared_residual(squared_move, squared_displacement, limit, in_contact)
    add_products(sums, thread, i, weight * metric, last, changed, new, rest)
    if lines.block_rows[kind] > 0:
        add_length(sums_of_blocks, thread, block_at(axis.center, kind, lines, space), axis.length / preferred_length)
    else:
        add(sums, thread, LENGTHS + kind, i, axis.length / preferred_length)


@wp.func
def move_of(i: int, direction: wp.array(dtype=float), motion: Motion):
    """How far body ``i`` goes in the direction that :func:`~.kernels_direction.decide_direction` found."""
    return direction[0] * motion.move[i] + direction[1] * motion.displacement[i] + direction[2] * motion.change[i]


@wp.kernel
def move_lines(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    lines: Lines,
    steps: Steps,
    images: Images,
    space: Space,
    # outputs
    motion: Motion,
    pose: wp.array(dtype=wp.vec4),
    bend: wp.array(dtype=float),
):
    """Move every line in the direction that was found; its charges stay in the support."""
    i = first + wp.tid()
    kind = bodies.kind[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = pose[i]
    k = bodies.support[i]
    begin = bodies.first_charge[i]
    end = bodies.first_charge[i + 1]
    center = wp.vec2(old[0], old[1])
    d = move_of(i, direction, motion)
    shift = limited(wp.vec2(d[0], d[1]), steps.limit[nearest_node(center, steps.mesh)])
    turn = wp.clamp(d[2], -LARGEST_TURN, LARGEST_TURN)
    preferred_length = preferred_length_at(center, kind, lines, space)
    length = wp.clamp(old[3] + d[3], SHORTEST_LINE * preferred_length, LONGEST_LINE * preferred_length)
    wanted = wp.vec4(old[0] + shift[0], old[1] + shift[1], old[2] + turn, length)
    line = confine_line(old, wanted, begin, end, bodies, bend, k, images, space)
    if lines.straightness[kind] >= 0.0:
        if vector_into_support(line, begin, end, bodies, bend, k, images, space)[2] != 0.0:
            # The old pose with a new bend: straight, a line always fits where it stood.
            for j in range(begin, end):
                bend[j] = 0.0
    new_center = confine(wp.vec2(line[0], line[1]), space)
    moved = difference(center, new_center, space)
    pose[i] = wp.vec4(new_center[0], new_center[1], line[2], line[3])
    motion.displacement[i] = wp.vec4(moved[0], moved[1], line[2] - old[2], line[3] - old[3])


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
        charge_position[j] = confine(charge_at(pose[i], bodies.axial[j], bend[j]), space)


@wp.kernel
def find_step_lengths(
    first: int,
    attraction: wp.array(dtype=float),
    node_count: int,
    inverse_node_area: float,
    least: wp.array(dtype=float),
    share: wp.array(dtype=float),
    # outputs
    step_length: wp.array(dtype=float),
):
    """Inverse of the energy's curvature, 2 pi times the attracting density, which counts as ``least`` of its group at least.

    It is multiplied by the ``share`` of the forces that counts at a node; an empty array says that they count wholly.
    """
    i = first + wp.tid()
    density = wp.max(attraction[i] * inverse_node_area, least[i / node_count])
    length = 1.0 / (2.0 * wp.pi * density)
    if share.shape[0] > 0:
        length = length * share[i]
    step_length[i] = length


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
