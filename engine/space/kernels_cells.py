"""Kernels that sort charges and bodies into cells, so that neighbors lie next to each other in memory (see :mod:`.cell_sort`)."""

from __future__ import annotations

import warp as wp

from .kernels_space import Space

wp.set_module_options({"enable_backward": False})


@wp.struct
class CellGrid:
    """Cells over a space, from an ``origin`` in it on: ``count`` along x and y, and their inverse size."""

    count_x: wp.int32
    count_y: wp.int32
    inverse_size: wp.vec2
    origin: wp.vec2
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
def column_and_row(position: wp.vec2, grid: CellGrid):
    """Column and row of the cell that holds ``position``, or of the nearest one."""
    x = wp.clamp(int((position[0] - grid.origin[0]) * grid.inverse_size[0]), 0, grid.count_x - 1)
    y = wp.clamp(int((position[1] - grid.origin[1]) * grid.inverse_size[1]), 0, grid.count_y - 1)
    return x, y


@wp.func
def cell_of(position: wp.vec2, grid: CellGrid):
    """Index of the cell that holds ``position``; row by row, from below."""
    x, y = column_and_row(position, grid)
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


# Cells that a thread of a GPU counts, as many as it reads at once, and threads of a block.
CELLS_OF_THREAD, THREADS_OF_BLOCK = 4, 256
CELLS_OF_BLOCK = wp.constant(CELLS_OF_THREAD * THREADS_OF_BLOCK)


@wp.struct
class Counting:
    """What a sort by counting needs beside what it makes.

    ``key`` is the cell of every item, ``in_cell`` the number of items in every cell. ``last`` is the item of a cell that was counted
    last, and ``before`` the one before it: a list of as many as the cell has. ``before_block`` is what is known of the numbers in
    blocks of cells, and ``taken`` how many of the blocks have begun. ``in_cell``, which has whole blocks, ``before_block`` and
    ``taken`` are 0 before items are counted, and after all have found their places.
    """

    key: wp.array(dtype=wp.int32)
    last: wp.array(dtype=wp.int32)
    before: wp.array(dtype=wp.int32)
    in_cell: wp.array(dtype=wp.int32)
    before_block: wp.array(dtype=wp.int64)
    taken: wp.array(dtype=wp.int32)


@wp.func
def count_in_cell(item: int, cell: int, counting: Counting):
    """Count an item."""
    counting.key[item] = cell
    counting.before[item] = wp.atomic_exch(counting.last, cell, item)
    wp.atomic_add(counting.in_cell, cell, 1)


@wp.func
def place_in_order(item: int, counting: Counting, cell_start: wp.array(dtype=wp.int32)) -> int:
    """The place of an item that was counted: in its cell behind those whose numbers are smaller."""
    cell = counting.key[item]
    start = cell_start[cell]
    place = start
    other = counting.last[cell]
    for _ in range(cell_start[cell + 1] - start):
        if other < item:
            place += 1
        other = counting.before[other]
    return place


@wp.func
def forget_blocks(i: int, counting: Counting):
    """Forget what is known of a block of cells, once all cells have been placed."""
    if i < counting.before_block.shape[0]:
        counting.before_block[i] = wp.int64(0)
    if i == 0:
        counting.taken[0] = 0


@wp.kernel
def count_charges(
    first: int,
    position: wp.array(dtype=wp.vec2),
    grid: CellGrid,
    # outputs
    counting: Counting,
):
    """Count a charge in its cell."""
    i = first + wp.tid()
    count_in_cell(i, cell_of(position[i], grid), counting)


@wp.kernel
def count_items(
    first: int,
    # outputs
    counting: Counting,
):
    """Count an item in the cell that its key says."""
    i = first + wp.tid()
    count_in_cell(i, counting.key[i], counting)


# A scan in a single pass, with a look back (Merrill and Garland, 2016). A block says how many items it has as soon as it knows, and
# how many there are up to its end once it knows that of a block before it; the upper half of an integer says which of these it is.
_PLACE = f"""
#if defined(__CUDA_ARCH__)
    constexpr int THREADS = {THREADS_OF_BLOCK}, WARPS = THREADS / 32;
    constexpr unsigned int ALL = 0xffffffffu;
    __shared__ int block_of_all, of_warps[WARPS], before_all;
    const int thread = threadIdx.x, lane = thread % 32, warp = thread / 32;
    // Blocks are numbered as they begin, so that those before one have begun.
    if (thread == 0) block_of_all = atomicAdd(counting.taken.data, 1);
    __syncthreads();
    const int block = block_of_all, own_cells = block * THREADS + thread;
    int4& numbers = ((int4*)counting.in_cell.data)[own_cells];
    const int4 own = numbers;
    numbers = make_int4(0, 0, 0, 0);
    const int total = own.x + own.y + own.z + own.w;
    int up_to = total;
    #pragma unroll
    for (int apart = 1; apart < 32; apart *= 2)
    {{
        const int other = __shfl_up_sync(ALL, up_to, apart);
        if (lane >= apart) up_to += other;
    }}
    if (lane == 31) of_warps[warp] = up_to;
    __syncthreads();
    int start = up_to - total, in_block = 0;
    for (int w = 0; w < WARPS; ++w)
    {{
        if (w < warp) start += of_warps[w];
        in_block += of_warps[w];
    }}
    volatile long long* known = (volatile long long*)counting.before_block.data;
    constexpr long long OWN_ONLY = 1ll << 32, UP_TO_END = 2ll << 32;
    if (warp == 0)
    {{
        if (lane == 0) known[block] = (block == 0 ? UP_TO_END : OWN_ONLY) + in_block;
        int before = 0;
        for (int next = block - 1; next >= 0; next -= 32)
        {{
            long long there = UP_TO_END;
            if (next - lane >= 0)
                do there = known[next - lane];
                while (there == 0);
            const unsigned int ends = __ballot_sync(ALL, there >= UP_TO_END);
            // From the nearest block on that knows all before it there is nothing to add.
            const int nearest = ends != 0 ? __ffs(ends) - 1 : 31;
            int amount = lane <= nearest ? (int)(there & 0xffffffffll) : 0;
            #pragma unroll
            for (int apart = 16; apart > 0; apart /= 2) amount += __shfl_xor_sync(ALL, amount, apart);
            before += amount;
            if (ends != 0) break;
        }}
        if (lane == 0)
        {{
            if (block > 0) known[block] = UP_TO_END + before + in_block;
            before_all = before;
        }}
    }}
    __syncthreads();
    start += before_all;
    ((int4*)cell_start.data)[own_cells] = make_int4(start, start + own.x, start + own.x + own.y, start + total - own.w);
#else
    // One thread does all.
    if (element > 0) return;
    int start = 0;
    for (int c = 0; c < counting.in_cell.shape[0]; ++c)
    {{
        cell_start.data[c] = start;
        start += counting.in_cell.data[c];
        counting.in_cell.data[c] = 0;
    }}
#endif
"""


@wp.func_native(_PLACE)
def place(element: int, counting: Counting, cell_start: wp.array(dtype=wp.int32)): ...


@wp.kernel
def place_cells(
    first: int,
    # outputs
    counting: Counting,
    cell_start: wp.array(dtype=wp.int32),
):
    """Find where cells start, and the last one ends, and empty them; whole blocks of threads, that have ``CELLS_OF_BLOCK`` cells each.

    The blocks go one cell farther than the last one, and ``cell_start`` has room for whole ones.
    """
    place(first + wp.tid(), counting, cell_start)


@wp.kernel
def order_items(
    first: int,
    count: int,
    cell_start: wp.array(dtype=wp.int32),
    # outputs
    counting: Counting,
    order: wp.array(dtype=wp.int32),
):
    """Put an item to its place, and forget about a block of cells; there may be more of either."""
    i = first + wp.tid()
    forget_blocks(i, counting)
    if i < count:
        order[place_in_order(i, counting, cell_start)] = i
