"""The near field of the target: the octaves of its force that are too narrow for the nodes.

The target lies still. So its near field is summed once, at the corners of all tiles, and kernels interpolate it within a tile. Sources
are the points of a :class:`.Quadrature`. After an edit, it is kept on facets far from all changes, and summed anew on the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS
from ..surface import kernels_facets
from . import kernels_cascade, kernels_near_target
from .carried_tiles import CarriedTiles
from .kernels_points import Points
from .native_lanes import LANES
from .node_images import NodeImages
from .nodes import NEAR_REACH
from .points import alike, chosen, empty_points, grid_of, nearest_of, places_where, taken, thinned
from .quadrature import Quadrature
from .softness import near_force
from .target_blur import TargetBlur
from .tiled_surface import TiledSurface

__all__ = ["KeptFacets", "NearTarget", "kept_facets", "sum_near_target"]

# Octaves of the near field, and entries of the table of its force.
NEAR_OCTAVES = 13
TABLE_SIZE = 2048
# If charges are points, the near field of the target is blurred by a Gaussian of this standard deviation, in lengths of the cascade:
# bodies cannot resolve more, and would crowd along its edges.
BLUR = 0.37
# A uniform target has no such edges, and its blur only leaks where the surface ends or bends sharply. Measured with 0.3, 0.33 and
# 0.37: coverage errors of a square at 1 spacing of .0022, .0023 and .0025; of Suzanne at 2 spacings of .0012, .0015 and .0020, and
# smallest spacings, of six seeds, of .75, .77 and .76.
BLUR_OF_UNIFORM = 0.33
# Corners of tiles are the same if their positions differ by less than this, in units, and their normals by less than that.
SAME_PLACE = 1e-3
SAME_SIDE = 0.125
# Sources are thinned out to this distance, in lengths, if there are more than so many for every square of it.
SOURCE_DISTANCE = 0.3
MANY_SOURCES = 4.0
# Largest variance of the blur of a charge, in squared lengths: a wider Gaussian would not have faded where the near field ends.
WIDEST_VARIANCE = 0.3
# The near field is kept on facets farther than this from all changes, in lengths: it ends after 2.7, and its blur follows densities
# within 2.5.
FAR_FROM_CHANGES = 5.5


@dataclass(frozen=True, eq=False)
class NearTarget:
    """The near field of the target at the corners of tiles.

    Attributes:
        blur: How the target is blurred.
        force: Force per unit charge of every image, ``wp.vec3``: for every share of the blur all images, for every image all corners.
        variance: Variance of the blur of a mean charge at every corner, ``float``; None unless the blur follows the density.
    """

    blur: TargetBlur
    force: wp.array
    variance: wp.array | None

    def for_kernels(self, attraction: np.ndarray) -> kernels_cascade.NearTarget:
        """Return it as kernels take it, with the charge of every image that every group sees, ``[group_count, image_count]``."""
        image_count, device = attraction.shape[1], self.force.device
        target = kernels_cascade.NearTarget()
        target.force, target.column_count = self.force, image_count
        target.corner_count = len(self.force) // (image_count * len(self.blur.shares))
        target.attraction = wp.array(attraction.ravel(), dtype=float, device=device)
        target.share = wp.array(self.blur.of_group, dtype=wp.int32, device=device)
        return target


class KeptFacets(NamedTuple):
    """Where the near field from before an edit is kept.

    Attributes:
        carried: What the edit changed.
        kept: On which facets it is kept, shape ``[facet_count]``.
    """

    carried: CarriedTiles
    kept: np.ndarray

    def tiles_to_sum(self, is_full: np.ndarray, length: float) -> np.ndarray:
        """Return which tiles are sources of what is found anew, bool, shape ``[tile_count]``.

        Args:
            is_full: Which tiles have any density.
            length: Length of the cascade, in units.
        """
        facets = self.carried.facets
        near = facets.near(~self.kept, NEAR_REACH * length + 2.0 * facets.across)
        result = is_full & np.repeat(near, facets.cuts**2)
        # Kernels need at least one.
        result[np.argmax(is_full)] = True
        return result


def kept_facets(blur: TargetBlur, before: NearTarget, carried: CarriedTiles, length: float) -> KeptFacets | None:
    """Find where the near field from before an edit is kept; None for nowhere.

    Args:
        blur: How the target is blurred now; notes what is not kept.
        before: The near field before the edit.
        carried: What the edit changed.
        length: Length of the cascade, in units.
    """
    kept = blur.carry(before.blur, carried.factor)
    if kept.any():
        kept &= ~carried.are_facets_near(FAR_FROM_CHANGES * length)
    blur.forget(~kept)
    return KeptFacets(carried, kept) if kept.any() else None


def sum_near_target(
    surface: TiledSurface,
    quadrature: Quadrature,
    images: NodeImages,
    blur: TargetBlur,
    before: tuple[NearTarget, KeptFacets] | None,
) -> NearTarget:
    """Find the near field of all images.

    Args:
        surface: The surface.
        quadrature: The sources. If ``before`` is given, these may lack tiles far from what is found anew.
        images: What nodes have of the images: the blur may follow their densities.
        blur: How the target is blurred.
        before: The near field before an edit, and where it is kept.
    """
    launcher, count, image_count = surface.launcher, surface.facets.corner_count, len(images.share)
    force = launcher.empty(len(blur.shares) * image_count * count, wp.vec3)
    result = NearTarget(blur, force, launcher.empty(count, float) if blur.follows_density else None)
    new = launcher.array(np.arange(count, dtype=np.int32), wp.int32)
    if before is not None:
        new = _carry(surface, *before, result)
    if len(new):
        _Summation(surface, images, blur).write(quadrature, new, result)
    return result


def _carry(surface: TiledSurface, before: NearTarget, facets: KeptFacets, result: NearTarget) -> wp.array:
    """Copy what is kept into the result; return the numbers of all other corners, ``wp.int32``."""
    launcher, (carried, kept) = surface.launcher, facets
    source = carried.corners_before(kept)
    on_device = launcher.array(source, wp.int32)
    factor = np.tile(carried.factor, len(result.blur.shares)).astype(np.float32)
    inputs = [on_device, before.force, launcher.array(factor, float)]
    launcher.launch(kernels_near_target.carry_forces, len(source), inputs, [result.force])
    if result.variance is not None:
        inputs = [on_device, before.variance]
        launcher.launch(kernels_near_target.carry_numbers, len(source), inputs, [result.variance])
    return places_where(launcher, source < 0)


class _Summation:
    """Sums the near field at corners of tiles.

    Args:
        surface: The surface.
        images: What nodes have of the images.
        blur: How the target is blurred.
    """

    def __init__(self, surface: TiledSurface, images: NodeImages, blur: TargetBlur) -> None:
        self._surface, self._images, self._blur = surface, images, blur
        self._launcher, self._length = surface.launcher, surface.nodes.length

    def write(self, quadrature: Quadrature, new: wp.array, result: NearTarget) -> None:
        """Write forces, and variances, of these corners, ``wp.int32``."""
        launcher, surface, image_count = self._launcher, self._surface, len(self._images.share)
        corners, tile = self._corners(new)
        # Neighboring facets do not share corners. Corners in one place with nearly the same normal have the same force.
        facets = surface.facets
        cell = max(SAME_PLACE, facets.extent / (1 << 20))
        first, which = alike(launcher, corners, -0.5 * (facets.size + cell), cell, 1.0 / SAME_SIDE)
        distinct, variance = chosen(launcher, corners, first), launcher.empty(0, float)
        if result.variance is not None:
            variance = self._variances(distinct, taken(launcher, taken(launcher, first, tile), surface.home))
            launcher.launch(kernels_near_target.put_numbers, len(new), [new, which, variance], [result.variance])
        table = self._table()
        sources, source_count = self._sources(quadrature, table.cutoff)
        shares = self._blur.shares.tolist()
        force = launcher.empty(len(shares) * image_count * len(first), wp.vec3)
        related = surface.nodes.related
        for number, share in enumerate(shares):
            place = number * image_count * len(first)
            inputs = [distinct, sources, *related, image_count, source_count, table, variance, share, place]
            launcher.launch(kernels_near_target.sum_near_target, len(first), inputs, [force], grain=GRAIN_OF_NEIGHBORS)
        inputs = [new, which, len(shares) * image_count, force]
        launcher.launch(kernels_near_target.put_forces, len(new), inputs, [result.force])

    def _corners(self, new: wp.array) -> tuple[Points, wp.array]:
        """Return some of the corners of tiles, by their numbers, and the tile of each, ``wp.int32``."""
        launcher, surface, count = self._launcher, self._surface, self._surface.facets.corner_count
        corners, tile = empty_points(launcher, count), launcher.empty(count, wp.int32)
        outputs = [corners.position, corners.normal, tile]
        launcher.launch(kernels_facets.locate_corners, count, [surface.facets.count, surface.on_device], outputs)
        corners.label = taken(launcher, tile, surface.centers.label)
        if len(new) < count:
            corners, tile = chosen(launcher, corners, new), taken(launcher, new, tile)
        return corners, tile

    def _table(self) -> kernels_near_target.NearTable:
        """Tabulate distance times force of a unit charge over squared distance, for images that vary and for uniform ones."""
        length, softness = self._length, self._blur.softness
        squares = length**2 * 4.0 ** (0.5 - np.arange(1, NEAR_OCTAVES + 1))
        cutoff = NEAR_REACH * math.sqrt(squares[0] + (BLUR * length) ** 2)
        square = np.linspace(0.0, cutoff**2, TABLE_SIZE + 1)[:, None]
        force = []
        for share in (BLUR, BLUR_OF_UNIFORM):
            if softness is not None:
                width = 0.0 if self._blur.follows_density else softness.blur
                force.append(near_force(square[:, 0] / length**2, width))
                continue
            blurred = squares + (share * length) ** 2
            ratio = square / blurred
            force.append((math.log(2.0) * squares / blurred * ratio * np.exp(-0.5 * ratio)).sum(axis=1))
        table, device = kernels_near_target.NearTable(), self._launcher.device
        table.force = wp.array(np.concatenate(force), dtype=float, device=device)
        table.kind = wp.array(self._blur.uniform.astype(np.int32), dtype=wp.int32, device=device)
        table.size = TABLE_SIZE + 1
        table.scale, table.cutoff = TABLE_SIZE / cutoff**2, cutoff
        table.blurs = int(self._blur.follows_density)
        return table

    def _variances(self, points: Points, home: wp.array) -> wp.array:
        """Return the variance of the blur of a mean charge at points with these homes, where it follows the density."""
        softness, launcher, square = self._blur.softness, self._launcher, self._length**2
        assert softness is not None
        following = softness.following
        assert following is not None
        number = launcher.array(np.array(following.number) @ self._images.share, float)
        area = launcher.array(self._images.area, float)
        usual = 0.5 * softness.blur**2 * square
        bounds = (following.lowest * usual, min(following.widest * usual, WIDEST_VARIANCE * square))
        result = launcher.empty(len(home), float)
        weights = self._surface.nodes.weights
        launcher.launch(
            kernels_cascade.follow_density,
            len(home),
            [points, home, weights, number, area, self._length, usual, following.exponent, *bounds],
            [result],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return result

    def _sources(self, quadrature: Quadrature, cutoff: float) -> tuple[kernels_near_target.Sources, int]:
        """Return the sources, sorted into cells of the cut-off's size, and their number."""
        launcher, points, columns = self._launcher, quadrature.points, len(self._images.share)
        charge = quadrature.all_shares()
        variance, on_host = None, None
        if self._blur.follows_density:
            homes = np.concatenate([taken(launcher, tile, self._surface.home).numpy() for tile in quadrature.tile])
            variance = self._blur.of_target * self._variances(points, launcher.array(homes, wp.int32)).numpy()
        # On a mesh that is finer than bodies can tell, one source stands for many points.
        apart = SOURCE_DISTANCE * self._length
        if len(points.position) * apart**2 > MANY_SOURCES * self._surface.facets.area.sum():
            points, on_host, variance = self._thinned(points, charge, apart, variance)
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

    def _thinned(
        self, points: Points, charge: wp.array, apart: float, variance: np.ndarray | None
    ) -> tuple[Points, np.ndarray, np.ndarray | None]:
        """Merge points into fewer sources that keep a distance.

        Returns:
            The sources, each in the middle of the points that it stands for; their charges, image after image, float32; and the means
            of the points' variances, if there are any.
        """
        launcher, count = self._launcher, len(points.position)
        few = chosen(launcher, points, thinned(launcher, points, apart))
        nearest = nearest_of(launcher, points, few, 2.0 * apart, apart).numpy()

        def added(values: np.ndarray) -> np.ndarray:
            return np.bincount(nearest, values, len(few.position))

        summed = np.concatenate([added(one) for one in charge.numpy().reshape(-1, count)])
        number = np.bincount(nearest, minlength=len(few.position))
        middle = np.stack([added(axis) / number for axis in points.position.numpy().astype(np.float64).T], axis=1)
        few.position.assign(middle.astype(np.float32))
        variance = None if variance is None else added(variance) / number
        return few, summed.astype(np.float32), variance
