"""Kernels of steps in which only bodies near a change move."""

from __future__ import annotations

import warp as wp

from ..space.kernels_mesh import Mesh
from ..space.kernels_space import Space, number_repeated

wp.set_module_options({"enable_backward": False})


@wp.kernel
def mark_places(
    first: int,
    place: wp.array(dtype=wp.vec2),
    rows: int,
    columns: int,
    size: wp.vec2,
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark the cell of the domain that a place lies in; whoever else does so at the same time writes the same."""
    at = place[first + wp.tid()]
    column = wp.clamp(int(at[0] / size[0] * float(columns)), 0, columns - 1)
    row = wp.clamp(int(at[1] / size[1] * float(rows)), 0, rows - 1)
    marked[row * columns + column] = 1


@wp.kernel
def mark_beside(
    first: int,
    thread: int,
    marked: wp.array(dtype=wp.int32),
    rows: int,
    columns: int,
    space: Space,
    # outputs
    near: wp.array(dtype=wp.uint8),
    count: wp.array(dtype=wp.int32),
):
    """Mark the cells that are beside a marked one, or are one, and count them for every thread."""
    c = first + wp.tid()
    found = int(0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            x = number_repeated(c % columns + dx, columns, space)
            y = number_repeated(c / columns + dy, rows, space)
            if x >= 0 and y >= 0:
                found = wp.max(found, marked[y * columns + x])
    near[c] = wp.uint8(found)
    if found != 0:
        wp.atomic_add(count, thread, 1)


@wp.kernel
def hold_far_away(
    first: int,
    mesh: Mesh,
    near: wp.array(dtype=wp.uint8),
    rows: int,
    columns: int,
    size: wp.vec2,
    share: float,
    # outputs
    step_length: wp.array(dtype=float),
):
    """Leave only a share of the steps at nodes in cells of the domain that are not near a change; of every group."""
    i = first + wp.tid()
    node = i % (mesh.count_x * mesh.count_y)
    x = float(node % mesh.count_x - mesh.margin) / mesh.inverse_spacing[0]
    y = float(node / mesh.count_x - mesh.margin) / mesh.inverse_spacing[1]
    column = wp.clamp(int(x / size[0] * float(columns)), 0, columns - 1)
    row = wp.clamp(int(y / size[1] * float(rows)), 0, rows - 1)
    if near[row * columns + column] == wp.uint8(0):
        step_length[i] = step_length[i] * share
