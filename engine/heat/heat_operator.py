"""The Laplacian of a mesh over the roots of both masses, as a sparse operator whose Chebyshev polynomials are added up."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.running_sum import running_sum
from . import kernels_heat
from .cut_mesh import CutMesh
from .kernels_cut_mesh import Stiffness
from .kernels_heat import ROWS

__all__ = ["HeatOperator"]


class HeatOperator:
    """A sparse operator on numbers of all vertices.

    What takes most of the time is to read its entries, and the numbers that they belong to. So there is one for every side of a
    vertex, and those of ``ROWS`` vertices lie side by side.

    Args:
        launcher: Where to run.
        mesh: The small triangles.
        stiffness: The Laplacian of the small triangles.
        root: Roots of the vertices' masses, shape ``[n]``.
        fastest: How fast heat spreads across a side over the mass of the lighter of its ends at most [1/m²].

    Attributes:
        bound: What no row exceeds, ``wp.float64``, shape ``[n]``.
        count: How many numbers an operand has: n, and those beyond that fill the last block. There they must be finite.
    """

    def __init__(self, launcher: Launcher, mesh: CutMesh, stiffness: Stiffness, root: wp.array, fastest: float) -> None:
        self._launcher, n = launcher, mesh.vertex_count
        room = 6 * mesh.small_count
        self._blocks = -(-n // ROWS)
        self.count = self._blocks * ROWS
        self.bound = launcher.empty(n, wp.float64)
        column, value = launcher.empty(room, wp.int32), launcher.empty(room, float)
        entries, diagonal = launcher.empty(n, wp.int32), launcher.zeros(self.count, float)
        launcher.launch(
            kernels_heat.find_entries,
            n,
            [mesh.cut, stiffness, root, fastest],
            [column, value, entries, diagonal, self.bound],
            grain=GRAIN_OF_NEIGHBORS,
        )
        width = launcher.empty(self._blocks, wp.int32)
        launcher.launch(kernels_heat.find_widths, self._blocks, [entries], [width])
        block_start, total = running_sum(launcher, width)
        beside, factor = launcher.empty(ROWS * total, wp.int32), launcher.empty(ROWS * total, float)
        inputs = [stiffness.start, column, value, entries, block_start]
        launcher.launch(kernels_heat.lay_side_by_side, self.count, inputs, [beside, factor])
        self._arrays = [block_start, beside, factor, diagonal]

    def spread(self, before: wp.array, coefficients: np.ndarray, scale: float, result: wp.array) -> None:
        """Add to a result what Chebyshev polynomials of ``1 - scale A`` make of some numbers, but for the first one, these themselves.

        Args:
            before: The numbers, float, shape ``[count]``; lost afterwards.
            coefficients: Of all polynomials, two at least.
            scale: See above.
            result: What is added to, float, shape ``[count]``.
        """
        # x = 1 - scale A: T_0 is 1, T_1 is x.
        now = self._launcher.zeros(self.count, float)
        # The first step makes twice T_1 of T_0; half of it is T_1.
        self._step(scale, before, 0.5 * coefficients[1], now, result)
        self._launcher.launch(kernels_heat.halve, self.count, [], [now])
        for factor in coefficients[2:]:
            self._step(scale, now, factor, before, result)
            before, now = now, before

    def _step(self, scale: float, now: wp.array, coefficient: float, before: wp.array, result: wp.array) -> None:
        """Put the next polynomial in the place of the one before the last, and add so many times of it to the result."""
        elements = self.count if self._launcher.device.is_cuda else self._blocks
        self._launcher.launch(
            kernels_heat.chebyshev_step,
            elements,
            [*self._arrays, scale, now, coefficient],
            [before, result],
            grain=GRAIN_OF_NEIGHBORS,
        )
