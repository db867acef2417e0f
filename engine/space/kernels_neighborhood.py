"""Kernels that find footprints in contact. Footprints are discs, or capsules around the axis of a line."""

from __future__ import annotations

import warp as wp

from .kernels_meeting import Meeting
from .kernels_space import Space, wrap

wp.set_module_options({"enable_backward": False})

# Bodies that the CPU looks at at once.
LANES = wp.constant(8)
# Looking at them quickly, they count as so much larger: far more than rounding may be wrong by.
SAFELY = wp.constant(1.0005)


@wp.struct
class ContactGrid:
    """Grids of cells, one per level; bodies of a level have a reach within a factor of two.

    Per level: the largest reach (from the center to the farthest point), cells along x and y, index of the first cell.
    """

    level_count: wp.int32
    reach: wp.array(dtype=float)
    count_x: wp.array(dtype=wp.int32)
    count_y: wp.array(dtype=wp.int32)
    first_cell: wp.array(dtype=wp.int32)
    space: Space


@wp.struct
class Footprints:
    """Level, radius (half the thickness of a capsule) and mass (area) of every body; and who keeps apart from whom."""

    level: wp.array(dtype=wp.int32)
    radius: wp.array(dtype=float)
    mass: wp.array(dtype=float)
    meeting: Meeting


@wp.func
def half_axis(pose: wp.vec4):
    if pose[3] == 0.0:
        return wp.vec2(0.0, 0.0)
    return wp.vec2(0.5 * pose[3] * wp.cos(pose[2]), 0.5 * pose[3] * wp.sin(pose[2]))


@wp.struct
class Sorted:
    """Bodies in the order of their cells: number, position, reach and half the axis of each; and the rank of every body in it.

    Positions and reaches have room for :data:`LANES` more.
    """

    body: wp.array(dtype=wp.int32)
    rank: wp.array(dtype=wp.int32)
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)
    reach: wp.array(dtype=float)
    half_axis: wp.array(dtype=wp.vec2)


@wp.struct
class Neighbors:
    """What finds neighbors: bodies in the order of their cells, their footprints, where every cell begins, and the cells."""

    bodies: Sorted
    footprints: Footprints
    cell_start: wp.array(dtype=wp.int32)
    grid: ContactGrid


@wp.func
def set_sorted(s: int, pose: wp.vec4, radius: float, bodies: Sorted):
    bodies.x[s] = pose[0]
    bodies.y[s] = pose[1]
    bodies.reach[s] = 0.5 * pose[3] + radius
    bodies.half_axis[s] = half_axis(pose)


@wp.kernel
def contact_keys(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    neighbors: Neighbors,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    m = neighbors.footprints.level[i]
    grid = neighbors.grid
    x = wp.clamp(int(pose[i][0] / grid.space.size[0] * float(grid.count_x[m])), 0, grid.count_x[m] - 1)
    y = wp.clamp(int(pose[i][1] / grid.space.size[1] * float(grid.count_y[m])), 0, grid.count_y[m] - 1)
    key[i] = grid.first_cell[m] + y * grid.count_x[m] + x
    order[i] = i


@wp.func
def closest_along(difference: wp.vec2, axis_i: wp.vec2, axis_j: wp.vec2):
    """Coordinates -1..1 along two axes (half vectors) where they are nearest, their middles being ``difference`` apart.

    Nearly so where the axes are nearly parallel: enough for bodies on their way, not for a count.
    """
    # Minimize |difference + v axis_j - u axis_i| over the square by clamping in turns, which ends after few rounds.
    ii = wp.dot(axis_i, axis_i)
    jj = wp.dot(axis_j, axis_j)
    ij = wp.dot(axis_i, axis_j)
    di = wp.dot(difference, axis_i)
    dj = wp.dot(difference, axis_j)
    u = float(0.0)
    v = float(0.0)
    if ii > 0.0 and jj > 0.0:
        determinant = ii * jj - ij * ij
        if determinant > 1.0e-6 * ii * jj:
            u = wp.clamp((di * jj - dj * ij) / determinant, -1.0, 1.0)
        v = wp.clamp((u * ij - dj) / jj, -1.0, 1.0)
        u = wp.clamp((v * ij + di) / ii, -1.0, 1.0)
        v = wp.clamp((u * ij - dj) / jj, -1.0, 1.0)
    elif ii > 0.0:
        u = wp.clamp(di / ii, -1.0, 1.0)
    elif jj > 0.0:
        v = wp.clamp(-dj / jj, -1.0, 1.0)
    return wp.vec2(u, v)


@wp.func
def cells_within(position: float, reach: float, domain: float, count: int, periodic: int):
    """First and last cell (unwrapped) of those that come within ``reach`` of ``position`` along one axis."""
    scale = float(count) / domain
    # Farther out than this nothing is another cell, and whole numbers end.
    farthest = 2.0 * float(count)
    low = int(wp.floor(wp.max((position - reach) * scale, -farthest)))
    high = int(wp.floor(wp.min((position + reach) * scale, farthest)))
    if periodic != 0:
        if high - low >= count:
            low = 0
            high = count - 1
    else:
        # Bodies on the far edge are in the last cell.
        low = wp.clamp(low, 0, count - 1)
        high = wp.clamp(high, 0, count - 1)
    return wp.vec2i(low, high)


@wp.func
def cells_of_period(cells: wp.vec2i, period: int, count: int):
    """Those of ``cells`` that lie one period before the domain (0), in it (1) or behind it (2), as cells of the domain."""
    start = (period - 1) * count
    return wp.vec2i(wp.max(cells[0] - start, 0), wp.min(cells[1] - start, count - 1))


@wp.struct
class Around:
    """Cells of a level that come within reach of a position: columns and rows (unwrapped), and how many periods they may lie in."""

    columns: wp.vec2i
    rows: wp.vec2i
    count_x: wp.int32
    count_y: wp.int32
    first_cell: wp.int32
    first_period: wp.int32
    periods: wp.int32


@wp.func
def cells_around(position: wp.vec2, reach: float, level: int, neighbors: Neighbors):
    """The cells of a level that come within ``reach`` of ``position``."""
    grid = neighbors.grid
    space = grid.space
    around = Around()
    around.count_x = grid.count_x[level]
    around.count_y = grid.count_y[level]
    around.columns = cells_within(position[0], reach, space.size[0], around.count_x, space.periodic)
    around.rows = cells_within(position[1], reach, space.size[1], around.count_y, space.periodic)
    around.first_cell = grid.first_cell[level]
    around.first_period = wp.where(space.periodic != 0, 0, 1)
    around.periods = wp.where(space.periodic != 0, 3, 1)
    return around


@wp.func
def run_count(around: Around):
    """Cells of a row are neighbors in memory: they are one run of bodies, or two where they lie on both sides of a wrap."""
    return (around.rows[1] - around.rows[0] + 1) * around.periods


@wp.func
def bodies_of_run(run: int, around: Around, neighbors: Neighbors):
    """First place in :class:`Sorted` of the bodies of a run, and the one after the last."""
    cells = cells_of_period(around.columns, around.first_period + run % around.periods, around.count_x)
    if cells[0] > cells[1]:
        return wp.vec2i(0, 0)
    row = wrap(around.rows[0] + run / around.periods, around.count_y)
    base = around.first_cell + row * around.count_x
    return wp.vec2i(neighbors.cell_start[base + cells[0]], neighbors.cell_start[base + cells[1] + 1])


# Which of the next bodies may be within reach, as bits: a quick look at several at once, wrong on the safe side only. Positions differ
# by less than a period; the nearest image of a body is meant.
_MAY_TOUCH = f"""
    const int count = end - start < {LANES} ? end - start : {LANES};
    const float period_x = periodic ? domain[0] : 0.0f, period_y = periodic ? domain[1] : 0.0f;
    const float per_x = periodic ? 1.0f / domain[0] : 0.0f, per_y = periodic ? 1.0f / domain[1] : 0.0f;
#if defined(__CUDA_ARCH__)
    int found = 0;
    for (int k = 0; k < count; ++k)
    {{
        float dx = xs.data[start + k] - x;
        float dy = ys.data[start + k] - y;
        dx -= period_x * rintf(dx * per_x);
        dy -= period_y * rintf(dy * per_y);
        const float limit = (reach + reaches.data[start + k]) * wider;
        if (dx * dx + dy * dy < limit * limit) found |= 1 << k;
    }}
    return found;
#else
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef bool B __attribute__((ext_vector_type({LANES})));
    V dx = *(const V*)(xs.data + start) - x;
    V dy = *(const V*)(ys.data + start) - y;
    if (periodic)
    {{
        dx -= period_x * __builtin_elementwise_rint(dx * per_x);
        dy -= period_y * __builtin_elementwise_rint(dy * per_y);
    }}
    const V limit = (reach + *(const V*)(reaches.data + start)) * wider;
    const B near = __builtin_convertvector(dx * dx + dy * dy < limit * limit, B);
    return __builtin_bit_cast(unsigned char, near) & ((1 << count) - 1);
#endif
"""


@wp.func_native(_MAY_TOUCH)
def may_touch(
    x: float,
    y: float,
    reach: float,
    wider: float,
    domain: wp.vec2,
    periodic: int,
    start: int,
    end: int,
    xs: wp.array(dtype=float),
    ys: wp.array(dtype=float),
    reaches: wp.array(dtype=float),
) -> int: ...


@wp.func
def next_near(position: wp.vec2, reach: float, wider: float, start: int, end: int, neighbors: Neighbors):
    """Which of the bodies from ``start`` on, :data:`LANES` of them at most, may be within reach of ``position``, as bits."""
    space = neighbors.grid.space
    near = neighbors.bodies
    return may_touch(
        position[0], position[1], reach, wider, space.size, space.periodic, start, end, near.x, near.y, near.reach
    )


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __ffs(bits) - 1;
#else
    return __builtin_ctz(bits);
#endif
""")
def lowest_bit(bits: int) -> int: ...


@wp.kernel
def gather_bodies(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    # outputs
    neighbors: Neighbors,
):
    s = first + wp.tid()
    i = neighbors.bodies.body[s]
    neighbors.bodies.rank[i] = s
    set_sorted(s, pose[i], neighbors.footprints.radius[i], neighbors.bodies)
