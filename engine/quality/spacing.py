"""How far the nearest neighbors of a placement are apart."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import least_and_number, median_of_least
from ..problem.domain import Domain
from ..space import kernels_cells
from ..space.cell_sort import CellSort, position_of
from . import kernels_spacing
from .measured_bodies import MeasuredBodies, measured_bodies

__all__ = ["Spacing", "measure_spacing", "smallest_spacing"]

# A hexagonal lattice of number density 1 has this distance of neighbors.
HEXAGONAL_SPACING = math.sqrt(2.0 / math.sqrt(3.0))
# A body without a neighbor in sight is told by a distance of more spacings; then cells grow by a factor until there is one.
MOST_SPACINGS = 1e3
WIDER = 4.0
# Width of a cell over the mean spacing of bodies, at least.
SMALLEST_CELL = 0.5
# Bodies whose order is looked at: the mean of so many is known to 0.002. And how many cells away their neighbors are looked for.
MOST_IN_ORDER = 10_000
FARTHEST_CELLS = 32


class Spacing(NamedTuple):
    """How far nearest neighbors are apart. A neighbor beyond the reach of the search counts as none.

    Attributes:
        smallest: Smallest distance over the hexagonal spacing of the local number density; 1 for a perfect hexagonal lattice. Bodies
            where the density is 0, as fixed ones may be, have none; None where that is so for all.
        closest: Smallest distance [m].
        reach: No two bodies that are nearer to each other than this [m] were overlooked.
        usual: Median of all bodies' distances to their nearest neighbors [m].
        order: Mean sixfold order of bodies' neighbors, see :attr:`~esh.engine.problem.report.Report.order`.
    """

    smallest: float | None
    closest: float
    reach: float
    usual: float
    order: float | None


def smallest_spacing(
    position: np.ndarray, number_density: np.ndarray, domain: Domain, launcher: Launcher
) -> float | None:
    """Smallest distance between two bodies over the hexagonal spacing of the local number density.

    Args:
        position: Body positions [m], shape ``[n, 2]``.
        number_density: Asked number density of all bodies at every body [1/m²], shape ``[n]``.
        domain: The domain.
        launcher: Where to count.

    Returns:
        1 for a perfect hexagonal lattice; None for fewer than two bodies, or where no two are neighbors.
    """
    bodies = measured_bodies(launcher, domain, position)
    density = launcher.array(number_density * bodies.unit**2, float)
    spacing = measure_spacing(bodies, density)
    return spacing and spacing.smallest


def measure_spacing(bodies: MeasuredBodies, number_density: wp.array) -> Spacing | None:
    """Measure how far nearest neighbors are apart, of bodies on a device, with a number density per square unit.

    Returns:
        None for fewer than two bodies, or where no two are neighbors.
    """
    if bodies.count < 2:
        return None
    n = bodies.count
    launcher, space = bodies.launcher, bodies.space
    # A typical density; some thousand bodies tell it well enough. Where nothing is asked for, that of all bodies: 1.
    some = number_density[:: max(1, n // 10_000)].numpy()
    asked = some[some > 0.0]
    reach = 1.5 / math.sqrt(float(np.median(asked)) if len(asked) else 1.0)
    origin, extent = _around(bodies, reach)
    # Cells no smaller than the reach, and not many more than bodies; a neighbor beyond the reach may be missed. In a long and narrow
    # domain all of them may lie beyond it.
    side = max(reach, SMALLEST_CELL * math.sqrt(extent[0] * extent[1] / n))
    nearest, share = launcher.empty(n, float), launcher.empty(n, float)
    while True:
        grid = kernels_cells.CellGrid()
        counts = [max(1, int(length / side)) for length in extent]
        grid.count_x, grid.count_y = counts
        grid.inverse_size = wp.vec2(counts[0] / extent[0], counts[1] / extent[1])
        grid.origin, grid.space = wp.vec2(*origin), space.for_kernels()
        cells = CellSort(launcher, n, counts[0] * counts[1])
        cells.sort(kernels_cells.compute_cell_keys, [position_of(bodies.pose), grid])
        launcher.launch(
            kernels_spacing.find_nearest,
            n,
            [bodies.pose, number_density, cells.order, cells.cell_start, grid],
            [nearest, share],
            grain=GRAIN_OF_NEIGHBORS,
        )
        nobody = float(kernels_spacing.NOBODY)
        closest, _ = least_and_number(launcher, nearest, nobody)
        launcher.launch(kernels_spacing.forget_unseen, n, [share, nobody, MOST_SPACINGS * HEXAGONAL_SPACING], [nearest])
        _, found = least_and_number(launcher, nearest, nobody)
        if found:
            break
        if max(counts) == 1:
            return None
        side *= WIDER
    smallest, _ = least_and_number(launcher, share, nobody)
    # Whoever has none in sight is farther from it than most are.
    usual = median_of_least(launcher, nearest, n if found > n // 2 else found)
    return Spacing(
        smallest / HEXAGONAL_SPACING if smallest < kernels_spacing.NOBODY else None,
        closest * bodies.unit,
        side * bodies.unit,
        usual * bodies.unit,
        _order(bodies, cells, grid),
    )


def _around(bodies: MeasuredBodies, reach: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Origin and extent of a rectangle that holds all bodies: the whole space, but around those that crowd on a part of it."""
    space = bodies.space
    if reach > SMALLEST_CELL or not space.has_edges:
        return (0.0, 0.0), space.size
    position = position_of(bodies.pose).numpy()
    low, high = position.min(axis=0).tolist(), position.max(axis=0).tolist()
    # No less than a cell.
    return (low[0], low[1]), (max(high[0] - low[0], reach), max(high[1] - low[1], reach))


def _order(bodies: MeasuredBodies, cells: CellSort, grid: kernels_cells.CellGrid) -> float | None:
    """Mean sixfold order of bodies, of some thousands where there are more."""
    every = -(-bodies.count // MOST_IN_ORDER)
    count = -(-bodies.count // every)
    order = bodies.launcher.empty(count, wp.float64)
    bodies.launcher.launch(
        kernels_spacing.find_order,
        count,
        [every, FARTHEST_CELLS, bodies.pose, cells.order, cells.cell_start, grid],
        [order],
        grain=GRAIN_OF_NEIGHBORS,
    )
    values = order.numpy()
    found = values[values >= 0.0]
    return float(found.mean()) if len(found) else None
