"""What kernels of the steps after an edit share: how far bodies have moved, in bins."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Ways beyond the reach of bodies that are held are told apart by this share of it, in so many bins; the first one is within it, and
# the last one has all that are longer.
BINS_OF_REACH = wp.constant(16)
BINS = wp.constant(64)


@wp.func
def bin_of_way(way: float, reach: float):
    """Which bin a way is in."""
    share = way / reach
    # One that is no number counts as long.
    bin = int(BINS - 1)
    if share < 1.0:
        bin = 0
    elif share < float(BINS):
        bin = wp.min(1 + int((share - 1.0) * float(BINS_OF_REACH)), BINS - 1)
    return bin
