"""The kernel that brings positions back into meters."""

from __future__ import annotations

import warp as wp

from ..space.kernels_space import Space, from_far_edges

wp.set_module_options({"enable_backward": False})


@wp.kernel
def place_in_meters(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    unit: wp.float64,
    size: wp.vec2d,
    space: Space,
    # outputs
    position: wp.array(dtype=wp.vec2d),
):
    """Positions [m] of bodies; beyond the far edges, where rounding leaves some, they go onto these, or round to the near ones."""
    i = first + wp.tid()
    at = wp.vec2d(wp.float64(pose[i][0]) * unit, wp.float64(pose[i][1]) * unit)
    position[i] = from_far_edges(at, size, space)
