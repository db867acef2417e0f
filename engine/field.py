"""The electrostatic field of charges and target densities, by particle-particle particle-mesh (P3M).

The paper sums over all pairs (equations 1 and 2). Here the kernel K = -log r is split by a Gaussian of width s into a
smooth far part, K * gauss(s), convolved on a mesh, and a near part whose force between two unit charges is exp(-r²/2s²)/r,
summed over neighbours (Hockney and Eastwood, Computer Simulation Using Particles, 1981, chapter 8).

Units: the solver's length unit makes the mean number density 1, and its charge unit is the mean charge.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from . import kernels_cells, kernels_field, kernels_mesh
from .convolution import Convolution, good_length
from .convolution_gpu import LONGEST_ROW
from .density import spline_deposit
from .device import Launcher

__all__ = ["Field", "FieldTarget"]

# Split width over mesh spacing, cut-off over split width, and mesh spacing over the spacing of the bodies; the force error
# that they give is 1e-3 to 3e-3 of the local force scale (benchmarks/force_accuracy.py prints it for others).
SPLIT_OVER_MESH = 1.9
SPLIT_OVER_SPACING = 0.95
CUTOFF_OVER_SPLIT = 3.5
MESH_OVER_SPACING = 0.46
# The target is smoothed by this share of the bodies' spacing, which they cannot resolve: coverage errors at half, one and
# two spacings all have their minimum near 0.37. On a coarse mesh it is widened to what the mesh carries without aliases.
BLUR_OVER_SPACING = 0.37
BLUR_OVER_MESH = 0.85
SMALLEST_MESH = 48
CROWDING_RESOLVED = 4.0
LARGEST_MESH = 65536
# Open meshes have nodes beyond the domain, so that the splines of bodies on its edge find theirs.
OPEN_MARGIN = 2
# Nodes between the farthest pair and the wrap of an open mesh: the kernel has a kink there, and the optimal influence
# function spreads it over a few nodes.
WRAP_GUARD = 6


@dataclass(frozen=True, eq=False)
class FieldTarget:
    """Target density of one group: an image (see :mod:`.problem`) and the charge that its integral stands for."""

    image: np.ndarray
    charge: float


class Field:
    """Evaluates the force per unit charge, -grad of sum_h M[g, h] K * (rho_h - u_h), at every charge of group g.

    Args:
        launcher: Where to run.
        size: Extent of the domain along x and y.
        periodic: Whether it wraps.
        interaction: M, shape ``[group_count, group_count]``.
        targets: One per group.
        spacing: Typical distance of neighbouring bodies where they are dense; sets the mesh.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.

    Attributes:
        blur: Standard deviation of the Gaussian by which the targets are smoothed.
        attraction: Sum over h of M[g, h] u_h as charge per node, shape ``[group_count, rows, columns]``.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        size: tuple[float, float],
        periodic: bool,
        interaction: np.ndarray,
        targets: Sequence[FieldTarget],
        spacing: float,
        charge: np.ndarray,
        charge_group: np.ndarray,
    ) -> None:
        self.launcher = launcher
        self.size = size
        self.periodic = periodic
        self.group_count = len(targets)
        self.charge_count = len(charge)
        device = launcher.device
        self._choose_mesh(spacing)
        rows, columns = self.shape
        self.node_count = rows * columns
        self._convolution = Convolution(launcher, self.shape, self.padded)
        self._interaction = wp.array(interaction.ravel(), dtype=float, device=device)
        self._charge = wp.array(charge, dtype=float, device=device)
        self._charge_group = wp.array(charge_group, dtype=wp.int32, device=device)

        mesh = kernels_mesh.Mesh()
        mesh.count_x, mesh.count_y = columns, rows
        mesh.inverse_spacing = wp.vec2(1.0 / self.mesh_spacing[0], 1.0 / self.mesh_spacing[1])
        mesh.margin = self.margin
        mesh.periodic = int(periodic)
        self.mesh = mesh
        self._choose_cells()

        n = self.charge_count
        self._key = wp.empty(2 * n, dtype=wp.int32, device=device)
        self._order = wp.empty(2 * n, dtype=wp.int32, device=device)
        self._cell_start = wp.empty(self.cells.count_x * self.cells.count_y + 1, dtype=wp.int32, device=device)
        self._sorted = [wp.empty(n, dtype=float, device=device) for _ in range(3)]
        self._sorted_group = wp.empty(n, dtype=wp.int32, device=device)
        self._node_charge = wp.zeros(self.group_count * self.node_count, dtype=wp.int64, device=device)
        self._mixed = [wp.empty(self.node_count, dtype=float, device=device) for _ in range(2)]
        self._spare = wp.empty(self.node_count, dtype=float, device=device)
        self._potential = wp.empty(self.group_count * self.node_count, dtype=float, device=device)
        self._potentials = [
            wp.array(
                ptr=self._potential.ptr + 4 * g * self.node_count, shape=(self.node_count,), dtype=float, device=device
            )
            for g in range(self.group_count)
        ]

        deposited = np.stack(
            [
                target.charge * spline_deposit(target.image, size, self.shape, self.mesh_spacing, self.margin, periodic)
                for target in targets
            ]
        )
        self.attraction = np.tensordot(interaction, deposited, axes=1)
        self._target = wp.array(self.attraction.astype(np.float32).ravel(), dtype=float, device=device)
        self._influence = self._convolution.influence_array(self._far_influence())
        self._correction = self._sharp_target()

    def _choose_mesh(self, spacing: float) -> None:
        on_gpu = self.launcher.device.is_cuda
        longest_row = LONGEST_ROW if on_gpu else LARGEST_MESH

        def length_for(least: float) -> int:
            return min(good_length(least, power_of_two=on_gpu), longest_row)

        # Where bodies crowd on a small part of the domain, a mesh that resolves them there would have far more nodes than
        # there are bodies; a coarser one shifts work to the near field. The crowding is 1 for a uniform density.
        crowding = spacing**-2
        coarsening = max(1.0, crowding / CROWDING_RESOLVED) ** 0.375
        wanted = min(coarsening * spacing * MESH_OVER_SPACING, max(self.size) / SMALLEST_MESH)
        widest_split = math.inf
        if self.periodic:
            # Neighbours are looked for in three cells along each axis, which must not be the same cell twice.
            widest_split = min(self.size) / (3.0 * CUTOFF_OVER_SPLIT)
            wanted = min(wanted, widest_split / SPLIT_OVER_MESH)
            columns, rows = (length_for(length / wanted) for length in self.size)
            self.mesh_spacing = (self.size[0] / columns, self.size[1] / rows)
            self.margin = 0
            self.shape = self.padded = (rows, columns)
        else:
            # One spacing for both axes, as small as the padded length of the longer one allows.
            extra = 2 * OPEN_MARGIN + 1 + WRAP_GUARD
            step = max(self.size) / (length_for(2.0 * (max(self.size) / wanted + extra)) / 2 - extra)
            self.mesh_spacing = (step, step)
            self.margin = OPEN_MARGIN
            columns, rows = (math.ceil(length / step - 1e-9) + 2 * OPEN_MARGIN + 1 for length in self.size)
            self.shape = (rows, columns)
            self.padded = (length_for(2 * (rows + WRAP_GUARD)), length_for(2 * (columns + WRAP_GUARD)))
        coarsest = max(self.mesh_spacing)
        self.split = max(SPLIT_OVER_MESH * coarsest, min(SPLIT_OVER_SPACING * spacing, widest_split))
        self.cutoff = CUTOFF_OVER_SPLIT * self.split
        self.blur = max(BLUR_OVER_SPACING * spacing, BLUR_OVER_MESH * coarsest)

    def _choose_cells(self) -> None:
        counts = [max(1, int(length / self.cutoff)) for length in self.size]
        cells = kernels_cells.CellGrid()
        cells.count_x, cells.count_y = counts
        cells.inverse_size = wp.vec2(counts[0] / self.size[0], counts[1] / self.size[1])
        cells.domain = wp.vec2(*self.size)
        cells.periodic = int(self.periodic)
        self.cells = cells

    def _wave_numbers(self) -> tuple[np.ndarray, np.ndarray]:
        rows, columns = self.padded
        ky = 2.0 * np.pi * np.arange(rows // 2 + 1) / rows / self.mesh_spacing[1]
        kx = 2.0 * np.pi * np.abs(np.fft.fftfreq(columns)) / self.mesh_spacing[0]
        return kx[None, :], ky[:, None]

    def _window(self) -> np.ndarray:
        """What turns a smooth kernel's transform into the optimal influence function for depositing and interpolating.

        W² / (sum of W² over all aliases)², W = sinc⁴ per axis being the transform of the cubic B-spline (Hockney and
        Eastwood, equation 8-22, where the kernel itself has no aliases). Divided by the number of elements, so that the
        pair of transforms is normalised.
        """
        kx, ky = self._wave_numbers()
        factors = []
        for k, step in ((kx, self.mesh_spacing[0]), (ky, self.mesh_spacing[1])):
            theta = k * step
            squared = np.sinc(theta / (2.0 * np.pi)) ** 8
            aliases = (
                2416.0 + 2382.0 * np.cos(theta) + 240.0 * np.cos(2.0 * theta) + 2.0 * np.cos(3.0 * theta)
            ) / 5040.0
            factors.append(squared / aliases**2)
        return factors[0] * factors[1] / (self.padded[0] * self.padded[1])

    def _far_influence(self) -> np.ndarray:
        kx, ky = self._wave_numbers()
        if self.periodic:
            k2 = kx**2 + ky**2
            k2[0, 0] = 1.0
            kernel = 2.0 * np.pi / k2 * np.exp(-0.5 * self.split**2 * k2)
            # The mean potential has no force.
            kernel[0, 0] = 0.0
            return kernel * self._window() / (self.mesh_spacing[0] * self.mesh_spacing[1])
        # In the plane the kernel has no transform of its own; that of its samples on the padded mesh, which no pair of
        # nodes of the unpadded one reaches around, convolves exactly.
        rows, columns = self.padded
        step = self.mesh_spacing[0]
        y = np.minimum(np.arange(rows), rows - np.arange(rows))[:, None] * step
        x = np.minimum(np.arange(columns), columns - np.arange(columns))[None, :] * step
        kernel = np.fft.rfft2(_far_kernel(x**2 + y**2, self.split)).real
        full = np.concatenate([kernel, kernel[:, 1 : columns - columns // 2][:, ::-1]], axis=1)
        return full[: rows // 2 + 1] * self._window()

    def _sharp_target(self) -> wp.array:
        """Potential of the part of the targets that the split's Gaussian smooths away, per group; it never changes."""
        kx, ky = self._wave_numbers()
        k2 = kx**2 + ky**2
        safe = np.where(k2 > 0.0, k2, 1.0)
        kernel = 2.0 * np.pi / safe * (np.exp(-0.5 * self.blur**2 * k2) - np.exp(-0.5 * self.split**2 * k2))
        kernel = np.where(k2 > 0.0, kernel, np.pi * (self.split**2 - self.blur**2))
        influence = self._convolution.influence_array(
            kernel * self._window() / (self.mesh_spacing[0] * self.mesh_spacing[1])
        )
        device = self.launcher.device
        result = np.empty((self.group_count, self.node_count), dtype=np.float32)
        for g in range(self.group_count):
            field = wp.array(self.attraction[g].astype(np.float32).ravel(), dtype=float, device=device)
            zero = wp.zeros_like(field)
            self._convolution.apply(influence, (field, zero), (field, zero))
            result[g] = field.numpy()
        return wp.array(result.ravel(), dtype=float, device=device)

    def evaluate(self, position: wp.array, field: wp.array) -> None:
        """Write the force per unit charge at every charge.

        Args:
            position: Charge positions inside the domain, ``wp.vec2``, shape ``[n]``.
            field: Receives the result, ``wp.vec2``, shape ``[n]``.
        """
        self._sort(position)
        self._deposit()
        self._solve_far_field()
        self.launcher.launch(
            kernels_field.evaluate_field,
            self.charge_count,
            [
                self._order,
                *self._sorted,
                self._sorted_group,
                self._cell_start,
                self.cells,
                self.cutoff**2,
                -math.log2(math.e) / (2.0 * self.split**2),
                self._interaction,
                self.group_count,
                self.mesh,
                self._potential,
            ],
            [field],
        )

    def _sort(self, position: wp.array) -> None:
        n = self.charge_count
        self.launcher.launch(kernels_cells.compute_cell_keys, n, [position, self.cells], [self._key, self._order])
        wp.utils.radix_sort_pairs(self._key, self._order, n)
        self.launcher.launch(
            kernels_cells.find_cell_starts,
            n,
            [self._key, n, self.cells.count_x * self.cells.count_y],
            [self._cell_start],
        )
        self.launcher.launch(
            kernels_cells.gather_charges,
            n,
            [self._order, position, self._charge, self._charge_group],
            [*self._sorted, self._sorted_group],
        )

    def _deposit(self) -> None:
        self._node_charge.zero_()
        inputs = [*self._sorted, self._sorted_group, self.mesh]
        if self.launcher.device.is_cuda:
            self.launcher.launch(kernels_mesh.deposit_charges, self.charge_count, inputs, [self._node_charge])
            return
        # Threads must not write to one node at once. Charges are sorted by rows of cells, and a row of cells is higher than
        # a spline's reach: bands of at least two rows never meet once every other one is left out.
        band_count = max(1, min(2 * self.launcher.thread_count, self.cells.count_y // 2))
        edges = [self.cells.count_y * b // band_count for b in range(band_count + 1)]
        starts = self._cell_start.numpy()[[edge * self.cells.count_x for edge in edges]]
        bands = list(itertools.pairwise(starts.tolist()))
        # A periodic mesh joins the last band to the first: with an odd number of bands the last goes alone.
        rounds = [bands[0::2], bands[1::2]]
        if self.periodic and band_count % 2 == 1 and band_count > 1:
            rounds = [bands[0:-1:2], bands[1::2], bands[-1:]]
        for chosen in rounds:
            if chosen:
                self.launcher.launch_ranges(kernels_mesh.deposit_charges, chosen, inputs, [self._node_charge])

    def _solve_far_field(self) -> None:
        for g in range(0, self.group_count, 2):
            self.launcher.launch(
                kernels_mesh.mix_groups,
                self.node_count,
                [self._node_charge, self._interaction, self._target, self.group_count, g, self.node_count],
                self._mixed,
            )
            second = self._potentials[g + 1] if g + 1 < self.group_count else self._spare
            self._convolution.apply(self._influence, tuple(self._mixed), (self._potentials[g], second))
        self.launcher.launch(
            kernels_mesh.subtract, self.group_count * self.node_count, [self._correction], [self._potential]
        )


def _far_kernel(squared_distance: np.ndarray, split: float) -> np.ndarray:
    """-log r convolved with a Gaussian of standard deviation ``split``: -(log r² + E1(r²/2s²)) / 2."""
    z = squared_distance / (2.0 * split**2)
    result = np.empty_like(z)
    # E1(z) < 1e-18 beyond 38: the plain logarithm.
    far = z > 38.0
    result[far] = -0.5 * np.log(squared_distance[far])
    near, inverse = np.unique(z[~far], return_inverse=True)
    smooth = np.array([_log_plus_e1(value) for value in near])
    result[~far] = -0.5 * (smooth[inverse.ravel()] + math.log(2.0 * split**2))
    return result


def _log_plus_e1(z: float) -> float:
    """Return log z + E1(z), finite at 0: its power series where that converges well, E1's continued fraction elsewhere."""
    if z < 2.0:
        total, term = -0.5772156649015329, -1.0
        for k in range(1, 40):
            term *= -z / k
            total += term / k
        return total
    fraction = 0.0
    for k in range(120, 0, -1):
        fraction = k / (1.0 + k / (z + fraction))
    return math.log(z) + math.exp(-z) / (z + fraction)
