"""Kernels that find a different body for each of some points (see :mod:`.nearest_free`)."""

from __future__ import annotations

import warp as wp

from .kernels_edit import Around, cell_at, place_of

wp.set_module_options({"enable_backward": False})

# Bodies of a row of cells among which the nearest to a point is looked for.
IN_ROW = wp.constant(16)


@wp.struct
class Candidates:
    """Bodies to choose from, in the order of cells, ``cells`` along either side of a rectangle: their places among all of them."""

    body: wp.array(dtype=wp.int32)
    pose: wp.array(dtype=wp.vec4)
    order: wp.array(dtype=wp.int32)
    cell_start: wp.array(dtype=wp.int32)
    cells: wp.int32
    around: Around


@wp.kernel
def find_cells(
    first: int,
    body: wp.array(dtype=wp.int32),
    pose: wp.array(dtype=wp.vec4),
    cells: int,
    around: Around,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    k = first + wp.tid()
    key[k] = cell_at(place_of(pose[body[k]]), cells, around)
    order[k] = k


@wp.func
def nearest_left(p: int, point: wp.vec2, candidates: Candidates, holder: wp.array(dtype=wp.int32)):
    """The candidate nearest to a point that no point before it has, in the cells around it; -1 where there is none."""
    cells = candidates.cells
    cell = cell_at(point, cells, candidates.around)
    column = cell % cells
    row = cell / cells
    best = int(-1)
    least = float(wp.inf)
    for line in range(wp.max(row - 1, 0), wp.min(row + 2, cells)):
        begin = candidates.cell_start[line * cells + wp.max(column - 1, 0)]
        end = candidates.cell_start[line * cells + wp.min(column + 1, cells - 1) + 1]
        # In a crowd, those in the middle of the range.
        begin = wp.max(begin, (begin + end - IN_ROW) / 2)
        for s in range(begin, wp.min(begin + IN_ROW, end)):
            c = candidates.order[s]
            away = wp.length_sq(place_of(candidates.pose[candidates.body[c]]) - point)
            if away < least and holder[c] > p:
                least = away
                best = c
    return best


@wp.kernel
def ask_nearest(
    first: int,
    point: wp.array(dtype=wp.vec2),
    candidates: Candidates,
    turn: int,
    # outputs
    chosen: wp.array(dtype=wp.int32),
    holder: wp.array(dtype=wp.int32),
    last_turn: wp.array(dtype=wp.int32),
):
    """Let a point that has no candidate ask for the nearest that is left to it, which goes to the first of those that ask.

    ``last_turn`` has the last turns in which any point got one, and in which any was left without one for good.
    """
    p = first + wp.tid()
    has = chosen[p]
    # One that no candidate is left to never gets one again.
    if has == -1 or (has >= 0 and holder[has] == p):
        return
    best = nearest_left(p, point[p], candidates, holder)
    chosen[p] = best
    if best >= 0:
        wp.atomic_min(holder, best, p)
        wp.atomic_max(last_turn, 0, turn)
    else:
        wp.atomic_max(last_turn, 1, turn)
