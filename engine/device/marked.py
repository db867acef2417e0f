"""Lists of those of many elements that a kernel has marked, or of all."""

from __future__ import annotations

import warp as wp

from . import kernels_marked
from .launcher import Launcher
from .running_sum import running_sum

__all__ = ["numbers_of_marked", "numbers_up_to"]


def numbers_of_marked(launcher: Launcher, marked: wp.array, begin: int = 0) -> wp.array:
    """Return the numbers of marked elements, from the smallest on, ``wp.int32``.

    Args:
        launcher: Where to run.
        marked: 1 for those, 0 for others, ``wp.int32``, shape ``[n]``.
        begin: Number of the first element.
    """
    place, count = running_sum(launcher, marked)
    number = launcher.empty(count, wp.int32)
    if count:
        launcher.launch(kernels_marked.list_marked, len(marked), [marked, place, begin], [number])
    return number


def numbers_up_to(launcher: Launcher, count: int) -> wp.array:
    """Return the numbers from 0 to ``count - 1``, ``wp.int32``; nobody waits for a million to be counted out here."""
    number = launcher.empty(count, wp.int32)
    launcher.launch(kernels_marked.list_all, count, [], [number])
    return number
