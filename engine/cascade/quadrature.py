"""Quadrature of target densities: points of the surface that carry what tiles have of every image."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..surface import kernels_facets
from .kernels_points import Points
from .points import empty_points, places_where, taken
from .tiled_surface import TiledSurface

__all__ = ["Quadrature"]

# Tiles of a larger area, in squared lengths of the cascade, get four points, smaller ones one. Measured: coverage errors of a torus of
# triangles of .1 to .6 units², at 1 and 2 spacings, are .0016 and .0004 with 0 and with 0.1, .0023 and .0008 with 0.3.
LARGE_TILE = 0.1
QUARTERS = 4


class Quadrature:
    """Points that stand for tiles: the centers of a large tile's four quarters, or the center of a small tile.

    They are stored quarter by quarter: first the first point of every tile, then the second points of all large tiles, and so on.

    Args:
        surface: The surface.
        share: Share of every image on every tile, shape ``[image_count, tile_count]``.
        is_used: Which tiles get points, shape ``[tile_count]``.

    Attributes:
        points: The points.
        tile: The tile of every point, ``wp.int32``: one array for each quarter that there is.
    """

    def __init__(self, surface: TiledSurface, share: np.ndarray, is_used: np.ndarray) -> None:
        self._launcher = launcher = surface.launcher
        self._image_count = len(share)
        facets = surface.facets
        tiles_of_facet = facets.cuts**2
        is_large = facets.area / tiles_of_facet > LARGE_TILE * surface.nodes.length**2
        used = places_where(launcher, is_used)
        split = used if is_large.all() else places_where(launcher, is_used & np.repeat(is_large, tiles_of_facet))
        self.tile = [used, *[split] * (QUARTERS - 1 if len(split) else 0)]
        self._end = np.cumsum([len(tile) for tile in self.tile]).tolist()
        self.points = empty_points(launcher, self._end[-1])
        for number, tile in enumerate(self.tile):
            own = self.quarter(number)
            inputs = [tile, number, facets.count, surface.on_device]
            launcher.launch(kernels_facets.locate_parts, len(tile), inputs, [own.position, own.normal, own.label])
        # What every point of a tile carries of each image, and of the tile's area.
        part = np.repeat(np.where(is_large, 1.0 / QUARTERS, 1.0).astype(np.float32), tiles_of_facet)
        self._share = [launcher.array((image * part).astype(np.float32), float) for image in share]
        self._area = launcher.array((facets.tile_area * part).astype(np.float32), float)

    def quarter(self, number: int) -> Points:
        """Return the points of one quarter, as a view of all points."""
        first, end = self._end[number] - len(self.tile[number]), self._end[number]
        points = Points()
        points.position, points.normal = self.points.position[first:end], self.points.normal[first:end]
        points.label = self.points.label[first:end]
        return points

    def share(self, number: int, image: int) -> wp.array:
        """Return what the points of one quarter carry of an image."""
        return taken(self._launcher, self.tile[number], self._share[image])

    def area(self, number: int) -> wp.array:
        """Return what the points of one quarter carry of the area."""
        return taken(self._launcher, self.tile[number], self._area)

    def all_shares(self) -> wp.array:
        """Return what all points carry of all images, image after image."""
        count = len(self.points.position)
        result = self._launcher.empty(self._image_count * count, float)
        for image in range(self._image_count):
            for number, tile in enumerate(self.tile):
                wp.copy(result, self.share(number, image), image * count + self._end[number] - len(tile))
        return result
