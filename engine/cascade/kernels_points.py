"""Kernels that find neighbors among points in space, by cells whose numbers are hashed into a table."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_relations import see_each_other

wp.set_module_options({"enable_backward": False})

SEED = wp.constant(1)


@wp.struct
class Points:
    """Points of a surface: where they are, where the surface looks to, and the label of the part that they are on."""

    position: wp.array(dtype=wp.vec3)
    normal: wp.array(dtype=wp.vec3)
    label: wp.array(dtype=wp.int32)


@wp.func
def side_factor(one: wp.vec3, other: wp.vec3):
    """How much two places of a surface see of each other: 1 on one sheet, 1/2 across a right angle, 0 through a thin wall."""
    return 0.5 + 0.5 * wp.dot(one, other)


@wp.struct
class PointGrid:
    """Cells of points: inverse size of a cell, slots of the table less one, and the points in the order of the slots."""

    inverse_size: wp.float32
    mask: wp.int32
    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.struct
class Likeness:
    """Which points are alike: those of one part in one cell whose normals, times ``turns``, are the same whole numbers.

    Where cells begin, and how large they are.
    """

    low: wp.vec3
    cell: wp.float32
    turns: wp.float32


@wp.func
def cell_at(position: wp.vec3, inverse_size: float):
    return wp.vec3i(
        int(wp.floor(position[0] * inverse_size)),
        int(wp.floor(position[1] * inverse_size)),
        int(wp.floor(position[2] * inverse_size)),
    )


@wp.func
def slot_of(cell: wp.vec3i, mask: int):
    """Slot of a cell: four times four times four cells have slots side by side, wherever these are."""
    mixed = ((cell[0] >> 2) * 73856093) ^ ((cell[1] >> 2) * 19349663) ^ ((cell[2] >> 2) * 83492791)
    mixed = mixed ^ (mixed >> 15)
    within = (cell[0] & 3) + 4 * (cell[1] & 3) + 16 * (cell[2] & 3)
    return (64 * mixed + within) & mask


@wp.func
def same_cell(one: wp.vec3i, other: wp.vec3i):
    return one[0] == other[0] and one[1] == other[1] and one[2] == other[2]


@wp.kernel
def find_slots(
    first: int,
    position: wp.array(dtype=wp.vec3),
    inverse_size: float,
    mask: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    key[i] = slot_of(cell_at(position[i], inverse_size), mask)
    order[i] = i


@wp.func
def cell_around(cell: wp.vec3i, number: int):
    """A cell, or one of the 26 that touch it, by a number from 0 to 26."""
    return wp.vec3i(cell[0] + number % 3 - 1, cell[1] + (number / 3) % 3 - 1, cell[2] + number / 9 - 1)


@wp.func
def is_crowded(
    i: int,
    points: Points,
    grid: PointGrid,
    radius: float,
    kept: wp.array(dtype=wp.int32),
    kept_count: wp.array(dtype=wp.int32),
):
    """Whether a point that is kept lies nearer than ``radius`` to point ``i``, on its sheet."""
    own = points.position[i]
    cell = cell_at(own, grid.inverse_size)
    for number in range(27):
        slot = slot_of(cell_around(cell, number), grid.mask)
        begin = grid.start[slot]
        for k in range(begin, begin + kept_count[slot]):
            # Another thread may be about to write what a far cell of the slot keeps.
            j = kept[k]
            if j >= 0 and wp.length_sq(points.position[j] - own) < radius * radius:
                if points.label[j] == points.label[i] and wp.dot(points.normal[i], points.normal[j]) > 0.0:
                    return True
    return False


@wp.kernel
def thin_out(
    first: int,
    phase: int,
    points: Points,
    grid: PointGrid,
    radius: float,
    # outputs
    kept: wp.array(dtype=wp.int32),
    kept_count: wp.array(dtype=wp.int32),
    is_kept: wp.array(dtype=wp.int32),
):
    """Keep points of which no two of one sheet are nearer than ``radius``, and of which no others could be kept too.

    An element is a slot, whose points that are kept are listed from its start on. Cells are as large as the radius; those of a phase,
    one in eight, do not touch, so that none of their points is near one of another cell.
    """
    slot = first + wp.tid()
    begin = grid.start[slot]
    length = grid.start[slot + 1] - begin
    # Neither the order of the points nor the cells may show in what is kept.
    state = wp.rand_init(SEED, slot)
    shift = wp.randi(state, 0, wp.max(length, 1))
    for k in range(length):
        i = grid.order[begin + (k + shift) % length]
        cell = cell_at(points.position[i], grid.inverse_size)
        if (cell[0] & 1) + 2 * (cell[1] & 1) + 4 * (cell[2] & 1) == phase:
            if not is_crowded(i, points, grid, radius, kept, kept_count):
                kept[begin + kept_count[slot]] = i
                kept_count[slot] = kept_count[slot] + 1
                is_kept[i] = 1


@wp.func
def cell_of_alike(position: wp.vec3, likeness: Likeness):
    return wp.vec3i(
        int(wp.floor((position[0] - likeness.low[0]) / likeness.cell)),
        int(wp.floor((position[1] - likeness.low[1]) / likeness.cell)),
        int(wp.floor((position[2] - likeness.low[2]) / likeness.cell)),
    )


@wp.func
def turn_of_alike(normal: wp.vec3, likeness: Likeness):
    return wp.vec3i(
        int(wp.rint(normal[0] * likeness.turns)),
        int(wp.rint(normal[1] * likeness.turns)),
        int(wp.rint(normal[2] * likeness.turns)),
    )


@wp.func
def slot_of_alike(i: int, points: Points, likeness: Likeness, mask: int):
    """Slot of what a point is like: neighboring cells have slots side by side, wherever these are."""
    turn = turn_of_alike(points.normal[i], likeness)
    mixed = (turn[0] * 73856093) ^ (turn[1] * 19349663) ^ (turn[2] * 83492791) ^ (points.label[i] * 49979693)
    mixed = mixed ^ (mixed >> 15)
    return (slot_of(cell_of_alike(points.position[i], likeness), mask) + 64 * mixed) & mask


@wp.kernel
def find_slots_of_alike(
    first: int,
    points: Points,
    likeness: Likeness,
    mask: int,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort points into a table in which those that are alike share a slot."""
    i = first + wp.tid()
    key[i] = slot_of_alike(i, points, likeness, mask)
    order[i] = i


@wp.func
def are_alike(i: int, j: int, points: Points, likeness: Likeness):
    if points.label[i] != points.label[j]:
        return False
    if not same_cell(cell_of_alike(points.position[i], likeness), cell_of_alike(points.position[j], likeness)):
        return False
    return same_cell(turn_of_alike(points.normal[i], likeness), turn_of_alike(points.normal[j], likeness))


@wp.kernel
def find_first_alike(
    first: int,
    points: Points,
    likeness: Likeness,
    mask: int,
    order: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    # outputs
    first_alike: wp.array(dtype=wp.int32),
    is_first: wp.array(dtype=wp.int32),
):
    """The first of the points that are like each, and whether it is that itself; those of a slot are in their order."""
    i = first + wp.tid()
    s = start[slot_of_alike(i, points, likeness, mask)]
    # It is found at last where it is itself.
    while order[s] != i and not are_alike(i, order[s], points, likeness):
        s += 1
    first_alike[i] = order[s]
    is_first[i] = int(order[s] == i)


@wp.kernel
def find_nearest(
    first: int,
    points: Points,
    others: Points,
    grid: PointGrid,
    reach: float,
    turn: float,
    # outputs
    nearest: wp.array(dtype=wp.int32),
):
    """Nearest of other points on the same part, where a turn of the surface counts as ``turn`` times the change of the normal; or -1.

    Cells are as large as ``reach``.
    """
    i = first + wp.tid()
    own = points.position[i]
    cell = cell_at(own, grid.inverse_size)
    best = int(-1)
    least = float(1.0e30)
    for number in range(27):
        around = cell_around(cell, number)
        slot = slot_of(around, grid.mask)
        for s in range(grid.start[slot], grid.start[slot + 1]):
            j = grid.order[s]
            square = wp.length_sq(others.position[j] - own)
            if square < reach * reach and others.label[j] == points.label[i]:
                far = square + turn * turn * wp.length_sq(others.normal[j] - points.normal[i])
                if far < least or (far == least and j < best):
                    least = far
                    best = j
    nearest[i] = best


@wp.kernel
def mark_own(
    first: int,
    points: Points,
    alike: wp.array(dtype=wp.int32),
    which: wp.array(dtype=wp.int32),
    # outputs
    is_own: wp.array(dtype=wp.int32),
):
    """Mark points that are the first of those that are alike, or differ from it in any digit."""
    i = first + wp.tid()
    j = alike[which[i]]
    same = points.position[i] == points.position[j] and points.normal[i] == points.normal[j]
    is_own[i] = int(i == j or not same)


@wp.kernel
def find_same(
    first: int,
    alike: wp.array(dtype=wp.int32),
    is_own: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    # outputs
    which: wp.array(dtype=wp.int32),
):
    """From which of ``alike`` a point is like to which of its own points it is the same as; ``start`` is their running sum."""
    i = first + wp.tid()
    if is_own[i] != 0:
        which[i] = start[i]
    else:
        which[i] = start[alike[which[i]]]


@wp.kernel
def average_normals(
    first: int,
    points: Points,
    others: Points,
    area: wp.array(dtype=float),
    grid: PointGrid,
    width: float,
    reach: float,
    # outputs
    average: wp.array(dtype=wp.vec3),
):
    """Average, by a Gaussian, of what the surface looks to at other points of the same part near every point.

    Each of the others counts by the ``area`` that it stands for, and by how much the point sees of it. Cells are as large as
    the reach.
    """
    i = first + wp.tid()
    place = points.position[i]
    own = points.normal[i]
    part = points.label[i]
    total = wp.vec3(0.0, 0.0, 0.0)
    cell = cell_at(place, grid.inverse_size)
    for number in range(27):
        around = cell_around(cell, number)
        slot = slot_of(around, grid.mask)
        for s in range(grid.start[slot], grid.start[slot + 1]):
            j = grid.order[s]
            square = wp.length_sq(others.position[j] - place)
            if square < reach * reach and others.label[j] == part:
                # Others may share the cell's slot.
                if same_cell(cell_at(others.position[j], grid.inverse_size), around):
                    near = wp.exp(-0.5 * square / (width * width))
                    total += (side_factor(others.normal[j], own) * near * area[j]) * others.normal[j]
    average[i] = direction_of(total, own)


@wp.func
def direction_of(total: wp.vec3, own: wp.vec3):
    """Where a sum of normals looks to; ``own`` if that is to no side, or to the other one."""
    length = wp.length(total)
    if length > 0.0 and wp.dot(total, own) > 0.0:
        return total / length
    return own


@wp.kernel
def weigh_near(
    first: int,
    points: Points,
    others: Points,
    start: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    width: float,
    # outputs
    near: wp.array(dtype=float),
):
    """A Gaussian of how far the others are away that are listed for every point."""
    i = first + wp.tid()
    for k in range(start[i], start[i + 1]):
        square = wp.length_sq(others.position[entry[k]] - points.position[i])
        near[k] = wp.exp(-0.5 * square / (width * width))


@wp.kernel
def average_listed(
    first: int,
    points: Points,
    others: Points,
    area: wp.array(dtype=float),
    start: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    near: wp.array(dtype=float),
    # outputs
    average: wp.array(dtype=wp.vec3),
):
    """What :func:`average_normals` finds, to the last bit, where the others are listed and weighed that it looks for."""
    i = first + wp.tid()
    own = points.normal[i]
    total = wp.vec3(0.0, 0.0, 0.0)
    for k in range(start[i], start[i + 1]):
        j = entry[k]
        total += (side_factor(others.normal[j], own) * near[k] * area[j]) * others.normal[j]
    average[i] = direction_of(total, own)


@wp.func
def sees(
    i: int,
    j: int,
    points: Points,
    others: Points,
    related: wp.array(dtype=wp.int32),
    relations: int,
    square_reach: float,
    least_cosine: float,
):
    return (
        wp.length_sq(others.position[j] - points.position[i]) < square_reach
        and see_each_other(points.label[i], others.label[j], related, relations)
        and wp.dot(points.normal[i], others.normal[j]) > least_cosine
    )


@wp.func
def sees_in_cell(
    i: int,
    j: int,
    points: Points,
    others: Points,
    related: wp.array(dtype=wp.int32),
    relations: int,
    square_reach: float,
    least_cosine: float,
    cell: wp.vec3i,
    grid: PointGrid,
):
    """The same, of another point that lies in a cell: others may share its slot."""
    if sees(i, j, points, others, related, relations, square_reach, least_cosine):
        return same_cell(cell_at(others.position[j], grid.inverse_size), cell)
    return False


@wp.kernel
def list_near(
    first: int,
    points: Points,
    others: Points,
    grid: PointGrid,
    related: wp.array(dtype=wp.int32),
    relations: int,
    reach: float,
    least_cosine: float,
    start: wp.array(dtype=wp.int32),
    # outputs
    near: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
):
    """List the other points within ``reach`` of each that it sees, and that look into like directions; cells are as large.

    Those of a point are listed from its ``start`` on, as far as there is room, and all are counted.
    """
    i = first + wp.tid()
    cell = cell_at(points.position[i], grid.inverse_size)
    at = start[i]
    end = start[i + 1]
    for number in range(27):
        around = cell_around(cell, number)
        slot = slot_of(around, grid.mask)
        for s in range(grid.start[slot], grid.start[slot + 1]):
            j = grid.order[s]
            if sees_in_cell(i, j, points, others, related, relations, reach * reach, least_cosine, around, grid):
                if at < end:
                    near[at] = j
                at += 1
    count[i] = at - start[i]


@wp.kernel
def close_up(
    first: int,
    room: int,
    entry: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    # outputs
    packed: wp.array(dtype=wp.int32),
):
    """Copy lists that have ``room`` each to where they start."""
    i = first + wp.tid()
    for k in range(start[i + 1] - start[i]):
        packed[start[i] + k] = entry[i * room + k]


@wp.func_native("""
    // Nearly in order already.
    int* list = entry.data;
    for (int k = begin + 1; k < end; ++k)
    {
        const int number = list[k];
        int at = k;
        for (; at > begin && list[at - 1] > number; --at) list[at] = list[at - 1];
        list[at] = number;
    }
""")
def put_in_order(begin: int, end: int, entry: wp.array(dtype=wp.int32)): ...


@wp.func
def ends_run(k: int, entry: wp.array(dtype=wp.int32), label: wp.array(dtype=wp.int32), most_between: int):
    """Whether a run ends before an entry: what lies between two parts may be another one."""
    before = entry[k - 1]
    return entry[k] - before - 1 > most_between or (entry[k] > before + 1 and label[entry[k]] != label[before])


@wp.kernel
def count_runs(
    first: int,
    start: wp.array(dtype=wp.int32),
    label: wp.array(dtype=wp.int32),
    most_between: int,
    # outputs
    entry: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
):
    """Put the numbers of every list in order, and count the runs in it: so many of one part that lie between two do not end a run."""
    i = first + wp.tid()
    put_in_order(start[i], start[i + 1], entry)
    found = int(0)
    for k in range(start[i], start[i + 1]):
        if k == start[i]:
            found = 1
        elif ends_run(k, entry, label, most_between):
            found += 1
    count[i] = found


@wp.kernel
def list_runs(
    first: int,
    start: wp.array(dtype=wp.int32),
    label: wp.array(dtype=wp.int32),
    most_between: int,
    entry: wp.array(dtype=wp.int32),
    run_start: wp.array(dtype=wp.int32),
    # outputs
    run: wp.array(dtype=wp.vec2i),
):
    """Write what :func:`count_runs` counts: the first number of every run, and the one behind its last."""
    i = first + wp.tid()
    at = run_start[i]
    for k in range(start[i], start[i + 1]):
        if k == start[i]:
            run[at] = wp.vec2i(entry[k], entry[k] + 1)
        elif ends_run(k, entry, label, most_between):
            at += 1
            run[at] = wp.vec2i(entry[k], entry[k] + 1)
        else:
            run[at] = wp.vec2i(run[at][0], entry[k] + 1)


@wp.kernel
def choose_points(
    first: int,
    index: wp.array(dtype=wp.int32),
    points: Points,
    # outputs
    chosen: Points,
):
    i = first + wp.tid()
    chosen.position[i] = points.position[index[i]]
    chosen.normal[i] = points.normal[index[i]]
    chosen.label[i] = points.label[index[i]]


@wp.kernel
def take_numbers(
    first: int,
    index: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
    # outputs
    taken: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    taken[i] = values[index[i]]


@wp.kernel
def take_amounts(
    first: int,
    index: wp.array(dtype=wp.int32),
    values: wp.array(dtype=float),
    # outputs
    taken: wp.array(dtype=float),
):
    i = first + wp.tid()
    taken[i] = values[index[i]]


@wp.kernel
def list_flagged(
    first: int,
    flag: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    # outputs
    place: wp.array(dtype=wp.int32),
):
    """Places of ones among zeros and ones; ``start`` is their running sum."""
    i = first + wp.tid()
    if flag[i] != 0:
        place[start[i]] = i


@wp.kernel
def repeat_numbers(
    first: int,
    values: wp.array(dtype=wp.int32),
    times: int,
    # outputs
    repeated: wp.array(dtype=wp.int32),
):
    """Each number so many times, one after the other."""
    i = first + wp.tid()
    repeated[i] = values[i / times]


@wp.kernel
def spread_vectors(
    first: int,
    of: wp.array(dtype=wp.int32),
    count: int,
    columns: int,
    values: wp.array(dtype=wp.vec3),
    # outputs
    result: wp.array(dtype=wp.vec3),
):
    """Give each of some points the vectors of the one of ``count`` that it is like, column after column."""
    i = first + wp.tid()
    for c in range(columns):
        result[c * of.shape[0] + i] = values[c * count + of[i]]
