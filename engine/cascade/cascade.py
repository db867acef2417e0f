"""The electrostatic forces on a surface, by multilevel summation.

Sources are the charges of the bodies and, with the opposite sign, the target: *images*, one for the density of each class. The kernel
is K(r) = -log r. Up to a constant and a ripple of 1e-3 it is a sum of Gaussians, one for every octave of their widths:

    -log r = sum over l of ln 2 exp(-r² / 2 s_l²), with s_l = 2^(l + 1/2) lengths.

Each Gaussian is multiplied by how much two places see of each other, (1 + n·m) / 2 of their normals n and m: 1 on one sheet, 1/2
across a right angle, 0 through a thin wall. This factor is positive semidefinite, and so are its products with Gaussians.

- Near field, octaves below l = 0: summed directly, over pairs of charges that are near each other, and, of the target, once for all
  steps (:mod:`.near_target`).
- Far field, octaves from l = 0 on: charges are deposited on *nodes*, points of the surface that keep a distance, by weights that are
  exact for linear functions. From these they go to the nodes of the next level, which lie twice as far apart and serve the next
  octave, and so on. Potentials come back the same way, with the transposed weights (:mod:`.nodes`).

There is no mesh whose quality would matter, and the work is in proportion to the number of charges (Hardy and others, Multilevel
summation method for electrostatic force evaluation, 2015).

Parts of a surface that stand on one another, as a box on the ground, see each other in the near field only, which keeps their bodies
apart. In the far field they do not: many things may stand on one ground without seeing each other, and then K would not be positive
semidefinite. Measured on 400 boxes on a ground: with the far field errors at 1 spacing are .0158, without it .0149; the nearest bodies
across their feet are .53 and .58 spacings apart.

Units: the solver's length unit is the spacing that the average body sees, its charge unit the mean charge. A cascade has a *length* of
its own, the spacing that it resolves: 1 unit, or more for the bodies of a rare class.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from ..surface import kernels_facets
from ..surface.facets import Facets
from . import kernels_cascade, kernels_near_charges, kernels_nodes
from .carried_tiles import CarriedTiles
from .kernels_points import Points
from .native_lanes import LANES
from .near_target import NearTarget, kept_facets, sum_near_target
from .node_images import NodeImages, empty_sorted_charges, images_at_nodes
from .nodes import NEAR_REACH, Nodes, homed
from .points import Lists, chosen, places_where
from .quadrature import Quadrature
from .softness import Softness, near_terms
from .target_blur import TargetBlur
from .tiled_surface import TiledSurface, centers_of_tiles, uniform_images

__all__ = ["Cascade"]


class Cascade:
    """Evaluates the force per unit charge, -grad of sum_h M[g, h] K * (rho_h - u_h), at every charge of group g.

    Here M is the interaction matrix, rho_h the charges of group h, and u_h their target.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same facets, as kernels take them.
        share: Share of every image on every tile, shape ``[image_count, tile_count]``; rows add up to 1.
        attraction: Charge of every image that attracts every group, shape ``[group_count, image_count]``.
        interaction: M, shape ``[group_count, group_count]``.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.
        length: Spacing that is to be resolved, in units.
        softness: How soft charges are. None for points; then only the near field of the target is blurred a little.
        before: Cascade of the same surface before an edit. Nodes, homes and near fields are taken from it where they still fit.

    Attributes:
        nodes: Nodes of the far field.
        node_count: Number of nodes of the finest level.
        home: Home node of every tile, ``wp.int32``, shape ``[tile_count]``: charges on a tile are deposited on nodes around it. A tile
            without density that has no node near it has the first node, which is too far away to get any charge of it.
        node_share: Share of every image at every node, shape ``[image_count, node_count]``.
        node_area: Area that every node stands for, shape ``[node_count]``.
        scale: Factor on the density of all images at every node, shape ``[node_count]``: see :meth:`scale_images`.
    """

    def __init__(
        self,
        launcher: Launcher,
        facets: Facets,
        on_device: kernels_facets.Facets,
        *,
        share: np.ndarray,
        attraction: np.ndarray,
        interaction: np.ndarray,
        charge: np.ndarray,
        charge_group: np.ndarray,
        length: float = 1.0,
        softness: Softness | None = None,
        before: Cascade | None = None,
    ) -> None:
        self.launcher, self._length = launcher, length
        self._facets, self._attraction = on_device, attraction
        self.group_count = len(interaction)
        self._interaction = wp.array(interaction.ravel(), dtype=float, device=launcher.device)
        self._charge = launcher.array(charge, float)
        self._group = launcher.array(charge_group, wp.int32)
        # For edits: which tiles there were, and what of every image was on them.
        self._share, self._cuts = share, facets.cuts.copy()

        self._centers = centers_of_tiles(launcher, facets, on_device)
        is_full = share.max(axis=0) > 0.0
        carried = None
        if before is not None and before._length == length and len(before._share) == len(share):
            carried = CarriedTiles(facets, share, before._cuts, before._share)
        self.nodes, self.home = self._nodes_and_homes(before, carried, facets, is_full)
        self.node_count = self.nodes.count
        if before is None or self.nodes is not before.nodes:
            before = carried = None
        surface = TiledSurface(launcher, facets, on_device, self._centers, self.nodes, self.home)

        blur = TargetBlur(
            facets.count,
            uniform_images(share, facets.tile_area),
            softness,
            charge,
            charge_group,
            self.group_count,
        )
        images_before = near_before = None
        is_used = is_full
        if before is not None and carried is not None:
            kept = kept_facets(blur, before._near_target, carried, length)
            if kept is not None:
                images_before, near_before = (before._node_images, carried), (before._near_target, kept)
                is_used = kept.tiles_to_sum(is_full, length)
        quadrature = Quadrature(surface, share, is_used)
        self._node_images: NodeImages = images_at_nodes(surface, quadrature, share, images_before)
        self.node_share, self.node_area = self._node_images.share, self._node_images.area
        self._near_target: NearTarget = sum_near_target(surface, quadrature, self._node_images, blur, near_before)
        self._near_target_on_device = self._near_target.for_kernels(attraction)
        self._near_charges = self._near_part_of_charges(softness)
        # Share of the variance of its place that every charge is blurred by.
        self._variance_share: wp.array | None = None
        if softness is not None and softness.following is not None:
            self._variance_share = launcher.array(softness.following.shares(charge), float)
        self._make_room()
        self.scale_images(np.ones(self.node_count))

    def _make_room(self) -> None:
        """Make the arrays that a step writes."""
        launcher, groups, n = self.launcher, self.group_count, len(self._charge)
        counts = [level.count for level in self.nodes.levels]
        self._sort = CellSort(launcher, n, self.node_count)
        self._sorted = empty_sorted_charges(launcher, n)
        self._node_charge = launcher.zeros(self.node_count * groups, float)
        self._target = launcher.empty(self.node_count * groups, float)
        self._offset = launcher.zeros(self.node_count * groups, float)
        # Of all levels.
        self._charges = [launcher.empty(count * groups, float) for count in counts]
        # Kernels read beyond their ends: see LANES.
        self._potentials = [launcher.zeros((count + LANES) * groups, float) for count in counts]

    def _nodes_and_homes(
        self, before: Cascade | None, carried: CarriedTiles | None, facets: Facets, is_full: np.ndarray
    ) -> tuple[Nodes, wp.array]:
        """Return nodes, if possible those from before, and the home of every tile among them."""
        launcher, centers = self.launcher, self._centers
        if before is not None and before._length == self._length:
            known = None
            if carried is not None:
                was_full = before._share.max(axis=0) > 0.0
                known = np.where(was_full[carried.source] == is_full, carried.source, -1), before.home
            home = before.nodes.homes(centers, is_full, made_for_others=True, known=known)
            if home is not None:
                return before.nodes, home
        full = centers if is_full.all() else chosen(launcher, centers, places_where(launcher, is_full))
        nodes = Nodes(launcher, facets, self._facets, full, self._length)
        home = nodes.homes(centers, is_full)
        assert home is not None
        return nodes, home

    def _near_part_of_charges(self, softness: Softness | None) -> kernels_near_charges.NearPart:
        """Return the near field between charges: which pairs it is summed over, and the force between two charges."""
        near, pairs = kernels_near_charges.NearPart(), self.nodes.pairs
        near.start, near.near, near.cutoff = pairs.start, pairs.entry, self.nodes.cutoff
        near.interaction = self._interaction
        near.blurs, near.core, near.core_end = 0, 0.0, 1.0
        cutoff, blur = NEAR_REACH / math.sqrt(2.0), 0.0
        if softness is not None:
            near.core = softness.core
            if softness.following is None:
                blur, near.core_end = softness.blur, (softness.reach / cutoff) ** 2
            else:
                near.blurs, near.core_end = 1, 0.5 * (softness.reach / softness.blur) ** 2
        near.term = wp.array(near_terms(cutoff, blur), dtype=float, device=self.launcher.device)
        return near

    def evaluate(self, charges: Points, facet: wp.array, weight: wp.array, home: wp.array, field: wp.array) -> None:
        """Write the force per unit charge at every charge.

        Args:
            charges: Positions and normals of the charges, shape ``[n]``.
            facet: Facet that each lies on, ``wp.int32``.
            weight: Weights of that facet's second and third corner, ``wp.vec2``.
            home: Home node of each, that of its tile: see :attr:`home`.
            field: Receives the result, ``wp.vec3``, shape ``[n]``.
        """
        launch, n = self.launcher.launch, len(self._charge)
        with self.launcher.phase("sort"):
            self._sort.sort(kernels_nodes.find_homes, [home])
        at_home = homed(charges, home, self._sort)
        with self.launcher.phase("deposit"):
            launch(
                kernels_cascade.fit_rows,
                n,
                [at_home, self._charge, self._group, self.nodes.weights],
                [self._sorted],
                grain=GRAIN_OF_NEIGHBORS,
            )
            if self._near_target.variance is not None:
                inputs = [at_home.order, self._variance_share, facet, weight, self._near_target.variance, self._facets]
                launch(kernels_cascade.blur_charges, n, inputs, [self._sorted])
            launch(
                kernels_cascade.deposit,
                self.node_count,
                [self._sorted, at_home.start, self.nodes.weights, self.group_count],
                [self._node_charge],
                grain=GRAIN_OF_NEIGHBORS,
            )
        with self.launcher.phase("cascade"):
            self._sum_far_field()
        with self.launcher.phase("near field, interpolation"):
            launch(
                kernels_cascade.evaluate,
                n,
                [
                    at_home,
                    self._sorted,
                    self.nodes.weights,
                    self._potentials[0],
                    self.group_count,
                    self._near_charges,
                    facet,
                    weight,
                    self._facets,
                    self._near_target_on_device,
                ],
                [field],
                grain=GRAIN_OF_NEIGHBORS,
            )

    @property
    def neighbors(self) -> Lists:
        """For every node all nodes within about three lengths, itself among them."""
        return self.nodes.levels[0].octave

    def set_offset(self, offset: np.ndarray) -> None:
        """Set a fixed potential that is added to that of the sources, shape ``[group_count, node_count]``."""
        self._offset.assign(offset.T.astype(np.float32).ravel())

    def tile_of_nodes(self) -> np.ndarray:
        """Return the tile nearest to every node, shape ``[node_count]``.

        A node that is no tile's home, as those beyond edges, has the tile of the nearest node that is one.
        """
        home, way = self.home.numpy(), self._centers.position.numpy()
        way = way - self.nodes.points.position.numpy()[home]
        order = np.lexsort([np.einsum("td,td->t", way, way), home])
        nodes, first = np.unique(home[order], return_index=True)
        tile = np.full(self.node_count, -1)
        tile[nodes] = order[first]
        beyond = np.flatnonzero(tile < 0)
        if len(beyond):
            tile[beyond] = tile[nodes[self.nodes.nearest(beyond, nodes)]]
        return tile

    def scale_images(self, factor: np.ndarray) -> None:
        """Multiply the density of all images in the far field by a factor at every node, and scale each image back to its total.

        The near field depends on how images change within half a spacing, and stays as it is.

        Args:
            factor: Shape ``[node_count]``, none negative.
        """
        self.scale, scaled = factor, self.node_share * factor
        before, after = (share.sum(axis=1, keepdims=True) for share in (self.node_share, scaled))
        self._set_target(scaled * before / np.maximum(after, 1e-300))

    def _set_target(self, node_share: np.ndarray) -> None:
        """Set the images that the far field sees, shape ``[image_count, node_count]``."""
        target = self._attraction @ node_share
        self._target.assign(target.T.astype(np.float32).ravel())

    def _sum_far_field(self) -> None:
        """Find the potential at the nodes of the finest level from the charges at them, through all levels."""
        levels, groups = self.nodes.levels, self.group_count
        charge, potential = self._charges, self._potentials
        self.launcher.launch(
            kernels_cascade.mix_groups,
            self.node_count * groups,
            [self._interaction, groups, self._target, self._node_charge],
            [charge[0]],
        )

        def multiply(lists: Lists | None, value: wp.array, column: wp.array, add: int, result: wp.array) -> None:
            assert lists is not None
            self.launcher.launch(
                kernels_cascade.multiply,
                (len(lists.start) - 1) * groups,
                [lists.start, lists.entry, value, column, groups, add],
                [result],
                grain=GRAIN_OF_NEIGHBORS,
            )

        for number, fine in enumerate(levels[:-1]):
            multiply(fine.down, fine.down_value, charge[number], 0, charge[number + 1])
        self.launcher.launch(kernels_cascade.begin_with, len(self._offset), [self._offset], [potential[0]])
        for number in reversed(range(len(levels))):
            level = levels[number]
            multiply(level.octave, level.octave_value, charge[number], int(number == 0), potential[number])
            if level.up is not None:
                multiply(level.up, level.up_value, potential[number + 1], 1, potential[number])
