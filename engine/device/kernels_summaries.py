"""Kernels that find the least and the largest of many numbers, and their sums, block by block.

A block is a stretch of the table, which one element goes through in its order. So results depend on no number of threads, and the host
gets a number for every block instead of every body.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Digits that an order is looked for by: four bits at once.
DIGITS = wp.constant(16)


@wp.kernel
def find_least(
    first: int,
    values: wp.array(dtype=float),
    above: float,
    limit: float,
    block: int,
    # outputs
    least: wp.array(dtype=float),
    below: wp.array(dtype=wp.int32),
):
    """Least value of every block that is ``above`` another, and how many of all are below a limit."""
    b = first + wp.tid()
    found = float(wp.inf)
    number = int(0)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        value = values[i]
        if value > above:
            found = wp.min(found, value)
        if value < limit:
            number += 1
    least[b] = found
    below[b] = number


@wp.kernel
def count_digits(
    first: int,
    bits: wp.array(dtype=wp.int32),
    begins: int,
    shift: int,
    block: int,
    # outputs
    counted: wp.array2d(dtype=wp.int32),
):
    """How often each digit, the four bits from ``shift`` on, is among the numbers of a block whose higher bits are ``begins``."""
    b = first + wp.tid()
    own = counted[b]
    for digit in range(DIGITS):
        own[digit] = 0
    for i in range(b * block, wp.min((b + 1) * block, bits.shape[0])):
        high = bits[i] >> shift
        if (high >> 4) == begins:
            digit = high & 15
            own[digit] = own[digit] + 1


@wp.kernel
def find_extremes(
    first: int,
    values: wp.array(dtype=float),
    block: int,
    # outputs
    extremes: wp.array(dtype=wp.vec2),
):
    """Least and largest of every block."""
    b = first + wp.tid()
    least = float(wp.inf)
    most = float(-wp.inf)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        least = wp.min(least, values[i])
        most = wp.max(most, values[i])
    extremes[b] = wp.vec2(least, most)


@wp.kernel
def find_most(
    first: int,
    values: wp.array(dtype=wp.float64),
    kind: wp.array(dtype=wp.int32),
    block: int,
    # outputs
    most: wp.array2d(dtype=wp.float64),
):
    """Largest number of every kind in every block, 0 where there is none."""
    b = first + wp.tid()
    own = most[b]
    for k in range(own.shape[0]):
        own[k] = wp.float64(0.0)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        own[kind[i]] = wp.max(own[kind[i]], values[i])


@wp.kernel
def find_largest_of_rows(
    first: int,
    values: wp.array(dtype=float),
    count: int,
    at_once: int,
    parts: int,
    # outputs
    largest: wp.array(dtype=float),
):
    """The largest of ``at_once`` values, or 0; rows of ``count`` values, and of ``parts`` results, lie one after the other."""
    i = first + wp.tid()
    row = i / parts
    begin = i % parts * at_once
    most = float(0.0)
    for k in range(begin, wp.min(begin + at_once, count)):
        most = wp.max(most, values[row * count + k])
    largest[i] = most


@wp.kernel
def add_whole(
    first: int,
    values: wp.array(dtype=wp.int32),
    block: int,
    # outputs
    total: wp.array(dtype=wp.int64),
):
    """Sum of the whole numbers of every block."""
    b = first + wp.tid()
    found = wp.int64(0)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        found += wp.int64(values[i])
    total[b] = found


@wp.kernel
def add_squares(
    first: int,
    values: wp.array(dtype=float),
    block: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sum of the squares of the numbers of every block."""
    b = first + wp.tid()
    found = wp.float64(0.0)
    for i in range(b * block, wp.min((b + 1) * block, values.shape[0])):
        found += wp.float64(values[i]) * wp.float64(values[i])
    total[b] = found
