"""Kernels for lines that bend on a surface: how far there is room to, and where they lie; gaps are shared out as in the plane."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at
from ..motion.kernels_descent import Bodies
from ..motion.kernels_lying import cell_of_block, slot_of_level
from ..motion.kernels_on_surface import Ground, Poses
from ..motion.kernels_surface_lines import place_along, way_along
from ..space.kernels_meeting import keep_apart
from ..surface.kernels_facets import carried, smooth_normal, spot_at, tangential
from .kernels_bends import share_of_gap
from .kernels_surface_separation import Standing, SurfaceCrowd, copy_corners, glance_at, in_cell, standing_of
from .kernels_touch import Core, core_of, touch_between

wp.set_module_options({"enable_backward": False})

# How often the way to a charge is corrected. Every time takes off a factor of at least ten where the surface is smooth.
MOST_CORRECTIONS = wp.constant(12)
# A charge that lies this close to its place, as a share of the way there, is there.
CLOSE_ENOUGH = wp.constant(1.0e-5)


@wp.func
def gap_between(i: int, here: Standing, j: int, farthest: float, crowd: SurfaceCrowd):
    """How far body j is from body i, where they see each other; any more than ``farthest`` otherwise."""
    outlines = crowd.outlines
    seen = glance_at(i, here, j, crowd)
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


@wp.func
def as_flat(way: wp.vec3, normal: wp.vec3):
    """A way from a body to a point, laid into the plane that touches the smooth surface at the body: as long as in a straight line."""
    flat = tangential(way, normal)
    length = wp.length(flat)
    if length > 0.0:
        flat = flat * (wp.length(way) / length)
    return flat


@wp.func
def place_as_flat(
    facet: int, weight: wp.vec2, way: wp.vec3, middle: wp.vec3, plane: wp.vec3, normal: wp.vec3, ground: Ground
):
    """Where a charge is that lies this way from its line's middle once it is laid flat; and by how much it is not."""
    wanted = carried(way, plane, normal)
    missed = wp.length(wanted)
    enough = CLOSE_ENOUGH * missed
    position = middle
    if missed > 0.0:
        onwards = way
        for _round in range(MOST_CORRECTIONS):
            if missed > enough:
                found = place_along(facet, weight, onwards, ground.facets).position
                off = wanted - as_flat(found - middle, normal)
                if wp.length(off) < missed:
                    missed = wp.length(off)
                    position = found
                onwards = onwards + carried(off, normal, plane)
    return position, missed


@wp.kernel
def lay_bends(
    first: int,
    poses: Poses,
    bodies: Bodies,
    ground: Ground,
    # outputs
    position: wp.array(dtype=wp.vec3),
    missed: wp.array(dtype=float),
):
    """Put the charges of lines where they are in the plane that lines were parted in: that of the smooth surface at their middles.

    ``missed`` is how far the worst charge of every line is from there, at the end of the surface or where this folds.
    """
    i = first + wp.tid()
    facet, weight = poses.facet[i], poses.weight[i]
    worst = float(0.0)
    if bodies.kind[i] >= 0:
        middle = spot_at(facet, weight, ground.facets).position
        plane = ground.facets.normal[facet]
        normal = smooth_normal(facet, weight, ground.facets)
        for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
            way = way_along(facet, poses.axis[i], bodies.axial[j], poses.bend[j], ground.facets)
            there, off = place_as_flat(facet, weight, way, middle, plane, normal, ground)
            position[j] = there
            worst = wp.max(worst, off)
    missed[i] = worst
