"""Functions for kernels: where two outlines touch, in which direction, and how deep."""

from __future__ import annotations

import warp as wp

from .kernels_outlines import BAND, FACES_OF_ONE, Outlines, apart, beyond_face, separation_along_faces, support

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(1.0e-9)
# The face that a contact lies on changes to one of the other body only where that is clearly farther out: it must not flicker.
CLEARLY = wp.constant(1.0e-4)
# Two long outlines lie side by side where the ways across them are at most this many times as wide as both are at their narrowest.
SIDE_BY_SIDE = wp.constant(1.5)
# The least that two outlines lie in one another along a face, as a share of the way to where they lie as deep as they can.
LEAST_DEPTH = wp.constant(1.0e-4)


@wp.struct
class Contact:
    """The signed distance of two outlines, the direction from the first to the second, and where they touch, from the first body.

    ``hint`` is the face that keeps them apart, plus one: it is the first that the next search looks at.
    """

    distance: float
    direction: wp.vec2
    at: wp.vec2
    hint: wp.int32


@wp.struct
class Core:
    """The core of an outline: its first corner and how many it has; and the radius around it."""

    first: wp.int32
    count: wp.int32
    rounding: float


@wp.struct
class Face:
    """How far one core lies beyond a face of another; which face, the corner nearest to it, and 1 if it is one of the second core."""

    beyond: float
    face: wp.int32
    nearest: wp.int32
    of_second: wp.int32


@wp.func
def core_of(i: int, outlines: Outlines):
    result = Core()
    result.first = outlines.first_corner[i]
    result.count = outlines.first_corner[i + 1] - result.first
    result.rounding = outlines.rounding[i]
    return result


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
def touch_of_points(i: int, j: int, a: Core, b: Core, d: wp.vec2, corner: wp.array(dtype=wp.vec4)):
    """The contact of two cores of a single corner each."""
    result = Contact()
    v = corner[a.first]
    w = corner[b.first]
    gap = wp.vec2(d[0] + w[0] - v[0], d[1] + w[1] - v[1])
    length = wp.length(gap)
    if length > TINY:
        result.direction = gap / length
    else:
        # Bodies on one another part in a direction of their own.
        angle = 0.01 * float((i * 7 + j * 13) % 628)
        result.direction = wp.vec2(wp.cos(angle), wp.sin(angle))
    result.distance = length - (a.rounding + b.rounding)
    result.at = wp.vec2(v[0], v[1]) + result.direction * (0.5 * (a.rounding + length - b.rounding))
    return result


@wp.func
def farthest_face(a: Core, b: Core, d: wp.vec2, enough: float, corner: wp.array(dtype=wp.vec4)):
    """The face of either core that the other one lies farthest beyond; ``enough`` ends the search."""
    result = Face()
    best = float(-1.0e30)
    face = int(0)
    nearest = int(0)
    if a.count > 1:
        best, face, nearest = separation_along_faces(corner, a.first, a.count, b.first, b.count, d, enough)
    if b.count > 1 and best < enough:
        other, other_face, other_nearest = separation_along_faces(
            corner, b.first, b.count, a.first, a.count, -d, enough
        )
        if other > best + CLEARLY * wp.abs(best) + TINY:
            best = other
            face = other_face
            nearest = other_nearest
            result.of_second = 1
    result.beyond = best
    result.face = face
    result.nearest = nearest
    return result


@wp.func
def touch_of_corners(found: Face, a: Core, b: Core, d: wp.vec2, corner: wp.array(dtype=wp.vec4)):
    """The contact of cores that are apart, where their nearest points are nearer in no direction of a face; else a ``hint`` of 0."""
    result = Contact()
    squared, on_a, on_b = nearest_on_edges(corner, a.first, a.count, b.first, b.count, d)
    if b.count > 1:
        other_squared, other_on_b, other_on_a = nearest_on_edges(corner, b.first, b.count, a.first, a.count, -d)
        if other_squared < squared:
            squared = other_squared
            on_a = other_on_a + d
            on_b = other_on_b + d
    length = wp.sqrt(squared)
    if length > found.beyond * 1.001 and length > TINY:
        result.direction = (on_b - on_a) / length
        result.distance = length - (a.rounding + b.rounding)
        result.at = on_a + result.direction * (0.5 * (a.rounding + length - b.rounding))
        result.hint = 1
    return result


@wp.func
def touch_of_face(found: Face, a: Core, b: Core, d: wp.vec2, corner: wp.array(dtype=wp.vec4)):
    """The contact along a face."""
    result = Contact()
    result.distance = found.beyond - (a.rounding + b.rounding)
    between = 0.5 * (a.rounding - b.rounding)
    if found.of_second == 0:
        v = corner[a.first + found.face]
        result.direction = wp.vec2(v[2], v[3])
        middle = face_contact(corner, a.first, a.count, found.face, b.first, b.count, found.nearest, d)
        result.at = middle + result.direction * between
    else:
        v = corner[b.first + found.face]
        result.direction = wp.vec2(-v[2], -v[3])
        middle = face_contact(corner, b.first, b.count, found.face, a.first, a.count, found.nearest, -d)
        result.at = middle + d + result.direction * between
    return result


@wp.func
def touch_of_cores(a: Core, b: Core, d: wp.vec2, enough: float, hint: int, corner: wp.array(dtype=wp.vec4)):
    """The contact of two cores, of which one has faces; only its distance and hint where that is ``enough`` or more."""
    result = Contact()
    r = a.rounding + b.rounding
    known = float(-1.0e30)
    if hint > 0:
        known = beyond_face(corner, a.first, a.count, b.first, b.count, d, hint - 1)
    if known >= enough + r:
        result.distance = known - r
        result.hint = hint
        return result
    found = farthest_face(a, b, d, enough + r, corner)
    next_hint = 1 + found.face + found.of_second * FACES_OF_ONE
    result.distance = found.beyond - r
    if result.distance < enough:
        if found.beyond > 0.0 and r > 0.0:
            # Cores apart: the nearest points may be corners.
            result = touch_of_corners(found, a, b, d, corner)
        else:
            result.hint = 0
        if result.hint == 0:
            result = touch_of_face(found, a, b, d, corner)
    result.hint = next_hint
    return result


@wp.func
def touch_between(i: int, j: int, a: Core, b: Core, d: wp.vec2, outlines: Outlines, enough: float, hint: int):
    """The contact of body i with j, whose cores have these corners; see :func:`touch`."""
    if a.count == 1 and b.count == 1:
        result = touch_of_points(i, j, a, b, d, outlines.corner)
        result.hint = hint
        return result
    return touch_of_cores(a, b, d, enough, hint, outlines.corner)


@wp.func
def touch(i: int, j: int, d: wp.vec2, outlines: Outlines, enough: float, hint: int):
    """The contact of body i with j, which is at offset ``d``; its distance is a lower bound where that is ``enough`` or more.

    ``hint`` is that of the last contact of the two, 0 for none.
    """
    return touch_between(i, j, core_of(i, outlines), core_of(j, outlines), d, outlines, enough, hint)


@wp.func
def depth_of_overlap(i: int, a: int, j: int, b: int, d: wp.vec2, outlines: Outlines):
    """How deep two outlines lie in each other, 0 where they are apart; see :func:`~.kernels_outlines.apart`."""
    depth = -apart(i, a, j, b, d, outlines, 0.0)
    r = outlines.rounding[i] + outlines.rounding[j]
    a_count = outlines.first_corner[i + 1] - outlines.first_corner[i]
    b_count = outlines.first_corner[j + 1] - outlines.first_corner[j]
    if depth > 0.0 and depth < r and a_count + b_count > 2:
        # Cores apart: their nearest points may be corners, which are farther from each other than any face tells.
        squared, _on_a, _on_b = nearest_on_edges(outlines.corner, a, a_count, b, b_count, d)
        if b_count > 1:
            other, _on_b, _on_a = nearest_on_edges(outlines.corner, b, b_count, a, a_count, -d)
            squared = wp.min(squared, other)
        depth = r - wp.sqrt(squared)
    return wp.max(depth, 0.0)


@wp.struct
class WayOut:
    """The ways out of an overlap, added up with their weights, and the weights; and the shortest that one of them can be at most."""

    way: wp.vec2
    weights: float
    shortest: float


@wp.func
def middle_of_core(core: Core, corner: wp.array(dtype=wp.vec4)):
    """The mean of a core's corners, seen from the body's position: that may be at an end of it, or outside."""
    result = wp.vec2(0.0, 0.0)
    for k in range(core.first, core.first + core.count):
        result += wp.vec2(corner[k][0], corner[k][1])
    return result / float(core.count)


@wp.func
def ways_across_faces(
    before: WayOut,
    a: Core,
    b: Core,
    d: wp.vec2,
    between: wp.vec2,
    slack: float,
    sharpness: float,
    corner: wp.array(dtype=wp.vec4),
):
    """The ways of B, at offset ``d``, out of A across the faces of A, with those before; up to ``slack`` beyond the face.

    A way counts by how short it is, as a share of what it is where both have one middle, to the power of
    ``sharpness``: along two planks as much as across. ``between`` is from the middle of A to that of B where both have one position.
    """
    result = before
    r = a.rounding + b.rounding
    for face in range(a.count):
        v = corner[a.first + face]
        n = wp.vec2(v[2], v[3])
        lowest, _nearest = support(corner, b.first, b.count, n)
        longest = n[0] * (v[0] + between[0]) + n[1] * (v[1] + between[1]) - lowest + r
        depth = longest - (n[0] * (d[0] + between[0]) + n[1] * (d[1] + between[1]))
        result.shortest = wp.min(result.shortest, longest)
        if depth <= longest:
            share = wp.max(depth / longest, LEAST_DEPTH)
            weight = 1.0 / wp.pow(share, sharpness)
            result.way += n * (weight * (depth + slack))
            result.weights += weight
    return result


@wp.func
def way_between_parallels(i: int, j: int, d: wp.vec2, outlines: Outlines, slack: float, sharpness: float):
    """The ways of body j, at offset ``d``, out of body i, which are both long; with weights of 0 unless they lie side by side.

    Pushed the shortest way only, which is across, rows of parallel planks that overlap lengthwise never slide apart. What this goes by
    does not change where the plane is stretched: it parts parallel planks as it would part squares.
    """
    result = WayOut()
    a = core_of(i, outlines)
    b = core_of(j, outlines)
    result.shortest = outlines.reach[i] + outlines.reach[j]
    between = middle_of_core(b, outlines.corner) - middle_of_core(a, outlines.corner)
    result = ways_across_faces(result, b, a, -d, -between, slack, sharpness, outlines.corner)
    result.way = -result.way
    result = ways_across_faces(result, a, b, d, between, slack, sharpness, outlines.corner)
    if result.shortest > SIDE_BY_SIDE * 0.5 * (outlines.width[i] + outlines.width[j]):
        result.weights = 0.0
    return result
