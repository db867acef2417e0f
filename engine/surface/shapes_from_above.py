"""Shapes seen from above: how far points are from them, and whether points lie inside outlines."""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_layers
from .launching import launch_on_cpu

__all__ = ["FlatShapes", "draw_shapes", "inside_outlines"]

# Bands of y that outlines are sorted by.
BANDS = 512
# Height of a triangle over its longest edge below which it counts as a segment.
SMALLEST_HEIGHT = 1e-4
# What float32 rounds off where a point lies within a triangle, as a share of the extent.
ROUNDING = 1e-6


class FlatShapes:
    """Triangles, segments and points in the plane, to measure the distance to.

    Args:
        triangle: Corners in the world's x and y [m], shape ``[t, 3, 2]``, float64. Two corners may be the same, which is a segment;
            or all three, which is a point.
    """

    def __init__(self, triangle: np.ndarray) -> None:
        self._middle = 0.5 * (triangle.min(axis=(0, 1)) + triangle.max(axis=(0, 1)))
        self._extent = float(np.abs(triangle - self._middle).max())
        vertex = _standing(triangle - self._middle).astype(np.float32).reshape(-1, 3)
        self._mesh = wp.Mesh(
            wp.array(vertex, dtype=wp.vec3, device="cpu"),
            wp.array(np.arange(len(vertex), dtype=np.int32), dtype=wp.int32, device="cpu"),
        )

    def distance(self, position: np.ndarray, reach: float) -> np.ndarray:
        """Return how far points are from the nearest of the shapes [m], 0 where they lie within a triangle.

        Args:
            position: Points in the world [m], shape ``[n, 3]``, float64.
            reach: What is farther away is as far as this [m].

        Returns:
            Shape ``[n]``, float32.
        """
        distance = np.empty(len(position), np.float32)
        # Far enough for what lies beside to be told from what lies within.
        reach = max(reach, 2.0 * ROUNDING * self._extent)
        inputs = [self._mesh.id, wp.vec2d(self._middle), np.ascontiguousarray(position, np.float64), reach]
        launch_on_cpu(kernels_layers.measure_from_above, len(distance), inputs, [distance])
        distance[distance <= ROUNDING * self._extent] = 0.0
        return distance


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
        # What is exactly as far away is not left out by rounding.
        (1.0 + ROUNDING) * reach,
        wp.vec2d(size[0] / width, size[1] / height),
        height,
        width,
    ]
    launch_on_cpu(kernels_layers.draw_triangles, len(triangle), inputs, [drawn])
    image |= drawn.reshape(image.shape)


def _standing(triangle: np.ndarray) -> np.ndarray:
    """Return triangles in space, shape ``[t, 3, 3]``: those of the plane as they are, segments as triangles that stand on them.

    A triangle without area has no distance that float32 could find. Of one that stands, the edge in the plane is nearest to all points
    of the plane.
    """
    result = np.zeros((len(triangle), 3, 3))
    result[:, :, :2] = triangle
    edge = np.roll(triangle, -1, axis=1) - triangle
    length = np.linalg.norm(edge, axis=2)
    cross = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    longest = length.max(axis=1)
    thin = np.flatnonzero((np.abs(cross) <= SMALLEST_HEIGHT * longest**2) & (longest > 0.0))
    begin = length[thin].argmax(axis=1)
    a, b = triangle[thin, begin], triangle[thin, (begin + 1) % 3]
    result[thin, 0, :2], result[thin, 1, :2], result[thin, 2, :2] = a, b, 0.5 * (a + b)
    result[thin, 2, 2] = longest[thin]
    return result


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
