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

    A GPU sorts by radix. CPU threads put items into *buckets* of many cells, each thread those of a part, and then sort bucket after
    bucket by counting.

    Args:
        launcher: Where to run.
        count: Number of items.
        cell_count: Number of cells.

    Attributes:
        order: Items, cell after cell, ``wp.int32``, shape ``[count]`` or longer.
        cell_start: Place of the first item of every cell in ``order``, and at the end their number, shape ``[cell_count + 1]``.
    """

    def __init__(self, launcher: Launcher, count: int, cell_count: int) -> None:
        self._launcher = launcher
        self._count = count
        self._cell_count = cell_count
        device = launcher.device
        # The radix sort wants room for a copy.
        room = 2 * count if device.is_cuda else count
        self._key = launcher.empty(room, wp.int32)
        self.order = launcher.empty(room, wp.int32)
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
