"""Sorting what lies in cells, so that neighbors lie next to each other in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp

from ..device.launcher import Launcher
from . import kernels_cells

__all__ = ["CellSort", "position_of"]

# Fewer items are sorted by one thread at once: for them the passes of several would cost more than they save.
FEW_ITEMS = 4096
# Buckets for every thread: enough that a full one keeps no thread waiting.
BUCKETS_PER_THREAD = 8


def position_of(pose: wp.array) -> wp.array:
    """The first two numbers of ``wp.vec4`` poses as ``wp.vec2``, in the same memory."""
    view = wp.array(ptr=pose.ptr, dtype=wp.vec2, shape=pose.shape, strides=pose.strides, device=pose.device)
    # The memory must not go before the view does.
    view.pose = pose
    return view


class CellSort:
    """Puts items into the order of their cells; those of one cell keep their order, however many threads sort.

    A GPU sorts by radix, or where items are spread by counting, which takes a third of the time. CPU threads put items into
    *buckets* of many cells, each thread those of a part, and then sort bucket after bucket by counting.

    Args:
        launcher: Where to run.
        count: Number of items.
        cell_count: Number of cells.
        spread: Whether few items lie in a cell, or whoever sorts them goes through all pairs of a cell in any case.

    Attributes:
        order: Items, cell after cell, ``wp.int32``, shape ``[count]`` or longer.
        cell_start: Place of the first item of every cell in ``order``, and at the end their number, shape ``[cell_count + 1]``.
        counting: What a GPU counts spread items with; None elsewhere.
    """

    def __init__(self, launcher: Launcher, count: int, cell_count: int, *, spread: bool = False) -> None:
        self._launcher = launcher
        self._count = count
        self._cell_count = cell_count
        device = launcher.device
        self.counting: kernels_cells.Counting | None = None
        # The radix sort wants room for a copy.
        room = 2 * count if device.is_cuda and not spread else count
        self._key = launcher.empty(room, wp.int32)
        self.order = launcher.empty(room, wp.int32)
        if device.is_cuda and spread:
            self.counting = self._room_for_counting()
            return
        self.cell_start = launcher.empty(cell_count + 1, wp.int32)
        if device.is_cuda:
            return
        self._parts = 1 if count <= FEW_ITEMS else launcher.thread_count
        # Cells of a bucket, as a power of two.
        self._shift = 0
        most = 1 if self._parts == 1 else BUCKETS_PER_THREAD * self._parts
        while (cell_count - 1) >> self._shift >= most:
            self._shift += 1
        self._buckets = ((cell_count - 1) >> self._shift) + 1
        self._counted = launcher.empty((self._parts, self._buckets), wp.int32)
        self._bucket_start = wp.array([0, count], dtype=wp.int32, device=launcher.device)
        self._bucket_key, self._bucket_item = self._key, self.order
        if self._parts > 1:
            self._bucket_start = launcher.empty(self._buckets + 1, wp.int32)
            self._bucket_key, self._bucket_item = (launcher.empty(count, wp.int32) for _ in range(2))

    def sort(self, find_keys: wp.Kernel, inputs: Sequence[Any]) -> None:
        """Sort anew.

        Args:
            find_keys: Kernel that writes the cell of every item, and the item itself.
            inputs: Its arguments before these two.
        """
        n = self._count
        launch = self._launcher.launch
        launch(find_keys, n, inputs, [self._key, self.order])
        if self.counting is not None:
            elements = self.count(self.counting, kernels_cells.count_items, [])
            launch(kernels_cells.order_items, elements, [n, self.cell_start], [self.counting, self.order])
            return
        if self._launcher.device.is_cuda:
            # No more bits than cells have: a pass takes eight of them.
            wp.utils.radix_sort_pairs(self._key, self.order, n, end_bit=self._cell_count.bit_length())
            launch(kernels_cells.find_cell_starts, n, [self._key, n, self._cell_count], [self.cell_start])
            return
        if self._parts > 1:
            part = [n, self._parts, self._shift]
            launch(kernels_cells.count_in_buckets, self._parts, [self._key, *part], [self._counted], grain=1)
            launch(kernels_cells.find_bucket_starts, 1, [self._counted], [self._bucket_start])
            launch(
                kernels_cells.fill_buckets,
                self._parts,
                [self._key, *part, self._counted],
                [self._bucket_key, self._bucket_item],
                grain=1,
            )
        launch(
            kernels_cells.sort_buckets,
            self._buckets,
            [
                self._bucket_start,
                self._bucket_key,
                self._bucket_item,
                self._shift,
                self._cell_count,
                int(self._parts == 1),
            ],
            [self.cell_start, self.order],
            grain=1,
        )

    def _room_for_counting(self) -> kernels_cells.Counting:
        launcher, counting = self._launcher, kernels_cells.Counting()
        # Where the last cell ends is the start of one more.
        blocks = self._cell_count // kernels_cells.CELLS_OF_BLOCK + 1
        cells = blocks * kernels_cells.CELLS_OF_BLOCK
        self.cell_start = launcher.empty(cells, wp.int32)[: self._cell_count + 1]
        counting.key, counting.before = self._key, launcher.empty(self._count, wp.int32)
        counting.last, counting.in_cell = launcher.empty(self._cell_count, wp.int32), launcher.zeros(cells, wp.int32)
        counting.before_block, counting.taken = launcher.zeros(blocks, wp.int64), launcher.zeros(1, wp.int32)
        return counting

    def count(self, counting: kernels_cells.Counting, count_items: wp.Kernel, inputs: Sequence[Any]) -> int:
        """Count all items, and find where cells start, for a kernel that then asks for :func:`.kernels_cells.place_in_order`.

        Args:
            counting: That of this sort.
            count_items: Kernel that counts every item.
            inputs: Its arguments before ``counting``.

        Returns:
            How many elements such a kernel has: items, and blocks of cells that it is to forget.
        """
        blocks = len(counting.before_block)
        threads = blocks * kernels_cells.THREADS_OF_BLOCK
        self._launcher.launch(count_items, self._count, inputs, [counting])
        self._launcher.launch(kernels_cells.place_cells, threads, [], [counting, self.cell_start])
        return max(self._count, blocks)
