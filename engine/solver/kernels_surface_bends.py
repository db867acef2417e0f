"""Kernels for lines that bend on a surface: how far there is room to; gaps are shared out as in the plane."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at
from ..space.kernels_meeting import keep_apart
from .kernels_bends import share_of_gap
from .kernels_lying import cell_of_block, slot_of_level
from .kernels_surface_separation import Standing, SurfaceCrowd, copy_corners, glance_at, in_cell, standing_of
from .kernels_touch import Core, core_of, touch_between

wp.set_module_options({"enable_backward": False})


@wp.func
def gap_between(i: int, here: Standing, j: int, farthest: float, crowd: SurfaceCrowd):
    """How far body j is from body i, where they see each other; any more than ``farthest`` otherwise."""
    outlines = crowd.outlines
    seen = glance_at(here, j, crowd)
    gap = 2.0 * farthest + 1.0
    if seen.met != 0:
        other = Core()
        other.first = copy_corners(i, j, seen.turned, crowd)
        other.count = outlines.first_corner[j + 1] - outlines.first_corner[j]
        other.rounding = outlines.rounding[j]
        gap = touch_between(i, j, core_of(i, outlines), other, seen.way, outlines, farthest, 0).distance
    return gap


@wp.func
def room_in_cell(
    before: float, i: int, here: Standing, cell: wp.vec3i, m: int, widest: wp.array(dtype=float), crowd: SurfaceCrowd
):
    """What there was before, or less: what bodies of a cell leave to body i of the ground between."""
    room = before
    outlines = crowd.outlines
    own = widest[i]
    slot = slot_of_level(cell, m, crowd.slots.mask)
    for s in range(crowd.slots.start[slot], crowd.slots.start[slot + 1]):
        j = crowd.slots.order[s]
        other = widest[j]
        within = outlines.reach[i] + outlines.reach[j] + own + other
        near = j != i and wp.length_sq(crowd.position[j] - here.position) < within * within
        if near and in_cell(j, cell, m, crowd) and keep_apart(i, j, crowd.meeting):
            gap = gap_between(i, here, j, own + other, crowd)
            if gap < own + other:
                room = wp.min(room, share_of_gap(gap, own, other, outlines.lightness[j]))
    return room


@wp.kernel
def find_room_on_surface(
    first: int,
    crowd: SurfaceCrowd,
    widest: wp.array(dtype=float),
    widest_of_all: float,
    # outputs
    room: wp.array(dtype=float),
):
    """How far every body that is bent may reach beside its axis: two share the ground between them as they are bent."""
    i = first + wp.tid()
    left = widest[i]
    if left > 0.0 and crowd.outlines.lightness[i] > 0.0:
        here = standing_of(i, crowd)
        at = here.position
        for m in range(crowd.level_count):
            reach = crowd.outlines.reach[i] + widest[i] + crowd.level_size[m][0] + widest_of_all
            low = cell_at(at - wp.vec3(reach, reach, reach), crowd.level_size[m][1])
            counts = cell_at(at + wp.vec3(reach, reach, reach), crowd.level_size[m][1]) - low + wp.vec3i(1, 1, 1)
            for number in range(counts[0] * counts[1] * counts[2]):
                left = room_in_cell(left, i, here, low + cell_of_block(number, counts), m, widest, crowd)
    room[i] = left
