"""Kernels that list pairs of bodies whose outlines are near."""

from __future__ import annotations

import warp as wp

from ..space.kernels_meeting import keep_apart
from ..space.kernels_neighborhood import (
    LANES,
    SAFELY,
    Neighbors,
    bodies_of_run,
    cells_around,
    lowest_bit,
    next_near,
    run_count,
)
from ..space.kernels_space import confine, difference
from .kernels_outlines import Outlines, apart

wp.set_module_options({"enable_backward": False})

# A pair's note: the face that kept the two apart last, plus one, in the low bits; and which image of the second is meant.
FACE_BITS = wp.constant(63)
IMAGE_SHIFT = wp.constant(6)
IMAGES_A_SIDE = wp.constant(32)


@wp.struct
class Pairs:
    """Pairs of bodies that are near, those of a body (the first) one after the other from ``start`` on, ``count`` of them.

    The second body; a note (see :data:`FACE_BITS`); what the contact asks for (along x and y of the second, turns of the first and the
    second, per unit of inverse mass and inertia); depth over the smaller width, below 0 where they are apart. ``second_slot`` has the
    places of all pairs by their second body, those of a body from ``second_start`` on.
    """

    start: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    second: wp.array(dtype=wp.int32)
    note: wp.array(dtype=wp.int32)
    push: wp.array(dtype=wp.vec4)
    depth: wp.array(dtype=float)
    second_start: wp.array(dtype=wp.int32)
    second_slot: wp.array(dtype=wp.int32)


@wp.struct
class Crowd:
    """Bodies whose outlines are parted: their poses (x, y, turn), in spatial order, their outlines, and what finds neighbors.

    Behind the corners of all outlines there is room to turn those of one body in a trial: ``most_corners`` for each body, from
    ``copies`` on. How many periods away, along x and y, images of a body can still be near; and whether they are to stay inside the
    edges.
    """

    pose: wp.array(dtype=wp.vec4)
    outlines: Outlines
    copies: wp.int32
    most_corners: wp.int32
    neighbors: Neighbors
    images: wp.vec2i
    inset: wp.int32


@wp.kernel
def begin_list(
    first: int,
    # outputs
    crowd: Crowd,
    built: wp.array(dtype=wp.vec4),
    moved_far: wp.array(dtype=wp.int32),
):
    """Bring bodies back into a periodic domain, and note where they are when pairs are listed."""
    i = first + wp.tid()
    own = crowd.pose[i]
    p = confine(wp.vec2(own[0], own[1]), crowd.neighbors.grid.space)
    crowd.pose[i] = wp.vec4(p[0], p[1], own[2], 0.0)
    built[i] = crowd.pose[i]
    if i == 0:
        for thread in range(moved_far.shape[0]):
            moved_far[thread] = 0


@wp.func
def image_of(note: int, size: wp.vec2):
    """Where the image of the second body that a note means lies, from the body itself."""
    image = note >> IMAGE_SHIFT
    half = IMAGES_A_SIDE / 2
    return wp.vec2(
        float(image % IMAGES_A_SIDE - half) * size[0], float((image / IMAGES_A_SIDE) % IMAGES_A_SIDE - half) * size[1]
    )


@wp.func
def note_of(x: int, y: int):
    half = IMAGES_A_SIDE / 2
    return ((y + half) * IMAGES_A_SIDE + x + half) << IMAGE_SHIFT


@wp.func
def pairs_with(before: int, room: int, i: int, j: int, crowd: Crowd, fill: int, pairs: Pairs):
    """How many pairs body i has with those before and with the images of body j that are near; with notes where they are filled in."""
    count = before
    outlines = crowd.outlines
    space = crowd.neighbors.grid.space
    own = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    other = wp.vec2(crowd.pose[j][0], crowd.pose[j][1])
    short = difference(own, other, space)
    within = outlines.reach[i] + outlines.skin[i] + outlines.reach[j] + outlines.skin[j]
    skins = outlines.skin[i] + outlines.skin[j]
    for y in range(-crowd.images[1], crowd.images[1] + 1):
        for x in range(-crowd.images[0], crowd.images[0] + 1):
            d = wp.vec2(short[0] + float(x) * space.size[0], short[1] + float(y) * space.size[1])
            if wp.length_sq(d) < within * within and count < room:
                if fill == 0:
                    count += 1
                elif apart(i, outlines.first_corner[i], j, outlines.first_corner[j], d, outlines, skins) < skins:
                    slot = pairs.start[i] + count
                    pairs.second[slot] = j
                    pairs.note[slot] = note_of(
                        int(wp.round((d[0] - (other[0] - own[0])) / space.size[0])),
                        int(wp.round((d[1] - (other[1] - own[1])) / space.size[1])),
                    )
                    count += 1
    return count


@wp.func
def pairs_of_run(
    before: int, room: int, i: int, smaller: bool, members: wp.vec2i, crowd: Crowd, fill: int, pairs: Pairs
):
    """The same with the bodies of a run of cells; where they are as large as body i, with those of larger numbers only."""
    count = before
    outlines = crowd.outlines
    own = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    reach = outlines.reach[i] + outlines.skin[i]
    for start in range(members[0], members[1], LANES):
        found = next_near(own, reach, SAFELY, start, members[1], crowd.neighbors)
        while found != 0:
            s = start + lowest_bit(found)
            found = found & (found - 1)
            j = crowd.neighbors.bodies.body[s]
            movable = outlines.lightness[i] + outlines.lightness[j] > 0.0
            if (smaller or j > i) and count < room and movable and keep_apart(i, j, crowd.neighbors.footprints.meeting):
                count = pairs_with(count, room, i, j, crowd, fill, pairs)
    return count


@wp.kernel
def find_pairs(
    first: int,
    crowd: Crowd,
    most: int,
    fill: int,
    # outputs
    pairs: Pairs,
):
    """Count the bodies that may come near each one while both move by no more than their skins; or note those that really may.

    Of two bodies of a level the one with the smaller number has the pair, else the smaller one of the two.
    """
    i = first + wp.tid()
    neighbors = crowd.neighbors
    at = wp.vec2(crowd.pose[i][0], crowd.pose[i][1])
    own_level = neighbors.footprints.level[i]
    reach = crowd.outlines.reach[i] + crowd.outlines.skin[i]
    count = int(0)
    room = most
    if fill != 0:
        room = pairs.start[i + 1] - pairs.start[i]
    for m in range(own_level + 1):
        around = cells_around(at, reach + neighbors.grid.reach[m], m, neighbors)
        for run in range(run_count(around)):
            members = bodies_of_run(run, around, neighbors)
            if count < room:
                count = pairs_of_run(count, room, i, m < own_level, members, crowd, fill, pairs)
    pairs.count[i] = count


@wp.kernel
def second_keys(
    first: int,
    slots_of: wp.array(dtype=wp.int32),
    pairs: Pairs,
    body_count: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """The second body of every slot, and ``body_count`` for slots without a pair."""
    p = first + wp.tid()
    order[p] = p
    # The body whose slots hold p.
    low = int(0)
    high = body_count
    while high - low > 1:
        middle = (low + high) / 2
        if slots_of[middle] <= p:
            low = middle
        else:
            high = middle
    if p < pairs.start[low] + pairs.count[low]:
        key[p] = pairs.second[p]
    else:
        key[p] = body_count
