"""Kernels that measure placements on surfaces: heat that spreads over a mesh, distances of neighbors."""

from __future__ import annotations

import warp as wp

from .kernels_sheets import on_one_sheet

wp.set_module_options({"enable_backward": False})


@wp.struct
class Stiffness:
    """The cotangent Laplacian of small triangles, ``small`` of which make a triangle of the surface and have its shape.

    Corners of the small triangles, three for each; half the cotangents at those of the large ones, and a third of a small one's area;
    and the corners in the order of the vertices that they are, those of a vertex from ``start`` on.
    """

    face: wp.array(dtype=wp.int32)
    cotangent: wp.array(dtype=wp.vec3d)
    area: wp.array(dtype=wp.float64)
    small: wp.int32
    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.kernel
def find_vertices(
    first: int,
    face: wp.array(dtype=wp.int32),
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort the corners of all small triangles by the vertices that they are."""
    i = first + wp.tid()
    key[i] = face[i]
    order[i] = i


@wp.kernel
def sum_at_vertices(
    first: int,
    stiffness: Stiffness,
    # outputs
    mass: wp.array(dtype=wp.float64),
    diagonal: wp.array(dtype=wp.float64),
    bound: wp.array(dtype=wp.float64),
):
    """Area that every vertex stands for, the diagonal of the Laplacian, and what no row of it exceeds."""
    i = first + wp.tid()
    area = wp.float64(0.0)
    own = wp.float64(0.0)
    others = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        k = stiffness.order[s] % 3
        triangle = stiffness.order[s] / 3 / stiffness.small
        area += stiffness.area[triangle]
        one = stiffness.cotangent[triangle][(k + 1) % 3]
        other = stiffness.cotangent[triangle][(k + 2) % 3]
        own += one + other
        others += wp.abs(one) + wp.abs(other)
    mass[i] = area
    diagonal[i] = own
    bound[i] = own + others


@wp.kernel
def fill_operator(
    first: int,
    stiffness: Stiffness,
    root: wp.array(dtype=wp.float64),
    # outputs
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
):
    """What is beside the diagonal, over the roots of both masses: two entries for every corner, those of a vertex side by side."""
    i = first + wp.tid()
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        corner = stiffness.order[s]
        k = corner % 3
        triangle = corner / 3 / stiffness.small
        for step in range(2):
            # The angle that counts for a side lies opposite of it.
            other = stiffness.face[corner - k + (k + 1 + step) % 3]
            half = stiffness.cotangent[triangle][(k + 2 - step) % 3]
            column[2 * s + step] = other
            value[2 * s + step] = wp.float32(-half / (root[i] * root[other]))


@wp.kernel
def chebyshev_step(
    first: int,
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    factor: float,
    # outputs
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """The next Chebyshev polynomial of a sparse operator, in the place of the one before the last; add it to the result.

    ``start`` counts pairs of entries.
    """
    i = first + wp.tid()
    total = diagonal[i] * now[i]
    for k in range(2 * start[i], 2 * start[i + 1]):
        total += value[k] * now[column[k]]
    # T_{k+1} = 2 (1 - scale A) T_k - T_{k-1}
    new = 2.0 * (now[i] - scale * total) - before[i]
    before[i] = new
    result[i] = result[i] + factor * new


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
            if away < least:
                if on_one_sheet(wp.vec3d(way), wp.float64(away), wp.vec3d(normal[i]), wp.vec3d(normal[j])):
                    least = away
    distance[i] = least
