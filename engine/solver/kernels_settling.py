"""Kernels of steps in which only bodies near a change move."""

from __future__ import annotations

import warp as wp

from ..space.kernels_mesh import Mesh

wp.set_module_options({"enable_backward": False})


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
