"""Kernels that order bodies as they lie in space: row after row, and in a row from left to right."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def row_cell(pose: wp.vec4, size: wp.vec2, rows: int, columns: int):
    """The cell of a body: rows of cells, of which none has a body that is farther left than one in a cell before it."""
    row = int(wp.max(wp.min(pose[1] / size[1] * float(rows), float(rows - 1)), 0.0))
    column = wp.clamp(int(pose[0] / size[0] * float(columns)), 0, columns - 1)
    return row * columns + column


@wp.kernel
def row_cells(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    size: wp.vec2,
    rows: int,
    columns: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    key[i] = row_cell(pose[i], size, rows, columns)
    order[i] = i


@wp.kernel
def row_cells_of_groups(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    size: wp.vec2,
    group: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """The cell of every body: group after group, each of which has rows over the whole domain, and a first cell."""
    i = first + wp.tid()
    g = group[i]
    key[i] = begin[g] + row_cell(pose[i], size, rows[g], columns[g])
    order[i] = i


@wp.func
def is_later(i: int, j: int, pose: wp.array(dtype=wp.vec4)):
    """Whether body i lies farther right than j; of two at one place the one with the larger number does."""
    return pose[i][0] > pose[j][0] or (pose[i][0] == pose[j][0] and i > j)


@wp.func
def sift_down(start: int, root: int, count: int, pose: wp.array(dtype=wp.vec4), order: wp.array(dtype=wp.int32)):
    """Let a body of a heap, whose latest one is on top, sink to its place."""
    at = root
    moved = order[start + root]
    while 2 * at + 1 < count:
        below = 2 * at + 1
        if below + 1 < count:
            if is_later(order[start + below + 1], order[start + below], pose):
                below += 1
        if is_later(order[start + below], moved, pose):
            order[start + at] = order[start + below]
            at = below
        else:
            break
    order[start + at] = moved


@wp.kernel
def order_in_cells(
    first: int,
    cell_start: wp.array(dtype=wp.int32),
    pose: wp.array(dtype=wp.vec4),
    # outputs
    order: wp.array(dtype=wp.int32),
):
    """Sort the bodies of every cell from left to right; as a heap, for cells may be crowded."""
    cell = first + wp.tid()
    start = cell_start[cell]
    count = cell_start[cell + 1] - start
    for done in range(count / 2):
        sift_down(start, count / 2 - 1 - done, count, pose, order)
    for done in range(count - 1):
        last = start + count - 1 - done
        latest = order[start]
        order[start] = order[last]
        order[last] = latest
        sift_down(start, 0, count - 1 - done, pose, order)
