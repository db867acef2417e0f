"""Kernels that move outlines apart on a surface: each pair in the plane between the two that touch the surface at its bodies.

The second body of a pair is seen in that plane, as far off as it is in a straight line. Its corners are copied as the first body sees
them, and then all is as in a rectangle.
"""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import cell_at, same_cell
from ..motion.kernels_descent import Bodies
from ..motion.kernels_lying import (
    CREASED_COSINE,
    LEAST_COSINE,
    SHARPEST_COSINE,
    Slots,
    cell_of_block,
    flat_way,
    in_plane,
    on_one_sheet,
    over_crease,
    slot_of_level,
)
from ..motion.kernels_on_surface import Ground, walk
from ..motion.kernels_surface_lines import Lying, allowed
from ..space.kernels_meeting import Meeting, keep_apart
from ..surface.kernels_facets import carried, is_flat, smooth_normal, spot_at, tangential
from ..surface.kernels_relations import see_each_other
from .kernels_outlines import Outlines, apart
from .kernels_pairs import Pairs
from .kernels_separation import PULL, SLACK, Asked, asked_by_contact, limited, move_of, overlaps_of_pairs
from .kernels_touch import Core, core_of, touch_between

wp.set_module_options({"enable_backward": False})


@wp.struct
class SurfaceCrowd:
    """Bodies whose outlines are parted, in the order in which they lie along the surface.

    Where they are: facet, weights of its second and third corner, position; where the smooth surface that the mesh stands for looks
    to there, and the direction of the x axis of their outlines along that. Turns that were given, from the direction along the
    surface that every facet has in ``frame``. Outlines, whose corners are seen along these x axes; behind them there is room for the
    ``most_corners`` of somebody else for each body, from ``copies`` on. Levels of size, with the largest reach and the inverse size
    of the cells of each; and who is in which cell. And who keeps apart from whom.
    """

    facet: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec2)
    position: wp.array(dtype=wp.vec3)
    normal: wp.array(dtype=wp.vec3)
    along: wp.array(dtype=wp.vec3)
    heading: wp.array(dtype=float)
    frame: wp.array(dtype=wp.vec3)
    outlines: Outlines
    copies: wp.int32
    most_corners: wp.int32
    ground: Ground
    meeting: Meeting
    level_count: wp.int32
    level: wp.array(dtype=wp.int32)
    level_size: wp.array(dtype=wp.vec2)
    slots: Slots


@wp.struct
class SurfaceMoves:
    """What is remembered of every body: its last move, along its x axis, across it, and its turn; and where the pull draws it.

    Where it was when pairs were listed, and how far it has turned since then. And for every thread how many bodies are farther
    than their skins from there.
    """

    last: wp.array(dtype=wp.vec4)
    home: wp.array(dtype=wp.vec3)
    built: wp.array(dtype=wp.vec3)
    turned: wp.array(dtype=float)
    moved_far: wp.array(dtype=wp.int32)


@wp.struct
class Standing:
    """How a body stands: where, on which facet, where the smooth surface looks to there, and where its x axis points along it."""

    position: wp.vec3
    facet: wp.int32
    normal: wp.vec3
    along: wp.vec3


@wp.struct
class Glance:
    """How a body sees another one: whether it does, the way there, and the cosine and sine of its turn, all along its own x axis."""

    met: wp.int32
    way: wp.vec2
    turned: wp.vec2


@wp.func
def standing_of(i: int, crowd: SurfaceCrowd):
    result = Standing()
    result.position = crowd.position[i]
    result.facet = crowd.facet[i]
    result.normal = crowd.normal[i]
    result.along = crowd.along[i]
    return result


@wp.func
def direction_at(heading: float, facet: int, crowd: SurfaceCrowd):
    """Where something points that is turned by an angle from the direction of its facet."""
    one = crowd.frame[facet]
    return wp.cos(heading) * one + wp.sin(heading) * wp.cross(crowd.ground.facets.normal[facet], one)


@wp.func
def angle_between(one: wp.vec3, other: wp.vec3, normal: wp.vec3):
    """Angle from one direction in a plane to another."""
    return wp.atan2(wp.dot(wp.cross(one, other), normal), wp.dot(one, other))


@wp.func
def sees_over_creases(i: int, j: int, here: Standing, crowd: SurfaceCrowd):
    """Whether body i, at a standing, sees body j across a crease between flat faces as along both of them.

    Discs see each other in a straight line there, which keeps them farther apart, and all see so what stays where it is.
    """
    outlines = crowd.outlines
    corners = outlines.first_corner[i + 1] - outlines.first_corner[i]
    corners = wp.max(corners, outlines.first_corner[j + 1] - outlines.first_corner[j])
    moves = outlines.lightness[i] > 0.0 and outlines.lightness[j] > 0.0
    facets = crowd.ground.facets
    return corners > 1 and moves and is_flat(here.facet, facets) and is_flat(crowd.facet[j], facets)


@wp.func
def glance_at(i: int, here: Standing, j: int, crowd: SurfaceCrowd):
    """How body i, at a standing, sees body j."""
    seen = Glance()
    facets = crowd.ground.facets
    there = crowd.facet[j]
    normal = here.normal
    other = crowd.normal[j]
    way = crowd.position[j] - here.position
    distance = wp.length(way)
    if not see_each_other(facets.label[here.facet], facets.label[there], facets.label, facets.relations):
        return seen
    flat = wp.vec3(0.0)
    cosine = wp.dot(normal, other)
    if cosine < CREASED_COSINE and cosine > SHARPEST_COSINE:
        if cosine < LEAST_COSINE or sees_over_creases(i, j, here, crowd):
            flat = over_crease(way, normal, other)
    if wp.length_sq(flat) == 0.0:
        if not on_one_sheet(way, distance, normal, other):
            return seen
        flat = flat_way(way, distance, normal, other)
    seen.met = 1
    beside = wp.cross(normal, here.along)
    seen.way = in_plane(flat, here.along, beside)
    seen.turned = wp.normalize(in_plane(carried(crowd.along[j], other, normal), here.along, beside))
    return seen


@wp.func
def copy_corners(i: int, j: int, turned: wp.vec2, crowd: SurfaceCrowd):
    """Note the corners of body j, whose x axis is seen with this cosine and sine, in body i's room; returns where the first is."""
    outlines = crowd.outlines
    to = crowd.copies + i * crowd.most_corners
    begin = outlines.first_corner[j]
    c = turned[0]
    s = turned[1]
    for k in range(outlines.first_corner[j + 1] - begin):
        v = outlines.corner[begin + k]
        outlines.corner[to + k] = wp.vec4(
            c * v[0] - s * v[1], s * v[0] + c * v[1], c * v[2] - s * v[3], s * v[2] + c * v[3]
        )
    return to


@wp.kernel
def crowd_slots(
    first: int,
    crowd: SurfaceCrowd,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    m = crowd.level[i]
    key[i] = slot_of_level(cell_at(crowd.position[i], crowd.level_size[m][1]), m, crowd.slots.mask)
    order[i] = i


@wp.kernel
def begin_list_on_surface(
    first: int,
    crowd: SurfaceCrowd,
    # outputs
    moves: SurfaceMoves,
):
    """Note where bodies are when pairs are listed."""
    i = first + wp.tid()
    moves.built[i] = crowd.position[i]
    moves.turned[i] = 0.0
    if i == 0:
        for thread in range(moves.moved_far.shape[0]):
            moves.moved_far[thread] = 0


@wp.func
def in_cell(j: int, cell: wp.vec3i, m: int, crowd: SurfaceCrowd):
    """Whether body j was sorted into a cell of a level: others may share its slot."""
    return crowd.level[j] == m and same_cell(cell_at(crowd.slots.sorted_at[j], crowd.level_size[m][1]), cell)


@wp.func
def may_meet(i: int, j: int, crowd: SurfaceCrowd):
    """Whether body i may meet body j while both move by no more than their skins."""
    outlines = crowd.outlines
    here = standing_of(i, crowd)
    seen = glance_at(i, here, j, crowd)
    if seen.met == 0:
        # Whom it does not see now it may see round an edge.
        facets = crowd.ground.facets
        return see_each_other(facets.label[here.facet], facets.label[crowd.facet[j]], facets.label, facets.relations)
    skins = outlines.skin[i] + outlines.skin[j]
    copied = copy_corners(i, j, seen.turned, crowd)
    return apart(i, outlines.first_corner[i], j, copied, seen.way, outlines, skins) < skins


@wp.func
def pairs_of_cell(
    before: int, room: int, i: int, smaller: bool, cell: wp.vec3i, m: int, crowd: SurfaceCrowd, fill: int, pairs: Pairs
):
    """How many pairs body i has with those before and those of a cell; with those that are near noted where they are filled in."""
    count = before
    outlines = crowd.outlines
    slot = slot_of_level(cell, m, crowd.slots.mask)
    for s in range(crowd.slots.start[slot], crowd.slots.start[slot + 1]):
        j = crowd.slots.order[s]
        within = outlines.reach[i] + outlines.reach[j] + outlines.skin[i] + outlines.skin[j]
        wanted = (smaller or j > i) and outlines.lightness[i] + outlines.lightness[j] > 0.0
        wanted = wanted and keep_apart(i, j, crowd.meeting)
        near = wp.length_sq(crowd.position[j] - crowd.position[i]) < within * within
        if wanted and near and count < room and in_cell(j, cell, m, crowd):
            if fill == 0:
                count += 1
            elif may_meet(i, j, crowd):
                at = pairs.start[i] + count
                pairs.second[at] = j
                pairs.note[at] = 0
                count += 1
    return count


@wp.kernel
def find_pairs_on_surface(
    first: int,
    crowd: SurfaceCrowd,
    most: int,
    fill: int,
    # outputs
    pairs: Pairs,
):
    """Count the bodies that may come near each one while both move by no more than their skins; or note those that really may.

    Of two bodies of a level the one with the smaller number has the pair, else the smaller one of the two.
    """
    i = first + wp.tid()
    own_level = crowd.level[i]
    at = crowd.position[i]
    count = int(0)
    room = most
    if fill != 0:
        room = pairs.start[i + 1] - pairs.start[i]
    for m in range(own_level + 1):
        reach = crowd.outlines.reach[i] + crowd.outlines.skin[i] + crowd.level_size[m][0]
        low = cell_at(at - wp.vec3(reach, reach, reach), crowd.level_size[m][1])
        counts = cell_at(at + wp.vec3(reach, reach, reach), crowd.level_size[m][1]) - low + wp.vec3i(1, 1, 1)
        for number in range(counts[0] * counts[1] * counts[2]):
            if count < room:
                cell = low + cell_of_block(number, counts)
                count = pairs_of_cell(count, room, i, m < own_level, cell, m, crowd, fill, pairs)
    pairs.count[i] = count


@wp.kernel
def find_pushes_on_surface(
    first: int,
    crowd: SurfaceCrowd,
    settings: wp.array(dtype=float),
    # outputs
    pairs: Pairs,
    turned: wp.array(dtype=wp.vec2),
):
    """What every pair's contact asks for, and how the second body is turned as the first one sees it."""
    i = first + wp.tid()
    outlines = crowd.outlines
    here = standing_of(i, crowd)
    start = pairs.start[i]
    lightness = outlines.lightness[i]
    ease = outlines.ease[i]
    width = outlines.width[i]
    slack_share = settings[SLACK]
    own = core_of(i, outlines)
    for p in range(start, start + pairs.count[i]):
        j = pairs.second[p]
        narrower = wp.min(width, outlines.width[j])
        slack = slack_share * narrower
        asked = wp.vec4(0.0, 0.0, 0.0, 0.0)
        depth = float(-1.0)
        within = outlines.reach[i] + outlines.reach[j] + slack
        if wp.length_sq(crowd.position[j] - here.position) < within * within:
            seen = glance_at(i, here, j, crowd)
            if seen.met != 0:
                turned[p] = seen.turned
                other = Core()
                other.first = copy_corners(i, j, seen.turned, crowd)
                other.count = outlines.first_corner[j + 1] - outlines.first_corner[j]
                other.rounding = outlines.rounding[j]
                contact = touch_between(i, j, own, other, seen.way, outlines, slack, pairs.note[p])
                pairs.note[p] = contact.hint
                if contact.distance < slack:
                    asked = asked_by_contact(contact, j, seen.way, lightness, ease, slack, outlines)
                    depth = -contact.distance / narrower
        pairs.push[p] = asked
        pairs.depth[p] = depth


@wp.func
def asked_by_neighbors(i: int, lightness: float, ease: float, pairs: Pairs, turned: wp.array(dtype=wp.vec2)):
    """What the contacts with other bodies ask of body i, along its x axis and across it."""
    sx = float(0.0)
    sy = float(0.0)
    turn = float(0.0)
    contacts = int(0)
    start = pairs.start[i]
    for slot in range(start, start + pairs.count[i]):
        if pairs.depth[slot] > -1.0:
            push = pairs.push[slot]
            sx -= push[0]
            sy -= push[1]
            turn -= push[2]
            contacts += 1
    for at in range(pairs.second_start[i], pairs.second_start[i + 1]):
        slot = pairs.second_slot[at]
        if pairs.depth[slot] > -1.0:
            push = pairs.push[slot]
            c = turned[slot][0]
            s = turned[slot][1]
            sx += c * push[0] + s * push[1]
            sy += c * push[1] - s * push[0]
            turn += push[3]
            contacts += 1
    result = Asked()
    result.shift = wp.vec2(sx * lightness, sy * lightness)
    result.turn = turn * ease
    result.contacts = contacts
    return result


@wp.func
def moved_on_surface(i: int, move: wp.vec3, bodies: Bodies, bend: wp.array(dtype=float), crowd: SurfaceCrowd):
    """How body i lies in the plane of a facet after a move along its x axis, across it, and a turn: no farther than it may."""
    body = crowd.outlines.body[i]
    ground = crowd.ground
    # As others know it, a body lies in the plane of its facet.
    normal = ground.facets.normal[crowd.facet[i]]
    along = carried(crowd.along[i], crowd.normal[i], normal)
    beside = wp.cross(normal, along)
    way = move[0] * along + move[1] * beside
    after = wp.cos(move[2]) * along + wp.sin(move[2]) * beside
    new = Lying()
    if bodies.kind[body] < 0:
        new.middle = walk(crowd.facet[i], crowd.weight[i], way, body, bodies.support[body], ground)
        new.axis = carried(after, normal, ground.facets.normal[new.middle.facet])
        if crowd.outlines.ease[i] == 0.0:
            # Its turn was given.
            new.axis = direction_at(crowd.heading[i], new.middle.facet, crowd)
    else:
        half = wp.max(0.5 * crowd.outlines.length[i], 1.0e-6)
        old = Lying()
        old.middle = spot_at(crowd.facet[i], crowd.weight[i], ground.facets)
        old.axis = half * along
        old.turned = wp.vec2(0.0, 0.0)
        turned = Lying()
        turned.middle = old.middle
        turned.axis = half * after
        turned.turned = wp.vec2(move[2], 0.0)
        new = allowed(body, old, turned, way, bodies, bend, ground)
    # Turning into another plane keeps lengths but for rounding.
    new.axis = wp.normalize(tangential(new.axis, ground.facets.normal[new.middle.facet]))
    return new


@wp.kernel
def move_apart_on_surface(
    first: int,
    thread: int,
    pairs: Pairs,
    turned: wp.array(dtype=wp.vec2),
    bodies: Bodies,
    bend: wp.array(dtype=float),
    settings: wp.array(dtype=float),
    # outputs
    crowd: SurfaceCrowd,
    moves: SurfaceMoves,
):
    """Move every body as its contacts, its momentum and the pull to where it came from ask for."""
    i = first + wp.tid()
    outlines = crowd.outlines
    lightness = outlines.lightness[i]
    if lightness == 0.0:
        return
    facets = crowd.ground.facets
    ease = outlines.ease[i]
    position = crowd.position[i]
    along = crowd.along[i]
    normal = crowd.normal[i]
    asked = asked_by_neighbors(i, lightness, ease, pairs, turned)
    move = move_of(asked, moves.last[i], settings)
    pull = settings[PULL]
    if pull > 0.0:
        back = in_plane(moves.home[i] - position, along, wp.cross(normal, along))
        move = wp.vec3(move[0] + pull * back[0], move[1] + pull * back[1], move[2])
    move = limited(move, outlines.reach[i])
    new = moved_on_surface(i, move, bodies, bend, crowd)
    new_normal = smooth_normal(new.middle.facet, new.middle.weight, facets)
    new_along = carried(new.axis, facets.normal[new.middle.facet], new_normal)
    # What it has turned, beside what the surface has turned it.
    turn = angle_between(carried(along, normal, new_normal), new_along, new_normal)
    way = carried(tangential(new.middle.position - position, normal), normal, new_normal)
    gone = in_plane(way, new_along, wp.cross(new_normal, new_along))
    crowd.facet[i] = new.middle.facet
    crowd.weight[i] = new.middle.weight
    crowd.position[i] = new.middle.position
    crowd.normal[i] = new_normal
    crowd.along[i] = new_along
    moves.last[i] = wp.vec4(gone[0], gone[1], turn * wp.where(ease > 0.0, 1.0, 0.0), 0.0)
    since = moves.turned[i] + turn
    moves.turned[i] = since
    if not (wp.length(new.middle.position - moves.built[i]) + wp.abs(since) * outlines.reach[i] <= outlines.skin[i]):
        wp.atomic_add(moves.moved_far, thread, 1)


@wp.kernel
def measure_overlaps_on_surface(
    first: int,
    pairs: Pairs,
    tolerance: float,
    # outputs
    deep: wp.array(dtype=wp.int32),
    touching: wp.array(dtype=wp.int32),
    cost: wp.array(dtype=float),
):
    """Of every body: how many pairs whose first it is overlap by more than the tolerance, and at all; and its squared overlaps."""
    i = first + wp.tid()
    deeper, overlaps, squares = overlaps_of_pairs(i, pairs, tolerance)
    deep[i] = deeper
    touching[i] = overlaps
    cost[i] = squares
