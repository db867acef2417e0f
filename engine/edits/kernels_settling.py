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


@wp.kernel
def decide_free(
    first: int,
    threads: int,
    most_free: wp.float64,
    # outputs
    moved: wp.array2d(dtype=wp.int32),
    free_from: wp.array(dtype=wp.int32),
):
    """From which bin on bodies are free, where threads have counted ``moved`` in all but the first; counts become 0.

    Those in the first one never are, and those in the last one always. One element does all.
    """
    farther = int(0)
    begin = int(BINS - 1)
    for k in range(BINS - 1):
        bin = BINS - 1 - k
        for thread in range(threads):
            farther += moved[thread, bin]
            moved[thread, bin] = 0
        # How many moved at least as far as where the bin begins.
        if wp.float64(farther) <= most_free:
            begin = bin
    free_from[0] = begin
