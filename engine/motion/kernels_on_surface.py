"""Kernels that put bodies on a surface, and move them there."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import Points
from ..surface.kernels_facets import (
    SHORTER,
    Facets,
    Spot,
    carried,
    facet_of_tile,
    smooth_normal,
    spot_at,
    step_along,
    step_within,
    tangential,
    tile_of,
    weights_in_tile,
    without_outward,
)
from .kernels_descent import PINNED, Bodies, limited, squared_residual
from .kernels_direction import FIRST_SHARE, Sums, add_all
from .kernels_obstacles import OutlinesOnGround, inside_outlines

wp.set_module_options({"enable_backward": False})

# By this share of its depth a body must be less deep in an obstacle than before, and so much farther it goes than to the edge.
LESS_DEEP = wp.constant(0.01)
# Crumbs are parts of the surface for a few bodies each. What stands on them may be asked to go round them for ever, as few of them
# have the number that is asked for: in the sums over all bodies that would outweigh everything else. So each goes by its own forces,
# and by this share of its last way; in a step at most this share of the longest one, and in all so many longest ones. Measured on a
# ball with 40 balls of a fifth of a body each beside it: smallest spacings on the large one are 0.66 instead of 0.34 to 0.63, and it
# settles. On 200 cards for seven bodies each, and nothing else, they are as even as by the sums with a half, a tenth closer with 0.
CRUMB_MEMORY = wp.constant(0.5)
CRUMB_STEP = wp.constant(0.3)
CRUMB_WAY = wp.constant(4.0)


@wp.struct
class Ground:
    """The surface for the descent.

    Facets; the home node of every tile; on which tiles bodies of a class may be, class after class; and for every node how far bodies
    may move in a step and, group after group, the inverse of the energy's curvature. Balls that bodies keep out of, center and radius,
    and obstacles that are outlines; and by how much more every body keeps off balls, and off outlines. The label of crumbs, or -1.
    """

    facets: Facets
    tile_count: wp.int32
    node_count: wp.int32
    home: wp.array(dtype=wp.int32)
    full: wp.array(dtype=wp.uint8)
    step_limit: wp.array(dtype=float)
    step_length: wp.array(dtype=float)
    ball_count: wp.int32
    balls: wp.array(dtype=wp.vec4)
    clear: wp.array(dtype=wp.vec2)
    outlines: OutlinesOnGround
    crumbs: wp.int32


@wp.struct
class Charges:
    """Where the charges are: as points (the label is that of the part), by facets, and the nodes that are their homes.

    And the field at each.
    """

    points: Points
    facet: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec2)
    home: wp.array(dtype=wp.int32)
    field: wp.array(dtype=wp.vec3)


@wp.struct
class Poses:
    """Where bodies are: facet, weights of its second and third corner, and half the axis of a line along the surface.

    And how far every charge stands beside its line's axis.
    """

    facet: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec2)
    axis: wp.array(dtype=wp.vec3)
    bend: wp.array(dtype=float)


@wp.struct
class Motion:
    """Of every body: what the last step changed of its position, the move that the forces ask for, and what that changed by.

    And the same of a line's angle and length: ``turned``, ``turn``, ``turn_change``. Of a dot on a crumb the second number of
    ``turned`` is how far it has come.
    """

    displacement: wp.array(dtype=wp.vec3)
    move: wp.array(dtype=wp.vec3)
    change: wp.array(dtype=wp.vec3)
    turned: wp.array(dtype=wp.vec2)
    turn: wp.array(dtype=wp.vec2)
    turn_change: wp.array(dtype=wp.vec2)


@wp.func
def may_stand(facet: int, weight: wp.vec2, class_index: int, ground: Ground):
    tile = tile_of(facet, weight, ground.facets)
    return ground.full[class_index * ground.tile_count + tile] != wp.uint8(0)


@wp.func
def along_balls(way: wp.vec3, place: wp.vec3, clear: float, ground: Ground):
    """``way`` without what leads into a ball."""
    left = way
    for k in range(ground.ball_count):
        ball = ground.balls[k]
        out = place - wp.vec3(ball[0], ball[1], ball[2])
        away = wp.length(out)
        if away > 0.0:
            out = out / away
            # What is left of the way to the ball may be gone.
            inward = -wp.dot(left, out) - wp.max(away - ball[3] - clear, 0.0)
            left = left + wp.max(inward, 0.0) * out
    return left


@wp.func
def in_ball(place: wp.vec3, clear: float, ground: Ground):
    inside = bool(False)
    for k in range(ground.ball_count):
        ball = ground.balls[k]
        if wp.length(place - wp.vec3(ball[0], ball[1], ball[2])) < ball[3] + clear:
            inside = True
    return inside


@wp.func
def may_be(spot: Spot, class_index: int, clear: float, ground: Ground):
    if in_ball(spot.position, clear, ground):
        return False
    return may_stand(spot.facet, spot.weight, class_index, ground)


@wp.func
def walk(facet: int, weight: wp.vec2, way: wp.vec3, body: int, class_index: int, ground: Ground):
    """Where a body ends that goes ``way``: it stays on its sheet, where its class may be, and slides along obstacles."""
    clear = float(0.0)
    onwards = way
    if ground.ball_count > 0:
        clear = ground.clear[body][0]
        start = spot_at(facet, weight, ground.facets)
        onwards = tangential(along_balls(way, start.position, clear, ground), ground.facets.normal[facet])
    new = step_along(facet, weight, onwards, ground.facets)
    if ground.outlines.count > 0:
        return beside_outlines(new, facet, weight, onwards, body, class_index, clear, ground)
    if not may_be(new, class_index, clear, ground):
        new = step_along(facet, weight, SHORTER * onwards, ground.facets)
        if not may_be(new, class_index, clear, ground):
            new = spot_at(facet, weight, ground.facets)
    return new


@wp.func
def beside_outlines(
    wanted: Spot,
    facet: int,
    weight: wp.vec2,
    way: wp.vec3,
    body: int,
    class_index: int,
    clear: float,
    ground: Ground,
):
    """Where a body ends that wants to be somewhere: out of outlines, or less deep in them than it was."""
    facets = ground.facets
    room = ground.clear[body][1]
    here = spot_at(facet, weight, facets)
    inside = inside_outlines(wanted, room, facets, ground.outlines)
    free = may_be(wanted, class_index, clear, ground)
    if free and inside.depth <= 0.0:
        return wanted
    # Whoever is in one already, as where an obstacle has come, may go where it is less so.
    stuck = inside_outlines(here, room, facets, ground.outlines)
    most = wp.max((1.0 - LESS_DEEP) * stuck.depth, 0.0)
    result = here
    found = bool(False)
    # A number that the compiler does not know: it would compile every attempt by itself.
    attempts = int(4)
    for attempt in range(attempts):
        if not found:
            onwards = way
            if attempt == 1:
                # Along the outline.
                onwards = way + (1.0 + LESS_DEEP) * inside.depth * inside.out
            elif attempt == 2:
                onwards = SHORTER * way
            elif attempt == 3:
                onwards = (1.0 + LESS_DEEP) * stuck.depth * stuck.out
            new = step_along(facet, weight, tangential(onwards, facets.normal[facet]), facets)
            if may_be(new, class_index, clear, ground):
                if inside_outlines(new, room, facets, ground.outlines).depth <= most:
                    result = new
                    found = True
    return result


@wp.kernel
def place_on_tiles(
    first: int,
    group: wp.array(dtype=wp.int32),
    rank: wp.array(dtype=wp.int32),
    identity: wp.array(dtype=wp.int32),
    class_index: wp.array(dtype=wp.int32),
    group_shift: wp.array(dtype=wp.float64),
    running: wp.array(dtype=wp.float64),
    first_tile: wp.array(dtype=wp.int32),
    first_rank: wp.array(dtype=wp.int32),
    part_count: int,
    tile_count: int,
    facet_count: int,
    facets: Facets,
    seed: int,
    # outputs
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
):
    """Put every body at an even step of the running sum of its class's density over the tiles, at random within its tile.

    Parts between which bodies cannot move take whole numbers of them: those of a group from ``first_rank`` of a part to that of the
    next one, on the tiles from ``first_tile`` on.
    """
    i = first + wp.tid()
    g = group[i]
    state = wp.rand_init(seed, identity[i])
    along = group_shift[g] + wp.float64(0.5 * wp.randf(state))
    base = class_index[i] * tile_count
    part = int(0)
    last = part_count - 1
    own_ranks = g * (part_count + 1)
    while part < last:
        middle = (part + last) / 2
        if first_rank[own_ranks + middle + 1] > rank[i]:
            last = middle
        else:
            part = middle + 1
    begin = first_rank[own_ranks + part]
    bodies = wp.float64(wp.max(first_rank[own_ranks + part + 1] - begin, 1))
    before = wp.float64(0.0)
    if first_tile[part] > 0:
        before = running[base + first_tile[part] - 1]
    step = (wp.float64(rank[i] - begin) + along - wp.floor(along)) / bodies
    wanted = before + step * (running[base + first_tile[part + 1] - 1] - before)
    # The first tile whose sum is above what is wanted: one that is not empty.
    low = first_tile[part]
    high = first_tile[part + 1] - 1
    while low < high:
        middle = (low + high) / 2
        if running[base + middle] > wanted:
            high = middle
        else:
            low = middle + 1
    own = facet_of_tile(low, facet_count, facets.first_tile)
    u = wp.randf(state)
    v = wp.randf(state)
    if u + v > 1.0:
        u = 1.0 - u
        v = 1.0 - v
    # Not on the sides, where rounding might leave the tile.
    within = wp.vec2(1.0 / 3.0 + 0.998 * (u - 1.0 / 3.0), 1.0 / 3.0 + 0.998 * (v - 1.0 / 3.0))
    facet[i] = own
    weight[i] = weights_in_tile(low - facets.first_tile[own], facets.cuts[own], within)


@wp.kernel
def place_dots(
    first: int,
    poses: Poses,
    bodies: Bodies,
    ground: Ground,
    # outputs
    charges: Charges,
):
    """Put the charges of dots where these are."""
    i = first + wp.tid()
    if bodies.kind[i] >= 0:
        return
    put_charge(bodies.first_charge[i], poses.facet[i], poses.weight[i], ground, charges)


@wp.func
def put_charge(j: int, facet: int, weight: wp.vec2, ground: Ground, charges: Charges):
    spot = spot_at(facet, weight, ground.facets)
    charges.facet[j] = facet
    charges.weight[j] = weight
    charges.points.position[j] = spot.position
    charges.points.normal[j] = smooth_normal(facet, weight, ground.facets)
    charges.home[j] = ground.home[tile_of(facet, weight, ground.facets)]


@wp.func
def is_crumb(facet: int, ground: Ground):
    # Both sides of an `and` are found in any case.
    if ground.crumbs < 0:
        return False
    return ground.facets.label[facet] == ground.crumbs


@wp.func
def way_on_crumb(i: int, limit: float, motion: Motion):
    """The next way of dot ``i`` by its own forces, at a place where no step is longer than ``limit``."""
    come = motion.turned[i][1]
    asked = FIRST_SHARE * motion.move[i] + CRUMB_MEMORY * motion.displacement[i]
    way = limited(asked, wp.clamp(CRUMB_WAY * limit - come, 0.0, CRUMB_STEP * limit))
    motion.turned[i] = wp.vec2(motion.turned[i][0], come + wp.length(way))
    return way


@wp.kernel
def propose_dots(
    first: int,
    thread: int,
    charges: Charges,
    bodies: Bodies,
    ground: Ground,
    in_contact: int,
    # outputs
    motion: Motion,
    sums: wp.array3d(dtype=wp.int64),
):
    """The move along the surface that the force on every dot asks for, and what it changed by since the last step."""
    i = first + wp.tid()
    if bodies.kind[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    j = bodies.first_charge[i]
    force = without_outward(charges.field[j], charges.facet[j], charges.weight[j], ground.facets)
    home = charges.home[j]
    length = ground.step_length[bodies.group[i] * ground.node_count + home]
    limit = ground.step_limit[home]
    # Beyond a spacing no move is more than a direction.
    new = limited(force * length, 2.0 * limit)
    changed = motion.move[i] - new
    way = motion.displacement[i]
    motion.move[i] = new
    motion.change[i] = changed
    weight = bodies.charge[j] / length
    # Whoever rests has settled, there as in contact.
    may_rest = in_contact
    if is_crumb(charges.facet[j], ground):
        weight = 0.0
        may_rest = 1
    rest = squared_residual(wp.length_sq(new), wp.length_sq(way), limit, may_rest)
    add_all(
        sums,
        thread,
        i,
        Sums(
            weight * wp.dot(way, changed),
            weight * wp.dot(way, way),
            weight * wp.dot(changed, changed),
            weight * wp.dot(way, new),
            weight * wp.dot(changed, new),
            weight * wp.dot(new, new),
            rest,
        ),
    )


@wp.func
def remembered(i: int, way: wp.vec3, normal: wp.vec3, new_normal: wp.vec3, motion: Motion):
    """Turn what body ``i`` remembers of the way there into the plane that touches the surface where it is now."""
    motion.displacement[i] = carried(way, normal, new_normal)
    motion.move[i] = carried(motion.move[i], normal, new_normal)


@wp.kernel
def move_dots(
    first: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    ground: Ground,
    # outputs
    motion: Motion,
    poses: Poses,
    charges: Charges,
):
    """Move every dot in the direction that :func:`~.kernels_direction.decide_direction` found."""
    i = first + wp.tid()
    if bodies.kind[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    j = bodies.first_charge[i]
    limit = ground.step_limit[charges.home[j]]
    way = wp.vec3()
    if is_crumb(poses.facet[i], ground):
        way = way_on_crumb(i, limit, motion)
    else:
        d = direction[0] * motion.move[i] + direction[1] * motion.displacement[i] + direction[2] * motion.change[i]
        way = limited(d, limit)
    old = charges.points.position[j]
    normal = ground.facets.normal[poses.facet[i]]
    facet = poses.facet[i]
    weight = poses.weight[i]
    new = Spot()
    new.facet = -1
    # Most steps end on their facet: a walk, which may go anywhere, takes several times as long.
    if ground.ball_count == 0 and ground.outlines.count == 0:
        new = step_within(facet, weight, way, ground.facets)
    stays = new.facet >= 0
    if stays:
        stays = may_stand(facet, new.weight, bodies.support[i], ground)
    if not stays:
        new = walk(facet, weight, way, i, bodies.support[i], ground)
    poses.facet[i] = new.facet
    poses.weight[i] = new.weight
    remembered(i, tangential(new.position - old, normal), normal, ground.facets.normal[new.facet], motion)
    put_charge(j, new.facet, new.weight, ground, charges)
