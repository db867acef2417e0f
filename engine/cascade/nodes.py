"""Nodes of the far field: points of a surface that keep a distance, in levels, one for every octave.

Charges are deposited on the nodes of the finest level, by weights with compact support that are corrected to be exact for linear
functions (a moving least squares fit). In the same way charges at the nodes of one level go to those of the next, which lie twice as
far apart. The transposed weights interpolate potentials. At each level a sparse matrix holds the octave's Gaussian between nodes. The
weights of both ways blur it by some variance, so its own variance is smaller by that.

A point finds the nodes near it through its *home*: the node nearest to it, which has a list of its neighbors.

Nodes depend on the surface, and on where there is any density at all; not on how much of it there is, nor on the charges. So they can
be used again after an edit of the densities: see :meth:`Nodes.homes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.running_sum import running_sum
from ..space.cell_sort import CellSort
from ..surface import kernels_facets
from ..surface.facets import Facets
from . import kernels_nodes
from .beyond_edges import with_nodes_beyond_edges
from .kernels_points import Points
from .native_lanes import LANES
from .points import Lists, chosen, lists_of, nearest_of, room_for, runs_of, thinned

__all__ = ["NEAR_REACH", "NodeLevel", "Nodes", "homed"]

# All distances are in lengths of the level, if nothing else is said.
# Least distance of two nodes.
NODE_DISTANCE = 0.7
# Greatest distance of a tile with density from its home, and the same where nodes were made for another density: if a tile has no node
# so near, new nodes are made.
HOME_REACH = 1.5
HOME_REACH_OF_OTHERS = 1.0
# Greatest distance of a tile without density from its home.
FAR_HOME_REACH = 6.0
# When the nearest node is looked for, a difference between normals counts as a distance this many times as long.
HOME_TURN = 2.0
# Width of the weights; where they end, in widths; and greatest distance of a finer node from its home among the coarser ones.
WIDTH = 0.8
WEIGHT_REACH = math.sqrt(kernels_nodes.REACH_SQUARED)
HOME_DISTANCE = 0.8
# Where the Gaussian of an octave is cut off, in its standard deviations; and the same for the widest Gaussian of the near field.
OCTAVE_REACH = 3.5
NEAR_REACH = 3.6
# Nodes whose normals have a smaller cosine are opposite sides of a sheet, and do not see each other.
LEAST_COSINE = -0.95
# A level with fewer nodes is the coarsest.
FEWEST_NODES = 12


@dataclass(frozen=True, eq=False)
class NodeLevel:
    """Sparse matrices of a level: rows are lists of columns, and the values of these are ``float``.

    The last four are None at the coarsest level.

    Attributes:
        count: Number of nodes of the level.
        octave: For every node those that it sees.
        octave_value: The octave's Gaussian between the two.
        up: For every node the coarser ones that its charge goes to.
        up_value: Share of the charge that each gets.
        down: For every coarser node those whose charges go to it: the transposed matrix.
        down_value: Share of their charges that it gets.
    """

    count: int
    octave: Lists
    octave_value: wp.array
    up: Lists | None = None
    up_value: wp.array | None = None
    down: Lists | None = None
    down_value: wp.array | None = None


class Nodes:
    """Nodes of a surface, level after level.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same facets, as kernels take them.
        full: Centers of the tiles that have any density.
        length: Spacing that is to be resolved, in units.

    Attributes:
        length: That spacing.
        points: Nodes of the finest level: those on the surface, and others beyond its edges.
        count: Number of these nodes.
        weights: Weights by which points are deposited on them.
        pairs: For every node the nodes whose charges are in the near field of its own, as runs, ``wp.vec2i``.
        cutoff: Distance at which the near field ends, in units.
        related: Which parts of the surface stand on one another, for kernels.
        levels: Matrices of the levels, from the finest to the coarsest.
    """

    def __init__(
        self, launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets, full: Points, length: float
    ) -> None:
        self._launcher, self.length = launcher, length
        width, apart = WIDTH * length, NODE_DISTANCE * length
        self._on_surface = chosen(launcher, full, thinned(launcher, full, apart))
        self.points, self._place = with_nodes_beyond_edges(
            launcher, facets, on_device, self._on_surface, apart=apart, reach=WEIGHT_REACH * width, length=length
        )
        self.count = len(self.points.position)
        self.weights = _weights_of(launcher, self.points, width, length)
        self.cutoff = NEAR_REACH / math.sqrt(2.0) * length
        numbers, relations = facets.relations.behind(np.zeros(1), int(facets.label.max()) + 1, length)
        self.related = launcher.array(numbers, wp.int32), relations
        reach = self.cutoff + 2.0 * NODE_DISTANCE * length
        near = lists_of(launcher, self.points, self.points, reach, LEAST_COSINE, self.related)
        self.pairs = runs_of(launcher, near, self.points)
        self.levels = self._make_levels(facets.extent * math.sqrt(3.0))

    def homes(
        self,
        tiles: Points,
        is_full: np.ndarray,
        *,
        made_for_others: bool = False,
        known: tuple[np.ndarray, wp.array] | None = None,
    ) -> wp.array | None:
        """Return the home of every tile, a node on the surface, ``wp.int32``, shape ``[tile_count]``.

        Args:
            tiles: Centers of the tiles.
            is_full: Which of them have any density.
            made_for_others: Whether the nodes were made for another density. If so, the result is None if any tile with density has no
                node near it.
            known: Homes from before an edit: which tile each one was then, -1 for new ones, and the homes of the tiles then,
                ``wp.int32``.
        """
        launcher, length, count = self._launcher, self.length, len(is_full)
        result, is_new = launcher.zeros(count, wp.int32), np.ones(count, bool)
        if known is not None:
            is_new = known[0] < 0
            inputs = [launcher.array(known[0].astype(np.int32), wp.int32), known[1]]
            launcher.launch(kernels_nodes.carry_homes, count, inputs, [result])

        def find(own: np.ndarray, reach: float, turn: float) -> wp.array:
            number = launcher.array(np.flatnonzero(own).astype(np.int32), wp.int32)
            points = chosen(launcher, tiles, number) if len(number) < count else tiles
            near = nearest_of(launcher, points, self._on_surface, reach, turn)
            launcher.launch(kernels_nodes.settle, len(number), [number, near, self._place], [result])
            return near

        reach = HOME_REACH_OF_OTHERS if made_for_others else HOME_REACH
        near = find(is_full & is_new, reach * length, HOME_TURN * length)
        if made_for_others and (near.numpy() < 0).any():
            return None
        if not is_full.all():
            # Fixed bodies may lie there, and ends of lines.
            find(~is_full & is_new, FAR_HOME_REACH * length, 0.0)
        return result

    def nearest(self, some: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return which of the nodes ``others`` is nearest to each of the nodes ``some``; 0 if all are far.

        Returns:
            Indices of ``others``, shape ``[some_count]``.
        """
        launcher = self._launcher
        of_some, of_others = (
            chosen(launcher, self.points, launcher.array(number.astype(np.int32), wp.int32))
            for number in (some, others)
        )
        return np.maximum(nearest_of(launcher, of_some, of_others, FAR_HOME_REACH * self.length, 0.0).numpy(), 0)

    def _make_levels(self, diagonal: float) -> list[NodeLevel]:
        """Make one level after the other, until its octave is as wide as the surface, whose diagonal this is [units]."""
        launcher, nodes, length = self._launcher, self.points, self.length
        width = WIDTH * length
        levels: list[NodeLevel] = []
        while True:
            octave = math.sqrt(2.0) * length
            # The weights of both ways blur the Gaussian by their variance, so it is made narrower, and higher, by that.
            rest = math.sqrt(octave**2 - 2.0 * width**2)
            near = lists_of(launcher, nodes, nodes, min(OCTAVE_REACH * rest, 2.0 * diagonal), LEAST_COSINE)
            value = room_for(launcher, len(near.entry), float)
            count = len(nodes.position)
            height = math.log(2.0) * (octave / rest) ** 2
            launcher.launch(kernels_nodes.weigh_octave, count, [nodes, near.start, near.entry, rest, height], [value])
            if octave > diagonal or count < FEWEST_NODES:
                return [*levels, NodeLevel(count, near, value)]
            kept = thinned(launcher, nodes, 2.0 * NODE_DISTANCE * length, crowded=False)
            coarse = chosen(launcher, nodes, kept)
            wider = math.sqrt(3.0) * width
            levels.append(NodeLevel(count, near, value, *_between(launcher, nodes, coarse, 2.0 * length, wider)))
            nodes, length, width = coarse, 2.0 * length, 2.0 * width


def homed(points: Points, home: wp.array, sort: CellSort) -> kernels_nodes.Homed:
    """Return points with their homes, and in the order of these."""
    result = kernels_nodes.Homed()
    result.points, result.home, result.order, result.start = points, home, sort.order, sort.cell_start
    return result


def _between(
    launcher: Launcher, fine: Points, coarse: Points, length: float, width: float
) -> tuple[Lists, wp.array, Lists, wp.array]:
    """Return the matrix from finer nodes to coarser ones and its transpose: lists and values of each (see :class:`NodeLevel`)."""
    count, coarse_count = len(fine.position), len(coarse.position)
    weights = _weights_of(launcher, coarse, width, length)
    # Every finer node has a home within this distance, because the coarser ones were chosen among them so that no other fits between.
    # The two matrices agree only if homes are no farther.
    home = nearest_of(launcher, fine, coarse, HOME_DISTANCE * length, HOME_TURN * length)
    sort = CellSort(launcher, count, coarse_count)
    sort.sort(kernels_nodes.find_homes, [home])
    at_home = homed(fine, home, sort)
    row = launcher.empty(count, kernels_nodes.Row)
    launcher.launch(kernels_nodes.fit_rows_in_place, count, [at_home, weights], [row], grain=GRAIN_OF_NEIGHBORS)

    def shares(to_nodes: int, number: int) -> tuple[Lists, wp.array]:
        found = launcher.empty(number, wp.int32)
        inputs = [to_nodes, at_home, weights]
        launcher.launch(kernels_nodes.count_shares, number, inputs, [found], grain=GRAIN_OF_NEIGHBORS)
        start, total = running_sum(launcher, found)
        entry, value = room_for(launcher, total, wp.int32), room_for(launcher, total, float)
        inputs = [to_nodes, at_home, row, weights, start]
        launcher.launch(kernels_nodes.list_shares, number, inputs, [entry, value], grain=GRAIN_OF_NEIGHBORS)
        return Lists(start, entry), value

    return (*shares(0, count), *shares(1, coarse_count))


def _weights_of(launcher: Launcher, nodes: Points, width: float, length: float) -> kernels_nodes.Weights:
    """Return the weights, of a width, by which points are deposited on nodes of a level, of a length; both in units."""
    near = runs_of(launcher, lists_of(launcher, nodes, nodes, WEIGHT_REACH * width + HOME_DISTANCE * length), nodes)
    weights = kernels_nodes.Weights()
    weights.nodes, weights.start, weights.near, weights.width = nodes, near.start, near.entry, width
    count = len(nodes.position)
    weights.plane = launcher.zeros(kernels_nodes.NODE_PLANES * count + LANES, float)
    launcher.launch(kernels_nodes.fill_planes, count, [nodes], [weights.plane])
    return weights
