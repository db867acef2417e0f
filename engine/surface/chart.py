"""The chart *projected from above*: it ties the solver's rectangle to a mesh.

The domain is the bounding rectangle of the target in the world's x and y. Rays go down through the middle of every cell of a
grid; where one meets the mesh, the cell stands for a piece of surface, the larger the steeper it is. Densities are read at
those points, the solver works in the rectangle, and what it places is lifted back onto the mesh by rays of its own.

Limitations: where the mesh overhangs itself only its topmost surface is seen; surface steeper than ``SMALLEST_COSINE``
counts as if it were just as steep; parts narrower than a cell may be missed.
"""

from __future__ import annotations

import math
from copy import copy
from functools import cached_property

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from ..problem.slopes import LEVEL, slope_of_normal
from .surface_points import SurfacePoints
from .top_view import TopView
from .triangle_mesh import TriangleMesh
from .upper_side import NARROWEST, SMALLEST_COVER

__all__ = ["Chart"]

# Cells along the longer side of the rectangle.
RESOLUTION = 1024
# Corners of cells are looked at a little inside them; and at most this share of the cells is given up because the border cuts them.
INSIDE = 1.0 - 1e-4
MOST_CUT = 0.2
# Smallest z of a normal that slopes are accounted for with (84 degrees): a cliff is not worth a forest.
SMALLEST_COSINE = 0.1


class Chart:
    """The upper side of a target over its bounding rectangle.

    Args:
        mesh: The target.
        resolution: Cells along the longer side.

    Attributes:
        origin: Corner of smallest x and y in the world [m].
        size: Extent in x and y [m].
        shape: Rows and columns of the grid; row 0 has the largest y.
        points: The surface under the middle of every cell that has one.
        area: Area of the surface in every cell [m²], shape ``shape``; 0 where there is none.

    Raises:
        ProblemError: No extent in x or y, or nothing of it is seen from above.
    """

    def __init__(self, mesh: TriangleMesh, resolution: int = RESOLUTION) -> None:
        self.view = view = TopView(mesh)
        self.origin = view.low[:2]
        self.size = view.high[:2] - view.low[:2]
        for axis, length in zip("xy", self.size, strict=True):
            if not length > NARROWEST * max(view.extent, 1e-30):
                raise ProblemError(
                    f"{mesh.name} must have an extent in x and y seen from above; in {axis} it has none; "
                    "its whole surface needs none",
                    Refusal(Reason.NOT_SEEN_FROM_ABOVE, 1, 0),
                )
        if view.projected_area < SMALLEST_COVER * self.size.prod():
            raise ProblemError(
                f"{mesh.name} must have faces that are visible from above; all of them are vertical",
                Refusal(Reason.NOT_SEEN_FROM_ABOVE, 1, 0),
            )
        width, height = self.size
        cell = max(width, height) / resolution
        self.shape = (max(1, math.ceil(height / cell - 1e-6)), max(1, math.ceil(width / cell - 1e-6)))
        self.cell = self.size / self.shape[::-1]
        rows, columns = self.shape
        step = self.cell * (1.0, -1.0)
        self._first_middle = self.origin + (0.5, rows - 0.5) * self.cell
        spots: tuple[np.ndarray, ...] = view.cast_grid(self._first_middle, step, self.shape)
        self._filled = np.flatnonzero(spots[0] >= 0)
        if not len(self._filled):
            raise ProblemError(
                f"{mesh.name} must be visible from above; it is too narrow", Refusal(Reason.NOT_SEEN_FROM_ABOVE, 1, 0)
            )
        self._cut = self._cut_cells(step)
        if len(self._filled) < rows * columns:
            spots = tuple(values[self._filled] for values in spots)
        self.points = SurfacePoints(self.view, *spots)
        cosine = np.abs(view.cosine[self.points.triangle])
        self._slopes: dict[float, np.ndarray | None] = {}
        self.area = np.zeros(self.shape)
        self.area.ravel()[self._filled] = self.cell.prod() / np.maximum(cosine, SMALLEST_COSINE)

    def with_mesh(self, mesh: TriangleMesh) -> Chart:
        """Return the chart of a mesh of the same shape: only what it says at its points may be another."""
        chart, view = copy(self), copy(self.view)
        view.mesh = mesh
        chart.view, chart.points = view, self.points.seen_on(view)
        return chart

    @cached_property
    def share_seen(self) -> float:
        """Return the area seen from above over that of the whole surface."""
        return self._seen / max(float(self.view.mesh.areas().sum()), 1e-300)

    @cached_property
    def share_of_facing(self) -> float:
        """Return the area seen from above over that of what faces up, or down where that is more: 1 for flat ground."""
        area, cosine = self.view.mesh.areas(), self.view.cosine
        facing = max(float(area[cosine > 0.0].sum()), float(area[cosine < 0.0].sum()))
        return self._seen / max(facing, 1e-300)

    @property
    def _seen(self) -> float:
        return len(self._filled) * float(self.cell.prod())

    @cached_property
    def stretch(self) -> np.ndarray:
        """Area of the surface over the area of its cell, shape ``shape``; 0 where there is no surface, or not in the whole cell."""
        stretch = self.area / self.cell.prod()
        stretch.ravel()[self._cut] = 0.0
        stretch.setflags(write=False)
        return stretch

    def _cut_cells(self, step: np.ndarray) -> np.ndarray:
        """Cells that the mesh's border cuts, ``step`` [m] from each other: what lies beyond it is drawn onto the surface.

        There are none where hardly anything would be left.
        """
        rows, columns = self.shape
        there = np.zeros((rows + 2, columns + 2), bool)
        there[1:-1, 1:-1].flat[self._filled] = True
        inner = there[:-2] & there[1:-1] & there[2:]
        inner = inner[:, :-2] & inner[:, 1:-1] & inner[:, 2:]
        edge = self._filled[~inner.ravel()[self._filled]]
        if not len(edge):
            return edge
        corner = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (0.5 * INSIDE * self.cell)
        middle = self._first_middle + np.stack([edge % columns, edge // columns], axis=1) * step
        around = (middle[:, None] + corner).reshape(-1, 2)
        whole = (self.view.cast(around)[0] >= 0).reshape(-1, 4).all(axis=1)
        cut = edge[~whole]
        return cut if len(cut) <= MOST_CUT * len(self._filled) else cut[:0]

    def slope(self, align: float) -> np.ndarray | None:
        """Return the slopes of planes that lean so far, from 0 to 1, from level towards the surface, shape ``[rows, columns, 2]``.

        None where all of them are level.
        """
        if not align > 0.0:
            return None
        if align not in self._slopes:
            slope = np.empty((*self.shape, 2), np.float32)
            for axis, values in enumerate(slope_of_normal(self.points.normal, align).T):
                slope[..., axis] = self.continued(values)
            slope.setflags(write=False)
            self._slopes[align] = slope if max(slope.max(), -slope.min()) > LEVEL else None
        return self._slopes[align]

    def continued(self, values: np.ndarray) -> np.ndarray:
        """Return values of :attr:`points` over the whole rectangle, shape ``shape``, float32.

        Beside the surface they go on smoothly, so that its border is no edge to sharpen or to follow.
        """
        if len(self._filled) == self.area.size:
            return values.astype(np.float32).reshape(self.shape)
        image, known = np.zeros(self.shape, np.float32), np.zeros(self.shape, np.float32)
        image.ravel()[self._filled], known.ravel()[self._filled] = values, 1.0
        return _fill_gaps(image, known)

    def surface_points(self, position: np.ndarray) -> SurfacePoints:
        """Return the points of the surface above or below ``position`` ``[n, 2]`` of the rectangle [m].

        A cell may reach beyond the mesh's edge; what lies there goes to the nearest point of the surface.
        """
        xy = position + self.origin
        spots = self.view.cast(xy)
        beside = np.flatnonzero(spots[0] < 0)
        if len(beside):
            anchor = np.column_stack([xy[beside], self.height_near(position[beside])])
            for values, nearest in zip(spots, self.view.nearest(anchor), strict=True):
                values[beside] = nearest
        return SurfacePoints(self.view, *spots)

    def height_near(self, position: np.ndarray) -> np.ndarray:
        """Return z [m] of the surface in the cell of each position ``[n, 2]`` of the rectangle, or in a cell beside it."""
        rows, columns = self.shape
        index = np.full((rows + 2, columns + 2), -1)
        row, column = np.divmod(self._filled, columns)
        index[row + 1, column + 1] = np.arange(len(self._filled))
        column = np.clip((position[:, 0] / self.cell[0]).astype(int), 0, columns - 1)
        row = rows - 1 - np.clip((position[:, 1] / self.cell[1]).astype(int), 0, rows - 1)
        around = [(1, 1), *((i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1))]
        beside = np.stack([index[row + i, column + j] for i, j in around])
        chosen = np.take_along_axis(beside, np.argmax(beside >= 0, axis=0)[None], axis=0)[0]
        height = self.points.position[:, 2]
        return np.where(chosen >= 0, height[chosen], self.view.middle[2])


def _fill_gaps(image: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return ``image`` with means of what is known nearby where ``known`` is 0; values at 1 stay (pull and push)."""
    if known.all():
        return image
    rows, columns = image.shape
    odd = ((0, rows % 2), (0, columns % 2))
    blocks = ((rows + 1) // 2, 2, (columns + 1) // 2, 2)
    weight = np.pad(known, odd).reshape(blocks).sum(axis=(1, 3))
    total = np.pad(image * known, odd).reshape(blocks).sum(axis=(1, 3))
    coarse = _fill_gaps(total / np.maximum(weight, 1.0), (weight > 0.0).astype(known.dtype))
    return np.where(known > 0.0, image, coarse.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns])
