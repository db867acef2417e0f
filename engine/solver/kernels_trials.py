"""Kernels that try other places and other turns for bodies that overlap others where they are."""

from __future__ import annotations

import warp as wp

from ..space.kernels_neighbourhood import (
    LANES,
    SAFELY,
    ContactGrid,
    Sorted,
    bodies_of_run,
    cells_around,
    lowest_bit,
    next_near,
    run_count,
)
from ..space.kernels_space import Space, confine, difference
from .kernels_outlines import Outlines, apart, turned_corner, wall_contact
from .kernels_separation import WALL_COST

wp.set_module_options({"enable_backward": False})


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
def cost_with(
    before: float,
    i: int,
    corners: int,
    at: wp.vec2,
    j: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    images: wp.vec2i,
    space: Space,
):
    """What there was before, and the squared overlaps that body i would have at a place with body j and its images."""
    total = before
    short = difference(at, wp.vec2(place[j][0], place[j][1]), space)
    within = outlines.reach[i] + outlines.reach[j]
    for y in range(-images[1], images[1] + 1):
        for x in range(-images[0], images[0] + 1):
            d = wp.vec2(short[0] + float(x) * space.size[0], short[1] + float(y) * space.size[1])
            if wp.length_sq(d) < within * within:
                depth = -apart(i, corners, j, d, outlines, 0.0)
                if depth > 0.0:
                    depth = depth / wp.min(outlines.width[i], outlines.width[j])
                    total += depth * depth
    return total


@wp.func
def cost_of_place(
    i: int,
    corners: int,
    without: int,
    at: wp.vec2,
    most: float,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    inset: int,
):
    """Squared overlaps that body i would have at a place with all others but one; ``most`` or more where they are more.

    ``corners`` is the first of its corners: as it is turned, or as it might be.
    """
    total = float(0.0)
    reach = outlines.reach[i]
    if inset != 0:
        total = cost_of_walls(i, corners, at, outlines, grid.space.size)
    for m in range(grid.level_count):
        around = cells_around(at, reach + grid.reach[m], m, grid)
        for run in range(run_count(around)):
            members = wp.vec2i(0, 0)
            if total < most:
                members = bodies_of_run(run, around, cell_start)
            for start in range(members[0], members[1], LANES):
                found = next_near(at, reach, SAFELY, start, members[1], near, grid.space)
                while found != 0 and total < most:
                    s = start + lowest_bit(found)
                    found = found & (found - 1)
                    j = near.body[s]
                    if j != i and j != without:
                        total = cost_with(total, i, corners, at, j, place, outlines, images, grid.space)
    return total


@wp.func
def left_by_swap(
    i: int,
    j: int,
    most: float,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    inset: int,
):
    """Squared overlaps of two bodies that have traded places; ``most`` or more where they are more."""
    own = confine(wp.vec2(place[i][0], place[i][1]), grid.space)
    there = confine(wp.vec2(place[j][0], place[j][1]), grid.space)
    corners = outlines.first_corner[i]
    after = cost_of_place(i, corners, j, there, most, place, outlines, near, cell_start, grid, images, inset)
    if after < most:
        corners = outlines.first_corner[j]
        left = most - after
        after += cost_of_place(j, corners, i, own, left, place, outlines, near, cell_start, grid, images, inset)
    return after


@wp.kernel
def propose_swaps(
    first: int,
    stuck: wp.array(dtype=wp.int32),
    bin: wp.array(dtype=wp.int32),
    bin_start: wp.array(dtype=wp.int32),
    bin_member: wp.array(dtype=wp.int32),
    candidates: int,
    keep: float,
    seed: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    inset: int,
    cost: wp.array(dtype=float),
    # outputs
    partner: wp.array(dtype=wp.int32),
    gain: wp.array(dtype=float),
):
    """The body of its bin with which a stuck one had best trade places, and by how much their squared overlaps fall; -1: none."""
    q = first + wp.tid()
    i = stuck[q]
    own = wp.vec2(place[i][0], place[i][1])
    begin = bin_start[bin[i]]
    end = bin_start[bin[i] + 1]
    state = wp.rand_init(seed, i)
    best = float(0.0)
    chosen = int(-1)
    if end - begin > 1:
        for _candidate in range(candidates):
            j = bin_member[wp.randi(state, begin, end)]
            there = wp.vec2(place[j][0], place[j][1])
            apart_by = outlines.reach[i] + outlines.reach[j]
            d = difference(own, there, grid.space)
            if j != i and wp.length_sq(d) > 4.0 * apart_by * apart_by:
                before = cost[i] + cost[j]
                # As much may be left at most.
                most = keep * before - best
                after = left_by_swap(i, j, most, place, outlines, near, cell_start, grid, images, inset)
                if after < most:
                    best = keep * before - after
                    chosen = j
    partner[q] = chosen
    gain[q] = best


@wp.kernel
def find_costs(
    first: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    inset: int,
    # outputs
    cost: wp.array(dtype=float),
):
    """Squared overlaps of every body."""
    i = first + wp.tid()
    at = wp.vec2(place[i][0], place[i][1])
    cost[i] = cost_of_place(
        i, outlines.first_corner[i], i, at, 1.0e30, place, outlines, near, cell_start, grid, images, inset
    )


@wp.kernel
def propose_turns(
    first: int,
    trials: int,
    room_for_corners: int,
    most_corners: int,
    keep: float,
    seed: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    inset: int,
    cost: wp.array(dtype=float),
    # outputs
    corner: wp.array(dtype=wp.vec4),
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
):
    """The turn with which a body that overlaps others overlaps them least, and by how much its squared overlaps fall.

    Corners of trials lie behind those of the bodies, from ``room_for_corners`` on, ``most_corners`` for each body.
    """
    i = first + wp.tid()
    best = float(0.0)
    chosen = place[i][2]
    if cost[i] > 0.0 and outlines.ease[i] > 0.0 and outlines.length[i] == 0.0:
        count = outlines.first_corner[i + 1] - outlines.first_corner[i]
        at = wp.vec2(place[i][0], place[i][1])
        corners = room_for_corners + i * most_corners
        factor = outlines.factor[i]
        start = outlines.shape_start[outlines.shape[i]]
        state = wp.rand_init(seed, i)
        for _trial in range(trials):
            trial = wp.randf(state, 0.0, 2.0 * wp.pi)
            c = wp.cos(trial)
            s = wp.sin(trial)
            for k in range(count):
                corner[corners + k] = turned_corner(outlines.shape_corner[start + k], factor, c, s, outlines.slope[i])
            # As much may be left at most.
            most = keep * cost[i] - best
            after = cost_of_place(i, corners, i, at, most, place, outlines, near, cell_start, grid, images, inset)
            if after < most:
                best = keep * cost[i] - after
                chosen = trial
    angle[i] = chosen
    gain[i] = best


@wp.func
def gains_most(
    i: int,
    at: wp.vec2,
    reach: float,
    members: wp.vec2i,
    gain: wp.array(dtype=float),
    near: Sorted,
    space: Space,
):
    """Whether none of the bodies of a run of cells that may touch body i gains more than it does, or as much with a smaller number."""
    best = bool(True)
    for start in range(members[0], members[1], LANES):
        found = next_near(at, reach, SAFELY, start, members[1], near, space)
        while found != 0 and best:
            s = start + lowest_bit(found)
            found = found & (found - 1)
            j = near.body[s]
            if gain[j] > gain[i] or (gain[j] == gain[i] and j < i):
                best = False
    return best


@wp.kernel
def accept_turns(
    first: int,
    angle: wp.array(dtype=float),
    gain: wp.array(dtype=float),
    outlines: Outlines,
    near: Sorted,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    position: wp.array(dtype=wp.vec4),
    # outputs
    place: wp.array(dtype=wp.vec4),
    turned: wp.array(dtype=wp.int32),
):
    """Turn those that gain more than all others within reach: of two that may touch only one turns at a time."""
    i = first + wp.tid()
    own = position[i]
    reach = outlines.reach[i]
    at = wp.vec2(own[0], own[1])
    best = gain[i] > 0.0
    for m in range(grid.level_count):
        around = cells_around(at, reach + grid.reach[m], m, grid)
        for run in range(run_count(around)):
            if best:
                best = gains_most(i, at, reach, bodies_of_run(run, around, cell_start), gain, near, grid.space)
    turned[i] = int(best)
    if best:
        place[i] = wp.vec4(own[0], own[1], angle[i], own[3])
