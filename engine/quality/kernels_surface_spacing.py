"""Kernels that measure distances of neighbors on surfaces."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_relations import see_each_other
from .kernels_sheets import on_one_sheet

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_nearest_body(
    first: int,
    grid: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3d),
    sheet: wp.array(dtype=wp.int32),
    relations: int,
    reach: float,
    # outputs
    distance: wp.array(dtype=float),
    nearest: wp.array(dtype=wp.int32),
):
    """The nearest body of the same sheet, or of one that stands on it, and its distance: itself and ``reach`` where none is nearer.

    Which do lies behind the sheets of all bodies, from ``relations`` on.
    """
    i = first + wp.tid()
    own = position[i]
    least = float(reach)
    found = int(i)
    query = wp.hash_grid_query(grid, own, reach)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i and see_each_other(sheet[i], sheet[j], sheet, relations):
            way = position[j] - own
            away = wp.length(way)
            if away < least:
                if on_one_sheet(wp.vec3d(way), wp.float64(away), normal[i], normal[j]):
                    least = away
                    found = j
    distance[i] = least
    nearest[i] = found
