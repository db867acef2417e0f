"""Running sums on a device: where lists that lie one after the other start."""

from __future__ import annotations

import warp as wp

from .launcher import Launcher

__all__ = ["running_sum"]


def running_sum(launcher: Launcher, count: wp.array) -> tuple[wp.array, int]:
    """Return where lists of so many entries start, ``wp.int32``, shape ``[n + 1]``, and how many entries there are."""
    start = launcher.zeros(len(count) + 1, wp.int32)
    if not len(count):
        return start, 0
    wp.utils.array_scan(count, start[1:], inclusive=True)
    return start, int(start[len(count) :].numpy()[0])
