"""Kernels that find every body's nearest neighbor."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import CellGrid, column_and_row
from ..space.kernels_images import Images, density_pixel
from ..space.kernels_space import Space, difference, number_across, numbers_beside, numbers_within

wp.set_module_options({"enable_backward": False})

# What a body without a neighbor in sight has as its distance, and what has no spacing as its share of one.
NOBODY = wp.constant(1.0e6)


@wp.kernel
def find_number_density(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    per_pixel: wp.array(dtype=float),
    images: Images,
    domain: wp.vec2,
    # outputs
    number_density: wp.array(dtype=float),
):
    """Sum of what all classes ask for at every body: their pixels times the number that a pixel stands for."""
    i = first + wp.tid()
    at = wp.vec2(pose[i][0], pose[i][1])
    total = float(0.0)
    for k in range(per_pixel.shape[0]):
        total += per_pixel[k] * images.pixel[density_pixel(at, k, images, domain)]
    number_density[i] = total


@wp.func
def distance_to_nearest(
    i: int,
    position: wp.vec2,
    begin: int,
    end: int,
    pose: wp.array(dtype=wp.vec4),
    order: wp.array(dtype=wp.int32),
    space: Space,
):
    """Distance of body ``i`` to the nearest other one of those from place ``begin`` to ``end``."""
    closest = float(NOBODY)
    for s in range(begin, end):
        j = order[s]
        if j != i:
            way = difference(position, wp.vec2(pose[j][0], pose[j][1]), space)
            closest = wp.min(closest, wp.length(way))
    return closest


@wp.kernel
def find_nearest(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    number_density: wp.array(dtype=float),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    # outputs
    nearest: wp.array(dtype=float),
    share: wp.array(dtype=float),
):
    """How far each body's nearest neighbor is, and that over the spacing that is asked for where it is; 1e6 where none is in sight.

    Where nothing is asked for there is no spacing, either: a share of 1e6.
    """
    i = first + wp.tid()
    p = wp.vec2(pose[i][0], pose[i][1])
    cx, cy = column_and_row(p, grid)
    closest = float(NOBODY)
    rows = numbers_beside(cy, grid.count_y, grid.space)
    columns = numbers_beside(cx, grid.count_x, grid.space)
    for y in range(rows[0], rows[1] + 1):
        row = number_across(y, grid.count_y, grid.space)
        for x in range(columns[0], columns[1] + 1):
            column = number_across(x, grid.count_x, grid.space)
            if row >= 0 and row < grid.count_y and column >= 0 and column < grid.count_x:
                cell = row * grid.count_x + column
                found = distance_to_nearest(i, p, cell_start[cell], cell_start[cell + 1], pose, order, grid.space)
                closest = wp.min(closest, found)
    nearest[i] = closest
    share[i] = NOBODY
    if closest < NOBODY and number_density[i] > 0.0:
        share[i] = closest * wp.sqrt(number_density[i])


vec6 = wp.types.vector(length=6, dtype=float)


@wp.struct
class Six:
    """The nearest bodies found so far, the nearest first: how far they are, and the ways to them."""

    distance: vec6
    x: vec6
    y: vec6


@wp.func
def with_neighbor(before: Six, way: wp.vec2):
    """The same with a body at the end of a way, if it is among the nearest."""
    distance = before.distance
    x = before.x
    y = before.y
    far = wp.length(way)
    along_x = way[0]
    along_y = way[1]
    for k in range(6):
        if far < distance[k]:
            then_far = distance[k]
            then_x = x[k]
            then_y = y[k]
            distance[k] = far
            x[k] = along_x
            y[k] = along_y
            far = then_far
            along_x = then_x
            along_y = then_y
    six = Six()
    six.distance = distance
    six.x = x
    six.y = y
    return six


@wp.func
def nearest_six(
    i: int,
    reach: int,
    pose: wp.array(dtype=wp.vec4),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
):
    """The six bodies nearest to body ``i``, of those at most ``reach`` cells away."""
    p = wp.vec2(pose[i][0], pose[i][1])
    cx, cy = column_and_row(p, grid)
    six = Six()
    six.distance = vec6(NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY)
    rows = numbers_within(cy, reach, grid.count_y, grid.space)
    columns = numbers_within(cx, reach, grid.count_x, grid.space)
    for y in range(rows[0], rows[1] + 1):
        row = number_across(y, grid.count_y, grid.space)
        for x in range(columns[0], columns[1] + 1):
            cell = row * grid.count_x + number_across(x, grid.count_x, grid.space)
            for s in range(cell_start[cell], cell_start[cell + 1]):
                j = order[s]
                if j != i:
                    six = with_neighbor(six, difference(p, wp.vec2(pose[j][0], pose[j][1]), grid.space))
    return six


@wp.kernel
def find_order(
    first: int,
    every: int,
    farthest: int,
    pose: wp.array(dtype=wp.vec4),
    order: wp.array(dtype=wp.int32),
    cell_start: wp.array(dtype=wp.int32),
    grid: CellGrid,
    # outputs
    result: wp.array(dtype=wp.float64),
):
    """Sixfold order of every so many bodies: 1 where the six nearest stand at multiples of 60 degrees; below 0 where there are none.

    They are looked for in ever more cells, at most so many away.
    """
    k = first + wp.tid()
    side = wp.min(1.0 / grid.inverse_size[0], 1.0 / grid.inverse_size[1])
    reach = int(1)
    six = nearest_six(k * every, reach, pose, order, cell_start, grid)
    # Nobody nearer can be in other cells.
    while six.distance[5] > float(reach) * side and reach < farthest:
        reach = wp.min(2 * reach, farthest)
        six = nearest_six(k * every, reach, pose, order, cell_start, grid)
    result[k] = wp.float64(-1.0)
    if six.distance[5] < NOBODY:
        cosines = float(0.0)
        sines = float(0.0)
        for n in range(6):
            angle = 6.0 * wp.atan2(six.y[n], six.x[n])
            cosines += wp.cos(angle)
            sines += wp.sin(angle)
        result[k] = wp.float64(wp.sqrt(cosines * cosines + sines * sines) / 6.0)


@wp.kernel
def forget_unseen(
    first: int,
    share: wp.array(dtype=float),
    nobody: float,
    limit: float,
    # outputs
    nearest: wp.array(dtype=float),
):
    """Take distances to be those of ``nobody`` where no neighbor is within ``limit`` of the spacings that are asked for.

    Bodies that ask for no spacing, whose share is that of nobody, have the mean one of all, which is the unit.
    """
    i = first + wp.tid()
    seen = share[i] < limit or (share[i] >= nobody and nearest[i] < limit)
    if not seen:
        nearest[i] = nobody
