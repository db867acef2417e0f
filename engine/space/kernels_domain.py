"""What kernels know of the domain: its edges, or how it wraps."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def stay_inside(position: wp.vec2, domain: wp.vec2, periodic: int):
    """``position`` wrapped into a periodic domain, or moved to the edge of an open one."""
    x = position[0]
    y = position[1]
    if periodic != 0:
        x = x - wp.floor(x / domain[0]) * domain[0]
        y = y - wp.floor(y / domain[1]) * domain[1]
        # Rounding may have ended on the far edge itself.
        if x >= domain[0]:
            x = 0.0
        if y >= domain[1]:
            y = 0.0
    return wp.vec2(wp.clamp(x, 0.0, domain[0]), wp.clamp(y, 0.0, domain[1]))


@wp.func
def shortest(difference: wp.vec2, domain: wp.vec2, periodic: int):
    """``difference`` of two positions, the short way round a periodic domain."""
    if periodic != 0:
        return wp.vec2(
            difference[0] - domain[0] * wp.round(difference[0] / domain[0]),
            difference[1] - domain[1] * wp.round(difference[1] / domain[1]),
        )
    return difference


@wp.func
def wrap(i: int, count: int):
    """``i`` modulo ``count``, for ``i`` at most one period outside."""
    if i < 0:
        return i + count
    if i >= count:
        return i - count
    return i
