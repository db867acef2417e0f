"""Charges and a target on a surface, smoothed by the heat kernel, and compared.

The surface is cut into even triangles of about half a spacing, on which heat spreads by linear finite elements with the cotangent
Laplacian. Where some are slivers, sides are halved instead, and turned, also across the edges of the surface. In time it is exact:
exp(-t L) is expanded in Chebyshev polynomials of L.

The report measures coverage errors by this, and the solver corrects by it what it asks for. What says how good both are knows nothing
of it: ``benchmarks/surface_metric.py`` has finite elements of its own, by SciPy.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import largest_by_kind, sum_of_squares
from ..problem.of_bodies import of_all
from ..problem.sides import Sides
from ..problem.surface import PointsOnSurface, Surface
from ..space.cell_sort import CellSort
from . import kernels_heat
from .split_triangles import even_triangles, split_triangles

__all__ = ["HeatMesh", "HeatMeshes", "Shares"]

# Triangles along a mean spacing, how much longer sides may be than triangles are on average, and the most triangles that there may be:
# for every body, and whatever the number of these.
PER_SPACING = 2.5
LONGER = 1.5
MOST_PER_BODY = 8
FEWEST = 400_000
# Detail that is finer than this share of a spacing need not spread fast: bounds the number of polynomials where triangles are slivers.
FINEST = 1.0 / 12.0
# Sides that are no farther apart than this share of a spacing touch, as they do for the forces.
NEAR = 0.02
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


class Shares(NamedTuple):
    """What points share out: three vertices for each, ``wp.int32``, and what each of these gets, ``wp.float64``."""

    vertex: wp.array
    amount: wp.array


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
    """

    def __init__(self, launcher: Launcher, surface: Surface, count: int) -> None:
        self._launcher, self._surface = launcher, surface
        self.spacing = math.sqrt(surface.area / count)
        small = max(MOST_PER_BODY * count, FEWEST)
        finest = self.spacing / PER_SPACING
        typical, near = _typical_size(surface), NEAR * self.spacing
        # Slivers are split along their length first: even parts of them would be far finer across than they are long.
        self._triangles = split_triangles(surface, LONGER * max(typical, finest), small, near)
        cuts = max(1, min(math.ceil(typical / finest), int(math.sqrt(small / len(self._triangles)))))
        most_slowed = MOST_SLOWED
        lowest, longer = SLIVER_OF_FEW if count <= FEW_BODIES else SLIVER, 0.0 if cuts > 1 else LONG * finest
        if small == FEWEST and self._triangles.beside_slivers(lowest, self.spacing, longer) > FEW_SLIVERS:
            # Even parts of a sliver lie in rows along it, so fine that heat is slowed across each; together they are a wall. Where
            # more triangles are needed they are left, as others take too long.
            even = even_triangles(surface, finest, small, near)
            if not even.is_whole:
                self._triangles, cuts, most_slowed = even, 1, MOST_SLOWED_OF_SLIVERS
        triangles, self.border = len(self._triangles), self._triangles.border
        self._steps, self._pattern = _cut_evenly(cuts)
        self._cut, self._count = _vertices_of(launcher, self._triangles.sides, self._steps, self._pattern)
        n, corners = self._count, triangles * self._pattern.size
        stiffness = self._stiffness(corners)
        self._area, self._root, rate, bound = (launcher.empty(n, wp.float64) for _ in range(4))
        inputs = [self._cut, stiffness]
        launcher.launch(
            kernels_heat.sum_at_vertices, n, inputs, [self._area, self._root, rate], grain=GRAIN_OF_NEIGHBORS
        )
        fastest = self._fastest(rate, most_slowed)
        column, value = launcher.empty(2 * corners, wp.int32), launcher.empty(2 * corners, float)
        diagonal = launcher.empty(n, float)
        launcher.launch(
            kernels_heat.fill_operator,
            n,
            [*inputs, self._root, fastest],
            [column, value, diagonal, bound],
            grain=GRAIN_OF_NEIGHBORS,
        )
        self._largest = self._largest_of(bound)
        self._operator = [stiffness.start, column, value, diagonal]

    def _largest_of(self, values: wp.array) -> float:
        """The largest of numbers of all vertices."""
        alike = self._launcher.alike(of_all(np.int32(0), self._count), wp.int32)
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

    def _stiffness(self, corners: int) -> kernels_heat.Stiffness:
        """The Laplacian of so many corners of small triangles as kernels take it."""
        launcher = self._launcher
        stiffness = kernels_heat.Stiffness()
        stiffness.cotangent = launcher.array(0.5 * self._triangles.cotangents, wp.vec3d)
        stiffness.area = launcher.array(self._triangles.area / len(self._pattern) / 3.0, wp.float64)
        sort = CellSort(launcher, corners, self._count)
        sort.sort(kernels_heat.find_vertices, [self._cut])
        stiffness.order, stiffness.start = sort.order, sort.cell_start
        return stiffness

    def charges(self, triangle: wp.array, barycentric: wp.array, charge: np.ndarray) -> wp.array:
        """Charges at points of the surface, shared out among the corners of the small triangles that they lie in.

        Args:
            triangle: Triangles that they are on, ``wp.int32``, shape ``[n]``.
            barycentric: Weights of the corners of these, ``wp.vec3d``.
            charge: Shape ``[n]``.

        Returns:
            What every vertex gets, ``wp.float64``.
        """
        return self._added(self.shared_out(triangle, barycentric, charge))

    def charges_evenly(self, triangle: wp.array, barycentric: wp.array, charge: np.ndarray) -> wp.array:
        """The same, and among the vertices across the sides of these, too: as widely wherever they lie.

        By :meth:`charges` one in the middle of a small triangle is spread as far as its corners are, and one at a corner not at all.
        Bodies that are made more even by that would follow the triangles.
        """
        launcher, count = self._launcher, len(charge)
        shares = Shares(launcher.empty(6 * count, wp.int32), launcher.empty(6 * count, wp.float64))
        inputs = [*self._located(triangle, barycentric), launcher.alike(charge, wp.float64), self._cut]
        launcher.launch(kernels_heat.share_out_evenly, count, [*inputs, self._corners], [*shares])
        return self._added(shares)

    def area_evenly(self) -> wp.array:
        """Share of the surface's area at every vertex, as :meth:`charges_evenly` shares out what is spread over it."""
        launcher, count = self._launcher, len(self._triangles) * len(self._pattern)
        shares = Shares(launcher.empty(6 * count, wp.int32), launcher.empty(6 * count, wp.float64))
        launcher.launch(kernels_heat.share_out_area, count, [self._cut, self._corners], [*shares])
        return self.mixed([self._added(shares)], [1.0 / self._surface.area])

    @functools.cached_property
    def _corners(self) -> kernels_heat.Stiffness:
        """The triangles around every vertex. Only what is shared out evenly asks for them, so that reports need not hold them."""
        return self._stiffness(len(self._triangles) * self._pattern.size)

    def _added(self, shares: Shares) -> wp.array:
        """What every vertex gets of shares."""
        launcher = self._launcher
        sort = CellSort(launcher, len(shares.vertex), self._count)
        sort.sort(kernels_heat.find_shares, [shares.vertex])
        total = launcher.empty(self._count, wp.float64)
        launcher.launch(kernels_heat.add_shares, self._count, [sort.cell_start, sort.order, shares.amount], [total])
        return total

    def shared_out(self, triangle: wp.array, barycentric: wp.array, charge: np.ndarray) -> Shares:
        """Which vertices get what of charges; arguments are those of :meth:`charges`."""
        launcher, count = self._launcher, len(charge)
        shares = Shares(launcher.empty(3 * count, wp.int32), launcher.empty(3 * count, wp.float64))
        inputs = [*self._located(triangle, barycentric), launcher.alike(charge, wp.float64), self._cut]
        launcher.launch(kernels_heat.share_out, count, inputs, [*shares])
        return shares

    def _located(self, triangle: wp.array, barycentric: wp.array) -> tuple[wp.array, wp.array]:
        """Triangles of the mesh that points lie in, and weights of their corners, of points given by those of the surface."""
        if self._triangles.is_whole:
            return triangle, barycentric
        # They may not have been sent.
        self._launcher.send()
        place, weight = self._triangles.locate(triangle.numpy().astype(np.int64), barycentric.numpy())
        return self._launcher.array(place.astype(np.int32), wp.int32), self._launcher.array(weight, wp.vec3d)

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
        count, small = len(self._triangles), len(self._pattern)
        share = np.zeros(self._count)
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
        small, area = len(self._pattern), self._triangles.area
        weight = (inner @ (self._steps[self._pattern] / self._cut.cuts)).reshape(-1, 3)
        face = self._cut.vertex.numpy().reshape(len(area), -1)[:, self._pattern]
        stands = np.zeros(len(area), bool)
        if standing is not None:
            stands = self._triangles.reach_into(standing)
        at_once = max(1, POINTS_AT_ONCE // len(weight))
        left = []
        for first in range(0, len(triangle), at_once):
            self._launcher.ask()
            own = triangle[first : first + at_once]
            points = self._surface.points(
                *self._triangles.points(np.repeat(own, len(weight)), np.tile(weight, (len(own), 1)))
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
        result = self._launcher.zeros(self._count, wp.float64)
        for own, factor in zip(values, factors, strict=True):
            self._launcher.launch(kernels_heat.add_times, self._count, [own, factor], [result])
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
            places: What points of charge 1 share out, see :meth:`shared_out`.
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
        launch, n = self._launcher.launch, self._count
        half = 0.5 * time * self._largest
        coefficient = _chebyshev(half)
        scale = 2.0 / self._largest
        # x = 1 - 2 L / largest: T_0 is 1, T_1 is x.
        before, result = self._launcher.empty(n, float), self._launcher.empty(n, float)
        launch(kernels_heat.begin_spread, n, [charges, total, target, self._root, coefficient[0]], [before, result])
        # The first step makes twice T_1 of T_0; half of it is T_1.
        now = self._launcher.zeros(n, float)
        launch(kernels_heat.chebyshev_step, n, [*self._operator, scale, before, 0.5 * coefficient[1]], [now, result])
        launch(kernels_heat.halve, n, [], [now])
        for factor in coefficient[2:]:
            launch(kernels_heat.chebyshev_step, n, [*self._operator, scale, now, factor], [before, result])
            before, now = now, before
        return result


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
    steps, pattern = _cut_evenly(cuts)
    return (INNER @ (steps[pattern] / cuts)).reshape(-1, 3)


def _cut_evenly(cuts: int) -> tuple[np.ndarray, np.ndarray]:
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
) -> tuple[kernels_heat.Cut, int]:
    """Number the vertices that triangles have when they are cut; those on shared corners and sides are one.

    Args:
        launcher: Where to run.
        sides: The sides of the triangles.
        steps: Where the vertices of each lie, see :func:`_cut_evenly`.
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
    of_triangles = kernels_heat.Sides()
    of_triangles.start, of_triangles.end, of_triangles.number = (
        launcher.array(values.astype(np.int32), wp.int32) for values in (sides.start, sides.end, number)
    )
    is_inner = (steps > 0).all(axis=1)
    inner_count = int(is_inner.sum())
    inner = np.where(is_inner, np.cumsum(is_inner) - 1, 0).astype(np.int32)
    cut = kernels_heat.Cut()
    cut.cuts, cut.places, cut.small = cuts, len(steps), len(pattern)
    cut.pattern = launcher.array(pattern.astype(np.int32).ravel(), wp.int32)
    cut.vertex = launcher.empty(triangles * len(steps), wp.int32)
    launcher.launch(
        kernels_heat.number_vertices,
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
