"""Targets on a surface, corrected by how dense bodies have come to stand.

The cascade sees how far places are apart in straight lines, and through the edges of folds half of what is behind them. Where a
surface is folded more narrowly than bodies are spaced, as the lips and ears of a face are, they stand a little too dense or too sparse
by that. How dense they stand along the surface is measured during the run, smoothed by the heat kernel as long as a Gaussian of one
spacing would take, as it is for the coverage error; and what is asked for is changed by what is missing.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..cascade.cascade import Cascade
from ..device.launcher import Launcher
from ..heat.heat_mesh import HeatMesh
from ..model.model import Model
from ..motion.kernels_on_surface import Charges
from ..surface.facets import Facets
from .surface_placement import in_triangles

__all__ = ["SurfaceTargetCorrection"]

# Densities that differ by less, as a share of their mean, are the same.
SAME = 1e-6
# No density is made more different from what is asked for.
FACTORS = (0.5, 2.0)


class SurfaceTargetCorrection:
    """Corrects the targets of a descent on a surface.

    Args:
        model: What is placed, of one class.
        launcher: Where to run.
        facets: The surface.
        share: Share of the density of its only class on every tile, shape ``[tile_count]``.
        cascade: What follows it.
        heat: The surface, as heat spreads on it.
    """

    def __init__(
        self, model: Model, launcher: Launcher, facets: Facets, share: np.ndarray, cascade: Cascade, heat: HeatMesh
    ) -> None:
        self._launcher, self._facets, self._cascade, self._heat = launcher, facets, cascade, heat
        # What is fixed is a part of what is asked for.
        self._charge, self._number = model.charge.charge, model.body_count
        self._total = float(self._charge.sum())
        facet, weight = facets.tiles(np.arange(facets.count))
        tile = cascade.tile_of_nodes()
        self._nodes = heat.deposit.shared_out(*self._in_triangles(facet[tile], weight[tile]), np.ones(len(tile)))
        self._best, self._done = (np.inf, cascade.scale), False
        # Over the mean density. Where there is less the surplus of single bodies would count as much as that of many.
        self._density = np.ones(len(tile))
        if np.ptp(share / facets.tile_area) * facets.tile_area.sum() < SAME:
            # What is even stays so as heat spreads.
            self._target = heat.deposit.area_evenly()
        else:
            self._target = heat.deposit.charges_evenly(*self._in_triangles(facet, weight), share)
            nothing = launcher.zeros(len(self._target), wp.float64)
            surplus = heat.surplus_at(self._nodes, self._target, 1.0, nothing, self._number)
            self._density = np.maximum(surplus, 1.0)

    def _in_triangles(self, facet: np.ndarray, weight: np.ndarray) -> tuple[wp.array, wp.array]:
        """Triangles of points on facets, and weights of their corners."""
        triangle, of_corners = self._facets.in_triangle(facet, weight)
        # Read at once where triangles are split.
        own_array = self._launcher.own_array
        return own_array(triangle.astype(np.int32), wp.int32), own_array(of_corners, wp.vec3d)

    def correct(self, charges: Charges) -> None:
        """Ask for less where charges are denser than they should be, and for more where they are not as dense.

        Where the last correction was of no use it is taken back, and nothing is corrected any more.
        """
        if self._done:
            return
        places = in_triangles(self._launcher, self._facets, charges.facet, charges.weight)
        placed = self._heat.deposit.charges_evenly(*places, self._charge)
        surplus = self._heat.surplus_at(self._nodes, placed, self._total, self._target, self._number)
        # How uneven bodies are that have followed the targets as they are now.
        unevenness = float((surplus**2 * self._cascade.node_area.clip(min=0.0)).sum())
        scale, (least, best) = self._cascade.scale, self._best
        if unevenness > least:
            # Corrected further they would be worse: on the faces of a ridge that is narrower than nodes are apart, say, bodies
            # follow what is asked for on both.
            self._done = True
            self._cascade.scale_images(best)
            return
        self._best = unevenness, scale
        self._cascade.scale_images(np.clip(scale - surplus / self._density, *FACTORS))
