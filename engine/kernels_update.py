"""Kernels that move the bodies."""

from __future__ import annotations

import warp as wp

from .kernels_mesh import Mesh, nearest_node

wp.set_module_options({"enable_backward": False})


@wp.struct
class Images:
    """Density images of all classes in one array, row 0 at the top: where each starts, its height and width."""

    pixel: wp.array(dtype=float)
    start: wp.array(dtype=wp.int32)
    height: wp.array(dtype=wp.int32)
    width: wp.array(dtype=wp.int32)


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
def is_full(position: wp.vec2, class_index: int, images: Images, domain: wp.vec2):
    """Whether the class's density is above zero at ``position``."""
    height = images.height[class_index]
    width = images.width[class_index]
    column = wp.clamp(int(position[0] / domain[0] * float(width)), 0, width - 1)
    row = wp.clamp(int((1.0 - position[1] / domain[1]) * float(height)), 0, height - 1)
    return images.pixel[images.start[class_index] + row * width + column] > 0.0


@wp.func
def shortest(difference: wp.vec2, domain: wp.vec2, periodic: int):
    """``difference`` of two positions, the short way round a periodic domain."""
    if periodic != 0:
        return wp.vec2(
            difference[0] - domain[0] * wp.round(difference[0] / domain[0]),
            difference[1] - domain[1] * wp.round(difference[1] / domain[1]),
        )
    return difference


@wp.kernel
def take_step(
    first: int,
    ahead: wp.array(dtype=wp.vec2),
    field: wp.array(dtype=wp.vec2),
    body_group: wp.array(dtype=wp.int32),
    body_class: wp.array(dtype=wp.int32),
    body_charge: wp.array(dtype=float),
    step_length: wp.array(dtype=float),
    step_limit: wp.array(dtype=float),
    relaxation: float,
    mesh: Mesh,
    images: Images,
    domain: wp.vec2,
    # outputs
    position: wp.array(dtype=wp.vec2),
    displacement: wp.array(dtype=wp.vec2),
    uphill: wp.array(dtype=float),
    moved: wp.array(dtype=float),
):
    """Move every body from the extrapolated point ``ahead`` along the field; bodies never enter empty pixels.

    ``displacement`` is the way from the last position, ``uphill`` its work against the field (positive: the momentum points
    the wrong way), ``moved`` the squared displacement over the squared local spacing.
    """
    i = first + wp.tid()
    start = ahead[i]
    old = position[i]
    node = nearest_node(start, mesh)
    group_node = body_group[i] * mesh.count_x * mesh.count_y + node
    limit = step_limit[node]
    move = field[i] * (relaxation * step_length[group_node])
    length = wp.length(move)
    if length > limit:
        move = move * (limit / length)
    k = body_class[i]
    new = stay_inside(start + move, domain, mesh.periodic)
    if not is_full(new, k, images, domain):
        # Slide along the edge of the full region as far as its pixels allow.
        along_x = stay_inside(wp.vec2(start[0] + move[0], old[1]), domain, mesh.periodic)
        along_y = stay_inside(wp.vec2(old[0], start[1] + move[1]), domain, mesh.periodic)
        new = old
        if is_full(along_x, k, images, domain):
            new = along_x
        elif is_full(along_y, k, images, domain):
            new = along_y
    way = shortest(new - old, domain, mesh.periodic)
    position[i] = new
    displacement[i] = way
    uphill[i] = -body_charge[i] * wp.dot(field[i], way)
    moved[i] = wp.length_sq(way) / (4.0 * limit * limit)


@wp.kernel
def look_ahead(
    first: int,
    position: wp.array(dtype=wp.vec2),
    displacement: wp.array(dtype=wp.vec2),
    momentum: float,
    domain: wp.vec2,
    periodic: int,
    # outputs
    ahead: wp.array(dtype=wp.vec2),
):
    """Extrapolate along the last displacement (Nesterov's momentum)."""
    i = first + wp.tid()
    ahead[i] = stay_inside(position[i] + momentum * displacement[i], domain, periodic)
