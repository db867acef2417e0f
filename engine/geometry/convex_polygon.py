"""Convex polygons in NumPy: hulls of points, and smaller ones around them. Corners have shape ``[k, 2]``, counter-clockwise."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["SHORTEST_EDGE", "convex_hull", "enclosing_polygon", "farthest_points", "width_of"]

# Edges shorter than this share of a polygon's extent are cut off: their directions would be those of rounding errors.
SHORTEST_EDGE = 1e-5
# Directions whose farthest points say which others cannot be corners of a hull.
DIRECTIONS = 16


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Corners of the convex hull of points ``[n, 2]``, counter-clockwise; none of them on the line between its neighbors."""
    points = np.unique(_outer(points), axis=0)
    if len(points) < 3:
        return points

    def chain(ordered: np.ndarray) -> list[np.ndarray]:
        hull: list[np.ndarray] = []
        for point in ordered:
            while len(hull) > 1 and _cross(hull[-1] - hull[-2], point - hull[-2]) <= 0.0:
                hull.pop()
            hull.append(point)
        return hull[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _outer(points: np.ndarray) -> np.ndarray:
    """Points without those well inside the polygon of the farthest ones in some directions, which are no corners of the hull."""
    if len(points) <= 4 * DIRECTIONS:
        return points
    angle = np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
    normal = np.stack([np.cos(angle), np.sin(angle)])
    corner = points[np.argmax(points @ normal, axis=0)]
    edge = np.roll(corner, -1, axis=0) - corner
    reach = np.ptp(points, axis=0).max()
    inside = np.ones(len(points), bool)
    for start, way in zip(corner, edge, strict=True):
        if way.any():
            left = way[0] * (points[:, 1] - start[1]) - way[1] * (points[:, 0] - start[0])
            inside &= left > 1e-9 * reach * math.hypot(*way)
    return points[~inside]


def width_of(hull: np.ndarray) -> float:
    """Smallest width of a convex polygon ``[n, 2]``: across one of its edges."""
    edge = np.roll(hull, -1, axis=0) - hull
    normal = np.stack([edge[:, 1], -edge[:, 0]]) / np.hypot(*edge.T)
    return float(np.ptp(hull @ normal, axis=0).min())


def farthest_points(points: np.ndarray) -> tuple[int, int]:
    """Numbers of the two of some points ``[n, 2]`` that are farthest apart."""
    distance = np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0))
    first, second = np.unravel_index(int(np.argmax(distance)), distance.shape)
    return int(first), int(second)


def enclosing_polygon(hull: np.ndarray, most_corners: int) -> np.ndarray:
    """A convex polygon ``[k, 2]`` of at most ``most_corners`` corners around another ``[n, 2]``: some of its edges, made longer."""
    corners = hull
    shortest = SHORTEST_EDGE * float(np.ptp(hull, axis=0).max())
    while len(corners) > 3:
        start, end = corners, np.roll(corners, -1, axis=0)
        edge = end - start
        before, after = np.roll(edge, 1, axis=0), np.roll(edge, -1, axis=0)
        # Where the two edges beside every edge meet, and how much ground that adds; only where they do meet outside.
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        meets = turn > 1e-12 * np.hypot(*before.T) * np.hypot(*after.T)
        along = (edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]) / np.where(meets, turn, 1.0)
        corner = start + along[:, None] * before
        beyond = np.abs((corner[:, 0] - start[:, 0]) * edge[:, 1] - (corner[:, 1] - start[:, 1]) * edge[:, 0])
        added = np.where(meets, 0.5 * beyond, np.inf)
        short = np.flatnonzero((np.hypot(*edge.T) < shortest) & meets)
        if len(short):
            gone = int(short[np.argmin(added[short])])
        elif len(corners) > most_corners:
            gone = int(np.argmin(added))
        else:
            break
        kept = corners.copy()
        kept[gone] = corner[gone]
        corners = np.delete(kept, (gone + 1) % len(corners), axis=0)
    return corners
