"""The electrostatic field of charges and target densities on a surface, by multilevel summation over octaves.

The kernel K = -log r is a sum of Gaussians, one for every octave of their widths: -log r = sum over l of ln 2 exp(-r² / 2 s_l²), with
s_l = 2^(l + 1/2), up to a constant and a ripple of 1e-3. Each is multiplied by how much two places see of each other, (1 + n·m) / 2 of
their normals n and m, which is positive semidefinite as well: 1 on one sheet, 1/2 across a right angle, 0 through a thin wall.

Octaves below l = 0 are summed over pairs of neighbors. Those from l = 0 on go from the charges to *nodes*, points of the surface that
keep a distance, by weights that are exact for linear functions; from these to half as dense nodes for the next octave, and so on; and
all the way back. There is no mesh whose quality would matter, and the work is in proportion to the number of charges (Hardy and
others, Multilevel summation, 2015).

Parts of a surface that stand on one another, as a box on the ground, see each other in the octaves below l = 0 only. That is what
keeps bodies apart. Within the reach of wide ones there may be many things that stand on one ground and do not see each other, of
which K would not be positive semidefinite. Measured on 400 boxes on a ground: with the wide ones errors at 1 spacing are .0158,
without them .0149; the nearest bodies across their feet are .53 and .58 spacings apart.

Units: the solver's length unit is the spacing that the average body sees, its charge unit the mean charge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from ..surface import kernels_facets
from ..surface.facets import Facets
from . import kernels_cascade, kernels_near_charges, kernels_near_target, kernels_nodes
from .carried_tiles import CarriedTiles
from .kernels_points import Points
from .kernels_sorted_charges import CHARGE_PLANES, SortedCharges
from .native_lanes import LANES
from .nodes import NEAR_REACH, Nodes, homed
from .points import Lists, alike, chosen, empty_points, grid_of, nearest_of, taken, thinned
from .softness import Softness, near_force, near_terms

__all__ = ["Cascade"]

# The near part: octaves of the target's, and entries of its table.
NEAR_OCTAVES = 13
TABLE_SIZE = 2048
# Where charges are points, the target of the near part is blurred by this share of the spacing: bodies cannot resolve more, and would
# crowd along its edges.
BLUR = 0.37
# A uniform one has no such edges, and its blur only leaks where the surface ends or bends sharply. Measured with 0.3, 0.33 and 0.37:
# coverage errors of a square at 1 spacing of .0022, .0023 and .0025; of Suzanne at 2 spacings of .0012, .0015 and .0020, and smallest
# spacings, of six seeds, of .75, .77 and .76.
BLUR_OF_UNIFORM = 0.33
# Corners of tiles are in one place, in units, and look to one side, in lengths of a normal, where they differ by less.
SAME_PLACE = 1e-3
SAME_SIDE = 0.125
# Tiles of a larger area [units²] count as four points, smaller ones as one. Measured: coverage errors of a torus of triangles of .1
# to .6 units², at 1 and 2 spacings, are .0016 and .0004 with 0 and with 0.1, .0023 and .0008 with 0.3.
LARGE_TILE = 0.1
QUARTERS = 4
# Shares over areas that differ by less, as a share of them, are the same.
SAME_SHARE = 1e-9
# Distance of what the near part of the target's force is summed over where there is far more of it.
SOURCE_DISTANCE = 0.3
MANY_SOURCES = 4.0
# Charges go to nodes that are not as far from them as this, in lengths.
WEIGHED_WITHIN = 2.6
# How far from all that changed the near part of the target's force is as it was: it ends after 2.7 lengths, and what it is blurred by
# follows densities within 2.5.
FAR_FROM_CHANGES = 5.5
# Where densities changed by less [log], in one edit or in several, what was blurred for them before will do: by a twentieth, of which
# nobody sees anything.
MOST_DENSER = 0.05
# Largest variance of the blur of a charge, in squared lengths: what is blurred more is still seen where the near part ends.
WIDEST_VARIANCE = 0.3


class _Parts:
    """Points that stand for tiles: four for a large one, one for a small one. First parts of all tiles come first, and so on.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same as kernels take it.
        is_full: Which tiles are looked at, shape ``[tile_count]``.
        columns: Numbers that every tile has and its parts share, shape ``[column_count, tile_count]``; the last is its area.
        large: Area from which on a tile is large, in units.

    Attributes:
        points: The points.
        tile: For the first parts, and for the second, third and fourth if any tile has them: tiles that do, ``wp.int32``.
    """

    def __init__(
        self,
        launcher: Launcher,
        facets: Facets,
        on_device: kernels_facets.Facets,
        is_full: np.ndarray,
        columns: Sequence[np.ndarray],
        large: float,
    ) -> None:
        self._launcher = launcher
        tiles_of_facet = facets.cuts**2
        is_large = facets.area / tiles_of_facet > large
        full = _places(launcher, is_full)
        split = full if is_large.all() else _places(launcher, is_full & np.repeat(is_large, tiles_of_facet))
        self.tile = [full, *[split] * (QUARTERS - 1 if len(split) else 0)]
        self._end = np.cumsum([len(tile) for tile in self.tile]).tolist()
        self.points = empty_points(launcher, self._end[-1])
        for number, tile in enumerate(self.tile):
            own = self.quarter(number)
            inputs = [tile, number, facets.count, on_device]
            launcher.launch(kernels_facets.locate_parts, len(tile), inputs, [own.position, own.normal, own.label])
        share = np.repeat(np.where(is_large, 1.0 / QUARTERS, 1.0).astype(np.float32), tiles_of_facet)
        self._amount = [launcher.array((column * share).astype(np.float32), float) for column in columns]

    def quarter(self, number: int) -> Points:
        """The first, second, third or fourth parts of the tiles that have them: a view of the points."""
        first, end = self._end[number] - len(self.tile[number]), self._end[number]
        points = Points()
        points.position, points.normal = self.points.position[first:end], self.points.normal[first:end]
        points.label = self.points.label[first:end]
        return points

    def amounts(self, number: int, column: int) -> wp.array:
        """What the points of a quarter have of a column."""
        return taken(self._launcher, self.tile[number], self._amount[column])

    def all_amounts(self, columns: int) -> wp.array:
        """What all points have of the first columns, one column after the other."""
        count = len(self.points.position)
        result = self._launcher.empty(columns * count, float)
        for column in range(columns):
            for number, tile in enumerate(self.tile):
                wp.copy(result, self.amounts(number, column), column * count + self._end[number] - len(tile))
        return result


class _BlurredFor:
    """What the near part of a target's force is blurred for, facet by facet.

    Args:
        facet_count: Number of facets.
        uniform: Which images are uniform.
        softness: How soft charges are.
        charge: Charge of every particle.
        charge_group: Its group.
        group_count: Number of groups.

    Attributes:
        shares: Of the variance of a mean charge, those that forces are found for.
        of_group: Which of these every group has.
        of_target: Share that the target is blurred by.
    """

    def __init__(
        self,
        facet_count: int,
        uniform: np.ndarray,
        softness: Softness | None,
        charge: np.ndarray,
        charge_group: np.ndarray,
        group_count: int,
    ) -> None:
        self.shares, self.of_group, self.of_target = np.ones(1), np.zeros(group_count, np.int32), 1.0
        self._following = None if softness is None else softness.following
        # Points know two blurs; and a softness that follows the density does so in one way, however many charges there are.
        kinds = uniform.tolist() if softness is None else []
        if softness is not None and softness.following is not None:
            following = softness.following
            self.shares, self.of_group = following.shares_of_groups(charge, charge_group, group_count)
            self.of_target = float(np.average(following.shares(charge), weights=charge))
            softness = softness._replace(following=following._replace(number=()))
        self._how = (softness, kinds, self.shares.tolist(), round(self.of_target, 6))
        # Charges now over those that there were, image after image.
        self._density = np.ones((len(uniform), facet_count))

    def carry(self, before: _BlurredFor, factor: np.ndarray) -> np.ndarray:
        """Tell on which facets the forces from before are blurred about as they would be now, shares having changed by factors."""
        if self._how != before._how:
            return np.zeros(self._density.shape[1], bool)
        if self._following is not None:
            assert before._following is not None
            change = factor * np.array(self._following.number) / np.maximum(before._following.number, 1e-300)
            self._density = before._density * change[:, None]
        return (np.abs(np.log(np.maximum(self._density, 1e-300))) < MOST_DENSER).all(axis=0)

    def forget(self, facets: np.ndarray) -> None:
        """On these facets forces are found anew."""
        self._density[:, facets] = 1.0


class _Known(NamedTuple):
    """What a cascade takes from another one with the same nodes.

    Attributes:
        cascade: The other one.
        carried: Which of its tiles are as they were.
        kept: On which facets the near part of the target's force is, shape ``[f]``.
    """

    cascade: Cascade
    carried: CarriedTiles
    kept: np.ndarray


class Cascade:
    """Evaluates the force per unit charge, -grad of sum_h M[g, h] K * (rho_h - u_h), at every charge of group g.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same as kernels take it.
        share: Share of every image that lies on every tile, shape ``[column_count, tile_count]``; rows add up to 1.
        attraction: Charge of every image that every group sees, shape ``[group_count, column_count]``.
        interaction: M, shape ``[group_count, group_count]``.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.
        length: Spacing that it is to resolve, in units.
        softness: How soft charges are; None for points, before a target that is blurred a little.
        before: Another one of the same surface, of which is taken again what will do.

    Attributes:
        nodes: What charges are shared out among.
        home: Node that is the home of charges on a tile, ``wp.int32``, shape ``[tile_count]``. Where no image asks for any, and no
            node is near, it is the first: too far away to do anything.
        node_count: Number of nodes of the first level.
        node_share: Share of every image at every node, shape ``[column_count, node_count]``.
        node_area: Area that every node stands for, shape ``[node_count]``.
        scale: How many times as dense as given images are seen at every node: see :meth:`scale_images`.
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
        self.launcher, self._length, self._softness = launcher, length, softness
        self._following = None if softness is None else softness.following
        device = launcher.device
        self._facets = on_device
        self.group_count = len(interaction)
        self._interaction = wp.array(interaction.ravel(), dtype=float, device=device)
        self._charge = launcher.array(charge, float)
        self._group = launcher.array(charge_group, wp.int32)
        uniform = _same_everywhere(share, facets.tile_area)

        self._tiles, self._attraction = _middles(launcher, facets, on_device), attraction
        is_full = share.max(axis=0) > 0.0
        self._share, self._cuts = share, facets.cuts.copy()
        carried = None
        if before is not None and before._length == length and len(before._share) == len(share):
            carried = CarriedTiles(facets, share, before._cuts, before._share)
        self.nodes, self.home = self._serving(before, carried, facets, is_full)
        if before is None or self.nodes is not before.nodes:
            before = carried = None
        self.node_count = self.nodes.count
        self._weights, pairs = self.nodes.weights, self.nodes.pairs
        self._nearby = kernels_near_charges.NearPart()
        self._nearby.start, self._nearby.near, self._nearby.cutoff = pairs.start, pairs.entry, self.nodes.cutoff
        self._nearby.interaction = self._interaction
        self._set_softness(charge)
        self._blurred_for = _BlurredFor(facets.count, uniform, self._softness, charge, charge_group, self.group_count)
        known = None if before is None or carried is None else self._known(before, carried)
        parts = _Parts(
            launcher,
            facets,
            on_device,
            is_full if known is None else self._looked_at(known, is_full),
            [*share, facets.tile_area],
            LARGE_TILE * length**2,
        )
        self.node_share, self.node_area = self._shared_out(parts, facets.tile_area, is_full, known)
        self._target_nearby = self._find_near_target(facets, parts, uniform, known)
        self._target = launcher.empty(self.node_count * self.group_count, float)
        self.scale_images(np.ones(self.node_count))
        counts = [level.count for level in self.nodes.levels]
        self._charges = [launcher.empty(count * self.group_count, float) for count in counts]
        # Kernels read beyond their ends: see LANES.
        self._potentials = [launcher.zeros((count + LANES) * self.group_count, float) for count in counts]
        n = len(charge)
        self._sort = CellSort(launcher, n, self.node_count)
        self._sorted = _room_for_sorted(launcher, n)
        self._node_charge = launcher.zeros(self.node_count * self.group_count, float)
        self._offset = launcher.zeros(self.node_count * self.group_count, float)

    def evaluate(self, charges: Points, facet: wp.array, weight: wp.array, home: wp.array, field: wp.array) -> None:
        """Write the force per unit charge at every charge.

        Args:
            charges: Where they are.
            facet: Facet of each.
            weight: Weights of that facet's second and third corner.
            home: Their homes: see :attr:`home`.
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
                [at_home, self._charge, self._group, self._weights],
                [self._sorted],
                grain=GRAIN_OF_NEIGHBORS,
            )
            if self._variance is not None:
                inputs = [at_home.order, self._charge_share, facet, weight, self._variance, self._facets]
                launch(kernels_cascade.blur_charges, n, inputs, [self._sorted])
            launch(
                kernels_cascade.deposit,
                self.node_count,
                [self._sorted, at_home.start, self._weights, self.group_count],
                [self._node_charge],
                grain=GRAIN_OF_NEIGHBORS,
            )
        with self.launcher.phase("cascade"):
            self._cascade()
        with self.launcher.phase("near field, interpolation"):
            launch(
                kernels_cascade.evaluate,
                n,
                [
                    at_home,
                    self._sorted,
                    self._weights,
                    self._potentials[0],
                    self.group_count,
                    self._nearby,
                    facet,
                    weight,
                    self._facets,
                    self._target_nearby,
                ],
                [field],
                grain=GRAIN_OF_NEIGHBORS,
            )

    @property
    def neighbors(self) -> Lists:
        """Nodes within about three lengths of every node, each with itself."""
        return self.nodes.levels[0].octave

    def set_offset(self, offset: np.ndarray) -> None:
        """Give every group a potential of its own at every node, shape ``[group_count, node_count]``, that is added to the others."""
        self._offset.assign(offset.T.astype(np.float32).ravel())

    def tile_of_nodes(self) -> np.ndarray:
        """The tile that is nearest to every node, shape ``[node_count]``; of a node beyond an edge, that of the nearest other node."""
        home, way = self.home.numpy(), self._tiles.position.numpy()
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
        """Let the octaves from l = 0 on see images as that many times as dense, and as a whole no more than before.

        Those below go by how images change within half a spacing, and stay as they are.

        Args:
            factor: Shape ``[node_count]``, none negative.
        """
        self.scale, scaled = factor, self.node_share * factor
        before, after = (share.sum(axis=1, keepdims=True) for share in (self.node_share, scaled))
        self._set_target(scaled * before / np.maximum(after, 1e-300))

    def _set_target(self, node_share: np.ndarray) -> None:
        """Let the octaves from l = 0 on see images of which there is so much at every node, ``[column_count, node_count]``."""
        target = self._attraction @ node_share
        self._target.assign(target.T.astype(np.float32).ravel())

    def _cascade(self) -> None:
        """From the charges at the nodes to the potential there."""
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

    def _serving(
        self,
        before: Cascade | None,
        carried: CarriedTiles | None,
        facets: Facets,
        is_full: np.ndarray,
    ) -> tuple[Nodes, wp.array]:
        """Nodes, those from before if they will do, and the homes of tiles among them."""
        launcher, tiles = self.launcher, self._tiles
        if before is not None and before._length == self._length:
            known = None
            if carried is not None:
                was_full = before._share.max(axis=0) > 0.0
                known = np.where(was_full[carried.source] == is_full, carried.source, -1), before.home
            home = before.nodes.homes(tiles, is_full, made_for_others=True, known=known)
            if home is not None:
                return before.nodes, home
        middles = tiles if is_full.all() else chosen(launcher, tiles, _places(launcher, is_full))
        nodes = Nodes(launcher, facets, self._facets, middles, self._length)
        home = nodes.homes(tiles, is_full)
        assert home is not None
        return nodes, home

    def _make_table(self, uniform: np.ndarray) -> kernels_near_target.NearTable:
        """The near part between a charge and the target, up to where it ends: octaves of Gaussians, blurred as every image needs."""
        squares = self._length**2 * 4.0 ** (0.5 - np.arange(1, NEAR_OCTAVES + 1))
        cutoff = NEAR_REACH * math.sqrt(squares[0] + (BLUR * self._length) ** 2)
        square = np.linspace(0.0, cutoff**2, TABLE_SIZE + 1)[:, None]
        force = []
        for share in (BLUR, BLUR_OF_UNIFORM):
            if self._softness is not None:
                width = self._softness.blur if self._following is None else 0.0
                force.append(near_force(square[:, 0] / self._length**2, width))
                continue
            blurred = squares + (share * self._length) ** 2
            ratio = square / blurred
            force.append((math.log(2.0) * squares / blurred * ratio * np.exp(-0.5 * ratio)).sum(axis=1))
        table = kernels_near_target.NearTable()
        table.force = wp.array(np.concatenate(force), dtype=float, device=self.launcher.device)
        table.kind = wp.array(uniform.astype(np.int32), dtype=wp.int32, device=self.launcher.device)
        table.size = TABLE_SIZE + 1
        table.scale, table.cutoff = TABLE_SIZE / cutoff**2, cutoff
        table.blurs = int(self._following is not None)
        return table

    def _set_softness(self, charge: np.ndarray) -> None:
        """Say what the near part between two charges is."""
        near, softness = self._nearby, self._softness
        cutoff, blur = NEAR_REACH / math.sqrt(2.0), 0.0
        near.blurs, near.core, near.core_end = 0, 0.0, 1.0
        if softness is not None:
            near.core = softness.core
            if self._following is None:
                blur, near.core_end = softness.blur, (softness.reach / cutoff) ** 2
            else:
                near.blurs, near.core_end = 1, 0.5 * (softness.reach / softness.blur) ** 2
                self._charge_share = self.launcher.array(self._following.shares(charge), float)
        terms = near_terms(cutoff, blur)
        near.term = wp.array(terms, dtype=float, device=self.launcher.device)

    def _variances(self, points: Points, home: wp.array) -> wp.array:
        """Variance of the blur of a mean charge at points, by their homes."""
        softness, following = self._softness, self._following
        assert softness is not None
        assert following is not None
        launcher, square = self.launcher, self._length**2
        number = launcher.array(np.array(following.number) @ self.node_share, float)
        area = launcher.array(self.node_area, float)
        usual = 0.5 * softness.blur**2 * square
        bounds = (following.lowest * usual, min(following.widest * usual, WIDEST_VARIANCE * square))
        result = launcher.empty(len(home), float)
        launcher.launch(
            kernels_cascade.follow_density,
            len(home),
            [points, home, self._weights, number, area, self._length, usual, following.exponent, *bounds],
            [result],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return result

    def _known(self, before: Cascade, carried: CarriedTiles) -> _Known | None:
        """What is taken from another cascade with the same nodes; None for nothing."""
        kept = self._blurred_for.carry(before._blurred_for, carried.factor)
        if kept.any():
            kept &= ~carried.are_facets_near(FAR_FROM_CHANGES * self._length)
        self._blurred_for.forget(~kept)
        return _Known(before, carried, kept) if kept.any() else None

    def _looked_at(self, known: _Known, is_full: np.ndarray) -> np.ndarray:
        """Which tiles of those that are full have to do with what is found anew, shape ``[tile_count]``."""
        facets = known.carried.facets
        near = facets.near(~known.kept, NEAR_REACH * self._length + 2.0 * facets.across)
        looked_at = is_full & np.repeat(near, facets.cuts**2)
        # Kernels want something to look at.
        looked_at[np.argmax(is_full)] = True
        return looked_at

    def _find_near_target(
        self, facets: Facets, parts: _Parts, uniform: np.ndarray, known: _Known | None
    ) -> kernels_cascade.NearTarget:
        """Find the near part of the target's force at the corners of all tiles, for every share of the blur, image after image.

        What is known from another cascade is taken from there, and only what else there is is seen by ``parts``.
        """
        launcher, count, columns = self.launcher, facets.corner_count, self._attraction.shape[1]
        vectors = len(self._blurred_for.shares) * columns
        force = launcher.empty(vectors * count, wp.vec3)
        self._variance = None if self._following is None else launcher.empty(count, float)
        new = launcher.array(np.arange(count, dtype=np.int32), wp.int32)
        if known is not None:
            new = self._carry_near_target(known, force, vectors)
        if len(new):
            self._sum_near_target(facets, parts, self._make_table(uniform), new, force)
        target = kernels_cascade.NearTarget()
        target.force, target.corner_count, target.column_count = force, count, columns
        target.attraction = wp.array(self._attraction.ravel(), dtype=float, device=launcher.device)
        target.share = wp.array(self._blurred_for.of_group, dtype=wp.int32, device=launcher.device)
        return target

    def _sum_near_target(
        self, facets: Facets, parts: _Parts, table: kernels_near_target.NearTable, new: wp.array, force: wp.array
    ) -> None:
        """Sum the near part of the target's force at new corners of tiles, ``wp.int32``."""
        launcher, count, columns = self.launcher, facets.corner_count, self._attraction.shape[1]
        at_corners, tile = empty_points(launcher, count), launcher.empty(count, wp.int32)
        outputs = [at_corners.position, at_corners.normal, tile]
        launcher.launch(kernels_facets.locate_corners, count, [facets.count, self._facets], outputs)
        at_corners.label = taken(launcher, tile, self._tiles.label)
        if len(new) < count:
            at_corners, tile = chosen(launcher, at_corners, new), taken(launcher, new, tile)
        # Corners of neighboring facets that lie in one place, and look to nearly the same side, have the same force.
        cell = max(SAME_PLACE, facets.extent / (1 << 20))
        first, which = alike(launcher, at_corners, -0.5 * (facets.size + cell), cell, 1.0 / SAME_SIDE)
        corners, variance = chosen(launcher, at_corners, first), launcher.empty(0, float)
        if self._variance is not None:
            variance = self._variances(corners, taken(launcher, taken(launcher, first, tile), self.home))
            launcher.launch(kernels_near_target.put_numbers, len(new), [new, which, variance], [self._variance])
        sources, source_count = self._sources(facets, parts, columns, table.cutoff)
        shares = self._blurred_for.shares.tolist()
        few = launcher.empty(len(shares) * columns * len(first), wp.vec3)
        for number, share in enumerate(shares):
            place = number * columns * len(first)
            inputs = [corners, sources, *self.nodes.related, columns, source_count, table, variance, share, place]
            launcher.launch(kernels_near_target.sum_near_target, len(first), inputs, [few], grain=GRAIN_OF_NEIGHBORS)
        inputs = [new, which, len(shares) * columns, few]
        launcher.launch(kernels_near_target.put_forces, len(new), inputs, [force])

    def _carry_near_target(self, known: _Known, force: wp.array, vectors: int) -> wp.array:
        """Carry over forces, and variances, of facets that are kept; return all other corners, ``wp.int32``."""
        launcher, (before, carried, kept) = self.launcher, known
        source = carried.corners_before(kept)
        on_device = launcher.array(source, wp.int32)
        factor = np.tile(carried.factor, vectors // len(carried.factor)).astype(np.float32)
        inputs = [on_device, before._target_nearby.force, launcher.array(factor, float)]
        launcher.launch(kernels_near_target.carry_forces, len(source), inputs, [force])
        if self._variance is not None:
            inputs = [on_device, before._variance]
            launcher.launch(kernels_near_target.carry_numbers, len(source), inputs, [self._variance])
        return _places(launcher, source < 0)

    def _sources(
        self, facets: Facets, parts: _Parts, columns: int, cutoff: float
    ) -> tuple[kernels_near_target.Sources, int]:
        """What the near part of the target's force is summed over, in the order of its cells, and how many points that are."""
        launcher, points, charge = self.launcher, parts.points, parts.all_amounts(columns)
        variance, on_host = None, None
        if self._following is not None:
            homes = np.concatenate([taken(launcher, tile, self.home).numpy() for tile in parts.tile])
            variance = self._blurred_for.of_target * self._variances(points, launcher.array(homes, wp.int32)).numpy()
        # On a mesh that is finer than bodies can tell, many points count as one.
        apart = SOURCE_DISTANCE * self._length
        if len(points.position) * apart**2 > MANY_SOURCES * facets.area.sum():
            points, on_host, variance = self._fewer(points, charge, columns, apart, variance)
        count = len(points.position)
        if variance is not None:
            columns += 1
            on_host = np.concatenate([charge.numpy() if on_host is None else on_host, variance.astype(np.float32)])
        if on_host is not None:
            charge = launcher.array(on_host, float)
        sources = kernels_near_target.Sources()
        sources.grid = grid_of(launcher, points.position, cutoff)
        # Kernels read beyond the ends: see LANES.
        sources.label = launcher.zeros(count + LANES, wp.int32)
        sources.plane = launcher.zeros((6 + columns) * count + LANES, float)
        launcher.launch(kernels_near_target.sort_sources, count, [points, charge, columns], [sources])
        return sources, count

    def _fewer(
        self, points: Points, charge: wp.array, columns: int, apart: float, variance: np.ndarray | None
    ) -> tuple[Points, np.ndarray, np.ndarray | None]:
        """Fewer points, so far apart, that have the charges of those near them, column after column, and lie in their middle.

        The variances of their blurs, where these differ, are means.
        """
        launcher, count = self.launcher, len(points.position)
        few = chosen(launcher, points, thinned(launcher, points, apart))
        nearest = nearest_of(launcher, points, few, 2.0 * apart, apart).numpy()

        def added(values: np.ndarray) -> np.ndarray:
            return np.bincount(nearest, values, len(few.position))

        summed = np.concatenate([added(column) for column in charge.numpy().reshape(columns, count)])
        number = np.bincount(nearest, minlength=len(few.position))
        middle = np.stack([added(axis) / number for axis in points.position.numpy().astype(np.float64).T], axis=1)
        few.position.assign(middle.astype(np.float32))
        variance = None if variance is None else added(variance) / number
        return few, summed.astype(np.float32), variance

    def _shared_out(
        self, parts: _Parts, area: np.ndarray, is_full: np.ndarray, known: _Known | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Share images out among the nodes, as charges are; and the area of the tiles that are full.

        Every part of a tile goes by itself: from the middles of tiles alone, large ones would be blurred less than small ones, and
        bodies would follow where the two meet.

        Args:
            parts: What images are on, with the share of every image and, last, the area.
            area: Of every tile, shape ``[tile_count]``.
            is_full: Which tiles have any density, shape ``[tile_count]``.
            known: What is taken from another cascade, of which nodes far from all changes are.
        """
        launcher, share = self.launcher, self._share
        columns, total = len(share), share.sum(axis=1)
        # As much of them is on every tile that is full as this has area.
        full_area = area if is_full.all() else area[is_full]
        uniform = _same_everywhere(share if is_full.all() else share[:, is_full], full_area)
        result = np.zeros((columns + 1, self.node_count))
        room = None
        for number, tile in enumerate(parts.tile):
            at_home = self._homed(parts.quarter(number), taken(launcher, tile, self.home))
            if room is None or len(room.group) != len(tile):
                room = _room_for_sorted(launcher, len(tile))
            for column in [*np.flatnonzero(~uniform).tolist(), columns]:
                result[column] += self._deposited(at_home, parts.amounts(number, column), room)
        if known is not None:
            before, carried = known.cascade, known.carried
            away = ~carried.is_near(self.nodes.points.position.numpy(), WEIGHED_WITHIN * self._length)
            result[:-1, away] = carried.factor[:, None] * before.node_share[:, away]
            result[-1, away] = before.node_area[away]
        result[:-1][uniform] = total[uniform, None] / float(full_area.sum()) * result[-1]
        return result[:-1], result[-1]

    def _homed(self, points: Points, home: wp.array) -> kernels_nodes.Homed:
        """Points whose homes are known, sorted by these."""
        sort = CellSort(self.launcher, len(home), self.node_count)
        sort.sort(kernels_nodes.find_homes, [home])
        return homed(points, home, sort)

    def _deposited(self, at_home: kernels_nodes.Homed, amount: wp.array, room: SortedCharges) -> np.ndarray:
        """What every node gets of points that have so much each."""
        launcher, count = self.launcher, len(amount)
        launcher.launch(
            kernels_cascade.fit_rows,
            count,
            [at_home, amount, launcher.zeros(count, wp.int32), self._weights],
            [room],
            grain=GRAIN_OF_NEIGHBORS,
        )
        received = launcher.empty(self.node_count, float)
        launcher.launch(
            kernels_cascade.deposit,
            self.node_count,
            [room, at_home.start, self._weights, 1],
            [received],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return received.numpy()


def _middles(launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets) -> Points:
    """Middles of all tiles."""
    tiles = empty_points(launcher, facets.tile_count)
    outputs = [tiles.position, tiles.normal, tiles.label]
    launcher.launch(kernels_facets.locate_tiles, facets.tile_count, [facets.count, on_device], outputs)
    return tiles


def _places(launcher: Launcher, mask: np.ndarray) -> wp.array:
    """Where a mask is true, ``wp.int32``."""
    return launcher.array(np.flatnonzero(mask).astype(np.int32), wp.int32)


def _same_everywhere(share: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Which images are uniform, shape ``[column_count]``: they have as much of every tile as it has area."""
    ratio = share / area
    return ratio.max(axis=1) - ratio.min(axis=1) <= SAME_SHARE * ratio.max(axis=1)


def _room_for_sorted(launcher: Launcher, count: int) -> SortedCharges:
    """Room for charges in the order of their homes."""
    charges = SortedCharges()
    charges.group = launcher.empty(count, wp.int32)
    charges.plane = launcher.zeros(CHARGE_PLANES * count + LANES, float)
    return charges
