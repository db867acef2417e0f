"""Kernels that sort charges and bodies into cells, so that neighbors lie next to each other in memory (see :mod:`.cell_sort`)."""

from __future__ import annotations

import warp as wp

from .kernels_space import Space

wp.set_module_options({"enable_backward": False})


@wp.struct
class CellGrid:
    """Cells over a space: ``count`` along x and y, and their inverse size."""

    count_x: wp.int32
    count_y: wp.int32
    inverse_size: wp.vec2
    space: Space


@wp.struct
class SortedCharges:
    """Charges in the order of their cells: number, position, charge and group of each, and where every cell begins.

    ``weight`` has, group after group and ``weight_stride`` apart, what of every charge the group sees; or, ``by_group``, what it sees
    of every group. All but ``order`` and ``cell_start`` have room for a few more charges, which what reads several at once reads, too.
    """

    order: wp.array(dtype=wp.int32)
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)
    charge: wp.array(dtype=float)
    group: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=float)
    weight_stride: wp.int32
    by_group: wp.int32
    cell_start: wp.array(dtype=wp.int32)


@wp.func
def cell_of(position: wp.vec2, grid: CellGrid):
    """Index of the cell that holds ``position``; row by row, from below."""
    x = wp.clamp(int(position[0] * grid.inverse_size[0]), 0, grid.count_x - 1)
    y = wp.clamp(int(position[1] * grid.inverse_size[1]), 0, grid.count_y - 1)
    return y * grid.count_x + x


@wp.kernel
def compute_cell_keys(
    first: int,
    position: wp.array(dtype=wp.vec2),
    grid: CellGrid,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """The cell of every item, and the item itself."""
    i = first + wp.tid()
    key[i] = cell_of(position[i], grid)
    order[i] = i


@wp.kernel
def find_cell_starts(
    first: int,
    key: wp.array(dtype=wp.int32),
    charge_count: int,
    cell_count: int,
    # outputs
    cell_start: wp.array(dtype=wp.int32),
):
    """Fill ``cell_start[c]`` with the first sorted charge of cell c; ``cell_start[cell_count]`` is the charge count."""
    i = first + wp.tid()
    cell = key[i]
    previous = int(-1)
    if i > 0:
        previous = key[i - 1]
    for c in range(previous + 1, cell + 1):
        cell_start[c] = i
    if i == charge_count - 1:
        for c in range(cell + 1, cell_count + 1):
            cell_start[c] = charge_count


@wp.func
def first_of_part(part: int, count: int, parts: int):
    return int(wp.int64(count) * wp.int64(part) / wp.int64(parts))


@wp.kernel
def count_in_buckets(
    first: int,
    key: wp.array(dtype=wp.int32),
    count: int,
    parts: int,
    shift: int,
    # outputs
    counted: wp.array2d(dtype=wp.int32),
):
    """Count how many items of a part lie in every bucket; an element is a part."""
    part = first + wp.tid()
    own = counted[part]
    for b in range(counted.shape[1]):
        own[b] = 0
    for i in range(first_of_part(part, count, parts), first_of_part(part + 1, count, parts)):
        b = key[i] >> shift
        own[b] = own[b] + 1


@wp.kernel
def find_bucket_starts(
    first: int,
    counted: wp.array2d(dtype=wp.int32),
    # outputs
    bucket_start: wp.array(dtype=wp.int32),
):
    """Turn the counts into places: bucket after bucket, and in each of them part after part."""
    total = int(0)
    for b in range(counted.shape[1]):
        bucket_start[b] = total
        for part in range(counted.shape[0]):
            here = counted[part, b]
            counted[part, b] = total
            total += here
    bucket_start[counted.shape[1]] = total


@wp.kernel
def fill_buckets(
    first: int,
    key: wp.array(dtype=wp.int32),
    count: int,
    parts: int,
    shift: int,
    next_free: wp.array2d(dtype=wp.int32),
    # outputs
    bucket_key: wp.array(dtype=wp.int32),
    bucket_item: wp.array(dtype=wp.int32),
):
    """Put the items of a part into their buckets, in their order; an element is a part."""
    part = first + wp.tid()
    own = next_free[part]
    for i in range(first_of_part(part, count, parts), first_of_part(part + 1, count, parts)):
        k = key[i]
        b = k >> shift
        at = own[b]
        own[b] = at + 1
        bucket_key[at] = k
        bucket_item[at] = i


@wp.kernel
def sort_buckets(
    first: int,
    bucket_start: wp.array(dtype=wp.int32),
    bucket_key: wp.array(dtype=wp.int32),
    bucket_item: wp.array(dtype=wp.int32),
    shift: int,
    cell_count: int,
    single: int,
    # outputs
    cell_start: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort a bucket by cells; an element is a bucket. Where there is a ``single`` one, its items are numbered by their places."""
    bucket = first + wp.tid()
    begin = bucket_start[bucket]
    end = bucket_start[bucket + 1]
    low = bucket << shift
    high = wp.min((bucket + 1) << shift, cell_count)
    for c in range(low, high):
        cell_start[c] = 0
    for s in range(begin, end):
        k = bucket_key[s]
        cell_start[k] = cell_start[k] + 1
    total = begin
    for c in range(low, high):
        total += cell_start[c]
        cell_start[c] = total
    # From the last to the first: what is the end of a cell becomes its start.
    for back in range(end - begin):
        s = end - 1 - back
        k = bucket_key[s]
        at = cell_start[k] - 1
        cell_start[k] = at
        if single != 0:
            order[at] = s
        else:
            order[at] = bucket_item[s]
    if high == cell_count:
        cell_start[cell_count] = end


@wp.struct
class Counting:
    """What a sort by counting needs beside what it makes; all but ``key`` and ``unordered`` are zeros before it and after it.

    ``in_cell`` is the number of items in every cell, ``in_part`` that in every ``cells`` of them, ``in_group`` that in every ``parts``
    of these.
    """

    key: wp.array(dtype=wp.int32)
    unordered: wp.array(dtype=wp.int32)
    in_cell: wp.array(dtype=wp.int32)
    in_part: wp.array(dtype=wp.int32)
    in_group: wp.array(dtype=wp.int32)
    cells: wp.int32
    parts: wp.int32


@wp.kernel
def count_items(
    first: int,
    # outputs
    counting: Counting,
):
    """Count an item in its cell."""
    i = first + wp.tid()
    wp.atomic_add(counting.in_cell, counting.key[i], 1)


@wp.kernel
def add_up_cells(
    first: int,
    # outputs
    counting: Counting,
):
    """Count what is in a part, and add it to its group; an element is a part."""
    part = first + wp.tid()
    count = int(0)
    for c in range(part * counting.cells, wp.min((part + 1) * counting.cells, counting.in_cell.shape[0])):
        count += counting.in_cell[c]
    counting.in_part[part] = count
    if count > 0:
        wp.atomic_add(counting.in_group, part / counting.parts, count)


@wp.kernel
def place_cells(
    first: int,
    counting: Counting,
    # outputs
    cell_start: wp.array(dtype=wp.int32),
):
    """Find where the cells of a part start; an element is a part. The last one also says where the last cell ends."""
    part = first + wp.tid()
    group = part / counting.parts
    start = int(0)
    for g in range(group):
        start += counting.in_group[g]
    for p in range(group * counting.parts, part):
        start += counting.in_part[p]
    end = wp.min((part + 1) * counting.cells, counting.in_cell.shape[0])
    for c in range(part * counting.cells, end):
        cell_start[c] = start
        start += counting.in_cell[c]
    if end == counting.in_cell.shape[0]:
        cell_start[end] = start


@wp.kernel
def fill_cells(
    first: int,
    cell_start: wp.array(dtype=wp.int32),
    # outputs
    counting: Counting,
):
    """Put an item anywhere into its cell, and empty a group; there may be more of either."""
    i = first + wp.tid()
    if i < counting.in_group.shape[0]:
        counting.in_group[i] = 0
    if i < counting.unordered.shape[0]:
        cell = counting.key[i]
        counting.unordered[cell_start[cell] + wp.atomic_sub(counting.in_cell, cell, 1) - 1] = i


@wp.kernel
def order_cells(
    first: int,
    counting: Counting,
    cell_start: wp.array(dtype=wp.int32),
    # outputs
    order: wp.array(dtype=wp.int32),
):
    """Put an item to its place in its cell: behind those whose numbers are smaller."""
    item = counting.unordered[first + wp.tid()]
    cell = counting.key[item]
    place = cell_start[cell]
    for s in range(cell_start[cell], cell_start[cell + 1]):
        if counting.unordered[s] < item:
            place += 1
    order[place] = item
