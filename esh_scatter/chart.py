"""The chart *projected from above*: it ties the solver's rectangle to a mesh.

The domain is the bounding rectangle of the target in the world's x and y. Rays go down through the middle of every cell of a
grid; where one meets the mesh, the cell stands for a piece of surface, the larger the steeper it is. Densities are read at
those points, the solver works in the rectangle, and what it places is lifted back onto the mesh by rays of its own.

Limitations: where the mesh overhangs itself only its topmost surface is seen; surface steeper than ``SMALLEST_COSINE``
counts as if it were just as steep; parts narrower than a cell may be missed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..engine.device import Launcher, resolve_device
from ..engine.errors import ProblemError
from . import kernels_chart
from .target import TriangleMesh

__all__ = ["Chart", "SurfacePoints", "TopView"]

# Cells along the longer side of the rectangle.
RESOLUTION = 1024
# Smallest z of a normal that slopes are accounted for with (84 degrees): a cliff is not worth a forest.
SMALLEST_COSINE = 0.1
# Share of the bounding rectangle that must be covered by faces seen from above for the target to have an upper side.
SMALLEST_COVER = 1e-6


class TopView:
    """A triangle mesh seen from above.

    Args:
        mesh: Its triangles; those that stand upright are not seen.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.corner = mesh.position[mesh.triangle]
        edge = self.corner[:, 1:] - self.corner[:, :1]
        cross = np.cross(edge[:, 0], edge[:, 1])
        length = np.linalg.norm(cross, axis=1)
        self.cosine = np.abs(cross[:, 2]) / np.maximum(length, 1e-300)
        self.upside_down = cross[:, 2] < 0
        self.projected_area = 0.5 * np.abs(cross[:, 2])
        used = mesh.position[np.unique(mesh.triangle)]
        self.low, self.high = used.min(axis=0), used.max(axis=0)
        self.middle = 0.5 * (self.low + self.high)
        self.extent = float((self.high - self.low).max())
        # Upright triangles hide nothing, but rays along them meet them by rounding.
        self.seen = np.flatnonzero(self.cosine > 1e-5)
        self._built: wp.Mesh | None = None

    def _device_mesh(self) -> wp.Mesh:
        if self._built is None:
            vertex = wp.array((self.mesh.position - self.middle).astype(np.float32), dtype=wp.vec3, device="cpu")
            index = wp.array(self.mesh.triangle[self.seen].astype(np.int32).ravel(), dtype=wp.int32, device="cpu")
            self._built = wp.Mesh(points=vertex, indices=index)
        return self._built

    def cast(self, xy: np.ndarray) -> np.ndarray:
        """Return the topmost triangle at every ``xy`` ``[n, 2]``, or -1 beside the mesh."""
        if not len(self.seen):
            return np.full(len(xy), -1)
        launcher = Launcher(resolve_device("cpu"))
        try:
            above = 0.5 * (self.high[2] - self.low[2]) + 0.01 * self.extent
            origin = np.column_stack([xy - self.middle[:2], np.full(len(xy), above)]).astype(np.float32)
            found = wp.empty(len(xy), dtype=wp.int32, device="cpu")
            ray = wp.array(origin, dtype=wp.vec3, device="cpu")
            launcher.launch(kernels_chart.cast_down, len(xy), [self._device_mesh().id, ray, 4.0 * above], [found])
            hit = found.numpy()
        finally:
            launcher.close()
        return np.where(hit >= 0, self.seen[hit], -1)

    def nearest(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangle nearest to every ``point`` ``[n, 3]`` and the weights of its corners ``[n, 3]``."""
        launcher = Launcher(resolve_device("cpu"))
        try:
            where = wp.array((point - self.middle).astype(np.float32), dtype=wp.vec3, device="cpu")
            face = wp.empty(len(point), dtype=wp.int32, device="cpu")
            weight = wp.empty(len(point), dtype=wp.vec3, device="cpu")
            inputs = [self._device_mesh().id, where, 4.0 * self.extent]
            launcher.launch(kernels_chart.find_nearest, len(point), inputs, [face, weight])
            return self.seen[face.numpy()], weight.numpy().astype(np.float64)
        finally:
            launcher.close()

    def weights_at(self, triangle: np.ndarray, xy: np.ndarray) -> np.ndarray:
        """Return the weights ``[n, 3]`` of the corners of each triangle at ``xy`` ``[n, 2]``, clamped to within it."""
        a, b, c = (self.corner[triangle, k, :2] for k in range(3))
        ab, ac, ap = b - a, c - a, xy - a
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        second = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / area
        third = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / area
        weight = np.clip(np.stack([1.0 - second - third, second, third], axis=1), 0.0, 1.0)
        return weight / weight.sum(axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of a target's surface, and what its mesh says there.

    Attributes:
        chart: Whose surface.
        triangle: Triangle that each lies on, shape ``[n]``.
        weight: Weights of its corners, shape ``[n, 3]``.
    """

    chart: Chart
    triangle: np.ndarray
    weight: np.ndarray

    @property
    def target_name(self) -> str:
        """How sentences name the target."""
        return self.chart.view.mesh.name

    @property
    def position(self) -> np.ndarray:
        """Positions in the world [m], shape ``[n, 3]``, float64."""
        return self._blend(self.chart.view.corner[self.triangle])

    @property
    def normal(self) -> np.ndarray:
        """Shading normals of the upper side, shape ``[n, 3]``, of length 1 and never pointing down."""
        view = self.chart.view
        normal = self._blend(view.mesh.corner_normal[view.mesh.corner[self.triangle]])
        # The side that is seen is the upper one, whichever way the face was drawn or the object mirrored.
        normal[view.upside_down[self.triangle]] *= -1.0
        normal[:, 2] = np.maximum(normal[:, 2], 0.0)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return np.where(length > 1e-9, normal / np.maximum(length, 1e-9), [0.0, 0.0, 1.0])

    def rectangle_coordinates(self) -> np.ndarray:
        """Return where the points lie in the bounding rectangle, 0..1, y up, shape ``[n, 2]``."""
        return (self.position[:, :2] - self.chart.origin) / self.chart.size

    def uv(self, name: str, key: str) -> np.ndarray:
        """Return coordinates in a UV map (the active one if ``name`` is empty), shape ``[n, 2]``."""
        mesh = self.chart.view.mesh
        chosen = name or mesh.active_uv_map
        if not mesh.uv_map:
            raise ProblemError(f"{key} needs a UV map, and {mesh.name} has none; unwrap it, or map by position")
        if chosen not in mesh.uv_map:
            raise ProblemError(f'{key}: {mesh.name} has no UV map "{chosen}"; it has {_names(mesh.uv_map)}')
        return self._blend(mesh.uv_map[chosen][mesh.corner[self.triangle]])

    def vertex_group(self, name: str, key: str) -> np.ndarray:
        """Return the weights of a vertex group, shape ``[n]``."""
        mesh = self.chart.view.mesh
        if name not in mesh.vertex_group:
            raise ProblemError(f'{key}: {mesh.name} has no vertex group "{name}"; it has {_names(mesh.vertex_group)}')
        return self._blend(mesh.vertex_group[name][mesh.triangle[self.triangle]])

    def attribute(self, name: str, key: str) -> np.ndarray:
        """Return the values of an attribute, colours by their luminance, shape ``[n]``."""
        from .densities import LUMINANCE

        mesh = self.chart.view.mesh
        if name in mesh.unusable_attribute:
            raise ProblemError(f'{key}: attribute "{name}" of {mesh.name} {mesh.unusable_attribute[name]}')
        if name not in mesh.attribute:
            raise ProblemError(f'{key}: {mesh.name} has no attribute "{name}"; it has {_names(mesh.attribute)}')
        domain, values = mesh.attribute[name]
        if values.ndim == 2:
            values = values[:, :3] @ LUMINANCE
        if domain == "FACE":
            return values[mesh.face[self.triangle]]
        return self._blend(values[(mesh.triangle if domain == "POINT" else mesh.corner)[self.triangle]])

    def _blend(self, values: np.ndarray) -> np.ndarray:
        return np.einsum("nk,nk...->n...", self.weight, values)


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
            if not length > 1e-6 * max(view.extent, 1e-30):
                raise ProblemError(f"{mesh.name} must have an extent in x and y seen from above; in {axis} it has none")
        if view.projected_area.sum() < SMALLEST_COVER * self.size.prod():
            raise ProblemError(f"{mesh.name} must be seen from above; all its faces stand upright")
        width, height = self.size
        cell = max(width, height) / resolution
        self.shape = (max(1, math.ceil(height / cell - 1e-6)), max(1, math.ceil(width / cell - 1e-6)))
        self.cell = self.size / self.shape[::-1]
        rows, columns = self.shape
        x = self.origin[0] + (np.arange(columns) + 0.5) * self.cell[0]
        y = self.origin[1] + (np.arange(rows)[::-1] + 0.5) * self.cell[1]
        xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        triangle = view.cast(xy)
        self._filled = np.flatnonzero(triangle >= 0)
        if not len(self._filled):
            raise ProblemError(f"{mesh.name} must be seen from above; it is too narrow to be met by any ray")
        triangle = triangle[self._filled]
        self.points = SurfacePoints(self, triangle, view.weights_at(triangle, xy[self._filled]))
        self.area = np.zeros(self.shape)
        self.area.flat[self._filled] = self.cell.prod() / np.maximum(view.cosine[triangle], SMALLEST_COSINE)

    @property
    def stretch(self) -> np.ndarray:
        """Area of the surface over the area of its cell, shape ``shape``; 0 where there is no surface."""
        return self.area / self.cell.prod()

    def continued(self, values: np.ndarray) -> np.ndarray:
        """Return values of :attr:`points` over the whole rectangle, shape ``shape``, float32.

        Beside the surface they go on smoothly, so that its border is no edge to sharpen or to follow.
        """
        image, known = np.zeros(self.shape), np.zeros(self.shape)
        image.flat[self._filled], known.flat[self._filled] = values, 1.0
        return _fill_gaps(image, known).astype(np.float32)

    def lift(self, position: np.ndarray) -> SurfacePoints:
        """Return the points of the surface above or below ``position`` ``[n, 2]`` of the rectangle [m].

        A cell may reach beyond the mesh's edge; what lies there goes to the nearest point of the surface.
        """
        view = self.view
        xy = position + self.origin
        triangle = view.cast(xy)
        weight = np.empty((len(xy), 3))
        over, beside = np.flatnonzero(triangle >= 0), np.flatnonzero(triangle < 0)
        weight[over] = view.weights_at(triangle[over], xy[over])
        if len(beside):
            anchor = np.column_stack([xy[beside], self._height_near(position[beside])])
            triangle[beside], weight[beside] = view.nearest(anchor)
        return SurfacePoints(self, triangle, weight)

    def _height_near(self, position: np.ndarray) -> np.ndarray:
        """Return z of the surface in the cell of each position, or in a cell beside it."""
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
    coarse = _fill_gaps(total / np.maximum(weight, 1.0), (weight > 0.0).astype(np.float64))
    return np.where(known > 0.0, image, coarse.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns])


def _names(mapping: dict) -> str:
    return ", ".join(f'"{name}"' for name in mapping) if mapping else "none"
