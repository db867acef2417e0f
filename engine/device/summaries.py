"""A few numbers of many: least, median, largest and sum of tables on a device."""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_summaries
from .launcher import Launcher

__all__ = [
    "extremes",
    "largest_by_kind",
    "largest_of_rows",
    "least_and_number",
    "median_of_least",
    "sum_of_squares",
    "sum_of_whole",
]

# So many numbers are fetched and looked at here, which is done sooner than to have a device look.
FEW = 1 << 15
# Numbers that one element goes through: enough for a thread of the CPU; a GPU has many more elements at once.
BLOCK_ON_CPU, BLOCK_ON_GPU = 4096, 128
# The same of rows that the host does not see, on either.
BLOCK_OF_ROW = 256


def least_and_number(launcher: Launcher, values: wp.array, limit: float) -> tuple[float, int]:
    """Return the least of some floats, and how many of them are below a limit."""
    if len(values) <= FEW:
        here = values.numpy()
        return float(here.min()), int(np.count_nonzero(here < limit))
    return _least_and_number(launcher, values, -np.inf, limit)


def extremes(launcher: Launcher, values: wp.array) -> tuple[float, float]:
    """Return the least and the largest of some floats, at least one and none of them NaN."""
    blocks, block = _blocks(launcher, len(values))
    found = launcher.empty(blocks, wp.vec2)
    launcher.launch(kernels_summaries.find_extremes, blocks, [values, block], [found], grain=1)
    of_blocks = found.numpy()
    return float(of_blocks[:, 0].min()), float(of_blocks[:, 1].max())


def median_of_least(launcher: Launcher, values: wp.array, number: int) -> float:
    """Return the median of the ``number`` least of some floats, none of which is negative."""
    if len(values) <= FEW:
        return float(np.median(np.partition(values.numpy(), number - 1)[:number]))
    # The bits of such floats have the same order as they.
    bits = wp.array(ptr=values.ptr, shape=values.shape, dtype=wp.int32, device=values.device)
    low = (number - 1) // 2
    value = _ordered(launcher, bits, low)
    if number % 2:
        return float(value)
    above, not_above = _least_and_number(launcher, values, float(value), float(np.nextafter(value, np.float32(np.inf))))
    # As NumPy's median: in float32.
    return float(np.mean(np.array([value, value if not_above > low + 1 else above], np.float32)))


def largest_by_kind(launcher: Launcher, values: wp.array, kind: wp.array, kinds: int) -> np.ndarray:
    """Return the largest of the doubles of every kind, shape ``[kinds]``; 0 where there are none, or none above."""
    blocks, block = _blocks(launcher, len(values))
    most = launcher.empty((blocks, kinds), wp.float64)
    launcher.launch(kernels_summaries.find_most, blocks, [values, kind, block], [most], grain=1)
    return most.numpy().max(axis=0)


def largest_of_rows(launcher: Launcher, values: wp.array, rows: int) -> wp.array:
    """Return the largest of the floats of every row, shape ``[rows]``, on the device; 0 where none is above."""
    count = len(values) // rows
    parts = -(-count // BLOCK_OF_ROW)
    of_parts, of_rows = launcher.empty(rows * parts, float), launcher.empty(rows, float)
    for given, many, block, found in ((values, count, BLOCK_OF_ROW, of_parts), (of_parts, parts, parts, of_rows)):
        each = len(found) // rows
        launcher.launch(
            kernels_summaries.find_largest_of_rows, len(found), [given, many, block, each], [found], grain=1
        )
    return of_rows


def sum_of_whole(launcher: Launcher, values: wp.array) -> int:
    """Return the sum of some integers."""
    blocks, block = _blocks(launcher, len(values))
    total = launcher.empty(blocks, wp.int64)
    launcher.launch(kernels_summaries.add_whole, blocks, [values, block], [total], grain=1)
    return int(total.numpy().sum())


def sum_of_squares(launcher: Launcher, values: wp.array) -> float:
    """Return the sum of the squares of some floats, in double precision."""
    blocks, block = _blocks(launcher, len(values))
    total = launcher.empty(blocks, wp.float64)
    launcher.launch(kernels_summaries.add_squares, blocks, [values, block], [total], grain=1)
    return float(total.numpy().sum())


def _blocks(launcher: Launcher, count: int) -> tuple[int, int]:
    """How many blocks there are, and how long they are."""
    block = BLOCK_ON_GPU if launcher.device.is_cuda else BLOCK_ON_CPU
    return -(-count // block), block


def _least_and_number(launcher: Launcher, values: wp.array, above: float, limit: float) -> tuple[float, int]:
    """The least of some floats that are above a value, and how many of all are below a limit."""
    blocks, block = _blocks(launcher, len(values))
    least, number = launcher.empty(blocks, float), launcher.empty(blocks, wp.int32)
    launcher.launch(kernels_summaries.find_least, blocks, [values, above, limit, block], [least, number], grain=1)
    return float(least.numpy().min()), int(number.numpy().sum())


def _ordered(launcher: Launcher, bits: wp.array, place: int) -> np.float32:
    """The float whose bits are at a place, from 0, of the order of some: digit after digit, from the highest."""
    blocks, block = _blocks(launcher, len(bits))
    counted = launcher.empty((blocks, kernels_summaries.DIGITS), wp.int32)
    begins = 0
    for shift in range(28, -1, -4):
        launcher.launch(kernels_summaries.count_digits, blocks, [bits, begins, shift, block], [counted], grain=1)
        before = np.cumsum(counted.numpy().sum(axis=0, dtype=np.int64))
        digit = int(np.searchsorted(before, place, side="right"))
        place -= int(before[digit - 1]) if digit else 0
        begins = begins << 4 | digit
    return np.array([begins], np.int32).view(np.float32)[0]
