"""Charges and a target on a surface, smoothed by the heat kernel, and compared.

The surface is cut into even triangles of about half a spacing, on which heat spreads by linear finite elements with the cotangent
Laplacian. Where some are slivers, sides are halved instead, and turned, also across the edges of the surface. In time it is exact:
exp(-t L) is expanded in Chebyshev polynomials of L.

The report measures coverage errors by this, and the solver corrects by it what it asks for. What says how good both are knows nothing
of it: ``benchmarks/surface_metric.py`` has finite elements of its own, by SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import largest_by_kind, sum_of_squares
from ..problem.of_bodies import of_all
from ..problem.surface import PointsOnSurface, Surface
from . import kernels_heat
from .cut_mesh import CutMesh, cut_evenly
from .deposit import Deposit, Shares
from .heat_operator import HeatOperator
from .split_triangles import even_triangles, split_triangles

__all__ = ["HeatMesh", "HeatMeshes"]

# Triangles along a mean spacing, how much longer sides may be than triangles are on average, and the most triangles that there may be:
# for every body, and whatever the number of these.
PER_SPACING = 2.5
LONGER = 1.5
MOST_PER_BODY = 8
FEWEST = 400_000
# Detail that is finer than this share of a spacing need not spread fast: bounds the number of polynomials where triangles are slivers.
FINEST = 1.0 / 12.0
# Sides that are no farther apart than this share of a spacing touch. Forces look farther across: with 0.02 errors of halves of a ball
# with 32 and 64 corners, whose borders are up to 0.04 spacings apart, were ten times too high. But corners that are as near become
# one: of two meshes of other triangles side by side, with 4,096 bodies and 16 seeds, errors at 2 and 4 spacings are 0.99 and 0.90 of
# those on one with 0.05, and 1.09 and 1.15 with 0.1.
NEAR = 0.05
# Of slivers it may be this share, so that no larger share of the surface's area is too slow.
SHORTEST = 1.0 / 100.0
MOST_SLOWED = 0.01
# Triangles as low as this, over the side below, are slivers, among which it may be less. Of few bodies higher ones are, too, as other
# triangles are soon made. Measured on hulls of 30 points with 1,500 bodies, whose corners have 4 to 10 degrees: errors at 1 spacing
# are 1.6 to 2.7 times too high on triangles that are evenly cut, and 1.2 times on others.
SLIVER, SLIVER_OF_FEW = 1.0 / 16.0, 1.0 / 4.0
FEW_BODIES = 5_000
MOST_SLOWED_OF_SLIVERS = 0.002
# Where triangles are small enough, slivers matter that are so many times as long as they have to be. Measured on a lattice of 1,980
# bodies: among scattered slivers that are shorter, errors are right to 3 percent; in a row of those that are as long as the domain is
# wide they are two to three times as high.
LONG = 4.0
# Where no larger share of the area lies within a spacing of slivers, they are left as they are. Measured on spheres with one: with a
# share of .0006 errors are a twentieth too high, with .0012 up to two thirds.
FEW_SLIVERS = 5e-4
# Points that stand for a third of a triangle each, by weights of its corners; how many are asked for a density at once, and at least:
# small triangles are cut for that. Where a density varies between those of a triangle, or is 0 and a body stands there all the same,
# as many as the last number are asked instead, if that is more. Measured on 200 bodies in a band of a sphere that is a sixth of a
# spacing wide: errors were .49 on meshes of 1,280 and 5,120 triangles and .084 of 81,920, where each had three points; with ever more
# points they come to .004 to .006.
INNER = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
POINTS_AT_ONCE = 1 << 18
FEWEST_POINTS = 1 << 17
POINTS_WHERE_IT_VARIES = 1 << 19
# A density that differs by less than this share of its largest value does not vary.
VARIES = 0.2
# Polynomials that are left out count less than this.
PRECISION = 1e-7


class HeatMeshes:
    """The meshes of a surface for different numbers of bodies, each made when it is asked for.

    Args:
        launcher: Where to run.
        surface: The surface.
    """

    def __init__(self, launcher: Launcher, surface: Surface) -> None:
        self._launcher, self._surface = launcher, surface
        self._made: dict[int, HeatMesh] = {}

    def of(self, count: int) -> HeatMesh:
        """The mesh for so many bodies."""
        if count not in self._made:
            self._made[count] = HeatMesh(self._launcher, self._surface, count)
        return self._made[count]


class HeatMesh:
    """A surface cut into triangles, on which heat spreads.

    Args:
        launcher: Where to run.
        surface: The surface.
        count: Number of bodies that are to be measured.

    Attributes:
        spacing: Mean spacing of so many bodies [m].
        border: Length of all sides where heat ends [m].
        deposit: Shares charges out among its vertices.
    """

    def __init__(self, launcher: Launcher, surface: Surface, count: int) -> None:
        self._launcher, self._surface = launcher, surface
        self.spacing = math.sqrt(surface.area / count)
        small = max(MOST_PER_BODY * count, FEWEST)
        finest = self.spacing / PER_SPACING
        typical, near = _typical_size(surface), NEAR * self.spacing
        # Slivers are split along their length first: even parts of them would be far finer across than they are long.
        triangles = split_triangles(surface, LONGER * max(typical, finest), small, near)
        cuts = max(1, min(math.ceil(typical / finest), int(math.sqrt(small / len(triangles)))))
        most_slowed = MOST_SLOWED
        lowest, longer = SLIVER_OF_FEW if count <= FEW_BODIES else SLIVER, 0.0 if cuts > 1 else LONG * finest
        if small == FEWEST and triangles.beside_slivers(lowest, self.spacing, longer) > FEW_SLIVERS:
            # Even parts of a sliver lie in rows along it, so fine that heat is slowed across each; together they are a wall. Where
            # more triangles are needed they are left, as others take too long.
            even = even_triangles(surface, finest, small, near)
            if not even.is_whole:
                triangles, cuts, most_slowed = even, 1, MOST_SLOWED_OF_SLIVERS
        self.border = triangles.border
        self._mesh = mesh = CutMesh(launcher, triangles, cuts)
        n, stiffness = mesh.vertex_count, mesh.stiffness()
        # Of many it would take much memory, and next to nobody asks for it.
        self.deposit = Deposit(launcher, mesh, surface.area, stiffness if small == FEWEST else None)
        self._area, self._root, rate = (launcher.empty(n, wp.float64) for _ in range(3))
        inputs = [mesh.cut, stiffness]
        launcher.launch(
            kernels_heat.sum_at_vertices, n, inputs, [self._area, self._root, rate], grain=GRAIN_OF_NEIGHBORS
        )
        fastest = self._fastest(rate, most_slowed)
        self._operator = HeatOperator(launcher, mesh, stiffness, self._root, fastest)
        self._largest = self._largest_of(self._operator.bound)

    def _largest_of(self, values: wp.array) -> float:
        """The largest of numbers of all vertices."""
        alike = self._launcher.alike(of_all(np.int32(0), self._mesh.vertex_count), wp.int32)
        return float(largest_by_kind(self._launcher, values, alike, 1)[0])

    def _fastest(self, rate: wp.array, most_slowed: float) -> float:
        """How fast heat is to spread across a side over the mass of the lighter of its ends at most [1/m²].

        Sides that are shorter than the finest detail that matters are as slow as those, for there would be too many polynomials. Where
        slivers lie beside slivers heat is too slow then, so that they may take more of them, if they are a part of the surface that
        counts.
        """
        slowest, shortest = (0.5 / (detail * self.spacing) ** 2 for detail in (FINEST, SHORTEST))
        if self._largest_of(rate) <= 4.0 * slowest:
            # As on most surfaces: nothing leaves the device.
            return slowest
        values = rate.numpy()
        fast = np.flatnonzero(values > 4.0 * slowest)
        order = fast[np.argsort(-values[fast])]
        share = np.cumsum(self._area.numpy()[order]) / self._surface.area
        needed = values[order[min(int(np.searchsorted(share, most_slowed)), len(order) - 1)]]
        return float(np.clip(0.25 * needed, slowest, shortest))

    def target(
        self, density: Callable[[PointsOnSurface], np.ndarray] | None = None, standing: np.ndarray | None = None
    ) -> wp.array:
        """Share of a density at every vertex, ``wp.float64``; None: of the surface's area.

        Args:
            density: Of points on the surface, shape ``[n]``; it is asked at three in every small triangle or more, many at a time.
            standing: Triangles of the surface that bodies stand on.
        """
        if density is None:
            return self.mixed([self._area], [1.0 / self._surface.area])
        mesh = self._mesh
        count, small = len(mesh.triangles), len(mesh.pattern)
        share = np.zeros(mesh.vertex_count)
        cuts = _cuts_for(FEWEST_POINTS, count * small)
        # Where there are more points than would be asked for a second time, all count at once.
        is_coarse = _cuts_for(POINTS_WHERE_IT_VARIES, count * small) > cuts
        left = self._add_shares(share, density, np.arange(count), cuts, leave=is_coarse, standing=standing)
        if len(left):
            finer = max(cuts, _cuts_for(POINTS_WHERE_IT_VARIES, len(left) * small))
            self._add_shares(share, density, left, finer)
        return self._launcher.array(share / max(share.sum(), 1e-300), wp.float64)

    def _add_shares(
        self,
        share: np.ndarray,
        density: Callable[[PointsOnSurface], np.ndarray],
        triangle: np.ndarray,
        cuts: int,
        *,
        leave: bool = False,
        standing: np.ndarray | None = None,
    ) -> np.ndarray:
        """Add what vertices have of a density in some triangles, of which small ones are cut; return those that are left out.

        ``leave`` is whether those are in which it varies, or is 0 where a body stands.
        """
        inner = _inner_points(cuts)
        triangles, small, area = self._mesh.triangles, len(self._mesh.pattern), self._mesh.triangles.area
        weight = (inner @ self._mesh.small_corners).reshape(-1, 3)
        face = self._mesh.small_vertices
        stands = np.zeros(len(area), bool)
        if standing is not None:
            stands = triangles.reach_into(standing)
        at_once = max(1, POINTS_AT_ONCE // len(weight))
        left = []
        for first in range(0, len(triangle), at_once):
            self._launcher.ask()
            own = triangle[first : first + at_once]
            points = self._surface.points(
                *triangles.points(np.repeat(own, len(weight)), np.tile(weight, (len(own), 1)))
            )
            values = density(points).reshape(len(own), -1)
            if leave:
                most = values.max(axis=1)
                varies = (most - values.min(axis=1) > VARIES * most) | ((most <= 0.0) & stands[own])
                left.append(own[varies])
                values = np.where(varies[:, None], 0.0, values)
            amount = values.reshape(len(own), small, len(inner)) * (area[own] / len(inner))[:, None, None]
            share += np.bincount(face[own].ravel(), (amount @ inner).ravel(), len(share))
        return np.concatenate(left) if left else np.zeros(0, np.int64)

    def mixed(self, values: Sequence[wp.array], factors: Sequence[float]) -> wp.array:
        """Sum of numbers of all vertices, each times its factor."""
        result = self._launcher.zeros(self._mesh.vertex_count, wp.float64)
        for own, factor in zip(values, factors, strict=True):
            self._launcher.launch(kernels_heat.add_times, self._mesh.vertex_count, [own, factor], [result])
        return result

    def polynomials(self, count: int, k: float = 1.0) -> int:
        """How many of them :meth:`error` and :meth:`surplus_at` have to add up: many where triangles are slivers."""
        return len(_chebyshev(0.25 * k**2 * self._surface.area / count * self._largest))

    def error(self, charges: wp.array, total: float, target: wp.array, count: int, k: float = 1.0) -> float:
        """Coverage error of ``count`` bodies at ``k`` of their spacings: RMS of the smoothed difference over the mean density.

        ``total`` is the sum of their ``charges``.
        """
        spacing = math.sqrt(self._surface.area / count)
        smooth = self._spread(charges, total, target, 0.5 * (k * spacing) ** 2)
        return math.sqrt(sum_of_squares(self._launcher, smooth) * self._surface.area)

    def surplus_at(
        self, places: Shares, charges: wp.array, total: float, target: wp.array, count: int, k: float = 1.0
    ) -> np.ndarray:
        """How much denser than the target charges are at points, smoothed as in :meth:`error`, over the mean density.

        Args:
            places: What points of charge 1 share out, see :meth:`~.deposit.Deposit.shared_out`.
            charges: See :meth:`error`, as the others.
            total: See there.
            target: See there.
            count: See there.
            k: See there.

        Returns:
            Shape ``[n]``.
        """
        area = self._surface.area
        smooth = self._spread(charges, total, target, 0.5 * k**2 * area / count)
        result = self._launcher.empty(len(places.vertex) // 3, float)
        inputs = [places.vertex, places.amount, smooth, self._root, area]
        self._launcher.launch(kernels_heat.read, len(result), inputs, [result])
        return result.numpy().astype(np.float64)

    def excess(self, charges: wp.array, total: float, target: wp.array, count: int) -> float:
        """Return what is left of the :meth:`error` whatever bodies there are beside those whose ``charges`` are given.

        It is made where these alone are more than the target: others only add to that. ``total`` and ``count`` are of all.
        """
        smooth = self._spread(charges, total, target, 0.5 * self._surface.area / count).numpy()
        above = np.maximum(smooth, 0.0).astype(np.float64)
        return math.sqrt(float(above @ above) * self._surface.area)

    def _spread(self, charges: wp.array, total: float, target: wp.array, time: float) -> wp.array:
        """What charges over their total, less a target, are after a time [m²]: densities times the roots of the masses, float."""
        coefficients = _chebyshev(0.5 * time * self._largest)
        start, result = (self._launcher.zeros(self._operator.count, float) for _ in range(2))
        inputs = [charges, total, target, self._root, coefficients[0]]
        self._launcher.launch(kernels_heat.begin_spread, self._mesh.vertex_count, inputs, [start, result])
        self._operator.spread(start, coefficients, 2.0 / self._largest, result)
        return result[: self._mesh.vertex_count]


def _typical_size(surface: Surface) -> float:
    """How large the triangles of a surface are on average over its area [m]: their longest sides, of slivers twice the heights."""
    corner = surface.position[surface.triangle]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    height = 2.0 * surface.triangle_area / np.maximum(longest, 1e-300)
    return float((np.minimum(longest, 2.0 * height) * surface.triangle_area).sum() / surface.area)


def _cuts_for(points: int, triangles: int) -> int:
    """Into how many parts sides are cut for so many points in all."""
    return max(1, math.ceil(math.sqrt(points / (len(INNER) * triangles))))


def _inner_points(cuts: int) -> np.ndarray:
    """Points that stand for a triangle, three in each of those that it is cut into, by weights of its corners."""
    steps, pattern = cut_evenly(cuts)
    return (INNER @ (steps[pattern] / cuts)).reshape(-1, 3)


def _chebyshev(half: float) -> np.ndarray:
    """Coefficients of exp(half (x - 1)), as many as count."""
    terms = int(4.0 * math.sqrt(half * 17.0) + 24.0)
    angle = math.pi * (np.arange(terms) + 0.5) / terms
    values = np.exp(half * (np.cos(angle) - 1.0))
    # A cosine transform by way of a Fourier transform: the table of all cosines had millions of them for classes of few bodies.
    transformed = np.fft.fft(np.concatenate([values[::2], values[1::2][::-1]]))
    coefficient = 2.0 / terms * (np.exp(-0.5j * math.pi / terms * np.arange(terms)) * transformed).real
    coefficient[0] *= 0.5
    return coefficient[: max(2, int(np.flatnonzero(np.abs(coefficient) > PRECISION)[-1]) + 1)]
