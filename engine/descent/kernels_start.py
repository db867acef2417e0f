"""Kernels that put bodies where their density asks for them, along a Hilbert curve."""

from __future__ import annotations

import warp as wp

from ..space.kernels_images import Images, density_pixel, in_support

wp.set_module_options({"enable_backward": False})

# A cell that is partly empty is drawn from again this often before its body is put into the nearest pixel of the support.
REDRAWS = wp.constant(12)
# The largest float32 below 1.
BELOW_ONE = wp.constant(0.99999994)


@wp.func
def first_cell(level: int):
    """Place of a level of the pyramid: level l has 4^l cells."""
    return ((1 << (2 * level)) - 1) / 3


@wp.kernel
def copy_finest(
    first: int,
    share: wp.array(dtype=float),
    order: int,
    # outputs
    pyramid: wp.array(dtype=wp.float64),
):
    i = first + wp.tid()
    pyramid[first_cell(order) + i] = wp.float64(share[i])


@wp.func
def sum_quarters_at(level: int, row: int, column: int, pyramid: wp.array(dtype=wp.float64)):
    """Fill a cell of the pyramid with the sum of four of the next level."""
    side = 1 << level
    corner = first_cell(level + 1) + 4 * row * side + 2 * column
    pyramid[first_cell(level) + row * side + column] = (
        pyramid[corner] + pyramid[corner + 1] + pyramid[corner + 2 * side] + pyramid[corner + 2 * side + 1]
    )


@wp.kernel
def sum_quarters(
    first: int,
    level: int,
    levels: int,
    # outputs
    pyramid: wp.array(dtype=wp.float64),
):
    """Fill a level of the pyramid, of two ``levels`` the next one first: half as many launches."""
    i = first + wp.tid()
    side = 1 << level
    row = i / side
    column = i - row * side
    if levels == 2:
        for k in range(4):
            sum_quarters_at(level + 1, 2 * row + k / 2, 2 * column + k % 2, pyramid)
    sum_quarters_at(level, row, column, pyramid)


@wp.func
def cell_on_curve(share: wp.float64, order: int, pyramid: wp.array(dtype=wp.float64)):
    """Column and row of the cell up to which a Hilbert curve has passed ``share`` of the whole.

    A square is visited quarter by quarter: left below (the curve in it reflected about the diagonal), left above, right above, right
    below (reflected about the other diagonal).
    """
    left = share * pyramid[0]
    column = int(0)
    row = int(0)
    # What is done to the curve in this square: its axes swapped, both of them turned round.
    swapped = int(0)
    turned = int(0)
    for level in range(order):
        side = 2 << level
        found = int(0)
        chosen_swapped = int(0)
        chosen_turned = int(0)
        chosen_column = int(0)
        chosen_row = int(0)
        remains = wp.float64(0.0)
        for quarter in range(4):
            across = quarter / 2
            up = int(0)
            if quarter == 1 or quarter == 2:
                up = 1
            if swapped != 0:
                other = across
                across = up
                up = other
            if turned != 0:
                across = 1 - across
                up = 1 - up
            here = pyramid[first_cell(level + 1) + (2 * row + up) * side + 2 * column + across]
            # Rounding may leave something behind the last quarter that is not empty: that one then is it.
            if found == 0 and here > wp.float64(0.0):
                chosen_column = 2 * column + across
                chosen_row = 2 * row + up
                chosen_swapped = swapped
                chosen_turned = turned
                if quarter == 0 or quarter == 3:
                    chosen_swapped = 1 - swapped
                if quarter == 3:
                    chosen_turned = 1 - turned
                remains = wp.min(left, here)
                if left < here:
                    found = 1
                else:
                    left -= here
        column = chosen_column
        row = chosen_row
        swapped = chosen_swapped
        turned = chosen_turned
        left = remains
    return column, row


@wp.kernel
def place_bodies(
    first: int,
    support: wp.array(dtype=wp.int32),
    group: wp.array(dtype=wp.int32),
    rank: wp.array(dtype=wp.int32),
    identity: wp.array(dtype=wp.int32),
    group_count: wp.array(dtype=wp.int32),
    group_shift: wp.array(dtype=wp.float64),
    order: int,
    pyramid: wp.array(dtype=wp.float64),
    origin: wp.vec2,
    extent: wp.vec2,
    images: Images,
    domain: wp.vec2,
    seed: int,
    # outputs
    pose: wp.array(dtype=wp.vec4),
):
    """Put the bodies of one class at even steps of the running sum of its density along the curve, at random within their cells.

    The curve fills the rectangle of an ``extent`` from an ``origin`` on.
    """
    i = first + wp.tid()
    g = group[i]
    k = support[i]
    state = wp.rand_init(seed, identity[i])
    # Half a step of jitter: enough to hide the curve, little enough to stay even.
    along = group_shift[g] + wp.float64(0.5 * wp.randf(state))
    step = (wp.float64(rank[i]) + along - wp.floor(along)) / wp.float64(group_count[g])
    column, row = cell_on_curve(step, order, pyramid)
    cell = wp.cw_div(extent, wp.vec2(float(1 << order), float(1 << order)))
    corner = origin + wp.cw_mul(cell, wp.vec2(float(column), float(row)))
    position = wp.vec2(0.0, 0.0)
    inside = int(0)
    for _redraw in range(REDRAWS):
        if inside == 0:
            position = wp.min(corner + wp.cw_mul(cell, wp.vec2(wp.randf(state), wp.randf(state))), BELOW_ONE * domain)
            if in_support(position, k, images, domain):
                inside = 1
    if inside == 0:
        # The vector leads from one pixel's center to another's.
        pixel = density_pixel(position, k, images, domain)
        height = images.height[k]
        width = images.width[k]
        index = pixel - images.start[k]
        size = wp.cw_div(domain, wp.vec2(float(width), float(height)))
        center = wp.cw_mul(size, wp.vec2(float(index % width) + 0.5, float(height - 1 - index / width) + 0.5))
        within = wp.vec2(wp.randf(state) - 0.5, wp.randf(state) - 0.5)
        position = center + images.to_support[pixel] + 0.98 * wp.cw_mul(size, within)
    pose[i] = wp.vec4(position[0], position[1], 0.0, 0.0)


@wp.kernel
def rank_bodies(
    first: int,
    group: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    # outputs
    rank: wp.array(dtype=wp.int32),
):
    """Number of a body among those of its group, which lie one after the other from where it begins."""
    i = first + wp.tid()
    rank[i] = i - begin[group[i]]


@wp.kernel
def take_poses(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    source: wp.array(dtype=wp.int32),
    body: wp.array(dtype=wp.int32),
    # outputs
    taken: wp.array(dtype=wp.vec4),
):
    """The k-th of the bodies gets the pose of the k-th of the sources; without a list of bodies it is body k."""
    k = first + wp.tid()
    to = k
    if body.shape[0] > 0:
        to = body[k]
    taken[to] = pose[source[k]]
