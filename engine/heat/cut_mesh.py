"""A mesh of triangles, each of which is cut into even small ones: its vertices, and the Laplacian between them."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..geometry.sides import Sides
from ..space.cell_sort import CellSort
from . import kernels_cut_mesh
from .split_triangles import SplitTriangles

__all__ = ["CutMesh", "cut_evenly"]


class CutMesh:
    """Triangles cut into small ones.

    Args:
        launcher: Where to run.
        triangles: What is cut.
        cuts: Into how many parts every side is cut.

    Attributes:
        triangles: See above.
        cut: How they are cut, for kernels.
        pattern: Which places of a triangle its small ones have, see :func:`cut_evenly`.
        vertex_count: Number of the small triangles' vertices.
    """

    def __init__(self, launcher: Launcher, triangles: SplitTriangles, cuts: int) -> None:
        self._launcher, self.triangles = launcher, triangles
        self._steps, self.pattern = cut_evenly(cuts)
        self.cut, self.vertex_count = _vertices_of(launcher, triangles.sides, self._steps, self.pattern)

    @property
    def small_count(self) -> int:
        """Number of the small triangles."""
        return len(self.triangles) * len(self.pattern)

    @property
    def places(self) -> np.ndarray:
        """Where the vertices of a triangle lie, by weights of its corners, shape ``[p, 3]``."""
        return self._steps / self.cut.cuts

    @property
    def small_corners(self) -> np.ndarray:
        """The same of the corners of its small triangles, shape ``[cuts², 3, 3]``."""
        return self.places[self.pattern]

    @property
    def small_vertices(self) -> np.ndarray:
        """Numbers of the vertices of all small triangles, shape ``[t, cuts², 3]``."""
        return self.cut.vertex.numpy().reshape(len(self.triangles), -1)[:, self.pattern]

    def stiffness(self) -> kernels_cut_mesh.Stiffness:
        """The Laplacian of the small triangles as kernels take it."""
        launcher = self._launcher
        stiffness = kernels_cut_mesh.Stiffness()
        stiffness.cotangent = launcher.array(0.5 * self.triangles.cotangents, wp.vec3d)
        stiffness.area = launcher.array(self.triangles.area / len(self.pattern) / 3.0, wp.float64)
        sort = CellSort(launcher, 3 * self.small_count, self.vertex_count)
        sort.sort(kernels_cut_mesh.find_vertices, [self.cut])
        stiffness.order, stiffness.start = sort.order, sort.cell_start
        return stiffness


def cut_evenly(cuts: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the vertices of a triangle lie whose sides are cut into so many parts, and which three of them every small one has.

    Weights of the triangle's corners, whole numbers whose sum is ``cuts``, shape ``[p, 3]``; and places in that table, ``[cuts², 3]``.
    """
    place = np.array([(i, j) for j in range(cuts + 1) for i in range(cuts + 1 - j)])
    number = {(i, j): k for k, (i, j) in enumerate(place.tolist())}
    pattern = []
    for j in range(cuts):
        for i in range(cuts - j):
            pattern.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i < cuts - j - 1:
                pattern.append((number[i + 1, j + 1], number[i, j + 1], number[i + 1, j]))
    return np.column_stack([cuts - place.sum(axis=1), place]), np.array(pattern)


def _vertices_of(
    launcher: Launcher, sides: Sides, steps: np.ndarray, pattern: np.ndarray
) -> tuple[kernels_cut_mesh.Cut, int]:
    """Number the vertices that triangles have when they are cut; those on shared corners and sides are one.

    Args:
        launcher: Where to run.
        sides: The sides of the triangles.
        steps: Where the vertices of each lie, see :func:`cut_evenly`.
        pattern: Which of them its small triangles have, see there.

    Returns:
        How the surface is cut, and how many vertices there are.
    """
    triangles, cuts, corner_count = len(sides.number) // 3, int(steps[0].sum()), int(sides.start.max()) + 1
    # A side whose ends are one is a point, and has no number.
    is_side = np.zeros(len(sides.count), bool)
    is_side[sides.number[sides.start != sides.end]] = True
    number = (np.cumsum(is_side) - 1)[sides.number]
    side_count = int(is_side.sum())
    of_triangles = kernels_cut_mesh.Sides()
    of_triangles.start, of_triangles.end, of_triangles.number = (
        launcher.array(values.astype(np.int32), wp.int32) for values in (sides.start, sides.end, number)
    )
    is_inner = (steps > 0).all(axis=1)
    inner_count = int(is_inner.sum())
    inner = np.where(is_inner, np.cumsum(is_inner) - 1, 0).astype(np.int32)
    cut = kernels_cut_mesh.Cut()
    cut.cuts, cut.places, cut.small = cuts, len(steps), len(pattern)
    cut.pattern = launcher.array(pattern.astype(np.int32).ravel(), wp.int32)
    cut.vertex = launcher.empty(triangles * len(steps), wp.int32)
    launcher.launch(
        kernels_cut_mesh.number_vertices,
        triangles * len(steps),
        [
            launcher.array(steps.astype(np.int32), wp.vec3i),
            of_triangles,
            corner_count,
            side_count,
            launcher.array(inner, wp.int32),
            inner_count,
        ],
        [cut.vertex],
    )
    return cut, corner_count + side_count * (cuts - 1) + triangles * inner_count
