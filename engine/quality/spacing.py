"""How far the nearest neighbours of a placement are apart."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBOURS, Launcher
from ..problem.problem import Domain
from ..space import kernels_cells
from ..space.cell_sort import CellSort, position_of
from ..space.space import space_for_kernels
from . import kernels_spacing
from .measured_bodies import MeasuredBodies, measured_bodies

__all__ = ["smallest_distance", "smallest_spacing"]

# A hexagonal lattice of number density 1 has this distance of neighbours.
HEXAGONAL_SPACING = math.sqrt(2.0 / math.sqrt(3.0))
# A body without a neighbour in sight is told by a distance of more spacings; then cells grow by a factor until there is one.
MOST_SPACINGS = 1e3
WIDER = 4.0


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
        1 for a perfect hexagonal lattice; None for fewer than two bodies, or where no two are neighbours.
    """
    bodies = measured_bodies(launcher, domain, position)
    density = wp.array(number_density * bodies.unit**2, dtype=float, device=launcher.device)
    return smallest_distance(bodies, density)


def smallest_distance(bodies: MeasuredBodies, number_density: wp.array) -> float | None:
    """See :func:`smallest_spacing`: the same for bodies on a device, with a number density per square unit."""
    if bodies.count < 2:
        return None
    n = bodies.count
    launcher, domain = bodies.launcher, bodies.domain
    # A typical density; some thousand bodies tell it well enough.
    reach = 1.5 / math.sqrt(float(np.median(number_density.numpy()[:: max(1, n // 10_000)])))
    # Cells no smaller than the reach, and not many more than bodies; a neighbour beyond the reach may be missed. In a long and narrow
    # domain all of them may lie beyond it.
    side = max(reach, 0.5)
    nearest = launcher.empty(n, float)
    while True:
        grid = kernels_cells.CellGrid()
        counts = [max(1, int(length / side)) for length in bodies.size]
        grid.count_x, grid.count_y = counts
        grid.inverse_size = wp.vec2(counts[0] / bodies.size[0], counts[1] / bodies.size[1])
        grid.space = space_for_kernels(bodies.size, domain.periodic)
        cells = CellSort(launcher, n, counts[0] * counts[1])
        cells.sort(kernels_cells.compute_cell_keys, [position_of(bodies.pose), grid])
        launcher.launch(
            kernels_spacing.find_nearest,
            n,
            [bodies.pose, number_density, cells.order, cells.cell_start, grid],
            [nearest],
            grain=GRAIN_OF_NEIGHBOURS,
        )
        smallest = float(nearest.numpy().min()) / HEXAGONAL_SPACING
        if smallest < MOST_SPACINGS:
            return smallest
        if max(counts) == 1:
            return None
        side *= WIDER
