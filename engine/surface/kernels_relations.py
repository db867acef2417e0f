"""What kernels know of parts of a surface that stand on one another: bodies on the one see those on the other.

It lies in an array of numbers, behind others, as kernels cannot take many more arguments: for every label where those begin that it
has to do with, and where the last of them ends; and then these, in rising order.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def is_among(number: int, first: int, end: int, numbers: wp.array(dtype=wp.int32)):
    """Whether a number is among those from ``first`` up to ``end``, which rise."""
    low = int(first)
    high = int(end)
    while low < high:
        middle = (low + high) / 2
        if numbers[middle] < number:
            low = middle + 1
        else:
            high = middle
    if low == end:
        return False
    return numbers[low] == number


@wp.func
def see_each_other(one: int, other: int, numbers: wp.array(dtype=wp.int32), relations: int):
    """Whether bodies on parts of these labels see each other: on one part, or where one stands on the other.

    ``relations`` is where in ``numbers`` it lies who has to do with whom; 0 where nobody has.
    """
    if one == other:
        return True
    if relations == 0:
        return False
    # A ground may carry thousands; each of them stands on few.
    first = numbers[relations + one]
    end = numbers[relations + one + 1]
    other_first = numbers[relations + other]
    other_end = numbers[relations + other + 1]
    if end - first <= other_end - other_first:
        return is_among(other, first, end, numbers)
    return is_among(one, other_first, other_end, numbers)
