"""Kernels that count overlapping outlines: by every face of both, in double precision, with nothing taken from contact."""

from __future__ import annotations

import warp as wp

from ..space.kernels_meeting import Meeting, keep_apart

wp.set_module_options({"enable_backward": False})

ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))
HALF = wp.constant(wp.float64(0.5))


@wp.struct
class Shapes:
    """What lies where: position, first corner (one more at the end), radius around the core, reach, smallest width, 1 if it is fixed.

    And which of them keep apart.

    Corners are seen from the position, each with the outward normal of the edge that begins there.
    """

    position: wp.array(dtype=wp.vec2d)
    first_corner: wp.array(dtype=wp.int32)
    corner: wp.array(dtype=wp.vec4d)
    rounding: wp.array(dtype=wp.float64)
    reach: wp.array(dtype=wp.float64)
    width: wp.array(dtype=wp.float64)
    fixed: wp.array(dtype=wp.int32)
    pieces: wp.array(dtype=wp.int32)
    meeting: Meeting


@wp.func
def may_overlap(i: int, j: int, shapes: Shapes):
    """Whether the classes of two bodies are said to be free to overlap, or both bodies are fixed."""
    if shapes.fixed[i] * shapes.fixed[j] != 0:
        return True
    return not keep_apart(i, j, shapes.meeting)


@wp.struct
class Lattice:
    """Cells, one grid per level of size: largest reach, columns and rows, and first cell of each; and the bodies in every cell."""

    reach: wp.array(dtype=wp.float64)
    columns: wp.array(dtype=wp.int32)
    rows: wp.array(dtype=wp.int32)
    first_cell: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)
    member: wp.array(dtype=wp.int32)
    size: wp.vec2d
    periodic: wp.int32


@wp.struct
class Given:
    """What outlines bodies have: shape, factor on it, how it is turned, and of lines the length of the axis and the thickness.

    Corners of the shapes, one shape after the other from ``start`` on, and their roundings, reaches and widths without roundings. The
    last shape is the axis of a line, of half length 1; a body's ``smaller`` is a factor on it about the ``middle`` of the shape.
    ``slope`` is that of the plane that it lies in; there is none where all planes are horizontal.
    """

    shape: wp.array(dtype=wp.int32)
    factor: wp.array(dtype=wp.float64)
    angle: wp.array(dtype=wp.float64)
    length: wp.array(dtype=wp.float64)
    width: wp.array(dtype=wp.float64)
    smaller: wp.array(dtype=wp.float64)
    start: wp.array(dtype=wp.int32)
    corner: wp.array(dtype=wp.vec2d)
    middle: wp.array(dtype=wp.vec2d)
    shape_rounding: wp.array(dtype=wp.float64)
    shape_reach: wp.array(dtype=wp.float64)
    shape_width: wp.array(dtype=wp.float64)
    capsule: wp.int32
    slope: wp.array(dtype=wp.vec2d)


@wp.func
def seen_from_above(p: wp.vec2d, c: wp.float64, s: wp.float64, slope: wp.vec2d):
    """A point of an outline that is turned by the angle of this cosine and sine, and leans as the plane that it lies in."""
    at = wp.vec2d(p[0] * c - p[1] * s, p[0] * s + p[1] * c)
    square = wp.dot(slope, slope)
    if square == ZERO:
        return at
    # 1 - cosine, over the square.
    return at - slope * (wp.dot(at, slope) / (ONE + square + wp.sqrt(ONE + square)))


@wp.kernel
def lay_out(
    first: int,
    given: Given,
    # outputs
    shapes: Shapes,
):
    """Corners with outward normals, rounding, reach and smallest width of every body, as it is turned."""
    i = first + wp.tid()
    shape = given.shape[i]
    scale = given.factor[i] * given.smaller[i]
    rounding = given.shape_rounding[shape] * scale
    stays = given.middle[shape] * (given.factor[i] - scale)
    reach = given.shape_reach[shape] * given.factor[i]
    if shape == given.capsule:
        stays = wp.vec2d(ZERO, ZERO)
        scale = HALF * given.length[i] * given.smaller[i]
        rounding = HALF * given.width[i] * given.smaller[i]
        reach = HALF * (given.length[i] + given.width[i]) * given.smaller[i]
    shapes.rounding[i] = rounding
    shapes.reach[i] = reach
    shapes.width[i] = given.shape_width[shape] * scale + wp.float64(2.0) * rounding
    c = wp.cos(given.angle[i])
    s = wp.sin(given.angle[i])
    slope = wp.vec2d(ZERO, ZERO)
    if given.slope.shape[0] > 0:
        slope = given.slope[i]
        if given.length[i] > ZERO:
            # The angle of a line is that of its axis as it is seen from above.
            way = wp.vec2d(c, s)
            way = way + slope * (wp.dot(way, slope) / (ONE + wp.sqrt(ONE + wp.dot(slope, slope))))
            way = wp.normalize(way)
            c = way[0]
            s = way[1]
    begin = given.start[shape]
    count = given.start[shape + 1] - begin
    to = shapes.first_corner[i]
    for k in range(count):
        p = given.corner[begin + k] * scale + stays
        q = given.corner[begin + (k + 1) % count] * scale + stays
        at = seen_from_above(p, c, s, slope)
        edge = seen_from_above(q, c, s, slope) - at
        size = wp.length(edge)
        if size == ZERO:
            size = ONE
        shapes.corner[to + k] = wp.vec4d(at[0], at[1], edge[1] / size, -edge[0] / size)


@wp.kernel
def lay_out_bent(
    first: int,
    body: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.vec2d),
    smaller: wp.array(dtype=wp.float64),
    # outputs
    shapes: Shapes,
):
    """The same of bent lines, whose axis is straight from one point to the next: two corners for each piece."""
    k = first + wp.tid()
    i = body[k]
    to = shapes.first_corner[i]
    farthest = wp.length(point[start[k]])
    for m in range(start[k + 1] - start[k] - 1):
        at = point[start[k] + m] * smaller[i]
        end = point[start[k] + m + 1] * smaller[i]
        edge = end - at
        size = wp.length(edge)
        if size == ZERO:
            size = ONE
        shapes.corner[to + 2 * m] = wp.vec4d(at[0], at[1], edge[1] / size, -edge[0] / size)
        shapes.corner[to + 2 * m + 1] = wp.vec4d(end[0], end[1], -edge[1] / size, edge[0] / size)
        farthest = wp.max(farthest, wp.length(end))
    shapes.reach[i] = farthest + shapes.rounding[i]


@wp.kernel
def find_levels(
    first: int,
    reach: wp.array(dtype=wp.float64),
    largest: wp.float64,
    most: int,
    # outputs
    level: wp.array(dtype=wp.int32),
):
    """How many times a body's reach can be doubled before it is above the largest one, ``most`` at most."""
    i = first + wp.tid()
    own = int(0)
    doubled = wp.float64(2.0) * reach[i]
    while doubled <= largest and own < most:
        doubled = wp.float64(2.0) * doubled
        own += 1
    level[i] = own


@wp.func
def cell_of(position: wp.vec2d, m: int, lattice: Lattice):
    """The cell of level ``m`` that a position lies in."""
    columns = lattice.columns[m]
    rows = lattice.rows[m]
    column = wp.clamp(int(position[0] / lattice.size[0] * wp.float64(columns)), 0, columns - 1)
    row = wp.clamp(int(position[1] / lattice.size[1] * wp.float64(rows)), 0, rows - 1)
    return lattice.first_cell[m] + row * columns + column


@wp.kernel
def find_cells(
    first: int,
    position: wp.array(dtype=wp.vec2d),
    level: wp.array(dtype=wp.int32),
    lattice: Lattice,
    # outputs
    cell: wp.array(dtype=wp.int32),
    member: wp.array(dtype=wp.int32),
):
    """In which cell of its level every body lies, and the body, both to be sorted."""
    i = first + wp.tid()
    cell[i] = cell_of(position[i], level[i], lattice)
    member[i] = i


@wp.func
def inside_of_faces(
    corner: wp.array(dtype=wp.vec4d), a: int, a_end: int, b: int, b_end: int, d: wp.vec2d, enough: wp.float64
):
    """Smallest of how far B, at offset ``d``, reaches inside the faces of A; ``enough`` or less ends the search."""
    least = wp.float64(1.0e300)
    for e in range(a, a_end):
        if least > enough:
            v = corner[e]
            deepest = wp.float64(1.0e300)
            for q in range(b, b_end):
                w = corner[q]
                deepest = wp.min(deepest, v[2] * (w[0] + d[0] - v[0]) + v[3] * (w[1] + d[1] - v[1]))
            least = wp.min(least, -deepest)
    return least


@wp.func
def squared_distance_of_corners(corner: wp.array(dtype=wp.vec4d), a: int, a_end: int, b: int, b_end: int, d: wp.vec2d):
    """From A's edges to the corners of B, at offset ``d``."""
    least = wp.float64(1.0e300)
    for e in range(a, a_end):
        following = e + 1
        if following == a_end:
            following = a
        v = corner[e]
        u = corner[following]
        along = wp.vec2d(u[0] - v[0], u[1] - v[1])
        square = wp.dot(along, along)
        for q in range(b, b_end):
            w = corner[q]
            p = wp.vec2d(w[0] + d[0] - v[0], w[1] + d[1] - v[1])
            share = wp.float64(0.0)
            if square > ZERO:
                share = wp.clamp(wp.dot(p, along) / square, ZERO, ONE)
            gap = p - along * share
            least = wp.min(least, wp.dot(gap, gap))
    return least


@wp.func
def depth_of_cores(
    corner: wp.array(dtype=wp.vec4d), a: int, a_end: int, b: int, b_end: int, r: wp.float64, d: wp.vec2d
):
    """How far what is within ``r`` of two cores in all lies in each other; below 0 where they are apart."""
    least = wp.float64(1.0e300)
    if a_end - a > 1:
        least = wp.min(least, inside_of_faces(corner, a, a_end, b, b_end, d, -r))
    if b_end - b > 1 and least > -r:
        least = wp.min(least, inside_of_faces(corner, b, b_end, a, a_end, -d, -r))
    if least <= -r and a_end - a + b_end - b > 2:
        return least + r
    if least > ZERO and a_end - a + b_end - b > 2:
        return least + r
    if r == ZERO:
        return least
    # Cores apart, and perhaps nearer at their corners than across a face.
    square = squared_distance_of_corners(corner, a, a_end, b, b_end, d)
    square = wp.min(square, squared_distance_of_corners(corner, b, b_end, a, a_end, -d))
    return r - wp.sqrt(square)


@wp.func
def depth_from_corners(i: int, j: int, first: int, d: wp.vec2d, shapes: Shapes):
    """How far outline i and outline j, whose corners are taken from ``first`` on, lie in each other."""
    a = shapes.first_corner[i]
    a_end = shapes.first_corner[i + 1]
    b = first
    b_end = first + shapes.first_corner[j + 1] - shapes.first_corner[j]
    r = shapes.rounding[i] + shapes.rounding[j]
    own = shapes.pieces[i]
    other = shapes.pieces[j]
    if own == 0 and other == 0:
        return depth_of_cores(shapes.corner, a, a_end, b, b_end, r, d)
    depth = wp.float64(-1.0e300)
    for k in range(wp.max(own, 1)):
        if own > 0:
            a = shapes.first_corner[i] + 2 * k
            a_end = a + 2
        for m in range(wp.max(other, 1)):
            if other > 0:
                b = first + 2 * m
                b_end = b + 2
            depth = wp.max(depth, depth_of_cores(shapes.corner, a, a_end, b, b_end, r, d))
    return depth


@wp.func
def depth_of_overlap(i: int, j: int, d: wp.vec2d, shapes: Shapes):
    """How far two outlines lie in each other: the shortest way that parts them; below 0 where they are apart.

    Of bent lines it is that of the two pieces that lie deepest in each other.
    """
    return depth_from_corners(i, j, shapes.first_corner[j], d, shapes)


@wp.func
def cell_number(unwrapped: wp.float64, count: int):
    """A cell's column or row as a whole number, within those of three periods."""
    limit = wp.float64(2 * count)
    return int(wp.floor(wp.clamp(unwrapped, -limit, limit)))


@wp.func
def cells_within(position: wp.float64, reach: wp.float64, size: wp.float64, count: int, periodic: int):
    """First and last of ``count`` cells along an axis that come within ``reach`` of ``position``; unwrapped, none of them twice."""
    scale = wp.float64(count) / size
    low = cell_number((position - reach) * scale, count)
    high = cell_number((position + reach) * scale, count)
    if periodic == 0:
        return wp.vec2i(wp.clamp(low, 0, count - 1), wp.clamp(high, 0, count - 1))
    if high - low >= count:
        return wp.vec2i(0, count - 1)
    return wp.vec2i(low, high)


@wp.func
def shortest_way(start: wp.vec2d, end: wp.vec2d, lattice: Lattice):
    """The vector from ``start`` to ``end``, the shorter one round a periodic domain."""
    way = end - start
    if lattice.periodic == 0:
        return way
    return wp.vec2d(
        way[0] - lattice.size[0] * wp.floor(way[0] / lattice.size[0] + HALF),
        way[1] - lattice.size[1] * wp.floor(way[1] / lattice.size[1] + HALF),
    )


@wp.func
def deepest_of_images(i: int, j: int, way: wp.vec2d, images: wp.vec2i, shapes: Shapes, size: wp.vec2d):
    """How deep body ``i`` lies in any of the images of body ``j``, the nearest of which is at offset ``way``; 0 if in none."""
    touching = shapes.reach[i] + shapes.reach[j]
    columns = 2 * images[0] + 1
    depth = wp.float64(0.0)
    for image in range(columns * (2 * images[1] + 1)):
        x = image % columns - images[0]
        y = image / columns - images[1]
        at = wp.vec2d(way[0] + wp.float64(x) * size[0], way[1] + wp.float64(y) * size[1])
        if (j != i or x != 0 or y != 0) and wp.dot(at, at) < touching * touching:
            depth = wp.max(depth, depth_of_overlap(i, j, at, shapes))
    return depth


@wp.struct
class Found:
    """What a body lies in: how many others, how deep at most, and which is that one."""

    count: wp.int32
    deepest: wp.float64
    partner: wp.int32


@wp.func
def look_into_cell(
    before: Found,
    i: int,
    cell: int,
    shapes: Shapes,
    lattice: Lattice,
    images: wp.vec2i,
    tolerance: wp.float64,
    most: int,
):
    """What body ``i`` has been found to lie in, and what it lies in of the bodies of a cell."""
    found = before
    for s in range(lattice.start[cell], lattice.start[cell + 1]):
        j = lattice.member[s]
        way = shortest_way(shapes.position[i], shapes.position[j], lattice)
        touching = shapes.reach[i] + shapes.reach[j]
        counts = not may_overlap(i, j, shapes)
        if found.count < most and counts and wp.dot(way, way) < touching * touching:
            depth = deepest_of_images(i, j, way, images, shapes, lattice.size)
            if depth > tolerance * wp.min(shapes.width[i], shapes.width[j]):
                # An image of itself counts twice, as each of a couple counts once.
                found.count = found.count + wp.where(j == i, 2, 1)
                if depth > found.deepest:
                    found.deepest = depth
                    found.partner = j
    return found


@wp.kernel
def count_overlaps(
    first: int,
    shapes: Shapes,
    lattice: Lattice,
    images: wp.vec2i,
    tolerance: wp.float64,
    most: int,
    # outputs
    overlaps: wp.array(dtype=wp.int32),
    deepest: wp.array(dtype=wp.float64),
    partner: wp.array(dtype=wp.int32),
):
    """Of every body: in how many others it lies deeper than ``tolerance`` smaller widths, how deep at most [m], and in which.

    A body is left as soon as ``most`` are found.
    """
    i = first + wp.tid()
    own = shapes.position[i]
    found = Found()
    found.partner = -1
    for m in range(lattice.reach.shape[0]):
        within = shapes.reach[i] + lattice.reach[m]
        columns = lattice.columns[m]
        rows = lattice.rows[m]
        across = cells_within(own[0], within, lattice.size[0], columns, lattice.periodic)
        up = cells_within(own[1], within, lattice.size[1], rows, lattice.periodic)
        for y in range(up[0], up[1] + 1):
            row = (y + 2 * rows) % rows
            for x in range(across[0], across[1] + 1):
                cell = lattice.first_cell[m] + row * columns + (x + 2 * columns) % columns
                found = look_into_cell(found, i, cell, shapes, lattice, images, tolerance, most)
    overlaps[i] = found.count
    deepest[i] = found.deepest
    partner[i] = found.partner
