"""Shapes seen from above: drawing them, and whether points lie inside outlines."""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_layers
from .launching import launch_on_cpu

__all__ = ["draw_shapes", "inside_outlines"]

# Bands of y that outlines are sorted by.
BANDS = 512
# What is exactly as far away as asked for is not left out by rounding, of this share.
ROUNDING = 1e-6


def draw_shapes(image: np.ndarray, triangle: np.ndarray, reach: float, size: np.ndarray) -> None:
    """Set the cells of an image whose middles are as near to triangles as ``reach``, or within them.

    Args:
        image: Shape ``[height, width]``, bool, row 0 at the smallest y, over a rectangle from the origin on.
        triangle: Corners [m], shape ``[t, 3, 2]``; may be segments and points.
        reach: Above 0 [m].
        size: Of the rectangle [m].
    """
    height, width = image.shape
    drawn = np.zeros(image.size, bool)
    inputs = [
        np.ascontiguousarray(triangle, np.float64).reshape(-1, 6),
        (1.0 + ROUNDING) * reach,
        wp.vec2d(size[0] / width, size[1] / height),
        height,
        width,
    ]
    launch_on_cpu(kernels_layers.draw_triangles, len(triangle), inputs, [drawn])
    image |= drawn.reshape(image.shape)


def inside_outlines(segment: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return which points lie inside closed outlines, seen from above.

    Args:
        segment: Both ends of all pieces of the outlines in the world's x and y [m], shape ``[s, 2, 2]``, float64. What lies inside
            two outlines lies outside: a ring has a hole.
        position: Points in the world [m], shape ``[n, 3]``, float64.

    Returns:
        Shape ``[n]``, bool.
    """
    inside = np.zeros(len(position), bool)
    if not len(segment):
        return inside
    ends = np.sort(segment[:, :, 1], axis=1)
    low, high = ends[:, 0].min(), ends[:, 1].max()
    if not high > low:
        return inside
    per_length = BANDS / (high - low)
    begin, end = (np.clip(np.floor((ends - low) * per_length), 0, BANDS - 1).astype(np.int64)).T
    # A segment is in all the bands from its lower to its upper end.
    count = end - begin + 1
    owner = np.repeat(np.arange(len(segment)), count)
    band = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(begin, count)
    order = np.argsort(band, kind="stable")
    start = np.searchsorted(band[order], np.arange(BANDS + 1)).astype(np.int32)
    inputs = [
        np.ascontiguousarray(segment, np.float64).reshape(-1, 4),
        start,
        owner[order].astype(np.int32),
        float(low),
        float(per_length),
        np.ascontiguousarray(position, np.float64),
    ]
    launch_on_cpu(kernels_layers.count_crossings, len(position), inputs, [inside])
    return inside
