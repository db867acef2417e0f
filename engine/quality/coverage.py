"""Coverage error: how well a placement follows its densities."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.devices import resolve_device
from ..device.launcher import GRAIN, Launcher
from ..field.influence import product_influence
from ..problem.domain import Domain
from ..problem.of_bodies import one_by_one
from ..space.comparison_grid import comparison_cells
from ..space.target_deposit import integrate_boxes
from ..transforms.convolution import Convolution, good_length
from . import kernels_coverage
from .measured_bodies import MeasuredBodies, measured_bodies
from .taken_ground import LEAST_FREE, TakenGround

__all__ = ["Coverage", "coverage_error"]

# A Gaussian has fallen to 1e-8 of its height here.
REACH_OVER_SIGMA = 6.0
# And its transform has fallen to as little at the wave number of the padded length times this, over sigma.
WAVES_BY_SIGMA = 0.97
# Elements of the largest transform whose blur is kept for the next run.
MOST_KEPT = 1 << 20
# Cells whose squares an element adds up; on the CPU those of a row.
CELLS_ON_GPU = 256
# An image's density, and the charge that its integral stands for.
Target = tuple[np.ndarray, float]


def coverage_error(
    position: np.ndarray,
    charge: np.ndarray,
    image: np.ndarray | list[tuple[np.ndarray, float]],
    domain: Domain,
    k: float = 1.0,
) -> float:
    """Return how far the blurred charge is from the blurred target: RMS of the difference over the mean of the target.

    Charges are deposited by cloud-in-cell on a grid of square cells and blurred, as the target is, by a Gaussian of standard
    deviation ``k * sqrt(domain.area / n)``: with zeros outside an open domain, wrapped in a periodic one. The grid has 512 cells
    along the longer side, or four for each mean spacing, but at most 4,096. Independent random points score 0.31 at k = 1.

    Args:
        position: Body positions [m], shape ``[n, 2]``.
        charge: Their charges (footprint areas), shape ``[n]``.
        image: Target density, shape ``[height, width]``; or several, each with the charge that it stands for.
        domain: The domain.
        k: Width of the blur in mean spacings.
    """
    launcher = Launcher(resolve_device("cpu"))
    try:
        bodies = measured_bodies(launcher, domain, position)
        compared = Coverage(bodies, charge, np.zeros(len(position), dtype=np.int32))
        return compared.error(image if isinstance(image, list) else [(image, 1.0)], k=k)
    finally:
        launcher.close()


class Coverage:
    """Charges on a grid, to be compared with targets.

    Args:
        bodies: The bodies.
        charge: Their charges, shape ``[n]``.
        group: Which group each belongs to, shape ``[n]``: those of a class that are measured together.
    """

    def __init__(self, bodies: MeasuredBodies, charge: np.ndarray, group: np.ndarray) -> None:
        self.launcher, self.domain = bodies.launcher, bodies.domain
        self._bodies = bodies
        several = bool(group.any())
        self._total = np.bincount(group, weights=charge) if several else np.array([charge.sum()])
        self._count = np.bincount(group) if several else np.array([len(group)])
        longer = max(self.domain.size)
        cell = longer / comparison_cells(self.domain, bodies.count)
        columns, rows = (max(1, round(length / cell)) for length in self.domain.size)
        if self.domain.periodic:
            # What wraps is as long as its transform.
            rows, columns = (good_length(n, power_of_two=self.launcher.device.is_cuda) for n in (rows, columns))
        self.shape = (rows, columns)
        mean = float(charge.mean())
        self._given = charge
        self._unit = mean / kernels_coverage.CLOUD_SCALE
        in_units = one_by_one(lambda values: (values / mean).astype(np.float32), charge)
        self._charge = self.launcher.alike(in_units, float)
        self._group = self.launcher.array(group, wp.int32)
        self._shared: tuple[np.ndarray, wp.array] | None = None
        # One grid for all groups in turn: there may be many of them.
        self._grid = self.launcher.zeros(rows * columns, wp.int64)

    def error(self, targets: Sequence[Target], one: int | None = None, k: float = 1.0) -> float:
        """:func:`coverage_error` of group ``one``, or else of all together, beside what the targets add up to."""
        launcher, cells = self.launcher, self.shape[0] * self.shape[1]
        difference = self._difference(targets, one, k, self._charge)
        block = CELLS_ON_GPU if launcher.device.is_cuda else self.shape[1]
        squares = launcher.empty(-(-cells // block), wp.float64)
        inputs = [difference, cells, block]
        launcher.launch(kernels_coverage.sum_squares, len(squares), inputs, [squares], grain=max(1, GRAIN // block))
        return math.sqrt(float(squares.numpy().sum()) / cells)

    def beside(self, image: np.ndarray, taken: TakenGround) -> np.ndarray:
        """Return a density without the ground that is taken from it; the same one where hardly any is left."""
        free = taken.in_cells(self.domain, self.shape)
        if image.size > 1:
            free *= self._share_of(image).numpy().reshape(self.shape)
        if free.sum(dtype=np.float64) < LEAST_FREE * (1.0 if image.size > 1 else free.size):
            return image
        # Cells begin at the bottom, images at the top.
        return np.ascontiguousarray(free[::-1])

    def excess(self, some: np.ndarray, targets: Sequence[Target], one: int) -> float:
        """Return what is left of the :meth:`error` of a group whatever bodies there are beside ``some``, a truth value for each.

        It is made where these alone are more than the target: others only add to that.
        """
        charge = np.where(some, self._given / float(self._given.mean()), 0.0).astype(np.float32)
        difference = self._difference(targets, one, 1.0, self.launcher.array(charge, float))
        above = np.maximum(difference.numpy()[: self.shape[0] * self.shape[1]], 0.0)
        return math.sqrt(float(np.square(above, dtype=np.float64).mean()))

    def _difference(self, targets: Sequence[Target], one: int | None, k: float, charge: wp.array) -> wp.array:
        """Blurred charges less the blurred target, over the mean of the target, in every cell."""
        launcher, domain = self.launcher, self.domain
        self._deposit(-1 if one is None else one, charge)
        chosen = slice(None) if one is None else one
        count, total = int(self._count[chosen].sum()), float(self._total[chosen].sum())
        rows, columns = self.shape
        sigma = [
            k * math.sqrt(domain.area / count) / length * n
            for length, n in zip(domain.size[::-1], self.shape, strict=True)
        ]
        # Rows are transformed in pairs.
        shape = (rows + rows % 2, columns)
        padded = shape
        if not domain.periodic:
            reach = [min(n, math.ceil(REACH_OVER_SIGMA * s)) for n, s in zip(shape, sigma, strict=True)]
            padded_rows, padded_columns = (
                good_length(n + r, power_of_two=launcher.device.is_cuda) for n, r in zip(shape, reach, strict=True)
            )
            padded = (padded_rows, padded_columns)
        waves = None
        if domain.periodic or padded[1] >= shape[1] + REACH_OVER_SIGMA * sigma[1]:
            # Of a Gaussian that is whole.
            waves = math.ceil(WAVES_BY_SIGMA * padded[1] / sigma[1]) + 1
        convolution = Convolution(launcher, shape, padded, waves=waves)

        def blur() -> wp.array:
            along_y, along_x = (
                _gaussian_transform(n, s, wraps=domain.periodic) for n, s in zip(padded, sigma, strict=True)
            )
            return product_influence(convolution, along_y / (padded[0] * padded[1]), along_x)

        # Runs of one size need the same one.
        key = ("coverage", shape, padded, *sigma, domain.periodic)
        influence = launcher.shared(key, blur) if padded[0] * padded[1] <= MOST_KEPT else blur()
        difference = launcher.empty(shape[0] * shape[1], float)
        cells, on_gpu = rows * columns, launcher.device.is_cuda
        weights = sum(weight for _, weight in targets)
        # What is the same everywhere.
        even = sum(weight for image, weight in targets if image.size == 1) / weights
        block = 1 if on_gpu else columns
        inputs = [block, self._unit * cells / total, -even]
        launcher.launch(
            kernels_coverage.take_clouds,
            len(difference) // block,
            inputs,
            [self._grid, difference],
            grain=max(1, GRAIN // block),
        )
        for image, weight in targets:
            if image.size > 1:
                inputs = [self._share_of(image), -cells * weight / weights]
                launcher.launch(kernels_coverage.add_shares, cells, inputs, [difference])
        convolution.apply(influence, difference)
        return difference

    def _share_of(self, image: np.ndarray) -> wp.array:
        """Share of an image's integral in every cell; classes that share an image come one after the other, or all do."""
        if self._shared is None or self._shared[0] is not image:
            self._shared = image, integrate_boxes(self.launcher, image, self.shape)
        return self._shared[1]

    def _deposit(self, one: int, charge: wp.array) -> None:
        self.launcher.launch(
            kernels_coverage.deposit_clouds,
            self._bodies.count,
            [
                self._bodies.pose,
                charge,
                self._group,
                one,
                *self.shape,
                self._bodies.space.for_kernels(),
            ],
            [self._grid],
        )


def _gaussian_transform(count: int, sigma: float, *, wraps: bool) -> np.ndarray:
    """Transform of a Gaussian of sum 1, sampled over ``count`` cells, shape ``[count // 2 + 1]``.

    In a periodic domain it wraps as often as it reaches; in the padding of an open one, which is meant to be empty, it does not.
    """
    periods = math.ceil(9.0 * sigma / count)
    shifts = count * np.arange(-periods - 1, periods + 1)
    wrapped = np.exp(-0.5 * ((np.arange(count) + shifts[:, None]) / sigma) ** 2).sum(axis=0)
    cell = np.arange(count)
    weight = wrapped if wraps else np.exp(-0.5 * (np.minimum(cell, count - cell) / sigma) ** 2)
    return np.fft.rfft(weight / wrapped.sum()).real
