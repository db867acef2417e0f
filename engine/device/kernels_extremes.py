"""Kernels that find the least and the largest of many numbers, block by block (see :mod:`.extremes`)."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_extremes(
    first: int,
    values: wp.array(dtype=float),
    block: int,
    # outputs
    extremes: wp.array(dtype=wp.vec2),
):
    """Least and largest of a block: of a stretch of so many numbers, or fewer at the end."""
    b = first + wp.tid()
    least = float(wp.inf)
    most = float(-wp.inf)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        least = wp.min(least, values[i])
        most = wp.max(most, values[i])
    extremes[b] = wp.vec2(least, most)
