"""Points that lie evenly in every triangle of a surface, and what is between values that are known there.

In most triangles they are a triangular lattice, as many along each side. In a long narrow one, as on a cylinder or a plank, such a
lattice would be as fine across as it is along, with hundreds of points in a row no wider than one step: its points lie in rows across
it instead, from the corner between the long sides to the short side, as many in every row.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..problem.surface import PointsOnSurface
from . import kernels_chart
from .launching import launch_on_cpu

__all__ = ["Lattices"]

# Steps along a side at most.
MOST_CUTS = 1024
# Triangles have rows where these have at most so large a share of the points of the other lattice.
WORTHWHILE = 0.5


class Lattices:
    """The points of all triangles, one triangle after the other.

    Args:
        corner: Corners of the triangles [m], shape ``[t, 3, 3]``.
        step: How far apart neighbors are to be at most [m]: they are farther where a side would have more than :data:`MOST_CUTS`.

    Attributes:
        step: How far apart they are at most [m].
    """

    def __init__(self, corner: np.ndarray, step: float) -> None:
        # Opposite of each corner.
        side = np.linalg.norm(np.roll(corner, -1, axis=1) - np.roll(corner, 1, axis=1), axis=2).astype(np.float64)
        apex = side.argmin(axis=1)
        longest, shortest = side.max(axis=1), side.min(axis=1)
        # Steps along every side, or between rows; and steps in a row, 0 where there are none.
        self._cuts = np.clip(np.ceil(longest / step), 1, MOST_CUTS).astype(np.int64)
        across = np.clip(np.ceil(shortest / step), 1, MOST_CUTS).astype(np.int64)
        usual = (self._cuts + 1) * (self._cuts + 2) // 2
        in_rows = (self._cuts + 1) * (across + 1)
        has_rows = in_rows <= WORTHWHILE * usual
        self._across = np.where(has_rows, across, 0)
        self._apex = np.where(has_rows, apex, 0).astype(np.int64)
        count = np.where(has_rows, in_rows, usual)
        self._first = np.concatenate([[0], np.cumsum(count)])
        wide = np.where(has_rows, shortest / across, 0.0)
        self.step = float(np.maximum(longest / self._cuts, wide).max())

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangles of all points, shape ``[n]``, and the weights of these triangles' corners, ``[n, 3]``, float32."""
        count = np.diff(self._first)
        weight = np.empty((self._first[-1], 3), np.float32)
        for cuts, across, apex, own in self._alike():
            lattice = np.roll(_rows(cuts, across), apex, axis=1) if across else _lattice(cuts)
            weight[(self._first[own][:, None] + np.arange(len(lattice))).ravel()] = np.tile(lattice, (len(own), 1))
        return np.repeat(np.arange(len(count)), count), weight

    def pieces(self) -> np.ndarray:
        """Return the small triangles between neighbors, shape ``[k, 3]``: they cover the surface."""
        found = []
        for cuts, across, _, own in self._alike():
            pieces = _pieces_of_rows(cuts, across) if across else _pieces(cuts)
            found.append((self._first[own][:, None, None] + pieces).reshape(-1, 3))
        return np.concatenate(found)

    def between(self, values: np.ndarray, points: PointsOnSurface) -> np.ndarray:
        """Return what values, float32, that are known at the points of the lattices, are at others, shape ``[n]``, float64."""
        _, triangle, barycentric = points.source()
        value = np.empty(len(triangle))
        numbers = (self._cuts, self._across, self._apex, self._first, np.ascontiguousarray(triangle, np.int64))
        inputs = [values, *numbers, np.ascontiguousarray(barycentric, np.float64)]
        launch_on_cpu(kernels_chart.interpolate_lattice, len(value), inputs, [value])
        return value

    def _alike(self) -> Iterator[tuple[int, int, int, np.ndarray]]:
        """Yield steps along and across, the corner that rows begin at, and the triangles that have them."""
        # As one number: rows of a table take NumPy a dozen times as long to sort.
        number = (self._cuts * (MOST_CUTS + 1) + self._across) * 3 + self._apex
        _, first, kind = np.unique(number, return_index=True, return_inverse=True)
        groups = np.split(np.argsort(kind, kind="stable"), np.cumsum(np.bincount(kind))[:-1])
        for one, own in zip(first.tolist(), groups, strict=True):
            yield int(self._cuts[one]), int(self._across[one]), int(self._apex[one]), own


def _lattice(cuts: int) -> np.ndarray:
    """Return the weights of a triangle's corners at its points, row after row towards the third, shape ``[n, 3]``, float32."""
    row = np.repeat(np.arange(cuts + 1), np.arange(cuts + 1, 0, -1))
    start = np.concatenate([[0], np.cumsum(np.arange(cuts + 1, 0, -1))[:-1]])
    column = np.arange(len(row)) - start[row]
    place = np.stack([column, row], axis=1) / cuts
    return np.column_stack([1.0 - place.sum(axis=1), place]).astype(np.float32)


def _pieces(cuts: int) -> np.ndarray:
    """Return the small triangles between the points of :func:`_lattice`, shape ``[cuts², 3]``."""
    start = np.concatenate([[0], np.cumsum(np.arange(cuts + 1, 0, -1))])
    row = np.repeat(np.arange(cuts), np.arange(cuts, 0, -1))
    column = np.arange(len(row)) - np.concatenate([[0], np.cumsum(np.arange(cuts, 0, -1))])[row]
    here, above = start[row] + column, start[row + 1] + column
    pointing_up = np.stack([here, here + 1, above], axis=1)
    inner = column < cuts - 1 - row
    return np.concatenate([pointing_up, np.stack([here + 1, above + 1, above], axis=1)[inner]])


def _rows(cuts: int, across: int) -> np.ndarray:
    """Return the weights of a triangle's corners at points in rows from the first corner on, shape ``[n, 3]``, float32."""
    far, share = (values.ravel() for values in np.indices((cuts + 1, across + 1)))
    far, share = far / cuts, share / across
    return np.stack([1.0 - far, far * (1.0 - share), far * share], axis=1).astype(np.float32)


def _pieces_of_rows(cuts: int, across: int) -> np.ndarray:
    """Return the small triangles between the points of :func:`_rows`; the points of the first row are one."""
    row, column = (values.ravel() for values in np.indices((cuts, across)))
    here = row * (across + 1) + column
    beyond = here + across + 1
    outer = np.stack([here, beyond, beyond + 1], axis=1)
    inner = np.stack([here, beyond + 1, here + 1], axis=1)[row > 0]
    return np.concatenate([outer, inner])
