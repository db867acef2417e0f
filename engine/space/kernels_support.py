"""Kernels that find the pixel of the support, where the density is above zero, that is nearest to every empty one."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_nearer_support(
    first: int,
    height: int,
    width: int,
    size: wp.vec2,
    jump: int,
    nearest: wp.array(dtype=wp.int32),
    # outputs
    nearer: wp.array(dtype=wp.int32),
):
    """One round of jump flooding: ask the eight pixels ``jump`` away for the pixel of the support nearest to them; -1: none yet."""
    i = first + wp.tid()
    row = i / width
    column = i - row * width
    best = nearest[i]
    # Nothing is nearer to what is in the support itself, and most pixels mostly are.
    if best == i:
        nearer[i] = i
        return
    least = float(1.0e30)
    for neighbor in range(9):
        r = row + (neighbor / 3 - 1) * jump
        c = column + (neighbor % 3 - 1) * jump
        candidate = int(-1)
        if r >= 0 and r < height and c >= 0 and c < width:
            candidate = nearest[r * width + c]
        if candidate >= 0:
            to = candidate / width
            dx = float(candidate - to * width - column) * size[0]
            dy = float(to - row) * size[1]
            away = dx * dx + dy * dy
            if away < least:
                least = away
                best = candidate
    nearer[i] = best


@wp.kernel
def find_vectors(
    first: int,
    width: int,
    size: wp.vec2,
    nearest: wp.array(dtype=wp.int32),
    # outputs
    vector: wp.array(dtype=wp.vec2),
):
    """Vector from every pixel's center to that of the nearest in the support: x to the right, y up."""
    i = first + wp.tid()
    row = i / width
    to = nearest[i] / width
    vector[i] = wp.vec2(float(nearest[i] - to * width - (i - row * width)) * size[0], float(row - to) * size[1])
