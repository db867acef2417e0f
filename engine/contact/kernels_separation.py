"""Kernels that move outlines apart: what every contact asks for, how far bodies go, and what is left of overlaps."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import Bodies, confine_line, slide
from ..space.kernels_images import Images
from ..space.kernels_space import Space, confine, difference
from .kernels_outlines import Outlines, wall_contact
from .kernels_pairs import FACE_BITS, Crowd, Pairs, image_of
from .kernels_touch import Contact, touch, way_between_parallels

wp.set_module_options({"enable_backward": False})

# What a body moves in a round at most: a share of its reach, and an angle [rad]. Measured as in separation: with a share of 0.05
# coverage errors are 3 % larger.
LARGEST_MOVE = wp.constant(0.25)
LARGEST_TURN = wp.constant(0.15)
# Contacts of a body whose corrections are made in full: one on either side, which do not add up. Measured as in separation: with 1
# coverage errors are 3 % larger.
FULL_CONTACTS = wp.constant(2)
# Weight of what stands out of the domain in the cost of a place.
WALL_COST = wp.constant(4.0)

# Numbers of a round, by their places in an array, because they change.
DAMPING = wp.constant(0)
MOMENTUM = wp.constant(1)
COASTING = wp.constant(2)
PULL = wp.constant(3)
SLACK = wp.constant(4)
SHARPNESS = wp.constant(5)


@wp.func
def asked_by_contact(
    contact: Contact, j: int, d: wp.vec2, lightness: float, ease: float, slack: float, outlines: Outlines
):
    """What a contact with body j, which is at offset ``d``, asks for: see :class:`~.kernels_pairs.Pairs`."""
    n = contact.direction
    at = contact.at
    lever = at[0] * n[1] - at[1] * n[0]
    other_lever = (at[0] - d[0]) * n[1] - (at[1] - d[1]) * n[0]
    give = lightness + outlines.lightness[j] + lever * lever * ease + other_lever * other_lever * outlines.ease[j]
    asked = wp.vec4(0.0, 0.0, 0.0, 0.0)
    if give > 0.0:
        push = (slack - contact.distance) / give
        asked = wp.vec4(n[0] * push, n[1] * push, lever * push, other_lever * push)
    return asked


@wp.func
def asked_by_parallels(
    asked: wp.vec4,
    i: int,
    j: int,
    d: wp.vec2,
    lightness: float,
    slack: float,
    sharpness: float,
    outlines: Outlines,
):
    """What an overlap of two long bodies that do not turn asks for: as their contact does, unless they are parallel."""
    result = asked
    give = lightness + outlines.lightness[j]
    found = way_between_parallels(i, j, d, outlines, slack, sharpness)
    if give > 0.0 and found.weights > 0.0:
        push = found.way / (found.weights * give)
        result = wp.vec4(push[0], push[1], 0.0, 0.0)
    return result


@wp.kernel
def find_parallels(
    first: int,
    crowd: Crowd,
    kept: wp.array(dtype=wp.int32),
    # outputs
    pairs: Pairs,
):
    """Note as the depth of every pair: 1 if the two are parallel, 0 if not, -1 unless both are ``kept``: long, with given turns."""
    i = first + wp.tid()
    own = crowd.pose[i]
    start = pairs.start[i]
    for p in range(start, start + pairs.count[i]):
        j = pairs.second[p]
        found = float(-1.0)
        if kept[i] != 0 and kept[j] != 0:
            other = crowd.pose[j]
            image = image_of(pairs.note[p], crowd.neighbors.grid.space.size)
            d = wp.vec2(other[0] - own[0] + image[0], other[1] - own[1] + image[1])
            found = 0.0
            if way_between_parallels(i, j, d, crowd.outlines, 0.0, 1.0).weights > 0.0:
                found = 1.0
        pairs.depth[p] = found


@wp.kernel
def find_rows(
    first: int,
    pairs: Pairs,
    least: float,
    # outputs
    in_row: wp.array(dtype=wp.int32),
):
    """Whether every body is one of a row: at least this share of its like around it is parallel to it; see :func:`find_parallels`."""
    i = first + wp.tid()
    near = float(0.0)
    parallel = float(0.0)
    start = pairs.start[i]
    for p in range(start, start + pairs.count[i]):
        if pairs.depth[p] >= 0.0:
            near += 1.0
            parallel += pairs.depth[p]
    for at in range(pairs.second_start[i], pairs.second_start[i + 1]):
        p = pairs.second_slot[at]
        if pairs.depth[p] >= 0.0:
            near += 1.0
            parallel += pairs.depth[p]
    in_row[i] = 0
    if parallel > 0.0 and parallel >= least * near:
        in_row[i] = 1


@wp.kernel
def find_pushes(
    first: int,
    crowd: Crowd,
    in_row: wp.array(dtype=wp.int32),
    settings: wp.array(dtype=float),
    # outputs
    pairs: Pairs,
):
    """What every pair's contact asks for; an element is a body with the pairs whose first it is."""
    i = first + wp.tid()
    outlines = crowd.outlines
    own = crowd.pose[i]
    start = pairs.start[i]
    lightness = outlines.lightness[i]
    ease = outlines.ease[i]
    width = outlines.width[i]
    slack_share = settings[SLACK]
    sharpness = settings[SHARPNESS]
    for p in range(start, start + pairs.count[i]):
        j = pairs.second[p]
        note = pairs.note[p]
        other = crowd.pose[j]
        image = image_of(note, crowd.neighbors.grid.space.size)
        d = wp.vec2(other[0] - own[0] + image[0], other[1] - own[1] + image[1])
        narrower = wp.min(width, outlines.width[j])
        slack = slack_share * narrower
        asked = wp.vec4(0.0, 0.0, 0.0, 0.0)
        depth = float(-1.0)
        within = outlines.reach[i] + outlines.reach[j] + slack
        if wp.length_sq(d) < within * within:
            contact = touch(i, j, d, outlines, slack, note & FACE_BITS)
            pairs.note[p] = (note & ~FACE_BITS) | contact.hint
            if contact.distance < slack:
                asked = asked_by_contact(contact, j, d, lightness, ease, slack, outlines)
                if contact.distance < 0.0 and sharpness > 0.0 and in_row[i] != 0 and in_row[j] != 0:
                    asked = asked_by_parallels(asked, i, j, d, lightness, slack, sharpness, outlines)
                depth = -contact.distance / narrower
        pairs.push[p] = asked
        pairs.depth[p] = depth


@wp.struct
class Asked:
    """What contacts ask of a body: a shift and a turn, and how many contacts there are."""

    shift: wp.vec2
    turn: float
    contacts: wp.int32


@wp.func
def asked_by_pairs(i: int, lightness: float, ease: float, pairs: Pairs):
    """What the contacts with other bodies ask of body i."""
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
            sx += push[0]
            sy += push[1]
            turn += push[3]
            contacts += 1
    result = Asked()
    result.shift = wp.vec2(sx * lightness, sy * lightness)
    result.turn = turn * ease
    result.contacts = contacts
    return result


@wp.func
def asked_by_walls(
    before: Asked, i: int, p: wp.vec2, lightness: float, ease: float, slack: float, outlines: Outlines, size: wp.vec2
):
    """The same with what the edges of the domain ask for."""
    sx = before.shift[0]
    sy = before.shift[1]
    turn = before.turn
    contacts = before.contacts
    for side in range(4):
        depth, n, lever = wall_contact(i, outlines.first_corner[i], side, p, outlines, size)
        if depth > -slack:
            strength = (depth + slack) / (lightness + lever * lever * ease)
            sx += n[0] * strength * lightness
            sy += n[1] * strength * lightness
            turn += lever * strength * ease
            contacts += 1
    result = Asked()
    result.shift = wp.vec2(sx, sy)
    result.turn = turn
    result.contacts = contacts
    return result


@wp.func
def move_of(asked: Asked, last: wp.vec4, settings: wp.array(dtype=float)):
    """The shift and turn of a round: a share of what is asked for, and of the last move."""
    share = settings[COASTING]
    scale = float(0.0)
    if asked.contacts > 0:
        share = settings[MOMENTUM]
        scale = settings[DAMPING]
        if asked.contacts > FULL_CONTACTS:
            scale = scale * float(FULL_CONTACTS) / float(asked.contacts)
    return wp.vec3(
        asked.shift[0] * scale + share * last[0],
        asked.shift[1] * scale + share * last[1],
        asked.turn * scale + share * last[2],
    )


@wp.func
def limited(move: wp.vec3, reach: float):
    """A move no longer than a share of a body's reach, and no wider than an angle."""
    mx = move[0]
    my = move[1]
    limit = LARGEST_MOVE * reach
    length = wp.sqrt(mx * mx + my * my)
    if length > limit:
        mx = mx * limit / length
        my = my * limit / length
    return wp.vec3(mx, my, wp.clamp(move[2], -LARGEST_TURN, LARGEST_TURN))


@wp.func
def moved(
    i: int,
    own: wp.vec4,
    move: wp.vec3,
    outlines: Outlines,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    images: Images,
    space: Space,
):
    """The way that body i goes, and its angle at the end: no farther than where it may be."""
    body = outlines.body[i]
    k = bodies.support[body]
    inside = confine(wp.vec2(own[0], own[1]), space)
    angle = own[2] + move[2]
    end = inside
    if bodies.kind[body] < 0:
        end = slide(inside, inside + wp.vec2(move[0], move[1]), k, images, space)
    else:
        line = confine_line(
            wp.vec4(inside[0], inside[1], own[2], outlines.length[i]),
            wp.vec4(inside[0] + move[0], inside[1] + move[1], angle, outlines.length[i]),
            bodies.first_charge[body],
            bodies.first_charge[body + 1],
            bodies,
            bend,
            k,
            images,
            space,
        )
        end = wp.vec2(line[0], line[1])
        angle = line[2]
    way = difference(inside, end, space)
    return wp.vec3(way[0], way[1], angle)


@wp.struct
class Moves:
    """Of every body: its last move, where the pull draws it, and where it was when pairs were listed.

    And for every thread how many bodies are farther than their skins from there.
    """

    last: wp.array(dtype=wp.vec4)
    home: wp.array(dtype=wp.vec4)
    built: wp.array(dtype=wp.vec4)
    moved_far: wp.array(dtype=wp.int32)


@wp.kernel
def move_apart(
    first: int,
    thread: int,
    pairs: Pairs,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    images: Images,
    settings: wp.array(dtype=float),
    # outputs
    crowd: Crowd,
    moves: Moves,
):
    """Move every body as its contacts, its momentum and the pull to where it came from ask for."""
    i = first + wp.tid()
    outlines = crowd.outlines
    space = crowd.neighbors.grid.space
    lightness = outlines.lightness[i]
    if lightness == 0.0:
        return
    ease = outlines.ease[i]
    own = crowd.pose[i]
    p = wp.vec2(own[0], own[1])
    asked = asked_by_pairs(i, lightness, ease, pairs)
    if crowd.inset != 0:
        slack = 0.5 * settings[SLACK] * outlines.width[i]
        asked = asked_by_walls(asked, i, p, lightness, ease, slack, outlines, space.size)
    move = move_of(asked, moves.last[i], settings)
    pull = settings[PULL]
    if pull > 0.0:
        back = difference(confine(p, space), confine(wp.vec2(moves.home[i][0], moves.home[i][1]), space), space)
        move = wp.vec3(move[0] + pull * back[0], move[1] + pull * back[1], move[2])
    move = limited(move, outlines.reach[i])
    way = moved(i, own, move, outlines, bodies, bend, images, space)
    angle = way[2]
    built = moves.built[i]
    crowd.pose[i] = wp.vec4(own[0] + way[0], own[1] + way[1], angle, 0.0)
    moves.last[i] = wp.vec4(way[0], way[1], angle - own[2], 0.0)
    gone_x = own[0] + way[0] - built[0]
    gone_y = own[1] + way[1] - built[1]
    gone = wp.sqrt(gone_x * gone_x + gone_y * gone_y) + wp.abs(angle - built[2]) * outlines.reach[i]
    if not (gone <= outlines.skin[i]):
        wp.atomic_add(moves.moved_far, thread, 1)


@wp.func
def overlaps_of_pairs(i: int, pairs: Pairs, tolerance: float):
    """Of the pairs whose first is body i: how many overlap by more than the tolerance, and at all; and its squared overlaps."""
    deeper = int(0)
    overlaps = int(0)
    squares = float(0.0)
    start = pairs.start[i]
    for slot in range(start, start + pairs.count[i]):
        depth = pairs.depth[slot]
        if depth > 0.0:
            overlaps += 1
            squares += depth * depth
            if depth > tolerance:
                deeper += 1
    for at in range(pairs.second_start[i], pairs.second_start[i + 1]):
        depth = wp.max(pairs.depth[pairs.second_slot[at]], 0.0)
        squares += depth * depth
    return deeper, overlaps, squares


@wp.kernel
def measure_overlaps(
    first: int,
    crowd: Crowd,
    pairs: Pairs,
    tolerance: float,
    # outputs
    deep: wp.array(dtype=wp.int32),
    touching: wp.array(dtype=wp.int32),
    cost: wp.array(dtype=float),
):
    """Of every body: how many pairs whose first it is overlap by more than the tolerance, how many at all, and its squared overlaps.

    Overlaps count in smaller widths; edges of the domain count as bodies, but for what does not move: obstacles go on beyond them.
    """
    i = first + wp.tid()
    outlines = crowd.outlines
    deeper, overlaps, squares = overlaps_of_pairs(i, pairs, tolerance)
    if crowd.inset != 0 and outlines.lightness[i] > 0.0:
        size = crowd.neighbors.grid.space.size
        p = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
        for side in range(4):
            depth, _n, _lever = wall_contact(i, outlines.first_corner[i], side, p, outlines, size)
            depth = depth / outlines.width[i]
            if depth > 0.0:
                overlaps += 1
                squares += WALL_COST * depth * depth
                if depth > tolerance:
                    deeper += 1
    deep[i] = deeper
    touching[i] = overlaps
    cost[i] = squares
