"""A surface cut into triangles of about a spacing: *facets* of a few spacings, and even *tiles* within each of them.

Every facet is cut for itself, so that no mesh is ever too bad for it. A tile is found from the place within its facet alone.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..problem.surface import Surface
from . import kernels_facets
from .triangle_mesh import triangle_areas

__all__ = ["Facets"]

# Longest side of a tile, and of a facet, in units.
TILE = 1.3
FACET = 5.2
# Longest side of a tile where the surface ends: there the pull of the target changes within half a spacing. Measured
# with 4,096 bodies and five seeds, all tiles alike and then so, errors at 1 and 2 spacings: two strips of other triangles that make a
# square .0026 and .0006, .0022 and .0005; a square of 37 by 37 cells .0026 and .0006, .0023 and .0005; one of 64 by 64 .0023 and
# .0005, .0020 and .0004. At creases, too: on a box with thin walls .0033 and .0008, .0030 and .0007; but on a surface of cubes
# that is all creases .055 and .003, .077 and .028.
TILE_AT_END = 0.65
# A facet's longest side over its height, beyond which it is cut in two rather than into even tiles.
MOST_SLENDER = 4.0
# Corners are in one place, in units, where they differ by less.
SAME_PLACE = 1e-3
# Make one number of three.
PLACE_FACTORS = np.array([1, 1_000_003, 998_244_353_001])
# Bits of the Hilbert curve along which facets are in order, per axis.
CURVE_BITS = 16


class Facets:
    """Facets of a surface, lengths in units, relative to the surface's middle.

    Args:
        surface: The surface.
        unit: Meters per unit.
        label: Number for every triangle of the surface; those of one number come one after the other.
        open_side: Whether the surface ends at the side opposite of each corner of its triangles, shape ``[t, 3]``.

    Attributes:
        middle: Of the surface [m], shape ``[3]``.
        unit: Meters per unit.
        corner: Corners of every facet, shape ``[f, 3, 3]``, float64.
        triangle: Triangle of the surface that each is part of, shape ``[f]``.
        weight: Where its corners lie in that triangle, shape ``[f, 3, 3]``: weights of the triangle's corners for each.
        normal: Shape ``[f, 3]``.
        corner_normal: Where the smooth surface that the mesh stands for looks to at every corner, shape ``[f, 3, 3]``.
        area: Shape ``[f]``.
        label: Shape ``[f]``.
        open_side: Whether the surface ends at the side opposite of each corner, shape ``[f, 3]``.
        edge_side: Whether a crease or the surface's end lies at that side, shape ``[f, 3]``.
        cuts: Tiles along every side of a facet, which has ``cuts²`` tiles, shape ``[f]``.
        first_tile: Number of the first tile of every facet, and at the end of all, shape ``[f + 1]``.
        first_corner: The same for the corners of tiles.
    """

    def __init__(self, surface: Surface, unit: float, label: np.ndarray, open_side: np.ndarray) -> None:
        self.surface, self.unit = surface, unit
        self.middle = 0.5 * (surface.low + surface.high)
        corner = (surface.position[surface.triangle] - self.middle) / unit
        triangle = np.arange(len(corner))
        weight = np.broadcast_to(np.eye(3), (len(corner), 3, 3)).copy()
        corner, triangle, weight = _cut_long(corner, triangle, weight)
        normal = surface.normal[triangle]
        order = _order(corner.mean(axis=1), normal, label[triangle])
        self.corner, self.triangle, self.weight = corner[order], triangle[order], weight[order]
        self.normal, self.label = normal[order], label[self.triangle]
        smooth = np.einsum("fkc,fcd->fkd", self.weight, surface.corner_normal[self.triangle])
        self.corner_normal = smooth / np.linalg.norm(smooth, axis=2, keepdims=True)
        self.open_side = self._sides_on(open_side)
        self.edge_side = self._sides_on(surface.edge_side)
        self.area = triangle_areas(self.corner)
        longest = np.linalg.norm(self.corner - np.roll(self.corner, 1, axis=1), axis=2).max(axis=1)
        tile = np.where(self._at_end(), TILE_AT_END, TILE)
        self.cuts = np.maximum(np.ceil(longest / tile - 1e-6), 1.0).astype(np.int64)
        self.first_tile, self.first_corner = self._counted()
        self._tile_area: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.corner)

    @property
    def tile_count(self) -> int:
        """Number of tiles of all facets."""
        return int(self.first_tile[-1])

    @property
    def corner_count(self) -> int:
        """Number of corners of tiles; those of neighboring facets are not shared."""
        return int(self.first_corner[-1])

    @property
    def size(self) -> np.ndarray:
        """Extent along x, y and z, in units, shape ``[3]``."""
        return (self.surface.high - self.surface.low) / self.unit

    @property
    def extent(self) -> float:
        """The largest of them."""
        return float(self.size.max())

    @property
    def tile_area(self) -> np.ndarray:
        """Area of every tile, shape ``[tile_count]``."""
        if self._tile_area is None:
            self._tile_area = np.repeat(self.area / self.cuts**2, self.cuts**2)
        return self._tile_area

    def cut_finer(self, facet: np.ndarray, factor: int) -> None:
        """Cut some facets into ``factor²`` times as many tiles."""
        self.cuts[facet] *= factor
        self.first_tile, self.first_corner = self._counted()
        self._tile_area = None

    def near(self, chosen: np.ndarray, distance: float) -> np.ndarray:
        """Which facets have chosen ones within a distance, and some that are up to three times as far; masks of shape ``[f]``."""
        cell = np.floor(self.corner.mean(axis=1) / max(distance, FACET)).astype(np.int64)
        cell -= cell.min(axis=0) - 1
        extent = cell.max(axis=0) + 2
        number = (cell[:, 0] * extent[1] + cell[:, 1]) * extent[2] + cell[:, 2]
        marked = np.unique(number[chosen])
        steps = np.array([-1, 0, 1])
        around = (steps[:, None, None] * extent[1] + steps[:, None]) * extent[2] + steps
        return np.isin(number, (marked[:, None] + around.ravel()).ravel())

    def tiles(self, facet: np.ndarray, inner: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Facet, and weights of its corners, of ``inner²`` points in every tile of some facets, shape ``[m]``, in rising order.

        Shapes ``[n]`` and ``[n, 3]``; tile after tile. One point is a tile's middle; several are the middles of the even tiles that it
        would be cut into.
        """
        facets, weights = [], []
        for cuts in np.unique(self.cuts[facet]).tolist():
            own = facet[self.cuts[facet] == cuts]
            pattern = _tile_pattern(cuts, inner)
            facets.append(np.repeat(own, len(pattern)))
            weights.append(np.tile(pattern, (len(own), 1)))
        of_point, weight = np.concatenate(facets), np.concatenate(weights)
        order = np.argsort(of_point, kind="stable")
        return of_point[order], weight[order]

    def in_triangle(self, facet: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of the surface, and weights of their corners, of points given by facets and weights of theirs."""
        return self.triangle[facet], np.einsum("nk,nkd->nd", weight, self.weight[facet])

    def for_kernels(self, device: wp.Device) -> kernels_facets.Facets:
        """The facets as kernels take them; :attr:`mesh` must live as long as they are used."""
        flat = self.corner.reshape(-1, 3).astype(np.float32)
        self.mesh = wp.Mesh(
            wp.array(flat, dtype=wp.vec3, device=device),
            wp.array(np.arange(len(flat), dtype=np.int32), dtype=wp.int32, device=device),
        )
        facets = kernels_facets.Facets()
        facets.mesh = self.mesh.id
        facets.corner = self.mesh.points
        facets.normal = wp.array(self.normal.astype(np.float32), dtype=wp.vec3, device=device)
        smooth = self.corner_normal.reshape(-1, 3).astype(np.float32)
        facets.corner_normal = wp.array(smooth, dtype=wp.vec3, device=device)
        facets.label = wp.array(self.label.astype(np.int32), dtype=wp.int32, device=device)
        sides = (self.open_side * np.array([1, 2, 4])).sum(axis=1)
        facets.open_sides = wp.array(sides.astype(np.int32), dtype=wp.int32, device=device)
        facets.cuts = wp.array(self.cuts.astype(np.int32), dtype=wp.int32, device=device)
        facets.first_tile = wp.array(self.first_tile.astype(np.int32), dtype=wp.int32, device=device)
        facets.first_corner = wp.array(self.first_corner.astype(np.int32), dtype=wp.int32, device=device)
        return facets

    def _sides_on(self, of_triangle: np.ndarray) -> np.ndarray:
        """Sides that lie on one of some sides of their triangle: both their ends have no weight of the corner opposite of it."""
        absent = self.weight == 0.0
        result = np.zeros((self.count, 3), bool)
        for k in range(3):
            on_side = absent[:, (k + 1) % 3] & absent[:, (k + 2) % 3]
            result[:, k] = (on_side & of_triangle[self.triangle]).any(axis=1)
        return result

    def _at_end(self) -> np.ndarray:
        """Facets that the surface's end touches, by a side or a corner, shape ``[f]``."""
        facet, side = np.nonzero(self.open_side)
        if not len(facet):
            return np.zeros(self.count, bool)
        cell = np.round(self.corner / SAME_PLACE).astype(np.int64)
        # Numbers that go round at 64 bits cut a facet for nothing, no more.
        place = (cell * PLACE_FACTORS).sum(axis=2)
        ends = np.concatenate([place[facet, (side + 1) % 3], place[facet, (side + 2) % 3]])
        return np.isin(place, np.unique(ends)).any(axis=1)

    def _counted(self) -> tuple[np.ndarray, np.ndarray]:
        """The first tile of every facet, and its first corner of tiles."""
        tiles, corners = self.cuts**2, (self.cuts + 1) * (self.cuts + 2) // 2
        return np.concatenate([[0], np.cumsum(tiles)]), np.concatenate([[0], np.cumsum(corners)])


def _tile_pattern(cuts: int, inner: int) -> np.ndarray:
    """Weights of a facet's corners at points of its tiles, in the order of the tiles, shape ``[cuts² inner², 3]``."""
    small = _pattern(inner)
    result = []
    for j in range(cuts):
        for i in range(cuts - j):
            corner = np.array([i, j]) / cuts
            result.append(corner + small / cuts)
            if i < cuts - j - 1:
                result.append(corner + (1.0 - small) / cuts)
    place = np.concatenate(result)
    return np.column_stack([1.0 - place.sum(axis=1), place])


def _pattern(cuts: int) -> np.ndarray:
    """Places of the middles of even tiles, as weights of the second and the third corner."""
    places = []
    for j in range(cuts):
        for i in range(cuts - j):
            places.append((i + 1.0 / 3.0, j + 1.0 / 3.0))
            if i < cuts - j - 1:
                places.append((i + 2.0 / 3.0, j + 2.0 / 3.0))
    return np.array(places) / cuts


def _cut_long(
    corner: np.ndarray, triangle: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut triangles in two across their longest side until none is long, or slender and longer than a tile."""
    done: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    while len(corner):
        length = np.linalg.norm(np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1), axis=2)
        longest = length.max(axis=1)
        height = 2.0 * triangle_areas(corner) / np.maximum(longest, 1e-30)
        long = (longest > FACET) | ((longest > TILE) & (longest > MOST_SLENDER * height))
        done.append((corner[~long], triangle[~long], weight[~long]))
        corner, triangle, weight, length = corner[long], triangle[long], weight[long], length[long]
        if not len(corner):
            break
        # The corner that the longest side lies opposite of comes first.
        turn = (np.argmax(length, axis=1)[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(corner, turn[:, :, None], axis=1)
        weight = np.take_along_axis(weight, turn[:, :, None], axis=1)
        corner, weight = (
            np.concatenate([np.stack([a, b, 0.5 * (b + c)], axis=1), np.stack([a, 0.5 * (b + c), c], axis=1)])
            for a, b, c in (np.moveaxis(corner, 1, 0), np.moveaxis(weight, 1, 0))
        )
        triangle = np.concatenate([triangle, triangle])
    parts = tuple(np.concatenate(values) for values in zip(*done, strict=True))
    return parts[0], parts[1], parts[2]


def _order(place: np.ndarray, normal: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Order of facets: label after label, and in each along a Hilbert curve for every one of six directions that they look to."""
    low = place.min(axis=0)
    extent = float((place.max(axis=0) - low).max()) or 1.0
    cell = np.minimum((place - low) / extent * (1 << CURVE_BITS), (1 << CURVE_BITS) - 1).astype(np.int64)
    axis = np.argmax(np.abs(normal), axis=1)
    sheet = 2 * axis + (normal[np.arange(len(normal)), axis] > 0.0)
    # Labels come in the order of where they are, so that few bodies on many parts are even, too.
    curve = _hilbert(cell)
    first = np.full(int(label.max()) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, label, curve)
    rank = np.argsort(np.argsort(first, kind="stable"), kind="stable")
    return np.lexsort((curve, sheet, rank[label]))


def _hilbert(cell: np.ndarray) -> np.ndarray:
    """Place along a Hilbert curve of cells, shape ``[n, 3]`` (J. Skilling, Programming the Hilbert curve, 2004)."""
    axes = [cell[:, k].copy() for k in range(3)]
    bit = 1 << (CURVE_BITS - 1)
    while bit > 1:
        mask = bit - 1
        for k in range(3):
            on = (axes[k] & bit) > 0
            swap = np.where(on, 0, (axes[0] ^ axes[k]) & mask)
            axes[0] ^= np.where(on, mask, swap)
            axes[k] ^= swap
        bit >>= 1
    axes[1] ^= axes[0]
    axes[2] ^= axes[1]
    flip = np.zeros_like(axes[0])
    bit = 1 << (CURVE_BITS - 1)
    while bit > 1:
        flip ^= np.where((axes[2] & bit) > 0, bit - 1, 0)
        bit >>= 1
    key = np.zeros_like(axes[0])
    for shift in reversed(range(CURVE_BITS)):
        for k in range(3):
            key = (key << 1) | (((axes[k] ^ flip) >> shift) & 1)
    return key
