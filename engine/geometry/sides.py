"""Sides of triangles, and which of them are one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Sides", "sides_of"]


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides of triangles, opposite of each corner, three for each triangle.

    Attributes:
        start: Vertex that each begins at, shape ``[3 t]``.
        end: Vertex that it ends at.
        number: Number of the vertices that it is between, whichever it begins at: the same for sides that are one.
        count: How many sides have each of these numbers.
        order: The sides in the order of their numbers, shape ``[3 t]``.
    """

    start: np.ndarray
    end: np.ndarray
    number: np.ndarray
    count: np.ndarray
    order: np.ndarray

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Sides of exactly two triangles: of one, and of the other, shape ``[k]`` each."""
        first = (np.cumsum(self.count) - self.count)[self.count == 2]
        return self.order[first], self.order[first + 1]


def sides_of(welded: np.ndarray) -> Sides:
    """Return the sides of triangles, by the numbers of their vertices, shape ``[t, 3]``."""
    start, end = (np.roll(welded, -step, axis=1).ravel() for step in (1, 2))
    key = np.minimum(start, end) * (int(welded.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    in_order = key[order]
    is_new = np.concatenate([[True], in_order[1:] != in_order[:-1]])
    number = np.empty(len(key), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return Sides(start, end, number, np.diff(np.append(np.flatnonzero(is_new), len(key))), order)
