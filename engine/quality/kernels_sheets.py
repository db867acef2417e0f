"""Kernels that count overlapping outlines on a surface, in double precision, with nothing taken from contact."""

from __future__ import annotations

import math

import warp as wp

from ..surface.kernels_relations import see_each_other
from .kernels_overlaps import ONE, ZERO, Found, Shapes, depth_from_corners, may_overlap

wp.set_module_options({"enable_backward": False})

# Bodies on one sheet of a surface see each other along it: the way between them leaves both planes, together, by as much as these are
# turned. Where it does so by this much more [rad], they lie on two sheets, one above the other.
STEEPER = wp.constant(wp.float64(math.pi / 3.0))
# Nor do they where the surface turns by much more than a right angle between them: below this cosine. Across a right-angled edge they
# do, whatever rounding makes of its cosine of 0.
LEAST_COSINE = wp.constant(wp.float64(-0.1))
# Outlines do across sharper creases, too, up to this cosine, as far apart as along both planes. So those that are no discs are across
# all creases between flat triangles, which bend by more than the second one says.
SHARPEST_COSINE, CREASED_COSINE = wp.constant(wp.float64(-0.99)), wp.constant(wp.float64(0.94))
FLAT_COSINE = wp.constant(wp.float64(0.99999))


@wp.struct
class Sheets:
    """Bodies on a surface: positions, where the smooth surface looks to there, x axes along it, whether it is flat there, and sheets.

    Behind the sheets of all bodies it lies which stand on one another, from ``relations`` on, see
    :mod:`esh.engine.surface.kernels_relations`.

    Corners of outlines that somebody sees are noted from ``copies`` on, ``most_corners`` for each body that sees them.
    """

    position: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    along: wp.array(dtype=wp.vec3d)
    flat: wp.array(dtype=wp.int32)
    sheet: wp.array(dtype=wp.int32)
    relations: wp.int32
    copies: wp.int32
    most_corners: wp.int32


@wp.func
def on_one_sheet(way: wp.vec3d, distance: wp.float64, normal: wp.vec3d, other: wp.vec3d):
    """Whether what lies at a way from here, where the surface looks along ``other``, lies on the sheet of the surface that is here."""
    cosine = wp.dot(normal, other)
    if cosine < LEAST_COSINE:
        return False
    if distance == ZERO:
        return True
    leaves = wp.asin(wp.min(wp.abs(wp.dot(way, normal)) / distance, ONE))
    leaves += wp.asin(wp.min(wp.abs(wp.dot(way, other)) / distance, ONE))
    return leaves <= wp.acos(wp.min(cosine, ONE)) + STEEPER


@wp.func
def in_plane_between(vector: wp.vec3d, normal: wp.vec3d, between: wp.vec3d):
    """A vector along the surface, which looks along ``normal``, turned the shortest way to where it looks along ``between``."""
    axis = wp.cross(normal, between)
    return (
        vector * wp.dot(normal, between)
        + wp.cross(axis, vector)
        + axis * (wp.dot(axis, vector) / (ONE + wp.dot(normal, between)))
    )


@wp.kernel
def look_smoothly(
    first: int,
    triangle: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3d),
    corner_normal: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
    tangent: wp.array(dtype=wp.vec3d),
    # outputs
    smooth: wp.array(dtype=wp.vec3d),
    along: wp.array(dtype=wp.vec3d),
    flat: wp.array(dtype=wp.int32),
):
    """Where the smooth surface looks to at bodies, between their corners; x axes, turned along it; and whether it is flat."""
    i = first + wp.tid()
    corner = 3 * triangle[i]
    weight = barycentric[i]
    looks = weight[0] * corner_normal[corner]
    looks += weight[1] * corner_normal[corner + 1]
    looks += weight[2] * corner_normal[corner + 2]
    smooth[i] = wp.normalize(looks)
    along[i] = in_plane_between(tangent[i], normal[i], smooth[i])
    least = ONE
    for k in range(3):
        least = wp.min(least, wp.dot(corner_normal[corner + k], normal[i]))
    flat[i] = int(least > FLAT_COSINE)


@wp.kernel
def take_units(
    first: int,
    position: wp.array(dtype=wp.vec3d),
    middle: wp.vec3d,
    unit: wp.float64,
    # outputs
    in_units: wp.array(dtype=wp.vec3),
):
    """Positions in a unit, from a middle, in single precision."""
    i = first + wp.tid()
    p = (position[i] - middle) / unit
    in_units[i] = wp.vec3(float(p[0]), float(p[1]), float(p[2]))


@wp.func
def unfolded(way: wp.vec3d, normal: wp.vec3d, other: wp.vec3d):
    """How far it is over the line in which two planes meet, along them and along it; 0 where they do not meet between."""
    line = wp.normalize(wp.cross(normal, other))
    # In each plane, away from here and across the line.
    here = wp.cross(line, normal)
    there = wp.cross(line, other)
    # The way is a step in the one and a step in the other, and one along the line.
    first = wp.dot(way, other) / wp.dot(here, other)
    second = wp.dot(way, normal) / wp.dot(there, normal)
    if first * second <= ZERO:
        return wp.vec2d(ZERO, ZERO)
    return wp.vec2d(first + second, wp.dot(way, line))


@wp.func
def depth_on_sheet(i: int, j: int, way: wp.vec3d, distance: wp.float64, over: wp.vec2d, sheets: Sheets, shapes: Shapes):
    """How deep two outlines lie in each other in the plane between them; ``over`` is what :func:`unfolded` returns, or 0."""
    between = wp.normalize(sheets.normal[i] + sheets.normal[j])
    x = in_plane_between(sheets.along[i], sheets.normal[i], between)
    y = wp.cross(between, x)
    axis = in_plane_between(sheets.along[j], sheets.normal[j], between)
    c = wp.dot(axis, x)
    s = wp.dot(axis, y)
    at = wp.vec2d(wp.dot(way, x), wp.dot(way, y))
    flat = wp.length(at)
    if wp.length(over) > ZERO:
        line = wp.normalize(wp.cross(sheets.normal[i], sheets.normal[j]))
        across = wp.cross(line, between)
        at = wp.vec2d(
            over[0] * wp.dot(across, x) + over[1] * wp.dot(line, x),
            over[0] * wp.dot(across, y) + over[1] * wp.dot(line, y),
        )
    elif flat > ZERO:
        at = at * (distance / flat)
    begin = shapes.first_corner[j]
    count = shapes.first_corner[j + 1] - begin
    to = sheets.copies + i * sheets.most_corners
    for k in range(count):
        v = shapes.corner[begin + k]
        shapes.corner[to + k] = wp.vec4d(
            c * v[0] - s * v[1], s * v[0] + c * v[1], c * v[2] - s * v[3], s * v[2] + c * v[3]
        )
    return depth_from_corners(i, j, to, at, shapes)


@wp.func
def along_both_sides(i: int, j: int, sheets: Sheets, shapes: Shapes):
    """Whether two outlines see each other across a crease between flat faces as along both, and not in a straight line.

    Discs see each other so, which keeps them farther apart; and so all see what is fixed.
    """
    flat = sheets.flat[i] != 0 and sheets.flat[j] != 0
    corners = wp.max(
        shapes.first_corner[i + 1] - shapes.first_corner[i], shapes.first_corner[j + 1] - shapes.first_corner[j]
    )
    return flat and corners > 1 and shapes.fixed[i] == 0 and shapes.fixed[j] == 0


@wp.func
def depth_of_pair(i: int, j: int, sheets: Sheets, shapes: Shapes):
    """How deep two outlines lie in each other; 0 or less where they are apart, or do not see each other."""
    way = sheets.position[j] - sheets.position[i]
    distance = wp.length(way)
    if distance >= shapes.reach[i] + shapes.reach[j]:
        return ZERO
    over = wp.vec2d(ZERO, ZERO)
    cosine = wp.dot(sheets.normal[i], sheets.normal[j])
    if cosine < CREASED_COSINE and cosine > SHARPEST_COSINE:
        if cosine < LEAST_COSINE or along_both_sides(i, j, sheets, shapes):
            over = unfolded(way, sheets.normal[i], sheets.normal[j])
    if wp.length(over) == ZERO and not on_one_sheet(way, distance, sheets.normal[i], sheets.normal[j]):
        return ZERO
    return depth_on_sheet(i, j, way, distance, over, sheets, shapes)


@wp.struct
class GridsOfLevels:
    """Bodies in hash grids of their own for each level of size, the largest first.

    The level of every body; of every level the farthest reach, in units, a grid for bodies that are no larger, one of coarse cells for
    those that are, and its first place in ``body``, which says who is there. ``margin`` is what rounding may make of a distance.
    """

    level: wp.array(dtype=wp.int32)
    reach: wp.array(dtype=float)
    grid: wp.array(dtype=wp.uint64)
    coarse: wp.array(dtype=wp.uint64)
    first: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    margin: float


@wp.kernel
def take_some(
    first: int,
    body: wp.array(dtype=wp.int32),
    in_units: wp.array(dtype=wp.vec3),
    # outputs
    taken: wp.array(dtype=wp.vec3),
):
    i = first + wp.tid()
    taken[i] = in_units[body[i]]


@wp.func
def with_overlap(before: Found, i: int, j: int, sheets: Sheets, shapes: Shapes, tolerance: wp.float64, most: int):
    """What body ``i`` has been found to lie in, and whether it lies in body ``j``."""
    found = before
    counts = not may_overlap(i, j, shapes)
    seen = see_each_other(sheets.sheet[i], sheets.sheet[j], sheets.sheet, sheets.relations)
    if j != i and found.count < most and counts and seen:
        depth = depth_of_pair(i, j, sheets, shapes)
        if depth > tolerance * wp.min(shapes.width[i], shapes.width[j]):
            found.count = found.count + 1
            # Of equal ones the first, in whatever order they come.
            if depth > found.deepest or (depth == found.deepest and j < found.partner):
                found.deepest = depth
                found.partner = j
    return found


@wp.kernel
def count_on_sheets(
    first: int,
    levels: GridsOfLevels,
    in_units: wp.array(dtype=wp.vec3),
    unit: wp.float64,
    sheets: Sheets,
    shapes: Shapes,
    tolerance: wp.float64,
    most: int,
    # outputs
    overlaps: wp.array(dtype=wp.int32),
    deepest: wp.array(dtype=wp.float64),
    partner: wp.array(dtype=wp.int32),
):
    """Of every body: in how many others it lies deeper than ``tolerance`` smaller widths, how deep at most [m], and in which.

    No body reaches farther than a unit. A body is left as soon as ``most`` are found.
    """
    i = first + wp.tid()
    found = Found()
    found.partner = -1
    for m in range(levels.grid.shape[0]):
        within = float(shapes.reach[i] / unit) + levels.reach[m] + levels.margin
        grid = levels.grid[m]
        if levels.level[i] < m:
            grid = levels.coarse[m]
        query = wp.hash_grid_query(grid, in_units[i], within)
        k = int(0)
        while wp.hash_grid_query_next(query, k):
            j = levels.body[levels.first[m] + k]
            found = with_overlap(found, i, j, sheets, shapes, tolerance, most)
    overlaps[i] = found.count
    deepest[i] = found.deepest
    partner[i] = found.partner
