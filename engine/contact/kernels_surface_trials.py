"""Kernels that try other places and other turns on a surface for bodies that overlap others where they are."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at
from ..motion.kernels_descent import Bodies
from ..motion.kernels_lying import cell_of_block, slot_of_level
from ..motion.kernels_on_surface import may_be
from ..motion.kernels_surface_lines import line_fits, way_back
from ..space.kernels_meeting import keep_apart
from ..surface.kernels_facets import Spot, carried, smooth_normal, spot_at, step_along, tangential, tile_of
from .kernels_surface_separation import (
    Standing,
    SurfaceCrowd,
    angle_between,
    copy_corners,
    direction_at,
    glance_at,
    in_cell,
    standing_of,
)
from .kernels_touch import depth_of_overlap
from .kernels_trials import PINNED_COST, TOLERABLE, Bins, Trials

wp.set_module_options({"enable_backward": False})

# How far a place that is tried around a body is from it at most, in its reaches: at first, and at last.
NEAREST_AROUND, FARTHEST_AROUND = wp.constant(0.5), wp.constant(8.0)


@wp.struct
class Pool:
    """Places on the surface, class after class: facet, weights of its second and third corner; and where those of a class begin."""

    facet: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec2)
    start: wp.array(dtype=wp.int32)


@wp.struct
class SurfacePlaces:
    """The best place of every lane: facet, weights, and where the x axis points; the squared overlaps there, and how far it is.

    The facet is -1 where none is better than to lie in what cannot give way.
    """

    facet: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec2)
    axis: wp.array(dtype=wp.vec3)
    cost: wp.array(dtype=float)
    distance: wp.array(dtype=float)


@wp.func
def squared_overlap(i: int, room_of: int, here: Standing, j: int, crowd: SurfaceCrowd):
    """Squared overlap that body i would have somewhere with body j, in the smaller width of the two."""
    outlines = crowd.outlines
    seen = glance_at(i, here, j, crowd)
    depth = float(0.0)
    if seen.met != 0:
        copied = copy_corners(room_of, j, seen.turned, crowd)
        depth = depth_of_overlap(i, outlines.first_corner[i], j, copied, seen.way, outlines)
        depth = depth / wp.min(outlines.width[i], outlines.width[j])
        if outlines.lightness[j] == 0.0 and depth > TOLERABLE:
            # It cannot give way.
            return depth * depth + PINNED_COST
    return depth * depth


@wp.func
def cost_with_cell(
    before: float,
    i: int,
    room_of: int,
    here: Standing,
    without: int,
    most: float,
    cell: wp.vec3i,
    m: int,
    crowd: SurfaceCrowd,
):
    """What there was before, and the squared overlaps that body i would have somewhere with the bodies of a cell, but for one."""
    total = before
    outlines = crowd.outlines
    slot = slot_of_level(cell, m, crowd.slots.mask)
    for s in range(crowd.slots.start[slot], crowd.slots.start[slot + 1]):
        j = crowd.slots.order[s]
        within = outlines.reach[i] + outlines.reach[j]
        near = wp.length_sq(crowd.position[j] - here.position) < within * within and keep_apart(i, j, crowd.meeting)
        if near and j != i and j != without and total < most and in_cell(j, cell, m, crowd):
            total += squared_overlap(i, room_of, here, j, crowd)
    return total


@wp.func
def cost_of_standing(i: int, room_of: int, here: Standing, without: int, most: float, crowd: SurfaceCrowd):
    """Squared overlaps that body i would have somewhere with all others but one; ``most`` or more where they are more.

    Copies of corners go where there is room for those that body ``room_of`` sees.
    """
    total = float(0.0)
    for m in range(crowd.level_count):
        reach = crowd.outlines.reach[i] + crowd.level_size[m][0]
        low = cell_at(here.position - wp.vec3(reach, reach, reach), crowd.level_size[m][1])
        high = cell_at(here.position + wp.vec3(reach, reach, reach), crowd.level_size[m][1])
        counts = high - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            if total < most:
                cell = low + cell_of_block(number, counts)
                total = cost_with_cell(total, i, room_of, here, without, most, cell, m, crowd)
    return total


@wp.func
def in_place_of(i: int, j: int, crowd: SurfaceCrowd):
    """How body i stands in the place of body j: turned there as it is here."""
    normal = crowd.ground.facets.normal[crowd.facet[i]]
    result = standing_of(j, crowd)
    heading = angle_between(crowd.frame[crowd.facet[i]], carried(crowd.along[i], crowd.normal[i], normal), normal)
    there = crowd.ground.facets.normal[result.facet]
    result.along = carried(direction_at(heading, result.facet, crowd), there, result.normal)
    return result


@wp.kernel
def propose_swaps_on_surface(
    first: int,
    stuck: wp.array(dtype=wp.int32),
    bins: Bins,
    candidates: int,
    keep: float,
    seed: int,
    crowd: SurfaceCrowd,
    cost: wp.array(dtype=float),
    # outputs
    partner: wp.array(dtype=wp.int32),
    gain: wp.array(dtype=float),
):
    """The body of its bin with which a stuck one had best trade places, and by how much their squared overlaps fall; -1: none."""
    q = first + wp.tid()
    i = stuck[q]
    outlines = crowd.outlines
    begin = bins.start[bins.bin[i]]
    end = bins.start[bins.bin[i] + 1]
    state = wp.rand_init(seed, i)
    best = float(0.0)
    chosen = int(-1)
    if end - begin > 1:
        for _candidate in range(candidates):
            j = bins.member[wp.randi(state, begin, end)]
            apart_by = outlines.reach[i] + outlines.reach[j]
            if j != i and wp.length_sq(crowd.position[j] - crowd.position[i]) > 4.0 * apart_by * apart_by:
                before = cost[i] + cost[j]
                # As much may be left at most.
                most = keep * before - best
                after = cost_of_standing(i, i, in_place_of(i, j, crowd), j, most, crowd)
                if after < most:
                    # Others may try something for body j at the same time.
                    after += cost_of_standing(j, i, in_place_of(j, i, crowd), i, most - after, crowd)
                if after < most:
                    best = keep * before - after
                    chosen = j
    partner[q] = chosen
    gain[q] = best


@wp.kernel
def find_costs_on_surface(
    first: int,
    crowd: SurfaceCrowd,
    # outputs
    cost: wp.array(dtype=float),
):
    """Squared overlaps of every body."""
    i = first + wp.tid()
    cost[i] = cost_of_standing(i, i, standing_of(i, crowd), i, 1.0e30, crowd)


@wp.kernel
def propose_turns_on_surface(
    first: int,
    trials: int,
    keep: float,
    seed: int,
    cost: wp.array(dtype=float),
    crowd: SurfaceCrowd,
    # outputs
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
):
    """By how much a body that overlaps others had best turn to overlap them least, and by how much its squared overlaps fall."""
    i = first + wp.tid()
    outlines = crowd.outlines
    best = float(0.0)
    chosen = float(0.0)
    if cost[i] > 0.0 and outlines.ease[i] > 0.0 and outlines.length[i] == 0.0:
        here = standing_of(i, crowd)
        along = here.along
        beside = wp.cross(here.normal, along)
        state = wp.rand_init(seed, i)
        for _trial in range(trials):
            trial = wp.randf(state, 0.0, 2.0 * wp.pi)
            here.along = wp.cos(trial) * along + wp.sin(trial) * beside
            # As much may be left at most.
            most = keep * cost[i] - best
            after = cost_of_standing(i, i, here, i, most, crowd)
            if after < most:
                best = keep * cost[i] - after
                chosen = trial
    angle[i] = chosen
    gain[i] = best


@wp.func
def gains_most_of_cell(i: int, reach: float, cell: wp.vec3i, m: int, gain: wp.array(dtype=float), crowd: SurfaceCrowd):
    """Whether none of the bodies of a cell that may touch body i gains more than it does, or as much with a smaller number."""
    best = bool(True)
    slot = slot_of_level(cell, m, crowd.slots.mask)
    for s in range(crowd.slots.start[slot], crowd.slots.start[slot + 1]):
        j = crowd.slots.order[s]
        if gain[j] > gain[i] or (gain[j] == gain[i] and j < i):
            within = reach + crowd.outlines.reach[j]
            near = wp.length_sq(crowd.position[j] - crowd.position[i]) < within * within
            if near and in_cell(j, cell, m, crowd):
                best = False
    return best


@wp.kernel
def accept_turns_on_surface(
    first: int,
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
    # outputs
    crowd: SurfaceCrowd,
    turned: wp.array(dtype=wp.int32),
):
    """Turn those that gain more than all others within reach: of two that may touch only one turns at a time."""
    i = first + wp.tid()
    at = crowd.position[i]
    best = gain[i] > 0.0
    for m in range(crowd.level_count):
        own = crowd.outlines.reach[i]
        reach = own + crowd.level_size[m][0]
        low = cell_at(at - wp.vec3(reach, reach, reach), crowd.level_size[m][1])
        counts = cell_at(at + wp.vec3(reach, reach, reach), crowd.level_size[m][1]) - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            if best:
                best = gains_most_of_cell(i, own, low + cell_of_block(number, counts), m, gain, crowd)
    turned[i] = int(best)
    if best:
        along = crowd.along[i]
        beside = wp.cross(crowd.normal[i], along)
        crowd.along[i] = wp.cos(angle[i]) * along + wp.sin(angle[i]) * beside


@wp.func
def preferred_at(i: int, spot: Spot, bodies: Bodies, preferred: wp.array(dtype=wp.vec3), crowd: SurfaceCrowd):
    """The direction that body i is to lie along somewhere, in the plane of the facet there; 0 where it has none."""
    result = wp.vec3(0.0, 0.0, 0.0)
    kind = bodies.kind[crowd.outlines.body[i]]
    if kind >= 0:
        ground = crowd.ground
        way = preferred[kind * ground.tile_count + tile_of(spot.facet, spot.weight, ground.facets)]
        way = tangential(way, ground.facets.normal[spot.facet])
        size = wp.length(way)
        if size > 1.0e-6:
            result = way / size
    return result


@wp.func
def turn_from_preferred(i: int, bodies: Bodies, preferred: wp.array(dtype=wp.vec3), crowd: SurfaceCrowd):
    """How body i lies to the direction that it prefers where it is, and 1; 0 and 0 where it prefers none."""
    spot = spot_at(crowd.facet[i], crowd.weight[i], crowd.ground.facets)
    normal = crowd.ground.facets.normal[spot.facet]
    way = preferred_at(i, spot, bodies, preferred, crowd)
    result = wp.vec2(0.0, 0.0)
    if wp.length_sq(way) > 0.0:
        result = wp.vec2(angle_between(way, carried(crowd.along[i], crowd.normal[i], normal), normal), 1.0)
    return result


@wp.func
def direction_of_trial(
    i: int,
    spot: Spot,
    angle: float,
    led: wp.vec2,
    bodies: Bodies,
    preferred: wp.array(dtype=wp.vec3),
    crowd: SurfaceCrowd,
):
    """Where the x axis of body i points somewhere, in the plane of the facet there: as it is led, as was given, or by an angle."""
    heading = crowd.heading[i]
    if crowd.outlines.ease[i] > 0.0:
        heading = angle
    result = direction_at(heading, spot.facet, crowd)
    if led[1] > 0.0:
        way = preferred_at(i, spot, bodies, preferred, crowd)
        if wp.length_sq(way) > 0.0:
            beside = wp.cross(crowd.ground.facets.normal[spot.facet], way)
            result = wp.cos(led[0]) * way + wp.sin(led[0]) * beside
    return result


@wp.func
def has_room(i: int, spot: Spot, along: wp.vec3, bodies: Bodies, bend: wp.array(dtype=float), crowd: SurfaceCrowd):
    """Whether body i, with its middle at a spot, is where its class may be; of a line all of it, and that on the surface."""
    body = crowd.outlines.body[i]
    fits = may_be(spot, bodies.support[body], crowd.ground.clear[body][0], crowd.ground)
    if fits and bodies.kind[body] >= 0:
        axis = (0.5 * crowd.outlines.length[i]) * along
        back = way_back(spot.facet, spot.weight, axis, body, bodies, bend, crowd.ground)
        fits = wp.length_sq(back) == 0.0
        if fits:
            fits = line_fits(spot.facet, spot.weight, axis, body, bodies, bend, crowd.ground)
    return fits


@wp.func
def spot_around(i: int, share: float, state: wp.uint32, crowd: SurfaceCrowd):
    """A place around body i: at random, the farther the larger the share (0..1) of those that have been tried."""
    # Two draws, one after the other: an expression's parts have no order of their own.
    turn = wp.randf(state, 0.0, 2.0 * wp.pi)
    ahead = wp.sqrt(wp.randf(state))
    far = crowd.outlines.reach[i] * NEAREST_AROUND * wp.pow(FARTHEST_AROUND / NEAREST_AROUND, share)
    facets = crowd.ground.facets
    normal = facets.normal[crowd.facet[i]]
    along = carried(crowd.along[i], crowd.normal[i], normal)
    way = (far * ahead) * (wp.cos(turn) * along + wp.sin(turn) * wp.cross(normal, along))
    return step_along(crowd.facet[i], crowd.weight[i], way, facets)


@wp.func
def standing_at(spot: Spot, along: wp.vec3, crowd: SurfaceCrowd):
    """How a body stands somewhere whose x axis points along this, in the plane of the facet there."""
    facets = crowd.ground.facets
    result = Standing()
    result.position = spot.position
    result.facet = spot.facet
    result.normal = smooth_normal(spot.facet, spot.weight, facets)
    result.along = carried(along, facets.normal[spot.facet], result.normal)
    return result


@wp.kernel
def propose_places_on_surface(
    first: int,
    trials: Trials,
    pool: Pool,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    preferred: wp.array(dtype=wp.vec3),
    crowd: SurfaceCrowd,
    # outputs
    places: SurfacePlaces,
):
    """Where a stuck body overlaps the least, or the nearest place where it does not.

    Places are those of a pool, and as many around it, where the gaps may be narrower than the pool is dense. Who may turn is turned at
    random; a line that prefers a direction lies there as it lies to that here.
    """
    q = first + wp.tid()
    lanes = trials.lanes
    lane = q % lanes
    i = trials.stuck[q / lanes]
    support = bodies.support[crowd.outlines.body[i]]
    begin = pool.start[support]
    count = pool.start[support + 1] - begin
    # Where it begins along the pool is the same for all lanes.
    drawn = wp.rand_init(trials.seed, i)
    along_curve = wp.randi(drawn, 0, wp.max(count, 1))
    state = drawn
    if lane > 0:
        state = wp.rand_init(trials.seed + lane, i)
    led = turn_from_preferred(i, bodies, preferred, crowd)
    least = float(PINNED_COST)
    far = float(1.0e30)
    best = int(-1)
    best_weight = crowd.weight[i]
    best_axis = crowd.along[i]
    for candidate in range(lane, wp.min(trials.candidates, count), lanes):
        at = begin + (along_curve + candidate) % count
        # Drawn whether it is used or not.
        angle = wp.randf(state, 0.0, 2.0 * wp.pi)
        spot = spot_at(pool.facet[at], pool.weight[at], crowd.ground.facets)
        if (candidate / lanes) % 2 == 1:
            spot = spot_around(i, float(candidate) / float(trials.candidates), state, crowd)
        away = wp.length(spot.position - crowd.position[i])
        free = TOLERABLE * TOLERABLE
        if least > free or away < far:
            there = direction_of_trial(i, spot, angle, led, bodies, preferred, crowd)
            here = standing_at(spot, there, crowd)
            if has_room(i, spot, there, bodies, bend, crowd):
                most = wp.max(least, free)
                # One body's corners may be turned by many at once.
                found = cost_of_standing(i, wp.where(lanes > 1, q, i), here, i, most, crowd)
                if found < most:
                    least = found
                    far = away
                    best = spot.facet
                    best_weight = spot.weight
                    best_axis = here.along
    places.facet[q] = best
    places.weight[q] = best_weight
    places.axis[q] = best_axis
    places.cost[q] = least
    places.distance[q] = far
