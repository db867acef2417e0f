"""Points of triangles that are nearest to others; of two sides of a face, on the one that looks to where it should."""

from __future__ import annotations

import numpy as np

from .morton_order import morton_order

__all__ = ["corner_weights", "nearest_in", "nearest_on_triangles"]

# Triangles are as near as others within this share of the distance to the nearest middle of one.
AS_NEAR = 1e-6
# Triangles in a block of neighbors.
TRIANGLES_OF_BLOCK = 32
# Lengths are a little more, for rounding.
SAFELY = 1.0 + 1e-9


def nearest_on_triangles(corner: np.ndarray, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of triangles that are nearest to others.

    Args:
        corner: Corners of the triangles [m], shape ``[t, 3, 3]``.
        position: The others [m], shape ``[n, 3]``.
        normal: Of two sides of a face it is the one that looks along this, shape ``[n, 3]``.

    Returns:
        Their triangles, shape ``[n]``, and the weights of these triangles' corners, shape ``[n, 3]``.
    """
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(face, axis=1, keepdims=True)
    blocks = _Blocks(corner, np.flatnonzero(length[:, 0] > 0.0))
    face /= np.maximum(length, 1e-300)
    triangle, weight = np.empty(len(position), np.int64), np.empty((len(position), 3))
    for row, point in enumerate(np.asarray(position, np.float64)):
        chosen, near = blocks.candidates(point)
        weights = nearest_in(corner[chosen], point)
        away = np.linalg.norm(np.einsum("nk,nkd->nd", weights, corner[chosen]) - point, axis=1)
        # Where several are as near, as on an edge or on two sides, it is the one that looks there.
        alike = np.flatnonzero(away <= away.min() + AS_NEAR * near)
        best = alike[np.argmax(face[chosen[alike]] @ normal[row])]
        triangle[row], weight[row] = chosen[best], weights[best]
    return triangle, weight


class _Blocks:
    """Triangles in blocks of neighbors, so that few are looked at for a point.

    Args:
        corner: Corners of triangles, shape ``[t, 3, 3]``.
        chosen: Which of them, by number.
    """

    def __init__(self, corner: np.ndarray, chosen: np.ndarray) -> None:
        middle = corner[chosen].mean(axis=1)
        order = chosen[morton_order(middle)]
        self._triangle, self._middle = order, corner[order].mean(axis=1)
        self._low, self._high = corner[order].min(axis=1), corner[order].max(axis=1)
        self._start = np.append(np.arange(0, len(order), TRIANGLES_OF_BLOCK), len(order))
        first = self._start[:-1]
        self._block_low = np.minimum.reduceat(self._low, first)
        self._block_high = np.maximum.reduceat(self._high, first)
        self._block_middle = self._middle[first]

    def candidates(self, point: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the triangles that may be nearest to a point, by number, and how far the nearest middle of one is."""
        far = _length(self._block_middle - point).min() * SAFELY
        block = np.flatnonzero(_from_box(self._block_low, self._block_high, point) <= far)
        within = [np.arange(self._start[b], self._start[b + 1]) for b in block.tolist()]
        rows = np.concatenate(within)
        # No triangle is nearer than its box, and one is as near as its middle.
        near = float(_length(self._middle[rows] - point).min())
        rows = rows[_from_box(self._low[rows], self._high[rows], point) <= near * SAFELY]
        return np.sort(self._triangle[rows]), near


def _from_box(low: np.ndarray, high: np.ndarray, point: np.ndarray) -> np.ndarray:
    """How far a point is from boxes, shape ``[n]``; 0 within them."""
    return _length(np.maximum(np.maximum(low - point, point - high), 0.0))


def _length(vector: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("nd,nd->n", vector, vector))


def nearest_in(corner: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Weights of the corners of triangles ``[n, 3, 3]`` for the points in them that are nearest to one, shape ``[n, 3]``."""
    found = corner_weights(corner, point)
    outside = np.flatnonzero((found < 0.0).any(axis=1))
    if len(outside):
        # Then it is on one of the sides.
        best = np.full(len(outside), np.inf)
        for k in range(3):
            start, end = corner[outside, k], corner[outside, (k + 1) % 3]
            side = end - start
            share = ((point - start) * side).sum(axis=1) / np.maximum((side * side).sum(axis=1), 1e-300)
            share = np.clip(share, 0.0, 1.0)
            away = np.linalg.norm(start + share[:, None] * side - point, axis=1)
            nearer = away < best
            best = np.where(nearer, away, best)
            rows = outside[nearer]
            found[rows] = 0.0
            found[rows, k], found[rows, (k + 1) % 3] = 1.0 - share[nearer], share[nearer]
    return found


def corner_weights(corner: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Weights of the corners of triangles ``[n, 3, 3]`` for points in their planes, shape ``[n, 3]``; below 0 for points beside them.

    What is not in a plane counts as if it were straight above or below it; ``point`` may be a single one.
    """
    one, two, way = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], point - corner[:, 0]
    a, b, c = (one * one).sum(axis=1), (one * two).sum(axis=1), (two * two).sum(axis=1)
    d, e = (way * one).sum(axis=1), (way * two).sum(axis=1)
    scale = 1.0 / np.maximum(a * c - b * b, 1e-300)
    second, third = (c * d - b * e) * scale, (a * e - b * d) * scale
    return np.stack([1.0 - second - third, second, third], axis=1)
