"""Kernels that move lines along a surface: by the rules of the plane, in the plane that touches it at a line's middle."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_facets import (
    ON_SIDE,
    Facets,
    Spot,
    carried,
    spot_at,
    step_along,
    tangential,
    tile_of,
    without_outward,
)
from .kernels_descent import PINNED, Bodies, limited, squared_residual
from .kernels_direction import LENGTHS, Sums, add, add_all
from .kernels_lines import (
    LARGEST_BEND,
    LARGEST_TURN,
    LONGEST_LINE,
    SHORTEST_LEVER,
    SHORTEST_LINE,
    SIDE_BY_SIDE,
    WEIGHING_SHARE,
    Lines,
    bent_by,
    take_rigid_part,
)
from .kernels_on_surface import Charges, Ground, Motion, Poses, may_be, put_charge, remembered, walk

wp.set_module_options({"enable_backward": False})

# Lines are shifted out of balls by at most so many times their depth, where the surface runs along the ball's.
STEEPEST_WAY_OUT = wp.constant(10.0)
# So much farther, as a share of the way, and in units.
ROUNDED_OFF = wp.constant(1.0e-3)


@wp.struct
class Axis:
    """A line: its charges; tile, node, and the plane that touches the surface at its middle; half its length, also in that plane.

    And what its forces are weighed by: how far bodies may move there, index of its group's first step length, and the share of the
    moves that is weighed against its preferences.
    """

    begin: int
    end: int
    tile: int
    home: int
    normal: wp.vec3
    along: wp.vec3
    across: wp.vec3
    half: float
    limit: float
    first_step: int
    share: float


@wp.struct
class RigidMove:
    """A line's move: shift along the surface, and the moments that turn and stretch it; beside its charge and moment of inertia."""

    shift: wp.vec3
    torque: float
    tension: float
    charge: float
    inertia: float


@wp.func
def way_along(facet: int, axis: wp.vec3, axial: float, beside: float, facets: Facets):
    """The way from a line's middle to a charge at ``axial`` (-1..1) along its axis and ``beside`` it."""
    way = axial * axis
    if beside != 0.0:
        way = way + beside * wp.normalize(wp.cross(facets.normal[facet], axis))
    return way


@wp.func
def place_along(facet: int, weight: wp.vec2, way: wp.vec3, facets: Facets):
    """Where a charge is that lies this way from the middle of a line."""
    if wp.length_sq(way) > 0.0:
        return step_along(facet, weight, way, facets)
    return spot_at(facet, weight, facets)


@wp.func
def over_the_end(spot: Spot, wanted: wp.vec3, facets: Facets):
    """The way back for a charge that ought to be where the surface has ended; 0 where it has not."""
    sides = facets.open_sides[spot.facet]
    back = wp.vec3(0.0, 0.0, 0.0)
    if sides != 0:
        for k in range(3):
            share = 1.0 - spot.weight[0] - spot.weight[1]
            if k > 0:
                share = spot.weight[k - 1]
            if (sides & (1 << k)) != 0 and share < ON_SIDE:
                back = spot.position - wanted
    return back


@wp.func
def way_back(
    facet: int, weight: wp.vec2, axis: wp.vec3, i: int, bodies: Bodies, bend: wp.array(dtype=float), ground: Ground
):
    """By how much a line must move so that the farthest of its charges beyond the surface's end is on it."""
    middle = spot_at(facet, weight, ground.facets)
    farthest = wp.vec3(0.0, 0.0, 0.0)
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        way = way_along(facet, axis, bodies.axial[j], bend[j], ground.facets)
        spot = place_along(facet, weight, way, ground.facets)
        back = over_the_end(spot, middle.position + way, ground.facets)
        if wp.length_sq(back) > wp.length_sq(farthest):
            farthest = back
    return tangential(farthest, ground.facets.normal[facet])


@wp.func
def way_out_of_balls(middle: wp.vec3, axis: wp.vec3, i: int, ground: Ground):
    """The way by which the axis of line ``i`` leaves the ball that it lies deepest in; 0 where it lies in none."""
    way = wp.vec3(0.0, 0.0, 0.0)
    if ground.ball_count > 0:
        clear = ground.clear[i][0]
        along = axis / wp.max(wp.length_sq(axis), 1.0e-12)
        deepest = float(0.0)
        for k in range(ground.ball_count):
            ball = ground.balls[k]
            way_here = middle - wp.vec3(ball[0], ball[1], ball[2])
            away = way_here + wp.clamp(-wp.dot(way_here, along), -1.0, 1.0) * axis
            distance = wp.length(away)
            depth = ball[3] + clear - distance
            if depth > deepest and distance > 0.0:
                deepest = depth
                way = away * (depth / distance)
    return way


@wp.func
def line_fits(
    facet: int, weight: wp.vec2, axis: wp.vec3, i: int, bodies: Bodies, bend: wp.array(dtype=float), ground: Ground
):
    """Whether all charges of a line are where its class may be, and its axis is outside of balls."""
    clear = float(0.0)
    fits = bool(True)
    if ground.ball_count > 0:
        clear = ground.clear[i][0]
        middle = spot_at(facet, weight, ground.facets).position
        fits = wp.length_sq(way_out_of_balls(middle, axis, i, ground)) == 0.0
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        way = way_along(facet, axis, bodies.axial[j], bend[j], ground.facets)
        spot = place_along(facet, weight, way, ground.facets)
        if not may_be(spot, bodies.support[i], clear, ground):
            fits = False
    return fits


@wp.kernel
def place_lines(
    first: int,
    poses: Poses,
    bodies: Bodies,
    ground: Ground,
    # outputs
    charges: Charges,
):
    """Put the charges of lines along their axes, and beside them where they bend."""
    i = first + wp.tid()
    if bodies.kind[i] < 0:
        return
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        way = way_along(poses.facet[i], poses.axis[i], bodies.axial[j], poses.bend[j], ground.facets)
        spot = place_along(poses.facet[i], poses.weight[i], way, ground.facets)
        put_charge(j, spot.facet, spot.weight, ground, charges)


@wp.func
def axis_of(i: int, poses: Poses, bodies: Bodies, ground: Ground):
    """The axis of line ``i``, and what its forces are weighed with."""
    facet = poses.facet[i]
    axis = Axis()
    axis.begin = bodies.first_charge[i]
    axis.end = bodies.first_charge[i + 1]
    axis.normal = ground.facets.normal[facet]
    axis.half = wp.length(poses.axis[i])
    axis.along = poses.axis[i] / wp.max(axis.half, 1.0e-12)
    axis.across = wp.cross(axis.normal, axis.along)
    axis.tile = tile_of(facet, poses.weight[i], ground.facets)
    axis.home = ground.home[axis.tile]
    axis.limit = ground.step_limit[axis.home]
    axis.first_step = bodies.group[i] * ground.node_count
    axis.share = WEIGHING_SHARE / (1.0 + SIDE_BY_SIDE * axis.half / axis.limit)
    return axis


@wp.func
def pull_on(j: int, axis: Axis, charges: Charges, ground: Ground):
    """The share of the move that the force on a line's charge asks for, turned into the plane at the line's middle."""
    at = charges.facet[j]
    force = without_outward(charges.field[j], at, charges.weight[j], ground.facets)
    length = ground.step_length[axis.first_step + charges.home[j]]
    there = limited(force * (axis.share * length), ground.step_limit[charges.home[j]])
    return carried(there, ground.facets.normal[at], axis.normal)


@wp.func
def fit_rigid_move(axis: Axis, charges: Charges, bodies: Bodies, ground: Ground):
    """The one shift, turn about the middle and stretch that fit the moves of a line's charges best."""
    fit = RigidMove()
    for j in range(axis.begin, axis.end):
        pull = pull_on(j, axis, charges, ground)
        q = bodies.charge[j]
        s = bodies.axial[j]
        fit.charge += q
        fit.inertia += q * s * s
        fit.shift += q * pull
        fit.torque += q * s * wp.dot(pull, axis.across)
        fit.tension += q * s * wp.dot(pull, axis.along)
    fit.shift = limited(tangential(fit.shift / fit.charge, axis.normal), axis.limit)
    return fit


@wp.func
def bend_on_surface(
    axis: Axis,
    fit: RigidMove,
    turn: float,
    straightness: float,
    charges: Charges,
    bodies: Bodies,
    ground: Ground,
    bend: wp.array(dtype=float),
):
    """Bend a line by what its shift and its turn leave of the moves across the axis, as :func:`.bend_line` does in the plane."""
    for j in range(axis.begin, axis.end):
        rest = wp.dot(pull_on(j, axis, charges, ground) - fit.shift, axis.across) - turn * axis.half * bodies.axial[j]
        bend[j] = bent_by(rest, bend[j], straightness, LARGEST_BEND * 2.0 * axis.half)
    take_rigid_part(axis.begin, axis.end, fit.charge, fit.inertia, bodies, bend)


@wp.func
def weigh_turn(kind: int, axis: Axis, fit: RigidMove, preferred: wp.vec3, lines: Lines):
    """The turn that the forces and the preferred direction ask for together."""
    lever = wp.max(axis.half, SHORTEST_LEVER * lines.length[kind])
    turn = lines.turn_by_force[kind] * fit.torque / (fit.inertia * lever)
    weight = wp.length(preferred)
    if weight > 0.0:
        x = wp.dot(preferred, axis.along)
        y = wp.dot(preferred, axis.across)
        # A line has no front.
        turn += lines.turn_by_preference[kind] * weight * 0.5 * wp.atan2(2.0 * x * y, x * x - y * y)
    return wp.clamp(turn, -LARGEST_TURN, LARGEST_TURN)


@wp.func
def weigh_stretch(kind: int, axis: Axis, fit: RigidMove, lines: Lines):
    """The change of length that the forces and the preferred length ask for together."""
    wanted = lines.length[kind] * lines.length_factor[kind]
    stretch = lines.stretch_by_force[kind] * 2.0 * fit.tension / fit.inertia
    stretch += lines.stretch_by_preference[kind] * (wanted - 2.0 * axis.half)
    return stretch


@wp.func
def add_products_of_line(
    sums: wp.array3d(dtype=wp.int64),
    thread: int,
    i: int,
    axis: Axis,
    fit: RigidMove,
    in_contact: int,
    ground: Ground,
    motion: Motion,
):
    """Add a line's share to the products that the direction depends on, in the mean square of the displacements of its charges."""
    metric = fit.charge / ground.step_length[axis.first_step + axis.home]
    flat = wp.vec2(fit.inertia / fit.charge * axis.half * axis.half, 0.25 * fit.inertia / fit.charge)
    way = motion.displacement[i]
    new = motion.move[i]
    changed = motion.change[i]
    of_way = wp.cw_mul(flat, motion.turned[i])
    of_change = wp.cw_mul(flat, motion.turn_change[i])
    of_new = wp.cw_mul(flat, motion.turn[i])
    squared_move = wp.dot(new, new) + wp.dot(of_new, motion.turn[i])
    squared_way = wp.dot(way, way) + wp.dot(of_way, motion.turned[i])
    add_all(
        sums,
        thread,
        i,
        Sums(
            metric * (wp.dot(way, changed) + wp.dot(of_way, motion.turn_change[i])),
            metric * squared_way,
            metric * (wp.dot(changed, changed) + wp.dot(of_change, motion.turn_change[i])),
            metric * (wp.dot(way, new) + wp.dot(of_way, motion.turn[i])),
            metric * (wp.dot(changed, new) + wp.dot(of_change, motion.turn[i])),
            metric * squared_move,
            squared_residual(squared_move, squared_way, axis.limit, in_contact),
        ),
    )


@wp.kernel
def propose_lines(
    first: int,
    thread: int,
    poses: Poses,
    charges: Charges,
    bodies: Bodies,
    lines: Lines,
    preferred: wp.array(dtype=wp.vec3),
    ground: Ground,
    in_contact: int,
    # outputs
    motion: Motion,
    bend: wp.array(dtype=float),
    sums: wp.array3d(dtype=wp.int64),
):
    """The shift, turn and stretch that forces and preferences ask for on every line, and what they changed by."""
    i = first + wp.tid()
    kind = bodies.kind[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    axis = axis_of(i, poses, bodies, ground)
    fit = fit_rigid_move(axis, charges, bodies, ground)
    turn = weigh_turn(kind, axis, fit, preferred[kind * ground.tile_count + axis.tile], lines)
    stretch = weigh_stretch(kind, axis, fit, lines)
    if lines.straightness[kind] >= 0.0:
        bend_on_surface(axis, fit, turn, lines.straightness[kind], charges, bodies, ground, bend)
    new = fit.shift / WEIGHING_SHARE
    new_turn = wp.vec2(turn, stretch) / WEIGHING_SHARE
    motion.change[i] = motion.move[i] - new
    motion.turn_change[i] = motion.turn[i] - new_turn
    motion.move[i] = new
    motion.turn[i] = new_turn
    add_products_of_line(sums, thread, i, axis, fit, in_contact, ground, motion)
    add(sums, thread, LENGTHS + kind, i, 2.0 * axis.half / lines.length[kind])


@wp.struct
class Lying:
    """How a line lies: where its middle is, half its axis, and what that changed of its angle and length."""

    middle: Spot
    axis: wp.vec3
    turned: wp.vec2


@wp.func
def wanted_lying(
    i: int, kind: int, direction: wp.array(dtype=float), old: Lying, lines: Lines, ground: Ground, motion: Motion
):
    """The old middle with the angle and length that line ``i`` is to have next."""
    half = wp.length(old.axis)
    along = old.axis / wp.max(half, 1.0e-12)
    normal = ground.facets.normal[old.middle.facet]
    asked = direction[0] * motion.turn[i] + direction[1] * motion.turned[i] + direction[2] * motion.turn_change[i]
    turn = wp.clamp(asked[0], -LARGEST_TURN, LARGEST_TURN)
    wanted = lines.length[kind]
    length = wp.clamp(2.0 * half + asked[1], SHORTEST_LINE * wanted, LONGEST_LINE * wanted)
    result = Lying()
    result.middle = old.middle
    result.axis = (0.5 * length) * (wp.cos(turn) * along + wp.sin(turn) * wp.cross(normal, along))
    result.turned = wp.vec2(turn, length - 2.0 * half)
    return result


@wp.func
def shifted(i: int, lying: Lying, way: wp.vec3, bodies: Bodies, ground: Ground):
    """Line ``i`` after it went ``way``, turned into the plane that it is in then."""
    normal = ground.facets.normal[lying.middle.facet]
    result = Lying()
    result.middle = walk(lying.middle.facet, lying.middle.weight, way, i, bodies.support[i], ground)
    result.axis = carried(lying.axis, normal, ground.facets.normal[result.middle.facet])
    result.turned = lying.turned
    return result


@wp.func
def fits(i: int, lying: Lying, bodies: Bodies, bend: wp.array(dtype=float), ground: Ground):
    """Whether all charges of a line are where its class may be."""
    return line_fits(lying.middle.facet, lying.middle.weight, lying.axis, i, bodies, bend, ground)


@wp.func
def depth_in_balls(i: int, lying: Lying, ground: Ground):
    """How deep the axis of line ``i`` lies in a ball, with its sides."""
    return wp.length(way_out_of_balls(lying.middle.position, lying.axis, i, ground))


@wp.func
def beside_balls(i: int, lying: Lying, bodies: Bodies, ground: Ground):
    """Line ``i``, shifted along the surface out of the ball that it lies deepest in."""
    out = way_out_of_balls(lying.middle.position, lying.axis, i, ground)
    along = tangential(out, ground.facets.normal[lying.middle.facet])
    steep = wp.length_sq(along)
    if steep == 0.0:
        return lying
    # So far along the surface that it is out by as much as is needed, and a little for rounding.
    longer = wp.min(wp.length_sq(out) / steep, STEEPEST_WAY_OUT) * (1.0 + ROUNDED_OFF) + ROUNDED_OFF / wp.sqrt(steep)
    return shifted(i, lying, longer * along, bodies, ground)


@wp.func
def allowed(
    i: int, old: Lying, turned: Lying, way: wp.vec3, bodies: Bodies, bend: wp.array(dtype=float), ground: Ground
):
    """How line ``i`` lies after a turn and a shift: whole on the surface, and where its class may be."""
    new = shifted(i, turned, way, bodies, ground)
    # Where the surface ends, lines stay on it as a whole.
    back = way_back(new.middle.facet, new.middle.weight, new.axis, i, bodies, bend, ground)
    if wp.length_sq(back) > 0.0:
        new = shifted(i, new, back, bodies, ground)
    if ground.ball_count > 0:
        new = beside_balls(i, new, bodies, ground)
        before = depth_in_balls(i, old, ground)
        if before > 0.0 and depth_in_balls(i, new, ground) < before:
            # What lies in a ball comes out of it little by little.
            return new
    if fits(i, new, bodies, bend, ground):
        return new
    # The shift alone, then the turn alone.
    normal = ground.facets.normal[old.middle.facet]
    new.axis = carried(old.axis, normal, ground.facets.normal[new.middle.facet])
    new.turned = wp.vec2(0.0, 0.0)
    if fits(i, new, bodies, bend, ground):
        return new
    if fits(i, turned, bodies, bend, ground):
        return turned
    return old


@wp.kernel
def move_lines(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    lines: Lines,
    ground: Ground,
    # outputs
    motion: Motion,
    poses: Poses,
):
    """Move every line in the direction that was found; its charges stay on the surface, and where its class may be."""
    i = first + wp.tid()
    kind = bodies.kind[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = Lying()
    old.middle = spot_at(poses.facet[i], poses.weight[i], ground.facets)
    old.axis = poses.axis[i]
    home = ground.home[tile_of(old.middle.facet, old.middle.weight, ground.facets)]
    d = direction[0] * motion.move[i] + direction[1] * motion.displacement[i] + direction[2] * motion.change[i]
    way = limited(d, ground.step_limit[home])
    turned = wanted_lying(i, kind, direction, old, lines, ground, motion)
    new = allowed(i, old, turned, way, bodies, poses.bend, ground)
    if lines.straightness[kind] >= 0.0:
        if not fits(i, new, bodies, poses.bend, ground):
            # The old pose with a new bend.
            for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
                poses.bend[j] = 0.0

    normal = ground.facets.normal[old.middle.facet]
    new_normal = ground.facets.normal[new.middle.facet]
    # Turning into another plane keeps lengths but for rounding.
    axis = tangential(new.axis, new_normal)
    kept = 0.5 * (2.0 * wp.length(old.axis) + new.turned[1])
    poses.axis[i] = axis * (kept / wp.max(wp.length(axis), 1.0e-12))
    poses.facet[i] = new.middle.facet
    poses.weight[i] = new.middle.weight
    motion.turned[i] = new.turned
    remembered(i, tangential(new.middle.position - old.middle.position, normal), normal, new_normal, motion)
