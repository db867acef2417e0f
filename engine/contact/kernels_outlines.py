"""Kernels for the outlines that are parted: where their corners are, and how far apart two of them are.

An outline is a convex core of 1 to 16 corners (a point, a segment, a polygon) and a radius around it, so that discs, capsules and
polygons are the same to all that follows. Bodies are numbered as they lie in space.
"""

from __future__ import annotations

import warp as wp

from ..problem.slopes import SMALLEST_COSINE as SMALLEST
from ..space.kernels_space import Space, confine

wp.set_module_options({"enable_backward": False})

# Points of a face count for where a contact is if they are no shallower than the deepest by this share of the face.
BAND = wp.constant(0.05)
# Faces of the second of two outlines are numbered from here on.
FACES_OF_ONE = wp.constant(32)
SMALLEST_COSINE = wp.constant(SMALLEST)


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
class Slopes:
    """Images of slopes, one after the other: which a body lies in (-1: none), first pixel, rows, columns, and the pixels.

    And where the axes of bodies point that lean over in the planes of these slopes, seen from there; of length 1.
    """

    image: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)
    rows: wp.array(dtype=wp.int32)
    columns: wp.array(dtype=wp.int32)
    pixel: wp.array(dtype=wp.vec2)
    tilt: wp.array(dtype=wp.vec3)


@wp.func
def tilted(slope: wp.vec2, tilt: wp.vec3):
    """Slope of the plane of a body that leans over in a plane of a slope; see :func:`~.problem.slopes.tilted`."""
    cosine = 1.0 / wp.sqrt(1.0 + wp.length_sq(slope))
    level = -cosine * slope
    along = level[0] * tilt[0] + level[1] * tilt[1]
    axis = wp.vec2(tilt[0], tilt[1]) + level * (tilt[2] - along / (1.0 + cosine))
    upright = cosine * tilt[2] - along
    steepest = wp.sqrt(1.0 - SMALLEST_COSINE * SMALLEST_COSINE)
    return axis * (-1.0 / wp.max(upright, wp.length(axis) * SMALLEST_COSINE / steepest))


@wp.kernel
def find_slopes(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    slopes: Slopes,
    space: Space,
    # outputs
    slope: wp.array(dtype=wp.vec2),
):
    """Slope of the plane that every outline lies in where its body is, blended from the pixels around it."""
    i = first + wp.tid()
    m = slopes.image[i]
    if m >= 0:
        p = confine(wp.vec2(pose[i][0], pose[i][1]), space)
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
    if slopes.tilt.shape[0] > 0:
        here = wp.vec2(0.0, 0.0)
        if m >= 0:
            here = slope[i]
        slope[i] = tilted(here, slopes.tilt[i])


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
    pose: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    # outputs
    corner: wp.array(dtype=wp.vec4),
):
    i = first + wp.tid()
    begin = outlines.first_corner[i]
    count = outlines.first_corner[i + 1] - begin
    c = wp.cos(pose[i][2] + outlines.offset[i])
    s = wp.sin(pose[i][2] + outlines.offset[i])
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

    The corner is walked round with the face, but between the two sides of a segment: from an edge of B that lies along it the next
    corner is no nearer. Faces after one that it lies ``enough`` beyond are not looked at.
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
        if e == 0 or a_count == 2:
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
def apart(i: int, a: int, j: int, b: int, d: wp.vec2, outlines: Outlines, enough: float):
    """A lower bound of the distance of two outlines, exact where they overlap; beyond ``enough``, any.

    ``a`` and ``b`` are the first corners of i and j, which is at offset ``d``.
    """
    a_count = outlines.first_corner[i + 1] - outlines.first_corner[i]
    b_count = outlines.first_corner[j + 1] - outlines.first_corner[j]
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
