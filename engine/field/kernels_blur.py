"""Kernels that find how wide charges and targets are blurred, place by place; see :mod:`.blur`."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Where less of a node's surroundings than this lies in the domain, no charge ever is.
LEAST_INSIDE = wp.constant(1.0e-3)


@wp.kernel
def find_variances(
    first: int,
    number: wp.array(dtype=float),
    inside: wp.array(dtype=float),
    inside_most: float,
    dense: float,
    usual: float,
    exponent: float,
    lowest: float,
    highest: float,
    # outputs
    variance: wp.array(dtype=float),
):
    """``usual`` where the smoothed number density is ``dense``; elsewhere a power of it, between bounds.

    ``number`` and ``inside`` are charges and area of the domain per node, smoothed alike: their ratio is the density
    inside. ``inside`` is ``inside_most`` at an inner node.
    """
    i = first + wp.tid()
    result = highest
    if inside[i] > LEAST_INSIDE * inside_most and number[i] > 0.0:
        result = wp.clamp(usual * wp.pow(number[i] / (inside[i] * dense), -exponent), lowest, highest)
    variance[i] = result


@wp.func
def level_of(variance: float, levels: wp.array(dtype=float)):
    """Level below ``variance``, and how far it is from there to the next, 0..1; there are two levels at least."""
    level = int(0)
    for above in range(1, levels.shape[0] - 1):
        if variance >= levels[above]:
            level = above
    low = levels[level]
    return level, wp.clamp((variance - low) / (levels[level + 1] - low), 0.0, 1.0)


@wp.kernel
def take_level(
    first: int,
    images: wp.array(dtype=float),
    node_count: int,
    variance: wp.array(dtype=float),
    of_target: float,
    levels: wp.array(dtype=float),
    level: int,
    # outputs
    result: wp.array(dtype=float),
):
    """What of the images is blurred by the variance of ``level``: shares between two levels add up to the whole."""
    i = first + wp.tid()
    below, place = level_of(of_target * variance[i - i / node_count * node_count], levels)
    share = float(0.0)
    if level == below:
        share = 1.0 - place
    elif level == below + 1:
        share = place
    result[i] = share * images[i]
