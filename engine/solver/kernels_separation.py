"""Kernels that separate convex outlines: which are near, where they touch, and how they move apart.

An outline is a convex core of 1 to 16 corners (a point, a segment, a polygon) and a radius around it, so that discs, capsules and
polygons are the same to all that follows. Bodies are numbered as they lie in space.
"""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images
from ..space.kernels_neighbourhood import (
    LANES,
    SAFELY,
    ContactGrid,
    Sorted,
    cells_of_period,
    cells_within,
    lowest_bit,
    may_touch,
)
from ..space.kernels_space import Space, confine, difference, wrap
from .kernels_descent import Bodies, confine_line, slide

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(1.0e-9)
# The face that a contact lies on changes to one of the other body only where that is clearly farther out: it must not flicker.
CLEARLY = wp.constant(1.0e-4)
# Points of a face count for where a contact is if they are no shallower than the deepest by this share of the face.
BAND = wp.constant(0.05)
# What a body moves in a round at most: a share of its reach, and an angle [rad].
LARGEST_MOVE = wp.constant(0.25)
LARGEST_TURN = wp.constant(0.15)
# Contacts of a body whose corrections are made in full.
FULL_CONTACTS = wp.constant(2)
# A pair's note: the face that kept the two apart last, plus one, in the low bits; and which image of the second is meant.
FACE_BITS = wp.constant(63)
FACES_OF_ONE = wp.constant(32)
IMAGE_SHIFT = wp.constant(6)
IMAGES_A_SIDE = wp.constant(32)
# Weight of what stands out of the domain in the cost of a place.
WALL_COST = wp.constant(4.0)


@wp.struct
class Outlines:
    """What bodies are in contact, in spatial order.

    The body's number in the model; its first corner (one more at the end); the shape, and the factor on it; radius around the core,
    reach (from the position to the farthest point), smallest width and skin; inverse mass and inverse moment of inertia; the length of
    a line's axis, and how the outline is turned from it; the slope of the plane that the outline lies in.
    Corners of shapes, with the outward normal of the edge that begins there; ``corner`` are those of the bodies as they are turned.
    """

    body: wp.array(dtype=wp.int32)
    first_corner: wp.array(dtype=wp.int32)
    shape: wp.array(dtype=wp.int32)
    factor: wp.array(dtype=float)
    rounding: wp.array(dtype=float)
    reach: wp.array(dtype=float)
    width: wp.array(dtype=float)
    skin: wp.array(dtype=float)
    lightness: wp.array(dtype=float)
    ease: wp.array(dtype=float)
    length: wp.array(dtype=float)
    offset: wp.array(dtype=float)
    slope: wp.array(dtype=wp.vec2)
    shape_start: wp.array(dtype=wp.int32)
    shape_corner: wp.array(dtype=wp.vec4)
    corner: wp.array(dtype=wp.vec4)


@wp.struct
class Pairs:
    """Pairs of bodies that are near, those of a body (the first) one after the other from ``start`` on, ``count`` of them.

    The second body; a note (see :data:`FACE_BITS`); what the contact asks for (along x and y of the second, turns of the first and the
    second, per unit of inverse mass and inertia); depth over the smaller width, below 0 where they are apart.
    """

    start: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    second: wp.array(dtype=wp.int32)
    note: wp.array(dtype=wp.int32)
    push: wp.array(dtype=wp.vec4)
    depth: wp.array(dtype=float)


@wp.struct
class Slopes:
    """Images of slopes, one after the other: which a body lies in (-1: none), first pixel, rows, columns, and the pixels."""

    image: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)
    rows: wp.array(dtype=wp.int32)
    columns: wp.array(dtype=wp.int32)
    pixel: wp.array(dtype=wp.vec2)


# Numbers of a round, by their places in an array, because they change.
DAMPING = wp.constant(0)
MOMENTUM = wp.constant(1)
COASTING = wp.constant(2)
PULL = wp.constant(3)
SLACK = wp.constant(4)


@wp.kernel
def begin_list(
    first: int,
    space: Space,
    # outputs
    place: wp.array(dtype=wp.vec4),
    built: wp.array(dtype=wp.vec4),
    moved_far: wp.array(dtype=wp.int32),
):
    """Bring bodies back into a periodic domain, and note where they are when pairs are listed."""
    i = first + wp.tid()
    own = place[i]
    p = confine(wp.vec2(own[0], own[1]), space)
    place[i] = wp.vec4(p[0], p[1], own[2], 0.0)
    built[i] = place[i]
    if i == 0:
        for thread in range(moved_far.shape[0]):
            moved_far[thread] = 0


@wp.kernel
def find_slopes(
    first: int,
    place: wp.array(dtype=wp.vec4),
    slopes: Slopes,
    space: Space,
    # outputs
    slope: wp.array(dtype=wp.vec2),
):
    """Slope of the plane that every outline lies in where its body is, blended from the pixels around it."""
    i = first + wp.tid()
    m = slopes.image[i]
    if m >= 0:
        p = confine(wp.vec2(place[i][0], place[i][1]), space)
        rows = slopes.rows[m]
        columns = slopes.columns[m]
        x = wp.clamp(p[0] / space.size[0] * float(columns) - 0.5, 0.0, float(columns - 1))
        y = wp.clamp((1.0 - p[1] / space.size[1]) * float(rows) - 0.5, 0.0, float(rows - 1))
        left = int(x)
        top = int(y)
        right = wp.min(left + 1, columns - 1)
        below = wp.min(top + 1, rows - 1)
        u = x - float(left)
        v = y - float(top)
        upper = slopes.start[m] + top * columns
        lower = slopes.start[m] + below * columns
        one = slopes.pixel[upper + left] * (1.0 - u) + slopes.pixel[upper + right] * u
        other = slopes.pixel[lower + left] * (1.0 - u) + slopes.pixel[lower + right] * u
        slope[i] = one * (1.0 - v) + other * v


@wp.func
def seen_from_above(v: wp.vec4, slope: wp.vec2):
    """A corner and its normal, in a plane of this slope, as they are seen from above."""
    square = wp.length_sq(slope)
    root = wp.sqrt(1.0 + square)
    along = (v[0] * slope[0] + v[1] * slope[1]) / (1.0 + square + root)
    across = (v[2] * slope[0] + v[3] * slope[1]) / (1.0 + root)
    n = wp.normalize(wp.vec2(v[2] + slope[0] * across, v[3] + slope[1] * across))
    return wp.vec4(v[0] - slope[0] * along, v[1] - slope[1] * along, n[0], n[1])


@wp.func
def turned_corner(v: wp.vec4, factor: float, c: float, s: float, slope: wp.vec2):
    """A corner of a shape and its normal as a body has them."""
    w = wp.vec4(
        factor * (c * v[0] - s * v[1]), factor * (s * v[0] + c * v[1]), c * v[2] - s * v[3], s * v[2] + c * v[3]
    )
    if slope[0] != 0.0 or slope[1] != 0.0:
        w = seen_from_above(w, slope)
    return w


@wp.kernel
def turn_corners(
    first: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    # outputs
    corner: wp.array(dtype=wp.vec4),
):
    i = first + wp.tid()
    begin = outlines.first_corner[i]
    count = outlines.first_corner[i + 1] - begin
    c = wp.cos(place[i][2] + outlines.offset[i])
    s = wp.sin(place[i][2] + outlines.offset[i])
    slope = outlines.slope[i]
    if outlines.length[i] > 0.0 and (slope[0] != 0.0 or slope[1] != 0.0):
        # The angle of a line is that of its axis as it is seen from above.
        across = (c * slope[0] + s * slope[1]) / (1.0 + wp.sqrt(1.0 + wp.length_sq(slope)))
        way = wp.normalize(wp.vec2(c + slope[0] * across, s + slope[1] * across))
        c = way[0]
        s = way[1]
    factor = outlines.factor[i]
    start = outlines.shape_start[outlines.shape[i]]
    for k in range(count):
        corner[begin + k] = turned_corner(outlines.shape_corner[start + k], factor, c, s, slope)


@wp.func
def support(corner: wp.array(dtype=wp.vec4), start: int, count: int, n: wp.vec2):
    """The corner that lies least far along ``n``, and how far that is."""
    lowest = float(1.0e30)
    k = int(0)
    for q in range(count):
        v = corner[start + q]
        along = n[0] * v[0] + n[1] * v[1]
        if along < lowest:
            lowest = along
            k = q
    return lowest, k


@wp.func
def separation_along_faces(
    corner: wp.array(dtype=wp.vec4),
    a: int,
    a_count: int,
    b: int,
    b_count: int,
    d: wp.vec2,
    enough: float,
):
    """How far B, at offset ``d``, lies beyond the face of A that it lies farthest beyond; that face, and B's corner nearest to it.

    The corner is walked round with the face. Faces after one that it lies ``enough`` beyond are not looked at.
    """
    best = float(-1.0e30)
    face = int(0)
    nearest = int(0)
    k = int(0)
    lowest = float(0.0)
    e = int(0)
    while e < a_count:
        v = corner[a + e]
        n = wp.vec2(v[2], v[3])
        if e == 0:
            lowest, k = support(corner, b, b_count, n)
        else:
            w = corner[b + k]
            lowest = n[0] * w[0] + n[1] * w[1]
            steps = int(1)
            while steps < b_count:
                q = k + 1
                if q == b_count:
                    q = 0
                w = corner[b + q]
                along = n[0] * w[0] + n[1] * w[1]
                if along < lowest:
                    lowest = along
                    k = q
                    steps += 1
                else:
                    steps = b_count
        beyond = n[0] * (d[0] - v[0]) + n[1] * (d[1] - v[1]) + lowest
        if beyond > best:
            best = beyond
            face = e
            nearest = k
        e += 1
        if best >= enough:
            e = a_count
    return best, face, nearest


@wp.func
def face_contact(
    corner: wp.array(dtype=wp.vec4),
    a: int,
    a_count: int,
    face: int,
    b: int,
    b_count: int,
    nearest: int,
    o: wp.vec2,
):
    """Middle of the contact of a face of A with B, at offset ``o``, weighted by depth; from A's position."""
    v = corner[a + face]
    n = wp.vec2(v[2], v[3])
    t = wp.vec2(-n[1], n[0])
    following = face + 1
    if following == a_count:
        following = 0
    w = corner[a + following]
    low = t[0] * v[0] + t[1] * v[1]
    high = t[0] * w[0] + t[1] * w[1]
    height = n[0] * v[0] + n[1] * v[1]
    p = corner[b + nearest]
    if b_count == 1:
        along = wp.clamp(t[0] * (p[0] + o[0]) + t[1] * (p[1] + o[1]), low, high)
        above = n[0] * (p[0] + o[0]) + n[1] * (p[1] + o[1])
        return t * along + n * (0.5 * (height + above))
    before = nearest - 1
    if before < 0:
        before = b_count - 1
    # Of the two edges at the nearest corner, the one that faces A more.
    q0 = before
    q1 = nearest
    r = corner[b + before]
    if p[2] * n[0] + p[3] * n[1] < r[2] * n[0] + r[3] * n[1]:
        q0 = nearest
        q1 = nearest + 1
        if q1 == b_count:
            q1 = 0
    u0 = corner[b + q0]
    u1 = corner[b + q1]
    s0 = t[0] * (u0[0] + o[0]) + t[1] * (u0[1] + o[1])
    d0 = n[0] * (u0[0] + o[0]) + n[1] * (u0[1] + o[1]) - height
    s1 = t[0] * (u1[0] + o[0]) + t[1] * (u1[1] + o[1])
    d1 = n[0] * (u1[0] + o[0]) + n[1] * (u1[1] + o[1]) - height
    a0 = s0
    b0 = d0
    a1 = s1
    b1 = d1
    if wp.abs(s1 - s0) > TINY:
        slope = (d1 - d0) / (s1 - s0)
        a0 = wp.clamp(s0, low, high)
        b0 = d0 + slope * (a0 - s0)
        a1 = wp.clamp(s1, low, high)
        b1 = d0 + slope * (a1 - s0)
    band = BAND * (high - low)
    deepest = wp.min(b0, b1)
    w0 = wp.max(0.0, deepest + band - b0)
    w1 = wp.max(0.0, deepest + band - b1)
    w0 = w0 * w0
    w1 = w1 * w1
    total = w0 + w1
    along = 0.5 * (a0 + a1)
    if total > 0.0:
        along = (w0 * a0 + w1 * a1) / total
    return t * along + n * (height + 0.5 * deepest)


@wp.func
def nearest_on_edges(
    corner: wp.array(dtype=wp.vec4),
    a: int,
    a_count: int,
    b: int,
    b_count: int,
    d: wp.vec2,
):
    """Of A's edges and the corners of B, at offset ``d``: squared distance of the nearest two, the edge's point and the corner."""
    best = float(1.0e30)
    on_a = wp.vec2(0.0, 0.0)
    on_b = wp.vec2(0.0, 0.0)
    edges = a_count
    if a_count == 2:
        edges = 1
    for e in range(edges):
        following = e + 1
        if following == a_count:
            following = 0
        v = corner[a + e]
        w = corner[a + following]
        ux = w[0] - v[0]
        uy = w[1] - v[1]
        uu = ux * ux + uy * uy
        for q in range(b_count):
            p = corner[b + q]
            px = p[0] + d[0] - v[0]
            py = p[1] + d[1] - v[1]
            s = float(0.0)
            if uu > 0.0:
                s = wp.clamp((px * ux + py * uy) / uu, 0.0, 1.0)
            gx = px - s * ux
            gy = py - s * uy
            g = gx * gx + gy * gy
            if g < best:
                best = g
                on_a = wp.vec2(v[0] + s * ux, v[1] + s * uy)
                on_b = wp.vec2(p[0] + d[0], p[1] + d[1])
    return best, on_a, on_b


@wp.func
def beyond_face(corner: wp.array(dtype=wp.vec4), a: int, a_count: int, b: int, b_count: int, d: wp.vec2, face: int):
    """How far B lies beyond one face: of A, or, counted from :data:`FACES_OF_ONE` on, how far A lies beyond one of B's."""
    result = float(-1.0e30)
    if face < FACES_OF_ONE:
        if face < a_count:
            v = corner[a + face]
            lowest, _k = support(corner, b, b_count, wp.vec2(v[2], v[3]))
            result = v[2] * (d[0] - v[0]) + v[3] * (d[1] - v[1]) + lowest
    elif face - FACES_OF_ONE < b_count:
        v = corner[b + face - FACES_OF_ONE]
        lowest, _k = support(corner, a, a_count, wp.vec2(v[2], v[3]))
        result = v[2] * (-d[0] - v[0]) + v[3] * (-d[1] - v[1]) + lowest
    return result


@wp.func
def apart(i: int, a: int, j: int, d: wp.vec2, outlines: Outlines, enough: float):
    """A lower bound of the distance of two outlines, exact where they overlap; beyond ``enough``, any. ``a`` is i's first corner."""
    a_count = outlines.first_corner[i + 1] - outlines.first_corner[i]
    b = outlines.first_corner[j]
    b_count = outlines.first_corner[j + 1] - b
    r = outlines.rounding[i] + outlines.rounding[j]
    best = float(-1.0e30)
    if a_count > 1:
        best, _face, _k = separation_along_faces(outlines.corner, a, a_count, b, b_count, d, enough + r)
    if b_count > 1 and best < enough + r:
        other, _face, _k = separation_along_faces(outlines.corner, b, b_count, a, a_count, -d, enough + r)
        best = wp.max(best, other)
    if a_count == 1 and b_count == 1:
        v = outlines.corner[a]
        w = outlines.corner[b]
        best = wp.length(wp.vec2(d[0] + w[0] - v[0], d[1] + w[1] - v[1]))
    return best - r


@wp.func
def touch(i: int, j: int, d: wp.vec2, outlines: Outlines, enough: float, hint: int):
    """The contact of body i with j, which is at offset ``d``.

    Returns the signed distance (a lower bound where it is ``enough`` or more), the direction from i to j, the contact from i's
    position, and the face that keeps them apart as a hint for the next time.
    """
    corner = outlines.corner
    a = outlines.first_corner[i]
    a_count = outlines.first_corner[i + 1] - a
    b = outlines.first_corner[j]
    b_count = outlines.first_corner[j + 1] - b
    ra = outlines.rounding[i]
    rb = outlines.rounding[j]
    r = ra + rb
    n = wp.vec2(1.0, 0.0)
    at = wp.vec2(0.0, 0.0)
    distance = float(0.0)
    next_hint = hint
    if a_count == 1 and b_count == 1:
        v = corner[a]
        w = corner[b]
        gap = wp.vec2(d[0] + w[0] - v[0], d[1] + w[1] - v[1])
        length = wp.length(gap)
        if length > TINY:
            n = gap / length
        else:
            # Bodies on one another part in a direction of their own.
            angle = 0.01 * float((i * 7 + j * 13) % 628)
            n = wp.vec2(wp.cos(angle), wp.sin(angle))
        distance = length - r
        at = wp.vec2(v[0], v[1]) + n * (0.5 * (ra + length - rb))
    else:
        known = float(-1.0e30)
        if hint > 0:
            known = beyond_face(corner, a, a_count, b, b_count, d, hint - 1)
        if known >= enough + r:
            distance = known - r
        else:
            best = float(-1.0e30)
            face = int(0)
            nearest = int(0)
            of_b = int(0)
            if a_count > 1:
                best, face, nearest = separation_along_faces(corner, a, a_count, b, b_count, d, enough + r)
            if b_count > 1 and best < enough + r:
                other, other_face, other_nearest = separation_along_faces(
                    corner, b, b_count, a, a_count, -d, enough + r
                )
                if other > best + CLEARLY * wp.abs(best) + TINY:
                    best = other
                    face = other_face
                    nearest = other_nearest
                    of_b = 1
            next_hint = 1 + face + of_b * FACES_OF_ONE
            distance = best - r
            if distance < enough:
                round_contact = int(0)
                if best > 0.0 and r > 0.0:
                    # Cores apart: the nearest points may be corners, nearer in no direction of a face.
                    squared, on_a, on_b = nearest_on_edges(corner, a, a_count, b, b_count, d)
                    if b_count > 1:
                        other_squared, other_on_b, other_on_a = nearest_on_edges(corner, b, b_count, a, a_count, -d)
                        if other_squared < squared:
                            squared = other_squared
                            on_a = other_on_a + d
                            on_b = other_on_b + d
                    length = wp.sqrt(squared)
                    if length > best * 1.001 and length > TINY:
                        n = (on_b - on_a) / length
                        distance = length - r
                        at = on_a + n * (0.5 * (ra + length - rb))
                        round_contact = 1
                if round_contact == 0:
                    if of_b == 0:
                        v = corner[a + face]
                        n = wp.vec2(v[2], v[3])
                        at = face_contact(corner, a, a_count, face, b, b_count, nearest, d) + n * (0.5 * (ra - rb))
                    else:
                        v = corner[b + face]
                        n = wp.vec2(-v[2], -v[3])
                        at = face_contact(corner, b, b_count, face, a, a_count, nearest, -d) + d + n * (0.5 * (ra - rb))
    return distance, n, at, next_hint


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


@wp.kernel
def find_pairs(
    first: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    near: Sorted,
    level: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    images: wp.vec2i,
    most: int,
    fill: int,
    # outputs
    pairs: Pairs,
):
    """Count the bodies that may come near each one while both move by no more than their skins; or note those that really may.

    Of two bodies of a level the one with the smaller number has the pair, else the smaller one of the two. ``images`` is how many
    periods away images of a body can still be near.
    """
    i = first + wp.tid()
    own = place[i]
    reach = outlines.reach[i] + outlines.skin[i]
    own_level = level[i]
    count = int(0)
    base_slot = int(0)
    room = most
    if fill != 0:
        base_slot = pairs.start[i]
        room = pairs.start[i + 1] - base_slot
    wrapping = wp.where(grid.space.periodic != 0, 1, 0)
    for m in range(own_level + 1):
        distance_most = reach + grid.reach[m]
        columns = cells_within(own[0], distance_most, grid.space.size[0], grid.count_x[m], grid.space.periodic)
        rows = cells_within(own[1], distance_most, grid.space.size[1], grid.count_y[m], grid.space.periodic)
        for unwrapped in range(rows[0], rows[1] + 1):
            row = wrap(unwrapped, grid.count_y[m])
            base = grid.first_cell[m] + row * grid.count_x[m]
            for period in range(1 - wrapping, 2 + wrapping):
                cells = cells_of_period(columns, period, grid.count_x[m])
                begin = int(0)
                end = int(0)
                if cells[0] <= cells[1] and count < room:
                    begin = cell_start[base + cells[0]]
                    end = cell_start[base + cells[1] + 1]
                for start in range(begin, end, LANES):
                    found = may_touch(
                        own[0],
                        own[1],
                        reach,
                        SAFELY,
                        grid.space.size,
                        grid.space.periodic,
                        start,
                        end,
                        near.x,
                        near.y,
                        near.reach,
                    )
                    while found != 0:
                        s = start + lowest_bit(found)
                        found = found & (found - 1)
                        j = near.body[s]
                        if (
                            (m < own_level or j > i)
                            and count < room
                            and outlines.lightness[i] + outlines.lightness[j] > 0.0
                        ):
                            other = place[j]
                            raw = wp.vec2(other[0] - own[0], other[1] - own[1])
                            short = difference(wp.vec2(own[0], own[1]), wp.vec2(other[0], other[1]), grid.space)
                            within = reach + outlines.reach[j] + outlines.skin[j]
                            for y in range(-images[1], images[1] + 1):
                                for x in range(-images[0], images[0] + 1):
                                    d = wp.vec2(
                                        short[0] + float(x) * grid.space.size[0],
                                        short[1] + float(y) * grid.space.size[1],
                                    )
                                    if wp.length_sq(d) < within * within and count < room:
                                        if fill == 0:
                                            count += 1
                                        else:
                                            skins = outlines.skin[i] + outlines.skin[j]
                                            if apart(i, outlines.first_corner[i], j, d, outlines, skins) < skins:
                                                pairs.second[base_slot + count] = j
                                                pairs.note[base_slot + count] = note_of(
                                                    int(wp.round((d[0] - raw[0]) / grid.space.size[0])),
                                                    int(wp.round((d[1] - raw[1]) / grid.space.size[1])),
                                                )
                                                count += 1
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


@wp.kernel
def find_pushes(
    first: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    size: wp.vec2,
    settings: wp.array(dtype=float),
    # outputs
    pairs: Pairs,
):
    """What every pair's contact asks for; an element is a body with the pairs whose first it is."""
    i = first + wp.tid()
    own = place[i]
    start = pairs.start[i]
    lightness = outlines.lightness[i]
    ease = outlines.ease[i]
    width = outlines.width[i]
    slack_share = settings[SLACK]
    for p in range(start, start + pairs.count[i]):
        j = pairs.second[p]
        note = pairs.note[p]
        other = place[j]
        image = image_of(note, size)
        d = wp.vec2(other[0] - own[0] + image[0], other[1] - own[1] + image[1])
        narrower = wp.min(width, outlines.width[j])
        slack = slack_share * narrower
        asked = wp.vec4(0.0, 0.0, 0.0, 0.0)
        depth = float(-1.0)
        within = outlines.reach[i] + outlines.reach[j] + slack
        if wp.length_sq(d) < within * within:
            distance, n, at, hint = touch(i, j, d, outlines, slack, note & FACE_BITS)
            pairs.note[p] = (note & ~FACE_BITS) | hint
            if distance < slack:
                lever = at[0] * n[1] - at[1] * n[0]
                other_lever = (at[0] - d[0]) * n[1] - (at[1] - d[1]) * n[0]
                give = (
                    lightness
                    + outlines.lightness[j]
                    + lever * lever * ease
                    + other_lever * other_lever * outlines.ease[j]
                )
                if give > 0.0:
                    push = (slack - distance) / give
                    asked = wp.vec4(n[0] * push, n[1] * push, lever * push, other_lever * push)
                depth = -distance / narrower
        pairs.push[p] = asked
        pairs.depth[p] = depth


@wp.func
def wall_contact(i: int, corners: int, side: int, p: wp.vec2, outlines: Outlines, size: wp.vec2):
    """How far a body stands out over an edge of the domain, the direction back inside, and the lever of the contact."""
    n = wp.vec2(1.0, 0.0)
    inside = p[0]
    if side == 1:
        n = wp.vec2(-1.0, 0.0)
        inside = size[0] - p[0]
    elif side == 2:
        n = wp.vec2(0.0, 1.0)
        inside = p[1]
    elif side == 3:
        n = wp.vec2(0.0, -1.0)
        inside = size[1] - p[1]
    count = outlines.first_corner[i + 1] - outlines.first_corner[i]
    lowest, _k = support(outlines.corner, corners, count, n)
    depth = outlines.rounding[i] - inside - lowest
    band = BAND * outlines.reach[i]
    weights = float(0.0)
    lever = float(0.0)
    for q in range(count):
        v = outlines.corner[corners + q]
        above = n[0] * v[0] + n[1] * v[1] - lowest
        if above < band:
            weight = (band - above) * (band - above)
            weights += weight
            lever += weight * (v[0] * n[1] - v[1] * n[0])
    return depth, n, lever / weights


@wp.kernel
def move_apart(
    first: int,
    thread: int,
    outlines: Outlines,
    pairs: Pairs,
    second_start: wp.array(dtype=wp.int32),
    second_slot: wp.array(dtype=wp.int32),
    home: wp.array(dtype=wp.vec4),
    built: wp.array(dtype=wp.vec4),
    bodies: Bodies,
    bend: wp.array(dtype=float),
    images: Images,
    space: Space,
    inset: int,
    settings: wp.array(dtype=float),
    # outputs
    place: wp.array(dtype=wp.vec4),
    last_move: wp.array(dtype=wp.vec4),
    moved_far: wp.array(dtype=wp.int32),
):
    """Move every body as its contacts, its momentum and the pull to where it came from ask for.

    Every thread counts those in ``moved_far`` that are farther than their skins from where pairs were listed.
    """
    i = first + wp.tid()
    lightness = outlines.lightness[i]
    if lightness == 0.0:
        return
    ease = outlines.ease[i]
    own = place[i]
    p = wp.vec2(own[0], own[1])
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
    for at in range(second_start[i], second_start[i + 1]):
        slot = second_slot[at]
        if pairs.depth[slot] > -1.0:
            push = pairs.push[slot]
            sx += push[0]
            sy += push[1]
            turn += push[3]
            contacts += 1
    sx = sx * lightness
    sy = sy * lightness
    turn = turn * ease
    if inset != 0:
        slack = 0.5 * settings[SLACK] * outlines.width[i]
        for side in range(4):
            depth, n, lever = wall_contact(i, outlines.first_corner[i], side, p, outlines, space.size)
            if depth > -slack:
                strength = (depth + slack) / (lightness + lever * lever * ease)
                sx += n[0] * strength * lightness
                sy += n[1] * strength * lightness
                turn += lever * strength * ease
                contacts += 1
    momentum = settings[MOMENTUM]
    before = last_move[i]
    share = settings[COASTING]
    scale = float(0.0)
    if contacts > 0:
        share = momentum
        scale = settings[DAMPING]
        if contacts > FULL_CONTACTS:
            scale = scale * float(FULL_CONTACTS) / float(contacts)
    mx = sx * scale + share * before[0]
    my = sy * scale + share * before[1]
    mt = turn * scale + share * before[2]
    pull = settings[PULL]
    if pull > 0.0:
        back = difference(confine(p, space), confine(wp.vec2(home[i][0], home[i][1]), space), space)
        mx += pull * back[0]
        my += pull * back[1]
    limit = LARGEST_MOVE * outlines.reach[i]
    length = wp.sqrt(mx * mx + my * my)
    if length > limit:
        mx = mx * limit / length
        my = my * limit / length
    mt = wp.clamp(mt, -LARGEST_TURN, LARGEST_TURN)
    body = outlines.body[i]
    k = bodies.support[body]
    inside = confine(p, space)
    angle = own[2] + mt
    end = inside
    if bodies.line[body] < 0:
        end = slide(inside, inside + wp.vec2(mx, my), k, images, space)
    else:
        line = confine_line(
            wp.vec4(inside[0], inside[1], own[2], outlines.length[i]),
            wp.vec4(inside[0] + mx, inside[1] + my, angle, outlines.length[i]),
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
    place[i] = wp.vec4(own[0] + way[0], own[1] + way[1], angle, 0.0)
    last_move[i] = wp.vec4(way[0], way[1], angle - own[2], 0.0)
    gone_x = own[0] + way[0] - built[i][0]
    gone_y = own[1] + way[1] - built[i][1]
    gone = wp.sqrt(gone_x * gone_x + gone_y * gone_y) + wp.abs(angle - built[i][2]) * outlines.reach[i]
    if not (gone <= outlines.skin[i]):
        wp.atomic_add(moved_far, thread, 1)


@wp.kernel
def measure_overlaps(
    first: int,
    place: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    pairs: Pairs,
    second_start: wp.array(dtype=wp.int32),
    second_slot: wp.array(dtype=wp.int32),
    space: Space,
    inset: int,
    tolerance: float,
    # outputs
    deep: wp.array(dtype=wp.int32),
    touching: wp.array(dtype=wp.int32),
    cost: wp.array(dtype=float),
):
    """Of every body: how many pairs whose first it is overlap by more than the tolerance, how many at all, and its squared overlaps.

    Overlaps count in smaller widths; edges of the domain count as bodies.
    """
    i = first + wp.tid()
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
    for at in range(second_start[i], second_start[i + 1]):
        depth = wp.max(pairs.depth[second_slot[at]], 0.0)
        squares += depth * depth
    if inset != 0:
        p = wp.vec2(place[i][0], place[i][1])
        for side in range(4):
            depth, _n, _lever = wall_contact(i, outlines.first_corner[i], side, p, outlines, space.size)
            depth = depth / outlines.width[i]
            if depth > 0.0:
                overlaps += 1
                squares += WALL_COST * depth * depth
                if depth > tolerance:
                    deeper += 1
    deep[i] = deeper
    touching[i] = overlaps
    cost[i] = squares


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
        for side in range(4):
            depth, _n, _lever = wall_contact(i, corners, side, at, outlines, grid.space.size)
            depth = wp.max(depth, 0.0) / outlines.width[i]
            total += WALL_COST * depth * depth
    wrapping = wp.where(grid.space.periodic != 0, 1, 0)
    for m in range(grid.level_count):
        distance_most = reach + grid.reach[m]
        columns = cells_within(at[0], distance_most, grid.space.size[0], grid.count_x[m], grid.space.periodic)
        rows = cells_within(at[1], distance_most, grid.space.size[1], grid.count_y[m], grid.space.periodic)
        for unwrapped in range(rows[0], rows[1] + 1):
            row = wrap(unwrapped, grid.count_y[m])
            base = grid.first_cell[m] + row * grid.count_x[m]
            for period in range(1 - wrapping, 2 + wrapping):
                cells = cells_of_period(columns, period, grid.count_x[m])
                begin = int(0)
                end = int(0)
                if cells[0] <= cells[1] and total < most:
                    begin = cell_start[base + cells[0]]
                    end = cell_start[base + cells[1] + 1]
                for start in range(begin, end, LANES):
                    found = may_touch(
                        at[0],
                        at[1],
                        reach,
                        SAFELY,
                        grid.space.size,
                        grid.space.periodic,
                        start,
                        end,
                        near.x,
                        near.y,
                        near.reach,
                    )
                    while found != 0 and total < most:
                        s = start + lowest_bit(found)
                        found = found & (found - 1)
                        j = near.body[s]
                        if j != i and j != without:
                            short = difference(at, wp.vec2(place[j][0], place[j][1]), grid.space)
                            within = reach + outlines.reach[j]
                            for y in range(-images[1], images[1] + 1):
                                for x in range(-images[0], images[0] + 1):
                                    d = wp.vec2(
                                        short[0] + float(x) * grid.space.size[0],
                                        short[1] + float(y) * grid.space.size[1],
                                    )
                                    if wp.length_sq(d) < within * within:
                                        depth = -apart(i, corners, j, d, outlines, 0.0)
                                        if depth > 0.0:
                                            depth = depth / wp.min(outlines.width[i], outlines.width[j])
                                            total += depth * depth
    return total


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
                there_in = confine(there, grid.space)
                own_in = confine(own, grid.space)
                after = cost_of_place(
                    i,
                    outlines.first_corner[i],
                    j,
                    there_in,
                    most,
                    place,
                    outlines,
                    near,
                    cell_start,
                    grid,
                    images,
                    inset,
                )
                if after < most:
                    after += cost_of_place(
                        j,
                        outlines.first_corner[j],
                        i,
                        own_in,
                        most - after,
                        place,
                        outlines,
                        near,
                        cell_start,
                        grid,
                        images,
                        inset,
                    )
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
    best = int(1)
    if gain[i] <= 0.0:
        best = 0
    wrapping = wp.where(grid.space.periodic != 0, 1, 0)
    for m in range(grid.level_count):
        distance_most = reach + grid.reach[m]
        columns = cells_within(own[0], distance_most, grid.space.size[0], grid.count_x[m], grid.space.periodic)
        rows = cells_within(own[1], distance_most, grid.space.size[1], grid.count_y[m], grid.space.periodic)
        for unwrapped in range(rows[0], rows[1] + 1):
            row = wrap(unwrapped, grid.count_y[m])
            base = grid.first_cell[m] + row * grid.count_x[m]
            for period in range(1 - wrapping, 2 + wrapping):
                cells = cells_of_period(columns, period, grid.count_x[m])
                begin = int(0)
                end = int(0)
                if cells[0] <= cells[1] and best != 0:
                    begin = cell_start[base + cells[0]]
                    end = cell_start[base + cells[1] + 1]
                for start in range(begin, end, LANES):
                    found = may_touch(
                        own[0],
                        own[1],
                        reach,
                        SAFELY,
                        grid.space.size,
                        grid.space.periodic,
                        start,
                        end,
                        near.x,
                        near.y,
                        near.reach,
                    )
                    while found != 0 and best != 0:
                        s = start + lowest_bit(found)
                        found = found & (found - 1)
                        j = near.body[s]
                        if gain[j] > gain[i] or (gain[j] == gain[i] and j < i):
                            best = 0
    turned[i] = best
    if best != 0:
        place[i] = wp.vec4(own[0], own[1], angle[i], own[3])
