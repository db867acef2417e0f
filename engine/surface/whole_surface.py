"""A target as a whole: all of its faces, walls and undersides too; what the chart from above is for its upper side.

Densities are read on the main thread, once, at points that lie evenly in every triangle. In between they are interpolated, so that
the solver can ask for them anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property
from typing import ClassVar

import numpy as np

from ..geometry.nearest_on_triangles import nearest_on_triangles
from ..geometry.unit_vectors import unit_vectors
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface, SurfaceMesh
from .lattices import Lattices
from .near_surface import NearSurface
from .surface_points import SurfacePoints
from .triangle_mesh import TriangleMesh

__all__ = ["WholeSurface"]

# Points that a density is read at, about: more where triangles are many.
READ_AT = 400_000
# Points that were put somewhere are still there within this share of the extent, which rounding may take.
AS_THERE = 1e-5


class WholeSurface:
    """All triangles of a target.

    Args:
        mesh: The target. Its triangles look to where objects are to stand.

    Attributes:
        mesh: The same.
        low: Smallest coordinates of its bounds [m], shape ``[3]``.
        high: Largest ones.
        surface: The domain of a problem.
        points: Where densities are read.

    Raises:
        ProblemError: No triangle with an area, or an extent that is too small or too large.
    """

    from_above: ClassVar[bool] = False

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.low, self.high = mesh.extent_of_triangles() if mesh.bounds is None else mesh.bounds
        # Vertices that no triangle has, such as those of faces that are left out, would count for nothing.
        used, index = np.unique(mesh.triangle, return_inverse=True)
        self.surface = Surface(SurfaceMesh(mesh.position[used], index.reshape(-1, 3), "target"))
        self._lattices = Lattices(mesh.position[mesh.triangle], np.sqrt(2.0 * self.surface.area / READ_AT))
        self.points = self._points(*self._lattices.points())

    @property
    def step(self) -> float:
        """How far apart neighbors of :attr:`points` are at most [m]."""
        return self._lattices.step

    @cached_property
    def near(self) -> NearSurface:
        """Finds what of :attr:`surface` is near."""
        return NearSurface(self.surface)

    @cached_property
    def on_surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return which of :attr:`points` lie on triangles of :attr:`surface`, and on which, shape ``[k]`` each: those with an area."""
        number = np.full(len(self.mesh.triangle), -1)
        number[self.surface.source] = np.arange(len(self.surface.source))
        triangle = number[self.points.triangle]
        row = np.flatnonzero(triangle >= 0)
        return row, triangle[row]

    def with_mesh(self, mesh: TriangleMesh) -> WholeSurface:
        """Return the surface of a mesh of the same shape: only what it says at its points may be another."""
        whole = copy(self)
        whole.mesh = mesh
        whole.points = self.points.seen_on(whole)
        return whole

    @property
    def area(self) -> float:
        """Area of all triangles [m²]."""
        return self.surface.area

    def density(self, values: np.ndarray) -> SampledDensity:
        """Return values of :attr:`points` as a function of points on :attr:`surface`."""
        return SampledDensity(np.asarray(values, np.float32), self._lattices)

    def vectors(self, values: np.ndarray) -> Callable[[PointsOnSurface], np.ndarray]:
        """Return vectors at :attr:`points`, shape ``[n, 3]``, as a function of points on :attr:`surface`."""
        parts = [np.ascontiguousarray(values[:, k], np.float32) for k in range(3)]

        def between(points: PointsOnSurface) -> np.ndarray:
            return np.stack([self._lattices.between(part, points) for part in parts], axis=1)

        return between

    def pieces(self) -> np.ndarray:
        """Return the small triangles between neighbors of :attr:`points`, shape ``[k, 3]``: they cover the surface."""
        return self._lattices.pieces()

    def surface_points(self, placement: Placement) -> SurfacePoints:
        """Return the points of the target that bodies were placed on."""
        assert placement.triangle is not None and placement.barycentric is not None
        return self._points(placement.triangle.astype(np.int64), placement.barycentric.astype(np.float32))

    def nearest(self, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points of the surface that are nearest to others.

        Args:
            position: In the world [m], shape ``[n, 3]``.
            normal: Of two sides of a face it is the one that looks along this, shape ``[n, 3]``.

        Returns:
            Their triangles, shape ``[n]``, and the weights of these triangles' corners, shape ``[n, 3]``.
        """
        return nearest_on_triangles(self.mesh.position[self.mesh.triangle].astype(np.float64), position, normal)

    def found_again(
        self, vertex: np.ndarray, weight: np.ndarray, position: np.ndarray, normal: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return where points are that know the triangles they were put on, as :meth:`nearest` does.

        Args:
            vertex: The vertices of these triangles, in their order, shape ``[n, 3]``.
            weight: Weights of these vertices, shape ``[n, 3]``.
            position: Where the points are [m], shape ``[n, 3]``: those that are elsewhere by now come to where that is nearest.
            normal: For these, see :meth:`nearest`.
        """
        triangles = self.mesh.triangle
        _, number = np.unique(np.concatenate([triangles, vertex]), axis=0, return_inverse=True)
        number = number.ravel()
        triangle_of = np.full(int(number.max(initial=0)) + 1, -1)
        triangle_of[number[: len(triangles)]] = np.arange(len(triangles))
        triangle, weight = triangle_of[number[len(triangles) :]], weight.astype(np.float64)
        there = np.einsum("nk,nkd->nd", weight, self.mesh.position[triangles[triangle]].astype(np.float64))
        moved = np.linalg.norm(there - position, axis=1) > AS_THERE * float((self.high - self.low).max())
        lost = np.flatnonzero(moved | (triangle < 0))
        triangle[lost], weight[lost] = self.nearest(position[lost], normal[lost])
        return triangle, weight

    def normals(self, triangle: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return shading normals of the outer side, shape ``[n, 3]``, float32, of length 1."""
        mesh = self.mesh
        corner = mesh.position[mesh.triangle[triangle]]
        flat = unit_vectors(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
        smooth = np.einsum("nk,nkd->nd", weight, mesh.corner_normal[mesh.corner[triangle]]) @ mesh.normal_matrix.T
        # That of a mirrored object, or of the other side of a face, looks the other way.
        smooth *= np.where((smooth * flat).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        return np.where(length > 1e-12, smooth / np.maximum(length, 1e-300), flat).astype(np.float32)

    def _points(self, triangle: np.ndarray, weight: np.ndarray) -> SurfacePoints:
        corner = self.mesh.position[self.mesh.triangle[triangle]]
        return SurfacePoints(self, triangle, weight, np.einsum("nk,nkd->nd", weight.astype(np.float64), corner))


class SampledDensity:
    """A density that is known at evenly spaced points of every triangle, and interpolated in between.

    Args:
        values: Of all points, triangle after triangle, float32.
        lattices: Where these points are.
    """

    def __init__(self, values: np.ndarray, lattices: Lattices) -> None:
        self.values, self._lattices = values, lattices

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Return the values at points, 0 or more, shape ``[n]``, float64."""
        return np.maximum(self._lattices.between(self.values, points), 0.0)
