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
from .kernels_descent import (
    LARGEST_TURN,
    LONGEST_LINE,
    PINNED,
    SHORTEST_LEVER,
    SHORTEST_LINE,
    SIDE_BY_SIDE,
    WEIGHING_SHARE,
    Bodies,
    Lines,
    squared_residual,
)
from .kernels_direction import LENGTHS, Sums, add, add_all
from .kernels_on_surface import Charges, Ground, may_be, put_charge, shortened, walk

wp.set_module_options({"enable_backward": False})


@wp.func
def place_along(facet: int, weight: wp.vec2, axis: wp.vec3, axial: float, facets: Facets):
    """Where a charge is that lies at ``axial`` (-1..1) along the axis of a line."""
    way = axial * axis
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
def way_back(facet: int, weight: wp.vec2, axis: wp.vec3, i: int, bodies: Bodies, ground: Ground):
    """By how much a line must move so that the farthest of its charges beyond the surface's end is on it."""
    middle = spot_at(facet, weight, ground.facets)
    farthest = wp.vec3(0.0, 0.0, 0.0)
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        spot = place_along(facet, weight, axis, bodies.axial[j], ground.facets)
        back = over_the_end(spot, middle.position + bodies.axial[j] * axis, ground.facets)
        if wp.length_sq(back) > wp.length_sq(farthest):
            farthest = back
    return tangential(farthest, ground.facets.normal[facet])


@wp.func
def line_fits(facet: int, weight: wp.vec2, axis: wp.vec3, i: int, bodies: Bodies, ground: Ground):
    """Whether all charges of a line are where its class may be."""
    clear = float(0.0)
    if ground.ball_count > 0:
        clear = ground.clear[i]
    fits = bool(True)
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        spot = place_along(facet, weight, axis, bodies.axial[j], ground.facets)
        if not may_be(spot, bodies.support[i], clear, ground):
            fits = False
    return fits


@wp.kernel
def place_lines(
    first: int,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    axis: wp.array(dtype=wp.vec3),
    bodies: Bodies,
    ground: Ground,
    # outputs
    charges: Charges,
):
    """Put the charges of lines along their axes."""
    i = first + wp.tid()
    if bodies.line[i] < 0:
        return
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        spot = place_along(facet[i], weight[i], axis[i], bodies.axial[j], ground.facets)
        put_charge(j, spot.facet, spot.weight, ground, charges)


@wp.kernel
def propose_lines(
    first: int,
    thread: int,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    axis: wp.array(dtype=wp.vec3),
    charges: Charges,
    field: wp.array(dtype=wp.vec3),
    bodies: Bodies,
    lines: Lines,
    preferred: wp.array(dtype=wp.vec3),
    ground: Ground,
    in_contact: int,
    displacement: wp.array(dtype=wp.vec3),
    turned: wp.array(dtype=wp.vec2),
    # outputs
    move: wp.array(dtype=wp.vec3),
    turn: wp.array(dtype=wp.vec2),
    change: wp.array(dtype=wp.vec3),
    turn_change: wp.array(dtype=wp.vec2),
    sums: wp.array3d(dtype=wp.int64),
):
    """The shift, turn and stretch that forces and preferences ask for on every line, and what they changed by."""
    i = first + wp.tid()
    kind = bodies.line[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    normal = ground.facets.normal[facet[i]]
    half = wp.length(axis[i])
    along = axis[i] / wp.max(half, 1.0e-12)
    across = wp.cross(normal, along)
    tile = tile_of(facet[i], weight[i], ground.facets)
    home = ground.home[tile]
    limit = ground.step_limit[home]
    start = bodies.group[i] * ground.node_count
    share = WEIGHING_SHARE / (1.0 + SIDE_BY_SIDE * half / limit)
    charge = float(0.0)
    inertia = float(0.0)
    torque = float(0.0)
    tension = float(0.0)
    shift = wp.vec3(0.0, 0.0, 0.0)
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        at = charges.facet[j]
        force = without_outward(field[j], at, charges.weight[j], ground.facets)
        length = ground.step_length[start + charges.home[j]]
        there = shortened(force * (share * length), ground.step_limit[charges.home[j]])
        # Into the plane at the middle.
        pull = carried(there, ground.facets.normal[at], normal)
        q = bodies.charge[j]
        s = bodies.axial[j]
        charge += q
        inertia += q * s * s
        shift += q * pull
        torque += q * s * wp.dot(pull, across)
        tension += q * s * wp.dot(pull, along)
    shift = shortened(tangential(shift / charge, normal), limit)
    wanted_length = lines.length[kind]
    lever = wp.max(half, SHORTEST_LEVER * wanted_length)
    spin = lines.turn_by_force[kind] * torque / (inertia * lever)
    towards = preferred[kind * ground.tile_count + tile]
    strength = wp.length(towards)
    if strength > 0.0:
        x = wp.dot(towards, along)
        y = wp.dot(towards, across)
        # A line has no front.
        spin += lines.turn_by_preference[kind] * strength * 0.5 * wp.atan2(2.0 * x * y, x * x - y * y)
    spin = wp.clamp(spin, -LARGEST_TURN, LARGEST_TURN)
    stretch = lines.stretch_by_force[kind] * 2.0 * tension / inertia
    stretch += lines.stretch_by_preference[kind] * (wanted_length * lines.length_factor[kind] - 2.0 * half)

    new = shift / WEIGHING_SHARE
    new_turn = wp.vec2(spin, stretch) / WEIGHING_SHARE
    changed = move[i] - new
    changed_turn = turn[i] - new_turn
    move[i] = new
    turn[i] = new_turn
    change[i] = changed
    turn_change[i] = changed_turn
    way = displacement[i]
    way_turn = turned[i]
    # The mean square of the displacements of its charges.
    metric = charge / ground.step_length[start + home]
    flat = wp.vec2(inertia / charge * half * half, 0.25 * inertia / charge)
    of_way = wp.cw_mul(flat, way_turn)
    of_change = wp.cw_mul(flat, changed_turn)
    of_new = wp.cw_mul(flat, new_turn)
    squared_move = wp.dot(new, new) + wp.dot(of_new, new_turn)
    squared_way = wp.dot(way, way) + wp.dot(of_way, way_turn)
    rest = squared_residual(squared_move, squared_way, limit, in_contact)
    add_all(
        sums,
        thread,
        i,
        Sums(
            metric * (wp.dot(way, changed) + wp.dot(of_way, changed_turn)),
            metric * squared_way,
            metric * (wp.dot(changed, changed) + wp.dot(of_change, changed_turn)),
            metric * (wp.dot(way, new) + wp.dot(of_way, new_turn)),
            metric * (wp.dot(changed, new) + wp.dot(of_change, new_turn)),
            metric * squared_move,
            rest,
        ),
    )
    add(sums, thread, LENGTHS + kind, i, 2.0 * half / wanted_length)


@wp.kernel
def move_lines(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    lines: Lines,
    ground: Ground,
    change: wp.array(dtype=wp.vec3),
    turn_change: wp.array(dtype=wp.vec2),
    turn: wp.array(dtype=wp.vec2),
    # outputs
    move: wp.array(dtype=wp.vec3),
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    axis: wp.array(dtype=wp.vec3),
    displacement: wp.array(dtype=wp.vec3),
    turned: wp.array(dtype=wp.vec2),
):
    """Move every line in the direction that was found; its charges stay on the surface, and where its class may be."""
    i = first + wp.tid()
    kind = bodies.line[i]
    if kind < 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = spot_at(facet[i], weight[i], ground.facets)
    normal = ground.facets.normal[old.facet]
    half = wp.length(axis[i])
    along = axis[i] / wp.max(half, 1.0e-12)
    home = ground.home[tile_of(old.facet, old.weight, ground.facets)]
    d = direction[0] * move[i] + direction[1] * displacement[i] + direction[2] * change[i]
    e = direction[0] * turn[i] + direction[1] * turned[i] + direction[2] * turn_change[i]
    way = shortened(d, ground.step_limit[home])
    spin = wp.clamp(e[0], -LARGEST_TURN, LARGEST_TURN)
    wanted_length = lines.length[kind]
    length = wp.clamp(2.0 * half + e[1], SHORTEST_LINE * wanted_length, LONGEST_LINE * wanted_length)
    turned_axis = (0.5 * length) * (wp.cos(spin) * along + wp.sin(spin) * wp.cross(normal, along))

    new = walk(old.facet, old.weight, way, i, bodies.support[i], ground)
    new_axis = carried(turned_axis, normal, ground.facets.normal[new.facet])
    # Where the surface ends, lines stay on it as a whole.
    back = way_back(new.facet, new.weight, new_axis, i, bodies, ground)
    if wp.length_sq(back) > 0.0:
        inner = walk(new.facet, new.weight, back, i, bodies.support[i], ground)
        new_axis = carried(new_axis, ground.facets.normal[new.facet], ground.facets.normal[inner.facet])
        new = inner
    reached = wp.vec2(spin, length - 2.0 * half)
    if not line_fits(new.facet, new.weight, new_axis, i, bodies, ground):
        # The shift alone, then the turn alone.
        new_axis = carried(axis[i], normal, ground.facets.normal[new.facet])
        reached = wp.vec2(0.0, 0.0)
        if not line_fits(new.facet, new.weight, new_axis, i, bodies, ground):
            new = old
            new_axis = turned_axis
            reached = wp.vec2(spin, length - 2.0 * half)
            if not line_fits(new.facet, new.weight, new_axis, i, bodies, ground):
                new_axis = axis[i]
                reached = wp.vec2(0.0, 0.0)
    new_normal = ground.facets.normal[new.facet]
    # Turning into another plane keeps lengths but for rounding.
    new_axis = tangential(new_axis, new_normal)
    kept = 0.5 * (2.0 * half + reached[1])
    axis[i] = new_axis * (kept / wp.max(wp.length(new_axis), 1.0e-12))
    facet[i] = new.facet
    weight[i] = new.weight
    displacement[i] = carried(tangential(new.position - old.position, normal), normal, new_normal)
    move[i] = carried(move[i], normal, new_normal)
    turned[i] = reached
