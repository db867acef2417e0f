"""A surface as the cascade takes it: facets, which are cut into tiles, and the nodes of the far field that stand for these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..surface import kernels_facets
from ..surface.facets import Facets
from .kernels_points import Points
from .nodes import Nodes
from .points import empty_points

__all__ = ["TiledSurface", "centers_of_tiles", "uniform_images"]

# An image is uniform if its density (share over area) varies by no more than this, as a fraction of the largest density.
SAME_DENSITY = 1e-9


@dataclass(frozen=True, eq=False)
class TiledSurface:
    """A surface, its tiles and its nodes.

    Attributes:
        launcher: Where to run.
        facets: The surface.
        on_device: The same facets, as kernels take them.
        centers: Centers of all tiles.
        nodes: Nodes of the far field.
        home: Home node of every tile, ``wp.int32``, shape ``[tile_count]``: sources on the tile are deposited on nodes around it.
    """

    launcher: Launcher
    facets: Facets
    on_device: kernels_facets.Facets
    centers: Points
    nodes: Nodes
    home: wp.array


def centers_of_tiles(launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets) -> Points:
    """Return the centers of all tiles."""
    tiles = empty_points(launcher, facets.tile_count)
    outputs = [tiles.position, tiles.normal, tiles.label]
    launcher.launch(kernels_facets.locate_tiles, facets.tile_count, [facets.count, on_device], outputs)
    return tiles


def uniform_images(share: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return which images have the same density on all tiles.

    Args:
        share: Share of every image on every tile, shape ``[image_count, tile_count]``.
        area: Area of every tile, shape ``[tile_count]``.

    Returns:
        bool, shape ``[image_count]``.
    """
    ratio = share / area
    return ratio.max(axis=1) - ratio.min(axis=1) <= SAME_DENSITY * ratio.max(axis=1)
