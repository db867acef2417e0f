"""What kernels know of a surface: its facets, their tiles, and how a point that moves stays on it."""

from __future__ import annotations

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

# Where a surface looks to at the corners of a triangle that is part of a plane, and to which side that looks, may differ by rounding.
FLAT_COSINE = wp.constant(0.99999)

# Which way a surface goes on that turns by more than this is no way: the other side of a sheet was reached.
SMALLEST_TURN_COSINE = wp.constant(-0.2)
# Share of a way that is tried where all of it leads to another sheet.
SHORTER = wp.constant(0.3)
# A way that falls short by more than this share of it leads over an edge, and is gone on with beyond it.
FELL_SHORT = wp.constant(0.1)
# How far beyond an edge the surface is looked for, in units.
PROBE = wp.constant(0.02)
# A point with a corner's weight below this is on the side opposite of it.
ON_SIDE = wp.constant(1.0e-4)


@wp.struct
class Facets:
    """See :class:`~.facets.Facets`.

    Corners, three for each; normal; where the smooth surface looks to at every corner; label, and behind all of them, from
    ``relations`` on, which see each other, as in :mod:`.kernels_relations`, and from ``parts`` on the parts, which nothing leaves; the
    sides where the surface ends (bit k: opposite of corner k); cuts; and the numbers of the first tile and of its first corner.
    """

    mesh: wp.uint64
    corner: wp.array(dtype=wp.vec3)
    normal: wp.array(dtype=wp.vec3)
    corner_normal: wp.array(dtype=wp.vec3)
    label: wp.array(dtype=wp.int32)
    open_sides: wp.array(dtype=wp.int32)
    cuts: wp.array(dtype=wp.int32)
    first_tile: wp.array(dtype=wp.int32)
    first_corner: wp.array(dtype=wp.int32)
    relations: wp.int32
    parts: wp.int32


@wp.struct
class Spot:
    """A point of the surface: its facet, the weights of that facet's second and third corner, and where it is."""

    facet: wp.int32
    weight: wp.vec2
    position: wp.vec3


@wp.func
def spot_at(facet: int, weight: wp.vec2, facets: Facets):
    spot = Spot()
    a = facets.corner[3 * facet]
    b = facets.corner[3 * facet + 1]
    c = facets.corner[3 * facet + 2]
    spot.facet = facet
    spot.weight = weight
    spot.position = a + weight[0] * (b - a) + weight[1] * (c - a)
    return spot


@wp.func
def smooth_normal(facet: int, weight: wp.vec2, facets: Facets):
    """Where the smooth surface that the mesh stands for looks to at a point of a facet."""
    a = facets.corner_normal[3 * facet]
    b = facets.corner_normal[3 * facet + 1]
    c = facets.corner_normal[3 * facet + 2]
    return wp.normalize(a + weight[0] * (b - a) + weight[1] * (c - a))


@wp.func
def is_flat(facet: int, facets: Facets):
    """Whether the surface is a plane within a facet, and not the approximation of one that bends."""
    normal = facets.normal[facet]
    least = wp.dot(facets.corner_normal[3 * facet], normal)
    for k in range(1, 3):
        least = wp.min(least, wp.dot(facets.corner_normal[3 * facet + k], normal))
    return least > FLAT_COSINE


@wp.func
def weights_in(facet: int, position: wp.vec3, facets: Facets):
    """Weights of the second and third corner at the point of a facet's plane below ``position``."""
    a = facets.corner[3 * facet]
    u = facets.corner[3 * facet + 1] - a
    v = facets.corner[3 * facet + 2] - a
    p = position - a
    uu = wp.dot(u, u)
    uv = wp.dot(u, v)
    vv = wp.dot(v, v)
    pu = wp.dot(p, u)
    pv = wp.dot(p, v)
    scale = 1.0 / wp.max(uu * vv - uv * uv, 1.0e-20)
    return wp.vec2((vv * pu - uv * pv) * scale, (uu * pv - uv * pu) * scale)


@wp.func
def nearest_spot(position: wp.vec3, guess: int, reach: float, facets: Facets):
    """Point of the surface nearest to ``position``: below it on the facet ``guess``, where it lies over that one."""
    weight = weights_in(guess, position, facets)
    facet = guess
    if weight[0] < 0.0 or weight[1] < 0.0 or weight[0] + weight[1] > 1.0:
        hit = wp.mesh_query_point_no_sign(facets.mesh, position, reach)
        if hit.result:
            facet = hit.face
            # Of the first and the second corner.
            weight = wp.vec2(hit.v, 1.0 - hit.u - hit.v)
        weight = wp.max(weight, wp.vec2(0.0, 0.0))
        total = weight[0] + weight[1]
        if total > 1.0:
            weight = weight / total
    return spot_at(facet, weight, facets)


@wp.func
def same_sheet(one: int, other: int, facets: Facets):
    """Whether a point may go from one facet to another: in one part, and not through to the back."""
    along = wp.dot(facets.normal[one], facets.normal[other])
    return facets.label[facets.parts + one] == facets.label[facets.parts + other] and along > SMALLEST_TURN_COSINE


@wp.func
def tile_of(facet: int, weight: wp.vec2, facets: Facets):
    """Number of the tile that a point of a facet lies on."""
    cuts = facets.cuts[facet]
    x = weight[0] * float(cuts)
    y = weight[1] * float(cuts)
    j = wp.clamp(int(y), 0, cuts - 1)
    i = wp.clamp(int(x), 0, cuts - 1 - j)
    upper = int(0)
    if i < cuts - 1 - j and (x - float(i)) + (y - float(j)) > 1.0:
        upper = 1
    return facets.first_tile[facet] + j * (2 * cuts - j) + 2 * i + upper


@wp.func
def corner_number(i: int, j: int, facet: int, facets: Facets):
    """Number of the corner of tiles that is ``i`` steps along the first side of a facet and ``j`` along the second."""
    return facets.first_corner[facet] + j * (facets.cuts[facet] + 1) - (j * (j - 1)) / 2 + i


@wp.func
def interpolated(facet: int, weight: wp.vec2, values: wp.array(dtype=Any), start: int, facets: Facets):
    """Values of the corners of tiles, from ``start`` on, between the corners of the tile that a point lies on."""
    cuts = facets.cuts[facet]
    x = weight[0] * float(cuts)
    y = weight[1] * float(cuts)
    j = wp.clamp(int(y), 0, cuts - 1)
    i = wp.clamp(int(x), 0, cuts - 1 - j)
    fx = x - float(i)
    fy = y - float(j)
    right = values[start + corner_number(i + 1, j, facet, facets)]
    above = values[start + corner_number(i, j + 1, facet, facets)]
    if i < cuts - 1 - j and fx + fy > 1.0:
        far = values[start + corner_number(i + 1, j + 1, facet, facets)]
        return far + (1.0 - fx) * (above - far) + (1.0 - fy) * (right - far)
    near = values[start + corner_number(i, j, facet, facets)]
    return near + fx * (right - near) + fy * (above - near)


@wp.func
def across(normal: wp.vec3):
    """A direction at a right angle to a normal."""
    away = wp.vec3(-normal[2], 0.0, normal[0])
    if wp.abs(normal[0]) < 0.6:
        away = wp.vec3(0.0, -normal[2], normal[1])
    return wp.normalize(away)


@wp.func
def tangential(vector: wp.vec3, normal: wp.vec3):
    return vector - wp.dot(vector, normal) * normal


@wp.func
def carried(vector: wp.vec3, old: wp.vec3, new: wp.vec3):
    """A vector at a right angle to the normal ``old``, turned the shortest way to where the normal is ``new``."""
    both = old + new
    return vector - (wp.dot(new, vector) / wp.max(1.0 + wp.dot(old, new), 0.05)) * both


@wp.func
def step_within(facet: int, weight: wp.vec2, way: wp.vec3, facets: Facets):
    """Where :func:`step_along` says that a point ends, if that is on its facet by all of the way; else the result's facet is -1."""
    old = spot_at(facet, weight, facets)
    inside = weights_in(facet, old.position + way, facets)
    new = spot_at(facet, inside, facets)
    length = wp.length(way)
    leaves = inside[0] < 0.0 or inside[1] < 0.0 or inside[0] + inside[1] > 1.0
    if leaves or length - wp.length(new.position - old.position) > FELL_SHORT * length:
        new.facet = -1
    return new


@wp.func
def step_along(facet: int, weight: wp.vec2, way: wp.vec3, facets: Facets):
    """Where a point ends that goes ``way`` along the surface, round an edge as well; where it stood, if that is on another sheet."""
    old = spot_at(facet, weight, facets)
    length = wp.length(way)
    reach = 2.0 * length + 4.0 * PROBE
    new = nearest_spot(old.position + way, facet, reach, facets)
    short = length - wp.length(new.position - old.position)
    if short > FELL_SHORT * length:
        normal = facets.normal[facet]
        ahead = way / length
        beyond = nearest_spot(new.position + PROBE * (ahead - normal), facet, reach, facets)
        if same_sheet(facet, beyond.facet, facets):
            onwards = carried(ahead, normal, facets.normal[beyond.facet])
            last = nearest_spot(new.position + short * onwards, beyond.facet, reach, facets)
            if same_sheet(beyond.facet, last.facet, facets):
                return last
    if same_sheet(facet, new.facet, facets):
        return new
    return old


@wp.func
def without_outward(vector: wp.vec3, facet: int, weight: wp.vec2, facets: Facets):
    """``vector`` without what presses against the end of the surface that a point lies on: it moves nothing."""
    sides = facets.open_sides[facet]
    left = vector
    if sides != 0:
        for k in range(3):
            share = 1.0 - weight[0] - weight[1]
            if k > 0:
                share = weight[k - 1]
            if (sides & (1 << k)) != 0 and share < ON_SIDE:
                start = facets.corner[3 * facet + (k + 1) % 3]
                side = wp.normalize(facets.corner[3 * facet + (k + 2) % 3] - start)
                out = start - facets.corner[3 * facet + k]
                out = wp.normalize(out - wp.dot(out, side) * side)
                left = left - wp.max(wp.dot(left, out), 0.0) * out
    return left


@wp.func
def facet_of_tile(tile: int, facet_count: int, first_tile: wp.array(dtype=wp.int32)):
    """Facet that a tile is part of."""
    low = int(0)
    high = int(facet_count)
    while high - low > 1:
        middle = (low + high) / 2
        if first_tile[middle] <= tile:
            low = middle
        else:
            high = middle
    return low


@wp.func
def weights_in_tile(number: int, cuts: int, within: wp.vec2):
    """Weights of a facet's second and third corner at a place ``within`` (the same of a tile) a tile, counted within its facet."""
    # Row j starts at j (2 cuts - j).
    j = int(float(cuts) - wp.sqrt(wp.max(float(cuts) * float(cuts) - float(number), 0.0)))
    while j > 0 and j * (2 * cuts - j) > number:
        j -= 1
    while (j + 1) * (2 * cuts - j - 1) <= number:
        j += 1
    rest = number - j * (2 * cuts - j)
    i = rest / 2
    place = within
    if rest % 2 == 1:
        place = wp.vec2(1.0, 1.0) - within
    return (wp.vec2(float(i), float(j)) + place) / float(cuts)


@wp.kernel
def locate_tiles(
    first: int,
    facet_count: int,
    facets: Facets,
    # outputs
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    label: wp.array(dtype=wp.int32),
):
    """Middles of all tiles."""
    i = first + wp.tid()
    facet = facet_of_tile(i, facet_count, facets.first_tile)
    third = wp.vec2(1.0 / 3.0, 1.0 / 3.0)
    weight = weights_in_tile(i - facets.first_tile[facet], facets.cuts[facet], third)
    spot = spot_at(facet, weight, facets)
    position[i] = spot.position
    normal[i] = smooth_normal(facet, weight, facets)
    label[i] = facets.label[facet]


@wp.kernel
def locate_parts(
    first: int,
    tile: wp.array(dtype=wp.int32),
    part: int,
    facet_count: int,
    facets: Facets,
    # outputs
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    label: wp.array(dtype=wp.int32),
):
    """Middles of a part of tiles: of one of the four even triangles that each would be cut into. That of the first is its tile's."""
    i = first + wp.tid()
    own = tile[i]
    facet = facet_of_tile(own, facet_count, facets.first_tile)
    within = wp.vec2(1.0 / 3.0, 1.0 / 3.0)
    if part == 1:
        within = wp.vec2(1.0 / 6.0, 1.0 / 6.0)
    elif part == 2:
        within = wp.vec2(2.0 / 3.0, 1.0 / 6.0)
    elif part == 3:
        within = wp.vec2(1.0 / 6.0, 2.0 / 3.0)
    weight = weights_in_tile(own - facets.first_tile[facet], facets.cuts[facet], within)
    spot = spot_at(facet, weight, facets)
    position[i] = spot.position
    normal[i] = smooth_normal(facet, weight, facets)
    label[i] = facets.label[facet]


@wp.kernel
def locate_corners(
    first: int,
    facet_count: int,
    facets: Facets,
    # outputs
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    tile: wp.array(dtype=wp.int32),
):
    """Where the corners of all tiles are, where the surface looks to there, and a tile that each is a corner of."""
    number = first + wp.tid()
    facet = facet_of_tile(number, facet_count, facets.first_corner)
    cuts = facets.cuts[facet]
    rest = number - facets.first_corner[facet]
    j = int(0)
    while rest >= cuts + 1 - j:
        rest -= cuts + 1 - j
        j += 1
    weight = wp.vec2(float(rest), float(j)) / float(cuts)
    spot = spot_at(facet, weight, facets)
    position[number] = spot.position
    normal[number] = smooth_normal(facet, weight, facets)
    # A little towards the facet's middle.
    inside = weight + (wp.vec2(1.0 / 3.0, 1.0 / 3.0) - weight) * 1.0e-3
    tile[number] = tile_of(facet, inside, facets)


@wp.kernel
def find_faces(
    first: int,
    mesh: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    reach: float,
    # outputs
    face: wp.array(dtype=wp.int32),
):
    """Face of a mesh within reach of every position, or -1."""
    i = first + wp.tid()
    hit = wp.mesh_query_point_no_sign(mesh, position[i], reach)
    face[i] = -1
    if hit.result:
        face[i] = hit.face
