"""Kernels that measure placements on surfaces: heat that spreads over a mesh, distances of neighbors."""

from __future__ import annotations

import math

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def chebyshev_step(
    first: int,
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    factor: float,
    # outputs
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """The next Chebyshev polynomial of a sparse operator, in the place of the one before the last; add it to the result."""
    i = first + wp.tid()
    total = float(0.0)
    for k in range(start[i], start[i + 1]):
        total += value[k] * now[column[k]]
    # T_{k+1} = 2 (1 - scale A) T_k - T_{k-1}
    new = 2.0 * (now[i] - scale * total) - before[i]
    before[i] = new
    result[i] = result[i] + factor * new


# Bodies on one sheet of a surface see each other along it: the way between them leaves both planes, together, by as much as these are
# turned. Where it does so by this much more [rad], they lie on two sheets, one above the other.
STEEPER = wp.constant(math.pi / 3.0)


@wp.func
def on_one_sheet(way: wp.vec3, distance: float, normal: wp.vec3, other: wp.vec3):
    """Whether what lies at a way from here, where the surface looks along ``other``, lies on the sheet of the surface that is here."""
    cosine = wp.dot(normal, other)
    if cosine <= 0.0:
        return False
    if distance == 0.0:
        return True
    leaves = wp.asin(wp.min(wp.abs(wp.dot(way, normal)) / distance, 1.0))
    leaves += wp.asin(wp.min(wp.abs(wp.dot(way, other)) / distance, 1.0))
    return leaves <= wp.acos(wp.min(cosine, 1.0)) + STEEPER


@wp.kernel
def nearest_distance(
    first: int,
    grid: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    reach: float,
    # outputs
    distance: wp.array(dtype=float),
):
    """Distance to the nearest body of the same sheet; ``reach`` where none is nearer."""
    i = first + wp.tid()
    own = position[i]
    least = float(reach)
    query = wp.hash_grid_query(grid, own, reach)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i:
            way = position[j] - own
            away = wp.length(way)
            if away < least and on_one_sheet(way, away, normal[i], normal[j]):
                least = away
    distance[i] = least


@wp.kernel
def count_touching(
    first: int,
    grid: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    axis: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    fixed: wp.array(dtype=wp.uint8),
    reach: float,
    touch: float,
    # outputs
    count: wp.array(dtype=wp.int32),
    depth: wp.array(dtype=float),
    partner: wp.array(dtype=wp.int32),
):
    """Bodies of the same sheet whose discs, or capsules around half axes, overlap each one's, in a straight line; the deepest one.

    Two bodies that are both fixed do not count.
    """
    i = first + wp.tid()
    own = position[i]
    found = int(0)
    deepest = float(0.0)
    with_whom = int(-1)
    query = wp.hash_grid_query(grid, own, wp.length(axis[i]) + radius[i] + reach)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i and (fixed[i] == wp.uint8(0) or fixed[j] == wp.uint8(0)):
            way = position[j] - own
            if wp.length_sq(axis[i]) + wp.length_sq(axis[j]) > 0.0:
                places = wp.closest_point_edge_edge(
                    own - axis[i], own + axis[i], position[j] - axis[j], position[j] + axis[j], 1.0e-9
                )
                way += (2.0 * places[1] - 1.0) * axis[j] - (2.0 * places[0] - 1.0) * axis[i]
            gap = wp.length(way)
            if gap < (radius[i] + radius[j]) * touch and on_one_sheet(way, gap, normal[i], normal[j]):
                found += 1
                deep = radius[i] + radius[j] - gap
                # Of equal ones the first, in whatever order they come.
                if deep > deepest or (deep == deepest and j < with_whom):
                    deepest = deep
                    with_whom = j
    count[i] = found
    depth[i] = deepest
    partner[i] = with_whom
