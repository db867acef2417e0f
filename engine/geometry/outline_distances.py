"""How far points of the plane are from outlines: convex polygons, segments and points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["OutlineCorners", "distance_from_outline"]


class OutlineCorners:
    """Corners of outlines, in tables of those that have as many.

    Args:
        corners: Of every outline, counter-clockwise, shape ``[k, 2]``.
    """

    def __init__(self, corners: Sequence[np.ndarray]) -> None:
        self._count = np.array([len(one) for one in corners], np.int64)
        self._row = np.zeros(len(corners), np.int64)
        self._table: dict[int, np.ndarray] = {}
        for k in np.unique(self._count).tolist():
            own = np.flatnonzero(self._count == k)
            self._row[own] = np.arange(len(own))
            self._table[k] = np.array([corners[number] for number in own])

    def distance(self, place: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Return how far places ``[n, 2]`` are from the outline of this number each, shape ``[n]``; below 0 within it."""
        result, count = np.empty(len(place)), self._count[number]
        for k, table in self._table.items():
            own = np.flatnonzero(count == k)
            if len(own):
                result[own] = _distance_from(place[own], table, self._row[number[own]])
        return result


def distance_from_outline(place: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return how far places ``[n, 2]`` are from a convex polygon, a segment or a point, shape ``[n]``; below 0 within a polygon."""
    return _distance_from(place, corners[None], np.zeros(len(place), np.int64))


def _distance_from(place: np.ndarray, table: np.ndarray, row: np.ndarray) -> np.ndarray:
    """The same from the outline in this row of a table each; the table has shape ``[outlines, corners, 2]``."""
    count = table.shape[1]
    squared = np.full(len(place), np.inf)
    inside = np.full(len(place), count > 2)
    edges = np.roll(table, -1, axis=1) - table
    lengths = np.maximum(np.einsum("mkd,mkd->mk", edges, edges), 1e-300)
    # Of one outline, numbers for all places.
    own: np.ndarray | int = row if len(table) > 1 else 0
    x, y = np.ascontiguousarray(place.T)
    for k in range(count):
        edge_x, edge_y = edges[:, k, 0][own], edges[:, k, 1][own]
        way_x, way_y = x - table[:, k, 0][own], y - table[:, k, 1][own]
        along = np.clip((way_x * edge_x + way_y * edge_y) / lengths[:, k][own], 0.0, 1.0)
        off_x, off_y = way_x - along * edge_x, way_y - along * edge_y
        np.minimum(squared, off_x * off_x + off_y * off_y, out=squared)
        inside &= edge_x * way_y - edge_y * way_x >= 0.0
    away = np.sqrt(squared)
    return np.where(inside, -away, away)
