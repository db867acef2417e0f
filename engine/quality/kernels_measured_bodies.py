"""The kernel that puts bodies where they are measured."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def place_bodies(
    first: int,
    position: wp.array(dtype=wp.vec2d),
    scale: wp.float64,
    # outputs
    pose: wp.array(dtype=wp.vec4),
):
    """Positions, scaled, as poses of dots."""
    i = first + wp.tid()
    at = position[i] * scale
    pose[i] = wp.vec4(float(at[0]), float(at[1]), 0.0, 0.0)
