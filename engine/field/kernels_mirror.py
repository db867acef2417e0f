"""Kernels that lay out the images of charges beyond borders that are mirrors."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# How near an image comes to a border, in mean spacings.
NEAREST = wp.constant(0.01)


@wp.kernel
def mirror_positions(
    first: int,
    position: wp.array(dtype=wp.vec2),
    count: int,
    size: wp.vec2,
    # outputs
    everywhere: wp.array(dtype=wp.vec2),
):
    """Every charge, then the images of all beyond the right border, beyond the upper one, and beyond both."""
    i = first + wp.tid()
    p = position[i]
    # The image of a charge on a border would act on it in no direction: it stands a little way off, and so pushes inwards.
    x = 2.0 * size[0] - wp.clamp(p[0], NEAREST, size[0] - NEAREST)
    y = 2.0 * size[1] - wp.clamp(p[1], NEAREST, size[1] - NEAREST)
    everywhere[i] = p
    everywhere[count + i] = wp.vec2(x, p[1])
    everywhere[2 * count + i] = wp.vec2(p[0], y)
    everywhere[3 * count + i] = wp.vec2(x, y)


@wp.kernel
def take_first(
    first: int,
    field: wp.array(dtype=wp.vec2),
    # outputs
    of_charges: wp.array(dtype=wp.vec2),
):
    i = first + wp.tid()
    of_charges[i] = field[i]
