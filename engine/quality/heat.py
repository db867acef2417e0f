"""Coverage error on a surface: charges and target, smoothed by the heat kernel, compared.

The surface is cut into even triangles of about half a spacing, on which heat spreads by linear finite elements with the cotangent
Laplacian. In time it is exact: exp(-t L) is expanded in Chebyshev polynomials of L. Nothing of this is known to the solver.

**Limitations**: Meshes that touch without sharing corners are measured as if they ended there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.smooth_normals import sides_of
from ..problem.surface import PointsOnSurface, Surface
from ..space.cell_sort import CellSort
from . import kernels_heat

__all__ = ["HeatMesh"]

# Triangles along a mean spacing, and the most that there may be for every body, and beside the surface's own.
PER_SPACING = 2.5
MOST_PER_BODY = 8
FEWEST = 400_000
# Detail that is finer than this share of a spacing need not spread fast: bounds the number of polynomials where triangles are slivers.
FINEST = 1.0 / 12.0
# Points that stand for a third of a small triangle each, by weights of its corners; how many are asked for a density at once.
INNER = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
POINTS_AT_ONCE = 1 << 20
# Polynomials that are left out count less than this.
PRECISION = 1e-7


class HeatMesh:
    """A surface cut into triangles, on which heat spreads.

    Args:
        launcher: Where to run.
        surface: The surface.
        count: Number of bodies that are to be measured.

    Attributes:
        spacing: Mean spacing of so many bodies [m].
    """

    def __init__(self, launcher: Launcher, surface: Surface, count: int) -> None:
        self._launcher, self._surface = launcher, surface
        self.spacing = math.sqrt(surface.area / count)
        triangles = len(surface.triangle)
        corner = surface.position[surface.triangle]
        longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
        # Large triangles take most of the area.
        typical = float((longest * surface.triangle_area).sum() / surface.area)
        most = math.sqrt(max(MOST_PER_BODY * count, FEWEST) / triangles)
        self._cuts = cuts = max(1, min(math.ceil(PER_SPACING * typical / self.spacing), int(most)))
        place = np.array([(i, j) for j in range(cuts + 1) for i in range(cuts + 1 - j)])
        self._weights = np.column_stack([cuts - place.sum(axis=1), place]) / cuts
        number = {(i, j): k for k, (i, j) in enumerate(place.tolist())}
        pattern = []
        for j in range(cuts):
            for i in range(cuts - j):
                pattern.append((number[i, j], number[i + 1, j], number[i, j + 1]))
                if i < cuts - j - 1:
                    pattern.append((number[i + 1, j + 1], number[i, j + 1], number[i + 1, j]))
        self._pattern = np.array(pattern)
        self._index, n = _vertices_of(surface.welded, np.column_stack([cuts - place.sum(axis=1), place]))
        self._face = face = self._index[:, self._pattern].reshape(-1, 3)
        stiffness = self._stiffness(corner, n)
        mass, diagonal, bound = (launcher.empty(n, wp.float64) for _ in range(3))
        launcher.launch(kernels_heat.sum_at_vertices, n, [stiffness], [mass, diagonal, bound], grain=GRAIN_OF_NEIGHBORS)
        # A vertex that slivers tie fast to its neighbors is as slow as the finest detail that matters.
        fastest = 4.0 / (FINEST * self.spacing) ** 2
        self._area, bounds = mass.numpy(), bound.numpy()
        self._mass = np.maximum(self._area, bounds / fastest)
        self._root = np.sqrt(self._mass)
        self._largest = float((bounds / self._mass).max())
        root = launcher.array(self._root, wp.float64)
        column, value = launcher.empty(2 * face.size, wp.int32), launcher.empty(2 * face.size, float)
        launcher.launch(kernels_heat.fill_operator, n, [stiffness, root], [column, value], grain=GRAIN_OF_NEIGHBORS)
        own = launcher.array((diagonal.numpy() / self._mass).astype(np.float32), float)
        self._operator = [stiffness.start, column, value, own]

    def _stiffness(self, corner: np.ndarray, vertex_count: int) -> kernels_heat.Stiffness:
        """The Laplacian as kernels take it."""
        launcher = self._launcher
        stiffness = kernels_heat.Stiffness()
        stiffness.face = launcher.array(self._face.ravel(), wp.int32)
        stiffness.cotangent = launcher.array(_half_cotangents(corner), wp.vec3d)
        stiffness.area = launcher.array(self._surface.triangle_area / (3.0 * self._cuts**2), wp.float64)
        stiffness.small = len(self._pattern)
        sort = CellSort(launcher, self._face.size, vertex_count)
        sort.sort(kernels_heat.find_vertices, [stiffness.face])
        stiffness.order, stiffness.start = sort.order, sort.cell_start
        return stiffness

    def charges(self, triangle: np.ndarray, barycentric: np.ndarray, charge: np.ndarray) -> np.ndarray:
        """Charges at points of the surface, shared out among the corners of the small triangles that they lie in."""
        cuts = self._cuts
        x, y = barycentric[:, 1] * cuts, barycentric[:, 2] * cuts
        j = np.clip(y.astype(np.int64), 0, cuts - 1)
        i = np.clip(x.astype(np.int64), 0, cuts - 1 - j)
        fx, fy = x - i, y - j
        upper = (i < cuts - 1 - j) & (fx + fy > 1.0)
        tile = j * (2 * cuts - j) + 2 * i + upper
        corner = self._index[triangle[:, None], self._pattern[tile]]
        weight = np.stack([1.0 - fx - fy, fx, fy], axis=1)
        turned = np.stack([fx + fy - 1.0, 1.0 - fx, 1.0 - fy], axis=1)
        weight = np.where(upper[:, None], turned, weight) * charge[:, None]
        return np.bincount(corner.ravel(), weight.ravel(), len(self._mass))

    def target(self, density: Callable[[PointsOnSurface], np.ndarray] | None = None) -> np.ndarray:
        """Share of a density at every vertex; None: of the surface's area.

        Args:
            density: Of points on the surface, shape ``[n]``; it is asked at three in every small triangle, many at a time.
        """
        if density is None:
            return self._area / self._area.sum()
        area = self._surface.triangle_area / self._cuts**2
        small = len(self._pattern)
        share = np.zeros(len(self._mass))
        weight = (INNER @ self._weights[self._pattern]).reshape(-1, 3)
        face = self._face.reshape(-1, small, 3)
        at_once = max(1, POINTS_AT_ONCE // len(weight))
        for first in range(0, len(area), at_once):
            own = np.arange(first, min(first + at_once, len(area)))
            points = self._surface.points(np.repeat(own, len(weight)), np.tile(weight, (len(own), 1)))
            values = density(points).reshape(len(own), small, 3) * (area[own] / 3.0)[:, None, None]
            share += np.bincount(face[own].ravel(), (values @ INNER).ravel(), len(share))
        return share / share.sum()

    def error(self, charges: np.ndarray, target: np.ndarray, count: int, k: float = 1.0) -> float:
        """Coverage error of ``count`` bodies at ``k`` of their spacings: RMS of the smoothed difference over the mean density."""
        total = float(charges.sum())
        spacing = math.sqrt(self._surface.area / count)
        smooth = self._spread(charges / total - target, 0.5 * (k * spacing) ** 2)
        return math.sqrt(float((self._mass * smooth**2).sum()) * self._surface.area)

    def _spread(self, charge: np.ndarray, time: float) -> np.ndarray:
        """Density of charges after a time [m²]."""
        half = 0.5 * time * self._largest
        coefficient = _chebyshev(half)
        device, n = self._launcher.device, len(charge)
        start = charge / self._root
        # x = 1 - 2 L / largest: T_0 is 1, T_1 is x.
        before = wp.array(start, dtype=float, device=device)
        result = wp.array(coefficient[0] * start, dtype=float, device=device)
        now = wp.clone(before)
        scale = 2.0 / self._largest
        zero = wp.zeros(n, dtype=float, device=device)
        # The first step makes twice T_1 of T_0; half of it is T_1.
        self._launcher.launch(
            kernels_heat.chebyshev_step, n, [*self._operator, scale, before, 0.5 * coefficient[1]], [zero, result]
        )
        now = wp.array(0.5 * zero.numpy(), dtype=float, device=device)
        for factor in coefficient[2:]:
            self._launcher.launch(
                kernels_heat.chebyshev_step, n, [*self._operator, scale, now, factor], [before, result]
            )
            before, now = now, before
        return result.numpy().astype(np.float64) / self._root


def _vertices_of(welded: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, int]:
    """Number the vertices that triangles have when they are cut; those on shared corners and sides are one.

    Args:
        welded: Numbers of the corners of the triangles, shape ``[t, 3]``.
        steps: Where the vertices of each lie: weights of its corners, whole numbers of the same sum, shape ``[p, 3]``.

    Returns:
        The number of every vertex, shape ``[t, p]``, int32, and how many there are.
    """
    triangles, cuts = len(welded), int(steps[0].sum())
    result = np.empty((triangles, len(steps)), np.int32)
    count = int(welded.max()) + 1
    start, end, key = (values.reshape(-1, 3) for values in sides_of(welded))
    # A side whose ends are one is a point.
    is_side = start != end
    side = np.zeros(is_side.shape, np.int64)
    sides, side[is_side] = np.unique(key[is_side], return_inverse=True)
    for k in range(3):
        ahead, behind = (k + 1) % 3, (k + 2) % 3
        result[:, np.flatnonzero(steps[:, k] == cuts)] = welded[:, k, None]
        on_side = np.flatnonzero((steps[:, k] == 0) & (steps[:, ahead] > 0) & (steps[:, behind] > 0))
        # Along it from the end with the smaller number, so that the triangles beside it agree.
        forward = (start[:, k] < end[:, k])[:, None]
        along = np.where(forward, steps[on_side, behind], steps[on_side, ahead])
        numbers = count + side[:, k, None] * (cuts - 1) + along - 1
        result[:, on_side] = np.where(is_side[:, k, None], numbers, start[:, k, None])
    count += len(sides) * (cuts - 1)
    inner = np.flatnonzero((steps > 0).all(axis=1))
    result[:, inner] = count + np.arange(triangles * len(inner)).reshape(triangles, -1)
    return result, count + triangles * len(inner)


def _chebyshev(half: float) -> np.ndarray:
    """Coefficients of exp(half (x - 1)), as many as count."""
    terms = int(4.0 * math.sqrt(half * 17.0) + 24.0)
    angle = math.pi * (np.arange(terms) + 0.5) / terms
    values = np.exp(half * (np.cos(angle) - 1.0))
    coefficient = 2.0 / terms * (values @ np.cos(angle[:, None] * np.arange(terms)))
    coefficient[0] *= 0.5
    return coefficient[: max(2, int(np.flatnonzero(np.abs(coefficient) > PRECISION)[-1]) + 1)]


def _half_cotangents(corner: np.ndarray) -> np.ndarray:
    """Half the cotangents of the angles at the corners of triangles, shape ``[t, 3]``."""
    result = []
    for k in range(3):
        to_next, to_last = (corner[:, (k + step) % 3] - corner[:, k] for step in (1, 2))
        double_area = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        result.append(0.5 * (to_next * to_last).sum(axis=1) / double_area)
    return np.stack(result, axis=1)
