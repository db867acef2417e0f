"""Kernels of the steps after an edit in a rectangle; see :mod:`.settling`."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import PINNED, Bodies, confine_line, slide
from ..space.kernels_images import Images
from ..space.kernels_mesh import Mesh, nearest_node
from ..space.kernels_space import Space, difference, number_repeated, overhang
from .kernels_settling import bin_of_way

wp.set_module_options({"enable_backward": False})

# How far those that share a corner go into the space, over how far a step may lead there; and what shares out the directions.
LEAVE = wp.constant(0.2)
GOLDEN = wp.constant(0.6180340)


@wp.struct
class Reach:
    """How far bodies that are held may go: ``within``, and not farther than ``locally`` times the step ``limit`` at their node."""

    mesh: Mesh
    limit: wp.array(dtype=float)
    within: float
    locally: float


@wp.struct
class Cells:
    """Cells of a rectangle that holds all bodies, row 0 at the bottom: 1 for those near a change, 0 for others."""

    rows: wp.int32
    columns: wp.int32
    origin: wp.vec2
    size: wp.vec2
    near: wp.array(dtype=wp.uint8)


@wp.func
def cell_at(position: wp.vec2, cells: Cells):
    column = wp.clamp(int((position[0] - cells.origin[0]) / cells.size[0] * float(cells.columns)), 0, cells.columns - 1)
    row = wp.clamp(int((position[1] - cells.origin[1]) / cells.size[1] * float(cells.rows)), 0, cells.rows - 1)
    return row * cells.columns + column


@wp.kernel
def mark_places(
    first: int,
    place: wp.array(dtype=wp.vec2),
    cells: Cells,
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark the cell that a place lies in; whoever else does so at the same time writes the same."""
    marked[cell_at(place[first + wp.tid()], cells)] = 1


@wp.kernel
def mark_beside(
    first: int,
    marked: wp.array(dtype=wp.int32),
    space: Space,
    # outputs
    cells: Cells,
):
    """Mark the cells that are beside a marked one, or are one."""
    c = first + wp.tid()
    found = int(0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            x = number_repeated(c % cells.columns + dx, cells.columns, space)
            y = number_repeated(c / cells.columns + dy, cells.rows, space)
            if x >= 0 and y >= 0:
                found = wp.max(found, marked[y * cells.columns + x])
    cells.near[c] = wp.uint8(found)


@wp.func
def reach_at(position: wp.vec2, reach: Reach):
    return wp.min(reach.within, reach.locally * reach.limit[nearest_node(position, reach.mesh)])


@wp.kernel
def count_moved(
    first: int,
    thread: int,
    start: wp.array(dtype=wp.vec4),
    source: wp.array(dtype=wp.int32),
    cells: Cells,
    reach: Reach,
    space: Space,
    pose: wp.array(dtype=wp.vec4),
    # outputs
    moved: wp.array2d(dtype=wp.int32),
):
    """Count bodies near a change that were there before it by how far they have moved, but those within their reach."""
    i = first + wp.tid()
    old = wp.vec2(start[i][0], start[i][1])
    if source[i] < 0 or cells.near[cell_at(old, cells)] == wp.uint8(0):
        return
    way = difference(old, wp.vec2(pose[i][0], pose[i][1]), space)
    bin = bin_of_way(wp.length(way), reach_at(old, reach))
    if bin > 0:
        wp.atomic_add(moved, thread, bin, 1)


@wp.kernel
def bring_back(
    first: int,
    start: wp.array(dtype=wp.vec4),
    source: wp.array(dtype=wp.int32),
    cells: Cells,
    reach: Reach,
    space: Space,
    free_from: wp.array(dtype=wp.int32),
    bodies: Bodies,
    images: Images,
    bend: wp.array(dtype=float),
    # outputs
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
):
    """Bring bodies back into their reach, but new ones and those near a change whose ways are in bin ``free_from`` or longer.

    Turns, lengths and bends stay as they are; charges of lines are still to follow.
    """
    i = first + wp.tid()
    at = pose[i]
    old = wp.vec2(start[i][0], start[i][1])
    here = wp.vec2(at[0], at[1])
    way = difference(old, here, space)
    length = wp.length(way)
    most = reach_at(old, reach)
    bin = bin_of_way(length, most)
    if source[i] < 0 or bin == 0 or not (length > 0.0):
        return
    if bin >= free_from[0] and cells.near[cell_at(old, cells)] != wp.uint8(0):
        return
    back = old + way * (most / length)
    if bodies.kind[i] < 0:
        new = slide(old, back, bodies.support[i], images, space)
        pose[i] = wp.vec4(new[0], new[1], at[2], at[3])
        charge_position[bodies.first_charge[i]] = new
    else:
        begin = bodies.first_charge[i]
        end = bodies.first_charge[i + 1]
        wanted = wp.vec4(back[0], back[1], at[2], at[3])
        pose[i] = confine_line(at, wanted, begin, end, bodies, bend, bodies.support[i], images, space)
    shift = difference(here, wp.vec2(pose[i][0], pose[i][1]), space)
    displacement[i] = displacement[i] + wp.vec4(shift[0], shift[1], 0.0, 0.0)


@wp.func
def corner_at(position: wp.vec2, space: Space):
    """Number of the corner of a space with edges that a position lies in, exactly; -1 for none."""
    beyond = overhang(position, space)
    right, upper = beyond[2] >= 0.0, beyond[3] >= 0.0
    if not (right or beyond[0] >= 0.0) or not (upper or beyond[1] >= 0.0):
        return -1
    return int(right) + 2 * int(upper)


@wp.kernel
def claim_corners(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    space: Space,
    bodies: Bodies,
    # outputs
    owner: wp.array(dtype=wp.int32),
):
    """Find who of those in a corner stays there: one that is pinned (-1), or else the first; ``owner`` holds large numbers before."""
    i = first + wp.tid()
    corner = corner_at(wp.vec2(pose[i][0], pose[i][1]), space)
    if corner >= 0:
        claim = i
        if (bodies.flags[i] & PINNED) != 0:
            claim = -1
        wp.atomic_min(owner, corner, claim)


@wp.kernel
def leave_corners(
    first: int,
    owner: wp.array(dtype=wp.int32),
    reach: Reach,
    space: Space,
    bodies: Bodies,
    images: Images,
    # outputs
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
):
    """Move dots that stand in a corner with another one a little into the space, each to a place of its own."""
    i = first + wp.tid()
    at = pose[i]
    here = wp.vec2(at[0], at[1])
    corner = corner_at(here, space)
    if corner < 0 or bodies.kind[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    if owner[corner] == i:
        return
    share = float(i) * GOLDEN
    share = share - wp.floor(share)
    way = wp.vec2(share, 1.0 - share) * (LEAVE * reach.limit[nearest_node(here, reach.mesh)])
    inwards = wp.vec2(1.0 - 2.0 * float(corner % 2), 1.0 - 2.0 * float(corner / 2))
    new = slide(here, here + wp.cw_mul(way, inwards), bodies.support[i], images, space)
    pose[i] = wp.vec4(new[0], new[1], at[2], at[3])
    charge_position[bodies.first_charge[i]] = new
    displacement[i] = displacement[i] + wp.vec4(new[0] - here[0], new[1] - here[1], 0.0, 0.0)
