"""Kernels that measure placements on surfaces: heat that spreads over a mesh, distances of neighbors."""

from __future__ import annotations

import warp as wp

from .kernels_sheets import on_one_sheet

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
