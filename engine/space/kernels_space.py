"""What kernels know of the space that bodies are in: its edges, or how it wraps.

Other kernels ask these functions, and do not look into :class:`Space` for how it ends: where positions go, ways between them, what the
border does to a force; and which of the cells or nodes that are numbered along an axis lies beyond an end. Another space provides the
same ones.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Space:
    """A rectangle from (0, 0) to ``size``, and whether it wraps."""

    size: wp.vec2
    periodic: wp.int32


@wp.func
def confine(position: wp.vec2, space: Space):
    """``position`` wrapped into a periodic space, or moved to the edge of an open one."""
    x = position[0]
    y = position[1]
    if space.periodic != 0:
        x = x - wp.floor(x / space.size[0]) * space.size[0]
        y = y - wp.floor(y / space.size[1]) * space.size[1]
        # Rounding may have ended on the far edge itself.
        if x >= space.size[0]:
            x = 0.0
        if y >= space.size[1]:
            y = 0.0
    # What is no number ends on an edge, too: a position outside would be looked up outside of arrays.
    if not (x >= 0.0):
        x = 0.0
    if not (y >= 0.0):
        y = 0.0
    return wp.vec2(wp.min(x, space.size[0]), wp.min(y, space.size[1]))


@wp.func
def difference(start: wp.vec2, end: wp.vec2, space: Space):
    """The vector from ``start`` to ``end``, the shorter one round a periodic space."""
    vector = end - start
    if space.periodic != 0:
        return wp.vec2(
            vector[0] - space.size[0] * wp.round(vector[0] / space.size[0]),
            vector[1] - space.size[1] * wp.round(vector[1] / space.size[1]),
        )
    return vector


@wp.func
def numbers_within(number: int, reach: int, count: int, space: Space):
    """First and last of the cells along an axis that lie within ``reach`` of one, unwrapped, none of them twice."""
    if space.periodic == 0:
        return wp.vec2i(wp.max(number - reach, 0), wp.min(number + reach, count - 1))
    if 2 * reach + 1 >= count:
        return wp.vec2i(0, count - 1)
    return wp.vec2i(number - reach, number + reach)


@wp.func
def from_far_edges(position: wp.vec2d, size: wp.vec2d, space: Space):
    """Where a position goes that rounding has left beyond the far edges of ``size``: onto these, or round to the near ones."""
    at = position
    for axis in range(2):
        # What is no number stays none.
        if space.periodic != 0:
            if at[axis] >= size[axis]:
                at[axis] = wp.float64(0.0)
        elif at[axis] > size[axis]:
            at[axis] = size[axis]
    return at


@wp.func
def overhang(position: wp.vec2, space: Space):
    """How far ``position`` lies before the lower edges of an open space (x, y), and behind the upper ones (z, w); below 0 inside."""
    if space.periodic != 0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    return wp.vec4(-position[0], -position[1], position[0] - space.size[0], position[1] - space.size[1])


@wp.func
def along_border(force: wp.vec2, position: wp.vec2, space: Space):
    """``force`` without what presses against the border of an open space that ``position`` lies on: it moves nothing."""
    if space.periodic != 0:
        return force
    x = force[0]
    y = force[1]
    if (position[0] <= 0.0 and x < 0.0) or (position[0] >= space.size[0] and x > 0.0):
        x = 0.0
    if (position[1] <= 0.0 and y < 0.0) or (position[1] >= space.size[1] and y > 0.0):
        y = 0.0
    return wp.vec2(x, y)


@wp.func
def wrapped(position: wp.vec2, space: Space):
    """``position`` inside a space that repeats itself; where one ends, it may lie outside."""
    if space.periodic != 0:
        return confine(position, space)
    return position


@wp.func
def number_inside(i: int, count: int, space: Space):
    """Which of ``count`` cells or nodes along an axis stands for number ``i``: the nearest one, or in a space that wraps its image."""
    inside = i
    if space.periodic != 0:
        inside = wrap(i, count)
    return wp.clamp(inside, 0, count - 1)


@wp.func
def number_across(i: int, count: int, space: Space):
    """Which of ``count`` cells along an axis lies at number ``i``, at most a period outside; below 0 or not below ``count``: none."""
    if space.periodic != 0:
        return wrap(i, count)
    return i


@wp.func
def number_repeated(i: int, count: int, space: Space):
    """Which of ``count`` cells along an axis stands for number ``i``, however many periods outside; -1 for none."""
    if space.periodic != 0:
        inside = i % count
        if inside < 0:
            inside += count
        return inside
    if i < 0 or i >= count:
        return -1
    return i


@wp.func
def between_cells(position: wp.vec2, values: wp.array(dtype=float), start: int, rows: int, columns: int, space: Space):
    """Values of cells over the space, row 0 at the bottom, ``start`` the first: linear between their middles."""
    u = position[0] / space.size[0] * float(columns) - 0.5
    v = position[1] / space.size[1] * float(rows) - 0.5
    left = int(wp.floor(u))
    low = int(wp.floor(v))
    fu = u - float(left)
    fv = v - float(low)
    x0 = number_inside(left, columns, space)
    x1 = number_inside(left + 1, columns, space)
    y0 = start + number_inside(low, rows, space) * columns
    y1 = start + number_inside(low + 1, rows, space) * columns
    lower = (1.0 - fu) * values[y0 + x0] + fu * values[y0 + x1]
    upper = (1.0 - fu) * values[y1 + x0] + fu * values[y1 + x1]
    return (1.0 - fv) * lower + fv * upper


@wp.func
def period(space: Space):
    """After which distance along x and along y the space repeats itself; 0 where it does not."""
    if space.periodic != 0:
        return space.size
    return wp.vec2(0.0, 0.0)


@wp.func
def numbers_beside(i: int, count: int, space: Space):
    """First and last number, for :func:`number_across`, of cell ``i`` along an axis and of those that touch it, none of them twice."""
    if space.periodic != 0 and count < 3:
        return wp.vec2i(0, count - 1)
    return wp.vec2i(i - 1, i + 1)


@wp.func
def wrap(i: int, count: int):
    """``i`` modulo ``count``, for ``i`` at most one period outside."""
    if i < 0:
        return i + count
    if i >= count:
        return i - count
    return i
