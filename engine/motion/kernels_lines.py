"""Kernels that move lines in the plane: as a whole, and by their bends. The paper is Schmaltz, Gwosdek and Weickert 2012."""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images, pixel_at
from ..space.kernels_mesh import nearest_node
from ..space.kernels_space import Space, between_cells, confine, difference
from .kernels_descent import (
    PINNED,
    Bodies,
    Charges,
    Motion,
    Steps,
    confine_line,
    first_step,
    limited,
    move_of,
    nearest_vector,
    squared_residual,
    vector_into_support,
)
from .kernels_direction import LENGTHS, add, add_length, add_products

wp.set_module_options({"enable_backward": False})

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
