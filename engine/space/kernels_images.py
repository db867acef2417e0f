"""What kernels know of density images."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Images:
    """Density images of all classes in one array, row 0 at the top: where each starts, its height and width.

    A class's *support* is where its density is above zero. ``to_support`` leads from an empty pixel's center to that of the nearest
    in the support. Of lines, points at most ``step`` apart are looked at; 0: their charges only.
    """

    pixel: wp.array(dtype=float)
    to_support: wp.array(dtype=wp.vec2)
    start: wp.array(dtype=wp.int32)
    height: wp.array(dtype=wp.int32)
    width: wp.array(dtype=wp.int32)
    step: float


@wp.func
def pixel_at(position: wp.vec2, start: int, height: int, width: int, domain: wp.vec2):
    """Index of the pixel that covers ``position``."""
    column = wp.clamp(int(position[0] / domain[0] * float(width)), 0, width - 1)
    row = wp.clamp(int((1.0 - position[1] / domain[1]) * float(height)), 0, height - 1)
    return start + row * width + column


@wp.func
def density_pixel(position: wp.vec2, k: int, images: Images, domain: wp.vec2):
    """Index of the pixel of class ``k`` that covers ``position``."""
    return pixel_at(position, images.start[k], images.height[k], images.width[k], domain)


@wp.func
def in_support(position: wp.vec2, k: int, images: Images, domain: wp.vec2):
    """Whether ``position`` lies where the density of class ``k`` is above zero."""
    return images.pixel[density_pixel(position, k, images, domain)] > 0.0
