"""Kernels that keep the middles of bodies out of obstacles that are outlines on a surface."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell
from ..surface.kernels_facets import Facets, Spot, carried, smooth_normal
from ..surface.kernels_relations import see_each_other
from .kernels_lying import cell_of_block, flat_way, in_plane, on_one_sheet, slot_of_level

wp.set_module_options({"enable_backward": False})

# Farther than anything is.
FAR = wp.constant(1.0e30)


@wp.struct
class OutlineOnGround:
    """An obstacle that is an outline on the surface.

    Position, where the smooth surface looks to there, x axis along it, and the label of the part that it is. Where the corners of its
    core begin and end, which are seen along its own axes; radius around them, farthest reach, and level of size.
    """

    position: wp.vec3
    normal: wp.vec3
    along: wp.vec3
    label: wp.int32
    first_corner: wp.int32
    end_corner: wp.int32
    rounding: float
    reach: float
    level: wp.int32


@wp.struct
class OutlinesOnGround:
    """All of them, in the order of the slots of their cells, and where each slot begins.

    Their corners. And of every level of size the largest reach and the inverse size of the cells.
    """

    count: wp.int32
    level_count: wp.int32
    mask: wp.int32
    outline: wp.array(dtype=OutlineOnGround)
    start: wp.array(dtype=wp.int32)
    corner: wp.array(dtype=wp.vec2)
    level: wp.array(dtype=wp.vec2)


@wp.struct
class Inside:
    """How deep a place lies in the outline in which it does so most; not above 0 where it lies in none; and the way out."""

    depth: float
    out: wp.vec3


@wp.kernel
def outline_slots(
    first: int,
    outline: wp.array(dtype=OutlineOnGround),
    level: wp.array(dtype=wp.vec2),
    mask: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    m = outline[i].level
    key[i] = slot_of_level(cell_at(outline[i].position, level[m][1]), m, mask)
    order[i] = i


@wp.func
def way_out(place: wp.vec2, begin: int, end: int, corner: wp.array(dtype=wp.vec2)):
    """How far a place is from a core, below 0 within, and the direction that leads out: x, y, distance."""
    inside = end - begin > 2
    least = float(FAR)
    off = wp.vec2(1.0, 0.0)
    for k in range(begin, end):
        a = corner[k]
        b = corner[wp.where(k + 1 < end, k + 1, begin)]
        edge = b - a
        way = place - a
        along = wp.clamp(wp.dot(way, edge) / wp.max(wp.length_sq(edge), 1.0e-20), 0.0, 1.0)
        to = way - along * edge
        if wp.length_sq(to) < least:
            least = wp.length_sq(to)
            off = to
        if edge[0] * way[1] - edge[1] * way[0] < 0.0:
            inside = False
    away = wp.sqrt(least)
    if away > 0.0:
        off = off / away
    else:
        off = wp.vec2(1.0, 0.0)
    if inside:
        return wp.vec3(-off[0], -off[1], -away)
    return wp.vec3(off[0], off[1], away)


@wp.func
def deeper_in(
    before: Inside,
    place: wp.vec3,
    normal: wp.vec3,
    label: int,
    facets: Facets,
    room: float,
    one: OutlineOnGround,
    corner: wp.array(dtype=wp.vec2),
):
    """How deep a place lies in the outlines that were looked at before, and in one more."""
    found = Inside()
    found.depth = before.depth
    found.out = before.out
    way = place - one.position
    distance = wp.length(way)
    near = distance < one.reach + room and see_each_other(one.label, label, facets.label, facets.relations)
    if near and on_one_sheet(way, distance, one.normal, normal):
        flat = flat_way(way, distance, one.normal, normal)
        beside = wp.cross(one.normal, one.along)
        out = way_out(in_plane(flat, one.along, beside), one.first_corner, one.end_corner, corner)
        depth = room + one.rounding - out[2]
        if depth > found.depth:
            found.depth = depth
            found.out = carried(out[0] * one.along + out[1] * beside, one.normal, normal)
    return found


@wp.func
def inside_outlines(spot: Spot, room: float, facets: Facets, o: OutlinesOnGround):
    """How deep a place lies in outlines, or in so much room around them."""
    result = Inside()
    result.depth = 0.0
    result.out = wp.vec3(0.0, 0.0, 0.0)
    normal = smooth_normal(spot.facet, spot.weight, facets)
    label = facets.label[spot.facet]
    for m in range(o.level_count):
        inverse_cell = o.level[m][1]
        reach = o.level[m][0] + room
        low = cell_at(spot.position - wp.vec3(reach, reach, reach), inverse_cell)
        high = cell_at(spot.position + wp.vec3(reach, reach, reach), inverse_cell)
        counts = high - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            cell = low + cell_of_block(number, counts)
            slot = slot_of_level(cell, m, o.mask)
            for j in range(o.start[slot], o.start[slot + 1]):
                if o.outline[j].level == m and same_cell(cell_at(o.outline[j].position, inverse_cell), cell):
                    result = deeper_in(result, spot.position, normal, label, facets, room, o.outline[j], o.corner)
    return result
