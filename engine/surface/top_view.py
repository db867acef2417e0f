"""A triangle mesh seen from above: what is topmost at a position, and what of it is nearest to one."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import warp as wp

from . import kernels_chart, kernels_raster
from .launching import launch_on_cpu
from .triangle_mesh import TriangleMesh

__all__ = ["Spots", "TopView"]

# Points of a mesh: the triangle that each lies on (shape [n], int32; -1 is none, and then the others mean nothing), the weights
# of its corners ([n, 3], float32), and where it is in the world [m] ([n, 3], float64).
Spots = tuple[np.ndarray, np.ndarray, np.ndarray]

# Upright triangles hide nothing, but rays along them meet them by rounding.
SMALLEST_SEEN_COSINE = 1e-5
# What one thread draws at a time.
ROWS_PER_BAND = 8


class TopView:
    """A triangle mesh seen from above.

    Args:
        mesh: Its triangles; those that stand upright are not seen.

    Attributes:
        low: Smallest coordinates of the mesh's bounds [m], shape ``[3]``.
        high: Largest ones.
        extent: The longest side between them [m].
        cosine: z of every triangle's unit normal, shape ``[t]``, float64; negative where it is seen from its back.
        projected_area: Area of all triangles seen from above [m²], also where they hide each other.
    """

    from_above: ClassVar[bool] = True

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.low, self.high = mesh.extent_of_triangles() if mesh.bounds is None else mesh.bounds
        self.middle = 0.5 * (self.low + self.high)
        self.extent = float((self.high - self.low).max())
        count = len(mesh.triangle)
        self.cosine, area = np.empty(count), np.empty(count)
        launch_on_cpu(kernels_chart.look_from_above, count, [mesh.position, mesh.triangle], [self.cosine, area])
        self.projected_area = float(np.abs(area).sum())
        self._seen = np.flatnonzero(np.abs(self.cosine) > SMALLEST_SEEN_COSINE).astype(np.int32)
        self._built: wp.Mesh | None = None

    def cast(self, xy: np.ndarray) -> Spots:
        """Return the topmost points of the mesh at ``xy`` ``[n, 2]``; no triangle beside the mesh."""
        above = 0.5 * (self.high[2] - self.low[2]) + 0.01 * self.extent
        return self._ask(kernels_chart.cast_down, xy, above)

    def cast_grid(self, origin: np.ndarray, step: np.ndarray, shape: tuple[int, int]) -> Spots:
        """Return what :meth:`cast` does at the points of a grid, row after row: drawn, which takes a fraction of the time.

        Args:
            origin: x and y of the first point [m].
            step: From one to the next along x, above 0, and from one row to the next along y [m].
            shape: Rows and columns.
        """
        grid = kernels_raster.Grid()
        grid.origin, grid.step = wp.vec2d(*origin), wp.vec2d(*step)
        grid.rows, grid.columns = rows, columns = shape
        mesh, count = self.mesh, rows * columns
        reach = np.empty((len(self._seen), 2), np.int32)
        launch_on_cpu(kernels_raster.find_rows, len(reach), [self._seen, mesh.position, mesh.triangle, grid], [reach])
        listed, start = _listed_by_band(reach, -(-rows // ROWS_PER_BAND))
        topmost, height = np.empty(count, np.int32), np.empty(count)
        inputs = [self._seen, reach, listed, start, ROWS_PER_BAND, mesh.position, mesh.triangle, grid]
        launch_on_cpu(kernels_raster.draw_bands, len(start) - 1, inputs, [height, topmost])
        weight, lifted = np.empty((count, 3), np.float32), np.empty((count, 3))
        inputs = [topmost, mesh.position, mesh.triangle, grid]
        launch_on_cpu(kernels_raster.lift_grid, count, inputs, [weight, lifted])
        return topmost, weight, lifted

    def nearest(self, position: np.ndarray) -> Spots:
        """Return the points of the mesh that are nearest to every ``position`` ``[n, 3]``."""
        return self._ask(kernels_chart.find_nearest, position, 4.0 * self.extent)

    def normals(self, triangle: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return the shading normals of the upper side, shape ``[n, 3]``, float32, of length 1 and never pointing down."""
        mesh = self.mesh
        normal = np.empty((len(triangle), 3), np.float32)
        matrix = wp.mat33(mesh.normal_matrix.ravel())
        inputs = [mesh.corner, mesh.corner_normal, matrix, self.cosine, triangle, weight]
        launch_on_cpu(kernels_chart.blend_normals, len(triangle), inputs, [normal])
        return normal

    def _ask(self, kernel: wp.Kernel, where: np.ndarray, reach: float) -> Spots:
        """Ask the mesh about every position, from its middle as far as ``reach``."""
        mesh, count = self.mesh, len(where)
        spots = np.full(count, -1, np.int32), np.empty((count, 3), np.float32), np.empty((count, 3))
        if len(self._seen):
            if self._built is None:
                vertex = (mesh.position - self.middle).astype(np.float32)
                index = mesh.triangle[self._seen].ravel()
                self._built = wp.Mesh(
                    wp.array(vertex, dtype=wp.vec3, device="cpu", copy=False),
                    wp.array(index, dtype=wp.int32, device="cpu", copy=False),
                )
            inputs = [self._built.id, self._seen, mesh.position, mesh.triangle, where, wp.vec3d(self.middle), reach]
            launch_on_cpu(kernel, count, inputs, list(spots))
        return spots


def _listed_by_band(reach: np.ndarray, bands: int) -> tuple[np.ndarray, np.ndarray]:
    """List the triangles that reach into every band of rows, in their order.

    Args:
        reach: First and last row of every triangle, shape ``[t, 2]``.
        bands: Number of bands.

    Returns:
        Their numbers, band after band, and where those of every band begin, shape ``[bands + 1]``; both int32.
    """
    there = np.flatnonzero(reach[:, 0] <= reach[:, 1])
    first, last = (reach[there] // ROWS_PER_BAND).T
    count = last - first + 1
    # The bands of a triangle follow each other.
    band = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
    order = np.argsort(band.astype(np.uint16 if bands < 1 << 16 else np.int64), kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(band, minlength=bands))])
    return np.repeat(there, count)[order].astype(np.int32), start.astype(np.int32)
