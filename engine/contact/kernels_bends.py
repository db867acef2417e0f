"""Kernels for lines that bend: how far there is room to, and what is left of their bends."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import Bodies
from ..space.kernels_meeting import keep_apart
from ..space.kernels_neighborhood import LANES, SAFELY, bodies_of_run, cells_around, lowest_bit, next_near, run_count
from ..space.kernels_space import difference
from .kernels_outlines import Outlines, wall_contact
from .kernels_pairs import Crowd
from .kernels_touch import touch

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_bends(
    first: int,
    outlines: Outlines,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    # outputs
    widest: wp.array(dtype=float),
):
    """How far every body reaches beside its axis."""
    i = first + wp.tid()
    body = outlines.body[i]
    most = float(0.0)
    if bodies.kind[body] >= 0:
        for j in range(bodies.first_charge[body], bodies.first_charge[body + 1]):
            most = wp.max(most, wp.abs(bend[j]))
    widest[i] = most


@wp.func
def share_of_gap(distance: float, own: float, other: float, lightness: float):
    """How far a body may reach towards another one, if it would reach ``own`` and the other one ``other``."""
    gap = wp.max(distance, 0.0)
    if lightness == 0.0:
        # The other one stays as it is.
        return wp.max(gap - other, 0.0)
    return gap * own / (own + other)


@wp.func
def room_beside(before: float, i: int, at: wp.vec2, j: int, crowd: Crowd, widest: wp.array(dtype=float)):
    """What there was before, or less: what body j and its images leave to body i of the ground between the two."""
    outlines = crowd.outlines
    space = crowd.neighbors.grid.space
    room = before
    own = widest[i]
    other = widest[j]
    short = difference(at, wp.vec2(crowd.pose[j][0], crowd.pose[j][1]), space)
    within = outlines.reach[i] + outlines.reach[j] + own + other
    for y in range(-crowd.images[1], crowd.images[1] + 1):
        for x in range(-crowd.images[0], crowd.images[0] + 1):
            d = wp.vec2(short[0] + float(x) * space.size[0], short[1] + float(y) * space.size[1])
            if wp.length_sq(d) < within * within:
                contact = touch(i, j, d, outlines, own + other, 0)
                room = wp.min(room, share_of_gap(contact.distance, own, other, outlines.lightness[j]))
    return room


@wp.func
def room_among(
    before: float, i: int, at: wp.vec2, reach: float, members: wp.vec2i, crowd: Crowd, widest: wp.array(dtype=float)
):
    """What there was before, or less: what bodies that lie in one run of cells leave to body i."""
    room = before
    for start in range(members[0], members[1], LANES):
        found = next_near(at, reach, SAFELY, start, members[1], crowd.neighbors)
        while found != 0:
            j = crowd.neighbors.bodies.body[start + lowest_bit(found)]
            found = found & (found - 1)
            if j != i and keep_apart(i, j, crowd.neighbors.footprints.meeting):
                room = room_beside(room, i, at, j, crowd, widest)
    return room


@wp.func
def room_inside(before: float, i: int, at: wp.vec2, crowd: Crowd):
    """What there was before, or less: what the edges of the domain leave to body i."""
    room = before
    outlines = crowd.outlines
    for side in range(4):
        depth, _n, _lever = wall_contact(
            i, outlines.first_corner[i], side, at, outlines, crowd.neighbors.grid.space.size
        )
        room = wp.min(room, wp.max(-depth, 0.0))
    return room


@wp.kernel
def find_room(
    first: int,
    crowd: Crowd,
    widest: wp.array(dtype=float),
    # outputs
    room: wp.array(dtype=float),
):
    """How far every body that is bent may reach beside its axis: two share the ground between them as they are bent."""
    i = first + wp.tid()
    own = widest[i]
    left = own
    if own > 0.0 and crowd.outlines.lightness[i] > 0.0:
        at = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
        reach = crowd.outlines.reach[i] + own
        if crowd.inset != 0:
            left = room_inside(left, i, at, crowd)
        grid = crowd.neighbors.grid
        for m in range(grid.level_count):
            around = cells_around(at, reach + grid.reach[m], m, crowd.neighbors)
            for run in range(run_count(around)):
                members = bodies_of_run(run, around, crowd.neighbors)
                left = room_among(left, i, at, reach, members, crowd, widest)
    room[i] = left


@wp.kernel
def straighten(
    first: int,
    outlines: Outlines,
    bodies: Bodies,
    widest: wp.array(dtype=float),
    room: wp.array(dtype=float),
    # outputs
    bend: wp.array(dtype=float),
):
    """Bend lines no farther than there is room."""
    i = first + wp.tid()
    if room[i] < widest[i]:
        body = outlines.body[i]
        for j in range(bodies.first_charge[body], bodies.first_charge[body + 1]):
            bend[j] = bend[j] * (room[i] / widest[i])
