"""Points of triangles that are nearest to others; of two sides of a face, on the one that looks to where it should."""

from __future__ import annotations

import numpy as np

__all__ = ["corner_weights", "nearest_in", "nearest_on_triangles"]

# Triangles are as near as others within this share of the distance to the nearest middle of one.
AS_NEAR = 1e-6


def nearest_on_triangles(corner: np.ndarray, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of triangles that are nearest to others.

    Args:
        corner: Corners of the triangles [m], shape ``[t, 3, 3]``.
        position: The others [m], shape ``[n, 3]``.
        normal: Of two sides of a face it is the one that looks along this, shape ``[n, 3]``.

    Returns:
        Their triangles, shape ``[n]``, and the weights of these triangles' corners, shape ``[n, 3]``.
    """
    low, high = corner.min(axis=1), corner.max(axis=1)
    middle = corner.mean(axis=1)
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(face, axis=1, keepdims=True)
    whole = np.flatnonzero(length[:, 0] > 0.0)
    face /= np.maximum(length, 1e-300)
    triangle, weight = np.empty(len(position), np.int64), np.empty((len(position), 3))
    for row, point in enumerate(np.asarray(position, np.float64)):
        # No triangle is nearer than its box, and one is as near as its middle.
        near = np.linalg.norm(middle[whole] - point, axis=1).min()
        box = np.linalg.norm(np.maximum(np.maximum(low[whole] - point, point - high[whole]), 0.0), axis=1)
        chosen = whole[box <= near * (1.0 + 1e-9)]
        weights = nearest_in(corner[chosen], point)
        away = np.linalg.norm(np.einsum("nk,nkd->nd", weights, corner[chosen]) - point, axis=1)
        # Where several are as near, as on an edge or on two sides, it is the one that looks there.
        alike = np.flatnonzero(away <= away.min() + AS_NEAR * near)
        best = alike[np.argmax(face[chosen[alike]] @ normal[row])]
        triangle[row], weight[row] = chosen[best], weights[best]
    return triangle, weight


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
