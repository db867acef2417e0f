"""Kernels that try other places and other turns for bodies that overlap others where they are."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import Bodies, vector_into_support
from ..space.kernels_images import Images, in_support
from ..space.kernels_meeting import keep_apart
from ..space.kernels_neighborhood import LANES, SAFELY, bodies_of_run, cells_around, lowest_bit, next_near, run_count
from ..space.kernels_space import confine, difference
from .kernels_outlines import Outlines, turned_corner, wall_contact
from .kernels_pairs import Crowd
from .kernels_separation import WALL_COST
from .kernels_touch import depth_of_overlap

wp.set_module_options({"enable_backward": False})

# What overlapping a body that cannot give way costs beside it, more than all else: nobody goes to such a place. And the depth from
# which on it counts, in widths of the narrower one.
PINNED_COST = 1e3
TOLERABLE = 1e-3
# How far a place that is tried may be, in reaches of the body: near ones are tried first.
NEAREST_PLACE, FARTHEST_PLACE = 1.0, 30.0


@wp.struct
class Bins:
    """Bodies that may trade places: the bin of every body, and the members of all bins, those of a bin from ``start`` on."""

    bin: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)
    member: wp.array(dtype=wp.int32)


@wp.struct
class Trials:
    """Which stuck bodies places are tried for; so many ``lanes`` share the ``candidates`` of each, and find the best of their own."""

    stuck: wp.array(dtype=wp.int32)
    lanes: wp.int32
    candidates: wp.int32
    seed: wp.int32


@wp.struct
class Places:
    """The best place of every lane (x, y, turn), the squared overlaps there, and which share (0..1) of all trials comes before it."""

    place: wp.array(dtype=wp.vec3)
    cost: wp.array(dtype=float)
    share: wp.array(dtype=float)


@wp.struct
class Supports:
    """What says where bodies may be: what they are, how they bend, and the images of their densities' supports."""

    bodies: Bodies
    bend: wp.array(dtype=float)
    images: Images


@wp.func
def cost_of_walls(i: int, corners: int, at: wp.vec2, outlines: Outlines, size: wp.vec2):
    """What body i would stand out over the edges of the domain, squared."""
    total = float(0.0)
    for side in range(4):
        depth, _n, _lever = wall_contact(i, corners, side, at, outlines, size)
        depth = wp.max(depth, 0.0) / outlines.width[i]
        total += WALL_COST * depth * depth
    return total


@wp.func
def comes_near(j: int, at: wp.vec2, reach: float, outlines: Outlines):
    """Whether a disc at a place seen from body j may touch its outline: quickly told of long ones, near which most bodies are not."""
    begin = outlines.first_corner[j]
    end = outlines.first_corner[j + 1]
    away = reach + outlines.rounding[j]
    near = bool(True)
    if end - begin > 1:
        for k in range(begin, end):
            v = outlines.corner[k]
            if v[2] * (at[0] - v[0]) + v[3] * (at[1] - v[1]) > away:
                near = False
    return near


@wp.func
def cost_of_pair(i: int, corners: int, j: int, d: wp.vec2, outlines: Outlines):
    """The squared overlap of body i with body j at a place relative to it, and more where that one cannot give way."""
    depth = depth_of_overlap(i, corners, j, outlines.first_corner[j], d, outlines)
    if depth <= 0.0:
        return 0.0
    depth = depth / wp.min(outlines.width[i], outlines.width[j])
    if outlines.lightness[j] == 0.0 and depth > TOLERABLE:
        return depth * depth + PINNED_COST
    return depth * depth


@wp.func
def cost_with(before: float, i: int, corners: int, at: wp.vec2, j: int, crowd: Crowd):
    """What there was before, and the squared overlaps that body i would have at a place with body j and its images."""
    total = before
    outlines = crowd.outlines
    space = crowd.neighbors.grid.space
    short = difference(at, wp.vec2(crowd.pose[j][0], crowd.pose[j][1]), space)
    within = outlines.reach[i] + outlines.reach[j]
    for y in range(-crowd.images[1], crowd.images[1] + 1):
        for x in range(-crowd.images[0], crowd.images[0] + 1):
            d = wp.vec2(short[0] + float(x) * space.size[0], short[1] + float(y) * space.size[1])
            if wp.length_sq(d) < within * within and comes_near(j, -d, outlines.reach[i], outlines):
                total += cost_of_pair(i, corners, j, d, outlines)
    return total


@wp.func
def cost_with_run(
    before: float, i: int, corners: int, without: int, at: wp.vec2, most: float, members: wp.vec2i, crowd: Crowd
):
    """The same with the bodies of a run of cells, but for one of them; looks no further once there is ``most`` or more."""
    total = before
    reach = crowd.outlines.reach[i]
    for start in range(members[0], members[1], LANES):
        found = next_near(at, reach, SAFELY, start, members[1], crowd.neighbors)
        while found != 0 and total < most:
            s = start + lowest_bit(found)
            found = found & (found - 1)
            j = crowd.neighbors.bodies.body[s]
            if j != i and j != without and keep_apart(i, j, crowd.neighbors.footprints.meeting):
                total = cost_with(total, i, corners, at, j, crowd)
    return total


@wp.func
def cost_of_place(i: int, corners: int, without: int, at: wp.vec2, most: float, crowd: Crowd):
    """Squared overlaps that body i would have at a place with all others but one; ``most`` or more where they are more.

    ``corners`` is the first of its corners: as it is turned, or as it might be.
    """
    total = float(0.0)
    neighbors = crowd.neighbors
    reach = crowd.outlines.reach[i]
    if crowd.inset != 0:
        total = cost_of_walls(i, corners, at, crowd.outlines, neighbors.grid.space.size)
    for m in range(neighbors.grid.level_count):
        around = cells_around(at, reach + neighbors.grid.reach[m], m, neighbors)
        for run in range(run_count(around)):
            if total < most:
                members = bodies_of_run(run, around, neighbors)
                total = cost_with_run(total, i, corners, without, at, most, members, crowd)
    return total


@wp.func
def left_by_swap(i: int, j: int, most: float, crowd: Crowd):
    """Squared overlaps of two bodies that have traded places; ``most`` or more where they are more."""
    space = crowd.neighbors.grid.space
    own = confine(wp.vec2(crowd.pose[i][0], crowd.pose[i][1]), space)
    there = confine(wp.vec2(crowd.pose[j][0], crowd.pose[j][1]), space)
    after = cost_of_place(i, crowd.outlines.first_corner[i], j, there, most, crowd)
    if after < most:
        after += cost_of_place(j, crowd.outlines.first_corner[j], i, own, most - after, crowd)
    return after


@wp.kernel
def propose_swaps(
    first: int,
    stuck: wp.array(dtype=wp.int32),
    bins: Bins,
    candidates: int,
    keep: float,
    seed: int,
    crowd: Crowd,
    cost: wp.array(dtype=float),
    # outputs
    partner: wp.array(dtype=wp.int32),
    gain: wp.array(dtype=float),
):
    """The body of its bin with which a stuck one had best trade places, and by how much their squared overlaps fall; -1: none."""
    q = first + wp.tid()
    i = stuck[q]
    outlines = crowd.outlines
    own = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    begin = bins.start[bins.bin[i]]
    end = bins.start[bins.bin[i] + 1]
    state = wp.rand_init(seed, i)
    best = float(0.0)
    chosen = int(-1)
    if end - begin > 1:
        for _candidate in range(candidates):
            j = bins.member[wp.randi(state, begin, end)]
            there = wp.vec2(crowd.pose[j][0], crowd.pose[j][1])
            apart_by = outlines.reach[i] + outlines.reach[j]
            d = difference(own, there, crowd.neighbors.grid.space)
            if j != i and wp.length_sq(d) > 4.0 * apart_by * apart_by:
                before = cost[i] + cost[j]
                # As much may be left at most.
                most = keep * before - best
                after = left_by_swap(i, j, most, crowd)
                if after < most:
                    best = keep * before - after
                    chosen = j
    partner[q] = chosen
    gain[q] = best


@wp.func
def turn_trial(i: int, angle: float, corners: int, outlines: Outlines):
    """Write corners of body i as they would be at an angle, from ``corners`` on."""
    c = wp.cos(angle + outlines.offset[i])
    s = wp.sin(angle + outlines.offset[i])
    start = outlines.shape_start[outlines.shape[i]]
    for k in range(outlines.first_corner[i + 1] - outlines.first_corner[i]):
        outlines.corner[corners + k] = turned_corner(
            outlines.shape_corner[start + k], outlines.factor[i], c, s, outlines.slope[i]
        )


@wp.func
def lies_in_support(i: int, at: wp.vec2, angle: float, supports: Supports, crowd: Crowd):
    """Whether body i may be at a place, with its axis if it has one."""
    body = crowd.outlines.body[i]
    bodies = supports.bodies
    support = bodies.support[body]
    space = crowd.neighbors.grid.space
    inside = in_support(at, support, supports.images, space.size)
    if inside and bodies.kind[body] >= 0:
        pose = wp.vec4(at[0], at[1], angle, crowd.outlines.length[i])
        begin = bodies.first_charge[body]
        end = bodies.first_charge[body + 1]
        back = vector_into_support(pose, begin, end, bodies, supports.bend, support, supports.images, space)
        inside = back[2] == 0.0
    return inside


@wp.kernel
def find_outside(
    first: int,
    supports: Supports,
    crowd: Crowd,
    # outputs
    outside: wp.array(dtype=wp.int32),
):
    """Whether every body that moves lies partly where it may not be."""
    i = first + wp.tid()
    found = int(0)
    if crowd.outlines.lightness[i] > 0.0:
        own = crowd.pose[i]
        if not lies_in_support(i, wp.vec2(own[0], own[1]), own[2], supports, crowd):
            found = 1
    outside[i] = found


@wp.kernel
def propose_places(
    first: int,
    trials: Trials,
    room: wp.vec4,
    may_turn: wp.array(dtype=wp.int32),
    supports: Supports,
    # outputs
    crowd: Crowd,
    places: Places,
):
    """The place around it where a stuck body overlaps the least, and how it is turned there: near ones are tried first.

    Places are on its density, and between the two corners of ``room``. Who may turn is turned at random in every other one.
    """
    q = first + wp.tid()
    lanes = trials.lanes
    lane = q % lanes
    i = trials.stuck[q / lanes]
    outlines = crowd.outlines
    space = crowd.neighbors.grid.space
    own = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    state = wp.rand_init(trials.seed + lane, i)
    room_of = i
    if lanes > 1:
        # One body's corners are turned by many at once.
        room_of = q
    least = float(PINNED_COST)
    chosen = wp.vec3(own[0], own[1], crowd.pose[i][2])
    before = float(1.0)
    for candidate in range(lane, trials.candidates, lanes):
        tried = float(candidate) / float(trials.candidates)
        far = outlines.reach[i] * NEAREST_PLACE * wp.pow(FARTHEST_PLACE / NEAREST_PLACE, tried)
        # Two draws, one after the other: an expression's parts have no order of their own.
        aside = wp.randn(state)
        ahead = wp.randn(state)
        at = confine(own + far * wp.vec2(aside, ahead), space)
        in_room = at[0] >= room[0] and at[1] >= room[1] and at[0] <= room[2] and at[1] <= room[3]
        angle = crowd.pose[i][2]
        corners = outlines.first_corner[i]
        if may_turn[i] != 0 and (candidate / lanes) % 2 == 1:
            angle = wp.randf(state, 0.0, 2.0 * wp.pi)
            corners = crowd.copies + room_of * crowd.most_corners
        if in_room and lies_in_support(i, at, angle, supports, crowd):
            if corners >= crowd.copies:
                turn_trial(i, angle, corners, outlines)
            # Edges do not give way, either.
            over = float(0.0)
            if crowd.inset != 0:
                over = cost_of_walls(i, corners, at, outlines, space.size)
            if over <= WALL_COST * TOLERABLE * TOLERABLE:
                here = cost_of_place(i, corners, i, at, least, crowd)
                if here < least:
                    least = here
                    before = tried
                    chosen = wp.vec3(at[0], at[1], angle)
    places.place[q] = chosen
    places.cost[q] = least
    places.share[q] = before


@wp.kernel
def find_costs(
    first: int,
    crowd: Crowd,
    # outputs
    cost: wp.array(dtype=float),
):
    """Squared overlaps of every body."""
    i = first + wp.tid()
    at = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    cost[i] = cost_of_place(i, crowd.outlines.first_corner[i], i, at, 1.0e30, crowd)


@wp.kernel
def propose_turns(
    first: int,
    trials: int,
    keep: float,
    seed: int,
    cost: wp.array(dtype=float),
    # outputs
    crowd: Crowd,
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
):
    """The turn with which a body that overlaps others overlaps them least, and by how much its squared overlaps fall."""
    i = first + wp.tid()
    outlines = crowd.outlines
    best = float(0.0)
    chosen = crowd.pose[i][2]
    if cost[i] > 0.0 and outlines.ease[i] > 0.0 and outlines.length[i] == 0.0:
        at = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
        corners = crowd.copies + i * crowd.most_corners
        state = wp.rand_init(seed, i)
        for _trial in range(trials):
            trial = wp.randf(state, 0.0, 2.0 * wp.pi)
            turn_trial(i, trial, corners, outlines)
            # As much may be left at most.
            most = keep * cost[i] - best
            after = cost_of_place(i, corners, i, at, most, crowd)
            if after < most:
                best = keep * cost[i] - after
                chosen = trial
    angle[i] = chosen
    gain[i] = best


@wp.func
def gains_most(i: int, at: wp.vec2, members: wp.vec2i, gain: wp.array(dtype=float), crowd: Crowd):
    """Whether none of the bodies of a run of cells that may touch body i gains more than it does, or as much with a smaller number."""
    best = bool(True)
    for start in range(members[0], members[1], LANES):
        found = next_near(at, crowd.outlines.reach[i], SAFELY, start, members[1], crowd.neighbors)
        while found != 0 and best:
            s = start + lowest_bit(found)
            found = found & (found - 1)
            j = crowd.neighbors.bodies.body[s]
            if gain[j] > gain[i] or (gain[j] == gain[i] and j < i):
                best = False
    return best


@wp.kernel
def accept_turns(
    first: int,
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
    # outputs
    crowd: Crowd,
    turned: wp.array(dtype=wp.int32),
):
    """Turn those that gain more than all others within reach: of two that may touch only one turns at a time."""
    i = first + wp.tid()
    neighbors = crowd.neighbors
    own = crowd.pose[i]
    reach = crowd.outlines.reach[i]
    at = wp.vec2(own[0], own[1])
    best = gain[i] > 0.0
    for m in range(neighbors.grid.level_count):
        around = cells_around(at, reach + neighbors.grid.reach[m], m, neighbors)
        for run in range(run_count(around)):
            if best:
                best = gains_most(i, at, bodies_of_run(run, around, neighbors), gain, crowd)
    turned[i] = int(best)
    if best:
        crowd.pose[i] = wp.vec4(own[0], own[1], angle[i], own[3])
