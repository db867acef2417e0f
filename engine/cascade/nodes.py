"""Nodes of a surface: points of it that keep a distance, which charges are shared out among, and coarser ones for wider octaves.

They depend on the surface, and on where there is any density at all; not on how much of it there is, nor on the charges. So they
serve on from one density to another: see :meth:`Nodes.homes`.
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
from .points import Lists, chosen, lists_of, nearest_of, runs_of, thinned

__all__ = ["NEAR_REACH", "NodeLevel", "Nodes", "homed"]

# Distance of nodes over the level's length, how much farther a home may be, and from where on it is too far for nodes that were made
# where there was another density.
NODE_DISTANCE = 0.7
HOME_REACH = 1.5
HOME_REACH_OF_OTHERS = 1.0
# How far a home may be of charges where there is no density.
FAR_HOME_REACH = 6.0
# A turn of the surface counts as so many of the level's lengths when a home is looked for.
HOME_TURN = 2.0
# Width of the weights over the level's length, and where they end; a home is nearer than the second.
WIDTH = 0.8
WEIGHT_REACH = math.sqrt(kernels_nodes.REACH_SQUARED)
HOME_DISTANCE = 0.8
# A Gaussian of a level ends at this many of its widths.
OCTAVE_REACH = 3.5
# Where the near part ends over the width of its widest Gaussian.
NEAR_REACH = 3.6
# Nodes whose normals are farther apart see nothing of each other.
LEAST_COSINE = -0.95
# Fewer nodes need no coarser ones.
FEWEST_NODES = 12


@dataclass(frozen=True, eq=False)
class NodeLevel:
    """Nodes of an octave: which of them see each other how, and what is shared out among the next, coarser ones.

    Attributes:
        count: How many there are.
        octave: Those that each of them sees.
        octave_value: By how much, ``float``.
        up: Of each, the coarser ones that its charge goes to; None at the coarsest level, as the following ones.
        up_value: Their shares.
        down: Of each coarser one, those whose charges go to it.
        down_value: The same shares.
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
        on_device: The same as kernels take it.
        full: Middles of tiles that have any density.
        length: Spacing that they are to resolve, in units.

    Attributes:
        length: That spacing.
        points: The nodes of the first level: those on the surface, and others beyond its edges.
        count: How many these are.
        weights: What points are shared out among them by.
        pairs: Runs of those that each one's near part reaches, ``wp.vec2i``.
        cutoff: Where that ends.
        related: Which parts of the surface stand on one another, for kernels.
        levels: From the finest to the coarsest.
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
        """Return which node on the surface is the home of charges on every tile, ``wp.int32``, shape ``[tile_count]``.

        Args:
            tiles: Their middles.
            is_full: Which of them have any density.
            made_for_others: Whether the nodes were made where another density was: then None where any full tile has none near.
            known: Which of others each tile was before, -1 for new ones, and the homes of these, ``wp.int32``.
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
            # What is fixed may lie there, and ends of lines.
            find(~is_full & is_new, FAR_HOME_REACH * length, 0.0)
        return result

    def nearest(self, some: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Which of other nodes is nearest to each of some, by places in ``others``, shape ``[some_count]``; 0 for far ones."""
        launcher = self._launcher
        of_some, of_others = (
            chosen(launcher, self.points, launcher.array(number.astype(np.int32), wp.int32))
            for number in (some, others)
        )
        return np.maximum(nearest_of(launcher, of_some, of_others, FAR_HOME_REACH * self.length, 0.0).numpy(), 0)

    def _make_levels(self, diagonal: float) -> list[NodeLevel]:
        """Make nodes for one octave after the other, until one is as wide as the surface."""
        launcher, nodes, length = self._launcher, self.points, self.length
        width = WIDTH * length
        levels: list[NodeLevel] = []
        while True:
            octave = math.sqrt(2.0) * length
            # What the weights on both ways blur is left out of the Gaussian.
            rest = math.sqrt(octave**2 - 2.0 * width**2)
            near = lists_of(launcher, nodes, nodes, min(OCTAVE_REACH * rest, 2.0 * diagonal), LEAST_COSINE)
            value = launcher.empty(len(near.entry), float)
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
    """Points with their homes, as they are sorted by these."""
    result = kernels_nodes.Homed()
    result.points, result.home, result.order, result.start = points, home, sort.order, sort.cell_start
    return result


def _between(
    launcher: Launcher, fine: Points, coarse: Points, length: float, width: float
) -> tuple[Lists, wp.array, Lists, wp.array]:
    """What finer nodes share out among coarser ones, as lists by both."""
    count, coarse_count = len(fine.position), len(coarse.position)
    weights = _weights_of(launcher, coarse, width, length)
    # There is one: the finer nodes were thinned out to these. Lists by home and by node agree only where it is no farther.
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
        entry, value = launcher.empty(max(total, 1), wp.int32), launcher.empty(max(total, 1), float)
        inputs = [to_nodes, at_home, row, weights, start]
        launcher.launch(kernels_nodes.list_shares, number, inputs, [entry, value], grain=GRAIN_OF_NEIGHBORS)
        return Lists(start, entry), value

    return (*shares(0, count), *shares(1, coarse_count))


def _weights_of(launcher: Launcher, nodes: Points, width: float, length: float) -> kernels_nodes.Weights:
    """What points are shared out among: nodes of a level of a length, by weights of a width."""
    near = runs_of(launcher, lists_of(launcher, nodes, nodes, WEIGHT_REACH * width + HOME_DISTANCE * length), nodes)
    weights = kernels_nodes.Weights()
    weights.nodes, weights.start, weights.near, weights.width = nodes, near.start, near.entry, width
    count = len(nodes.position)
    weights.plane = launcher.zeros(kernels_nodes.NODE_PLANES * count + LANES, float)
    launcher.launch(kernels_nodes.fill_planes, count, [nodes], [weights.plane])
    return weights
