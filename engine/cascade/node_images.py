"""Target densities at the nodes: images are deposited on them once, with the same weights as charges are in every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from . import kernels_cascade, kernels_nodes
from .carried_tiles import CarriedTiles
from .kernels_points import Points
from .kernels_sorted_charges import CHARGE_PLANES, SortedCharges
from .native_lanes import LANES
from .nodes import homed
from .points import taken
from .quadrature import Quadrature
from .tiled_surface import TiledSurface, uniform_images

__all__ = ["NodeImages", "empty_sorted_charges", "images_at_nodes"]

# A source is deposited only on nodes nearer to it than this, in lengths of the cascade.
DEPOSIT_REACH = 2.6


@dataclass(frozen=True, eq=False)
class NodeImages:
    """What nodes have of the images and of the surface's area.

    Attributes:
        share: Share of every image at every node, shape ``[image_count, node_count]``.
        area: Area that every node stands for, shape ``[node_count]``.
    """

    share: np.ndarray
    area: np.ndarray


def images_at_nodes(
    surface: TiledSurface,
    quadrature: Quadrature,
    share: np.ndarray,
    before: tuple[NodeImages, CarriedTiles] | None,
) -> NodeImages:
    """Deposit images, and the area of all tiles that have any density, on the nodes.

    Every point of the quadrature is deposited by itself. If only the centers of tiles were, large tiles would be blurred less than
    small ones, and bodies would follow where the two meet.

    Args:
        surface: The surface.
        quadrature: Points that carry the images. If ``before`` is given, these may lack tiles far from all changes.
        share: Share of every image on every tile, shape ``[image_count, tile_count]``.
        before: Images at the same nodes before an edit, and what has changed since; nodes far from all changes keep their values.
    """
    node_count, area = surface.nodes.count, surface.facets.tile_area
    is_full = share.max(axis=0) > 0.0
    # A uniform image follows from the area.
    full_area = area if is_full.all() else area[is_full]
    uniform = uniform_images(share if is_full.all() else share[:, is_full], full_area)
    deposited = np.zeros((len(share), node_count))
    node_area = np.zeros(node_count)
    room = None
    for number, tile in enumerate(quadrature.tile):
        at_home = _sorted_by_home(surface, quadrature.quarter(number), taken(surface.launcher, tile, surface.home))
        if room is None or len(room.group) != len(tile):
            room = empty_sorted_charges(surface.launcher, len(tile))
        for image in np.flatnonzero(~uniform).tolist():
            deposited[image] += _deposited(surface, at_home, quadrature.share(number, image), room)
        node_area += _deposited(surface, at_home, quadrature.area(number), room)
    if before is not None:
        images, carried = before
        away = ~carried.is_near(surface.nodes.points.position.numpy(), DEPOSIT_REACH * surface.nodes.length)
        deposited[:, away] = carried.factor[:, None] * images.share[:, away]
        node_area[away] = images.area[away]
    deposited[uniform] = share.sum(axis=1)[uniform, None] / float(full_area.sum()) * node_area
    return NodeImages(deposited, node_area)


def empty_sorted_charges(launcher: Launcher, count: int) -> SortedCharges:
    """Return arrays for charges in the order of their homes."""
    charges = SortedCharges()
    charges.group = launcher.empty(count, wp.int32)
    charges.plane = launcher.zeros(CHARGE_PLANES * count + LANES, float)
    return charges


def _sorted_by_home(surface: TiledSurface, points: Points, home: wp.array) -> kernels_nodes.Homed:
    sort = CellSort(surface.launcher, len(home), surface.nodes.count)
    sort.sort(kernels_nodes.find_homes, [home])
    return homed(points, home, sort)


def _deposited(
    surface: TiledSurface, at_home: kernels_nodes.Homed, amount: wp.array, room: SortedCharges
) -> np.ndarray:
    """Return what every node gets of an amount at every point, shape ``[node_count]``; ``room`` is overwritten."""
    launcher, nodes, count = surface.launcher, surface.nodes, len(amount)
    launcher.launch(
        kernels_cascade.fit_rows,
        count,
        [at_home, amount, launcher.zeros(count, wp.int32), nodes.weights],
        [room],
        grain=GRAIN_OF_NEIGHBORS,
    )
    received = launcher.empty(nodes.count, float)
    launcher.launch(
        kernels_cascade.deposit,
        nodes.count,
        [room, at_home.start, nodes.weights, 1],
        [received],
        grain=GRAIN_OF_NEIGHBORS,
    )
    return received.numpy()
