"""How far points are from shapes, in space or seen from above."""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_layers
from .launching import launch_on_cpu, mesh_on_cpu

__all__ = ["NearShapes"]

# Height of a triangle over its longest edge below which it counts as a segment.
SMALLEST_HEIGHT = 1e-4
# Height over its length of the triangle that stands for a segment in space: its distance is as wrong at most.
HEIGHT_OF_SEGMENT = 2e-4
# What float32 rounds off where a point lies within a triangle, as a share of the extent.
ROUNDING = 1e-6


class NearShapes:
    """Triangles, segments and points, to measure the distance to.

    Args:
        triangle: Corners in the world [m], shape ``[t, 3, 3]``, float64; or their x and y, shape ``[t, 3, 2]``, if distances are those
            seen from above. Two corners may be the same, which is a segment; or all three, which is a point.
    """

    def __init__(self, triangle: np.ndarray) -> None:
        self._from_above = triangle.shape[2] == 2
        corner = np.zeros((len(triangle), 3, 3))
        corner[..., : triangle.shape[2]] = triangle
        self._middle = 0.5 * (corner.min(axis=(0, 1)) + corner.max(axis=(0, 1)))
        corner -= self._middle
        self._extent = float(np.abs(corner).max())
        self._mesh = mesh_on_cpu(_with_areas(corner, self._from_above))

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
        place = np.ascontiguousarray(position, np.float64)
        inputs = [self._mesh.id, wp.vec3d(self._middle), int(self._from_above), place, reach]
        launch_on_cpu(kernels_layers.measure_distance, len(distance), inputs, [distance])
        distance[distance <= ROUNDING * self._extent] = 0.0
        return distance


def _with_areas(triangle: np.ndarray, from_above: bool) -> np.ndarray:
    """Return triangles ``[t, 3, 3]``, those without an area widened: of such a one float32 could find no distance.

    Of those that lie in the plane and are seen from above, one that stands on a segment has this for what is nearest to all points of
    the plane.
    """
    result = triangle.copy()
    edge = np.roll(triangle, -1, axis=1) - triangle
    length = np.linalg.norm(edge, axis=2)
    area = np.linalg.norm(np.cross(edge[:, 0], edge[:, 1]), axis=1)
    longest = length.max(axis=1)
    thin = np.flatnonzero((area <= SMALLEST_HEIGHT * longest**2) & (longest > 0.0))
    begin = length[thin].argmax(axis=1)
    a, b, along = triangle[thin, begin], triangle[thin, (begin + 1) % 3], edge[thin, begin]
    if from_above:
        beside = np.broadcast_to([0.0, 0.0, 1.0], along.shape)
        height = longest[thin]
    else:
        beside = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        height = HEIGHT_OF_SEGMENT * longest[thin]
    result[thin] = np.stack([a, b, 0.5 * (a + b) + height[:, None] * beside], axis=1)
    return result
