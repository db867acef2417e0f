"""Charges at points of a surface, shared out among the vertices of a mesh of it."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from . import kernels_cut_mesh, kernels_deposit
from .cut_mesh import CutMesh

__all__ = ["Deposit", "Shares"]


class Shares(NamedTuple):
    """What points share out: vertices, three or six for each, ``wp.int32``, and what each of these gets, ``wp.float64``."""

    vertex: wp.array
    amount: wp.array


class Deposit:
    """Shares charges out among the vertices of a mesh.

    Args:
        launcher: Where to run.
        mesh: The mesh.
        area: Of the surface [m²].
        stiffness: The triangles around every vertex; None: they are found again when somebody asks for them.
    """

    def __init__(
        self, launcher: Launcher, mesh: CutMesh, area: float, stiffness: kernels_cut_mesh.Stiffness | None = None
    ) -> None:
        self._launcher, self._mesh, self._area, self._given = launcher, mesh, area, stiffness

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
        inputs = [*self._located(triangle, barycentric), launcher.alike(charge, wp.float64), self._mesh.cut]
        launcher.launch(kernels_deposit.share_out_evenly, count, [*inputs, self._across], [*shares])
        return self._added(shares)

    def area_evenly(self) -> wp.array:
        """Share of the surface's area at every vertex, as :meth:`charges_evenly` shares out what is spread over it."""
        launcher, mesh = self._launcher, self._mesh
        amount, total = launcher.empty(6 * mesh.small_count, wp.float64), launcher.empty(mesh.vertex_count, wp.float64)
        inputs = [mesh.cut, self._across, self._area]
        launcher.launch(kernels_deposit.share_out_area, mesh.small_count, inputs, [amount], grain=GRAIN_OF_NEIGHBORS)
        inputs = [self._stiffness, self._across, amount]
        launcher.launch(kernels_deposit.add_areas, mesh.vertex_count, inputs, [total], grain=GRAIN_OF_NEIGHBORS)
        return total

    @functools.cached_property
    def _stiffness(self) -> kernels_cut_mesh.Stiffness:
        """The triangles around every vertex. Only what is shared out evenly asks for them, so that reports need not hold them."""
        return self._given or self._mesh.stiffness()

    @functools.cached_property
    def _across(self) -> kernels_deposit.Across:
        """What lies across the sides of small triangles; found once, as it takes longer than to share out."""
        launcher, stiffness = self._launcher, self._stiffness
        corners = 3 * self._mesh.small_count
        across = kernels_deposit.Across()
        across.corner, ahead, behind = (launcher.empty(corners, wp.int32) for _ in range(3))
        across.cotangent, across.area = stiffness.cotangent, stiffness.area
        launcher.launch(kernels_deposit.find_ends, corners, [stiffness.order, self._mesh.cut], [ahead, behind])
        launcher.launch(
            kernels_deposit.find_across,
            self._mesh.vertex_count,
            [stiffness.start, stiffness.order, ahead, behind],
            [across.corner],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return across

    def _added(self, shares: Shares) -> wp.array:
        """What every vertex gets of shares."""
        launcher = self._launcher
        sort = CellSort(launcher, len(shares.vertex), self._mesh.vertex_count)
        sort.sort(kernels_deposit.find_shares, [shares.vertex])
        total = launcher.empty(self._mesh.vertex_count, wp.float64)
        launcher.launch(
            kernels_deposit.add_shares, self._mesh.vertex_count, [sort.cell_start, sort.order, shares.amount], [total]
        )
        return total

    def shared_out(self, triangle: wp.array, barycentric: wp.array, charge: np.ndarray) -> Shares:
        """Which vertices get what of charges; arguments are those of :meth:`charges`."""
        launcher, count = self._launcher, len(charge)
        shares = Shares(launcher.empty(3 * count, wp.int32), launcher.empty(3 * count, wp.float64))
        inputs = [*self._located(triangle, barycentric), launcher.alike(charge, wp.float64), self._mesh.cut]
        launcher.launch(kernels_deposit.share_out, count, inputs, [*shares])
        return shares

    def _located(self, triangle: wp.array, barycentric: wp.array) -> tuple[wp.array, wp.array]:
        """Triangles of the mesh that points lie in, and weights of their corners, of points given by those of the surface."""
        if self._mesh.triangles.is_whole:
            return triangle, barycentric
        # They may not have been sent.
        self._launcher.send()
        place, weight = self._mesh.triangles.locate(triangle.numpy().astype(np.int64), barycentric.numpy())
        return self._launcher.array(place.astype(np.int32), wp.int32), self._launcher.array(weight, wp.vec3d)
