"""A surface cut into triangles of about a spacing: *facets* of a few spacings, and even *tiles* within each of them.

Every facet is cut for itself, so that no mesh is ever too bad for it. A tile is found from the place within its facet alone.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..problem.surface import Surface
from . import kernels_cut, kernels_facets, kernels_standing
from .cut import empty_pieces, places_of, small_pieces, triangles_of
from .relations import Relations

__all__ = ["Facets", "are_near"]

# Longest side of a tile, and of a facet, in units.
TILE = 1.3
FACET = 5.2
# Longest side of a tile beside an end or a bend of the surface: there the pull of the target changes within half a spacing, and is
# only known at the corners of tiles. Measured with 4,096 bodies and three seeds, with 1.3, 0.65, 0.5 and 0.4: errors at 1 spacing of a
# sphere of 80 triangles .0025, .0020, .0015, .0014; of a rough rock of 1,280 .0056, .0035, .0034, .0033. Runs on such a rock take a
# fifth longer with 0.5, and two fifths with 0.4.
TILE_AT_BEND = 0.5
# Tiles beside ends and bends at most: on a large mesh that bends everywhere they are larger.
MOST_AT_BENDS = 3_000_000
# A facet's longest side over its height, beyond which it is cut in two rather than into even tiles.
MOST_SLENDER = 4.0
# Corners are in one place, in units, where they differ by less.
SAME_PLACE = 1e-3
# Make one number of three.
PLACE_FACTORS = np.array([1, 1_000_003, 998_244_353_001])


class Facets:
    """Facets of a surface, lengths in units, relative to the surface's middle.

    Args:
        launcher: Where they are cut.
        surface: The surface.
        unit: Meters per unit.
        label: Number for every triangle of the surface; those of one number come one after the other.
        open_side: Whether the surface ends at the side opposite of each corner of its triangles, shape ``[t, 3]``.
        relations: Which labels stand on one another; None for none.
        part: Number of the part that every triangle is in; triangles of one have one label, and come one after the other, too. None
            where parts are what labels are.

    Attributes:
        middle: Of the surface [m], shape ``[3]``.
        unit: Meters per unit.
        triangle: Triangle of the surface that each is part of, shape ``[f]``.
        area: Shape ``[f]``.
        longest: Longest side of each, shape ``[f]``.
        label: Shape ``[f]``.
        part: Number of the part that each is in, shape ``[f]``.
        relations: Which labels stand on one another.
        cuts: Tiles along every side of a facet, which has ``cuts²`` tiles, shape ``[f]``.
        first_tile: Number of the first tile of every facet, and at the end of all, shape ``[f + 1]``.
        first_corner: The same for the corners of tiles.
        on_device: Their corners, weights and triangles, for kernels.
    """

    def __init__(
        self,
        launcher: Launcher,
        surface: Surface,
        unit: float,
        label: np.ndarray,
        open_side: np.ndarray,
        relations: Relations | None = None,
        part: np.ndarray | None = None,
    ) -> None:
        self.launcher, self.surface, self.unit = launcher, surface, unit
        self.relations = Relations() if relations is None else relations
        self.middle = 0.5 * (surface.low + surface.high)
        pieces = small_pieces(launcher, surface, self.middle, unit, facet=FACET, tile=TILE, slender=MOST_SLENDER)
        triangles = triangles_of(launcher, surface, open_side)
        own = pieces.triangle.numpy()
        order = _order(places_of(launcher, pieces, triangles), label[own], None if part is None else part[own])
        count = len(order)
        self.on_device, self._described = empty_pieces(launcher, count), _empty_description(launcher, count)
        inputs = [launcher.array(order.astype(np.int32), wp.int32), pieces, triangles]
        launcher.launch(kernels_cut.describe, count, inputs, [self.on_device, self._described])
        self.triangle = self.on_device.triangle.numpy()
        self.label, self.area = label[self.triangle], self._described.area.numpy()
        self.part = self.label if part is None or np.array_equal(part, label) else part[self.triangle]
        self.longest, at_bend = self._described.longest.numpy(), self._at_bend() | self._at_foot()
        fine = float(((self.longest[at_bend] / TILE_AT_BEND + 1.0) ** 2).sum())
        tile = np.where(at_bend, min(TILE_AT_BEND * max(math.sqrt(fine / MOST_AT_BENDS), 1.0), TILE), TILE)
        self.cuts = np.maximum(np.ceil(self.longest / tile - 1e-6), 1.0).astype(np.int64)
        self.first_tile, self.first_corner = self._counted()
        self._tile_area: np.ndarray | None = None

    @cached_property
    def corner(self) -> np.ndarray:
        """Corners of every facet, shape ``[f, 3, 3]``, float64."""
        return self.on_device.corner.numpy().reshape(-1, 3, 3)

    @cached_property
    def weight(self) -> np.ndarray:
        """Where they lie in its triangle, shape ``[f, 3, 3]``: weights of the triangle's corners for each."""
        return self.on_device.weight.numpy().reshape(-1, 3, 3)

    @cached_property
    def normal(self) -> np.ndarray:
        """Shape ``[f, 3]``."""
        return self._described.normal.numpy()

    @cached_property
    def corner_normal(self) -> np.ndarray:
        """Where the smooth surface that the mesh stands for looks to at every corner, shape ``[f, 3, 3]``."""
        return self._described.corner_normal.numpy().reshape(-1, 3, 3)

    @cached_property
    def open_side(self) -> np.ndarray:
        """Whether the surface ends at the side opposite of each corner, shape ``[f, 3]``."""
        return _sides_of_bits(self._described.open_sides.numpy())

    @cached_property
    def edge_side(self) -> np.ndarray:
        """Whether a crease or the surface's end lies at that side, shape ``[f, 3]``."""
        return _sides_of_bits(self._described.edge_sides.numpy())

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.triangle)

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
    def across(self) -> float:
        """How far a point of any facet is from its middle at most, in units."""
        return 2.0 / 3.0 * float(self.longest.max())

    @property
    def tile_area(self) -> np.ndarray:
        """Area of every tile, shape ``[tile_count]``."""
        if self._tile_area is None:
            self._tile_area = np.repeat(self.area / self.cuts**2, self.cuts**2)
        return self._tile_area

    def cut_finer(self, facet: np.ndarray, factor: int) -> None:
        """Cut some facets into ``factor²`` times as many tiles."""
        self.cut_into(facet, factor * self.cuts[facet])

    def cut_into(self, facet: np.ndarray, cuts: np.ndarray | int) -> None:
        """Cut some facets into so many tiles along every side."""
        self.cuts[facet] = cuts
        self.first_tile, self.first_corner = self._counted()
        self._tile_area = None

    def near(self, chosen: np.ndarray, distance: float, cells: int = 1) -> np.ndarray:
        """Which facets have chosen ones within a distance, and some that are farther; masks of shape ``[f]``.

        These are up to three times as far, and the nearer the more ``cells`` there are along the distance.
        """
        middle = self.corner.mean(axis=1)
        return are_near(middle, middle[chosen], max(distance, FACET), cells)

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

    def for_kernels(self) -> kernels_facets.Facets:
        """The facets as kernels take them; :attr:`mesh` must live as long as they are used."""
        launcher, described = self.launcher, self._described

        def single(values: wp.array) -> wp.array:
            result = launcher.empty(len(values), wp.vec3)
            launcher.launch(kernels_cut.to_single, len(values), [values], [result])
            return result

        corner = np.arange(3 * self.count, dtype=np.int32)
        self.mesh = wp.Mesh(single(self.on_device.corner), launcher.own_array(corner, wp.int32))
        facets = kernels_facets.Facets()
        facets.mesh = self.mesh.id
        facets.corner = self.mesh.points
        facets.normal, facets.corner_normal = single(described.normal), single(described.corner_normal)
        facets.open_sides = described.open_sides
        numbers, facets.relations = self.relations.behind(self.label, int(self.label.max()) + 1)
        # Of all but crumbs it is the label.
        facets.parts = 0 if self.part is self.label else len(numbers)
        if facets.parts:
            numbers = np.concatenate([numbers, self.part])
        facets.label, facets.cuts, facets.first_tile, facets.first_corner = (
            launcher.array(values.astype(np.int32), wp.int32)
            for values in (numbers, self.cuts, self.first_tile, self.first_corner)
        )
        return facets

    def turns(self, most: float) -> np.ndarray:
        """How much the smooth surface turns along every facet [rad per unit], shape ``[f]``; none counts as more than ``most``."""
        turn = self.launcher.empty(self.count, wp.float64)
        inputs = [self.on_device.corner, self._described.corner_normal, most]
        self.launcher.launch(kernels_cut.find_turns, self.count, inputs, [turn])
        return turn.numpy()

    def _at_bend(self) -> np.ndarray:
        """Facets that an end or a bend of the surface touches, by a side or a corner, shape ``[f]``."""
        bits = self._described.bent_sides.numpy()
        if not bits.any():
            return np.zeros(self.count, bool)
        facet, side = np.nonzero(_sides_of_bits(bits))
        cell = np.round(self.corner / SAME_PLACE).astype(np.int64)
        # Numbers that go round at 64 bits cut a facet for nothing, no more.
        place = (cell * PLACE_FACTORS).sum(axis=2)
        ends = np.concatenate([place[facet, (side + 1) % 3], place[facet, (side + 2) % 3]])
        return np.isin(place, np.unique(ends)).any(axis=1)

    def _at_foot(self) -> np.ndarray:
        """Facets on which another part stands, and those beside its foot, shape ``[f]``."""
        place, launcher = self.relations.place, self.launcher
        if not len(place):
            return np.zeros(self.count, bool)
        corner = launcher.own_array(self.corner.reshape(-1, 3).astype(np.float32), wp.vec3)
        mesh = wp.Mesh(corner, launcher.own_array(np.arange(3 * self.count, dtype=np.int32), wp.int32))
        is_near = launcher.zeros(self.count, wp.int32)
        inputs = [mesh.id, launcher.array(place.astype(np.float32), wp.vec3), TILE_AT_BEND]
        launcher.launch(kernels_standing.find_near_places, len(place), inputs, [is_near])
        return is_near.numpy() > 0

    def _counted(self) -> tuple[np.ndarray, np.ndarray]:
        """The first tile of every facet, and its first corner of tiles."""
        tiles, corners = self.cuts**2, (self.cuts + 1) * (self.cuts + 2) // 2
        return np.concatenate([[0], np.cumsum(tiles)]), np.concatenate([[0], np.cumsum(corners)])


def are_near(place: np.ndarray, others: np.ndarray, distance: float, cells: int) -> np.ndarray:
    """Which places, shape ``[n, 3]``, have others within a distance, and some that are farther: fewer with more cells along it."""
    if not len(others):
        return np.zeros(len(place), bool)
    cell, of_others = (np.floor(some / (distance / cells)).astype(np.int64) for some in (place, others))
    low = np.minimum(cell.min(axis=0), of_others.min(axis=0)) - cells
    extent = np.maximum(cell.max(axis=0), of_others.max(axis=0)) - low + cells + 1

    def numbers(of: np.ndarray) -> np.ndarray:
        x, y, z = (of - low).T
        return (x * extent[1] + y) * extent[2] + z

    steps = np.arange(-cells, cells + 1)
    around = (steps[:, None, None] * extent[1] + steps[:, None]) * extent[2] + steps
    marked = np.unique(numbers(of_others))
    return np.isin(numbers(cell), (marked[:, None] + around.ravel()).ravel())


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


def _empty_description(launcher: Launcher, count: int) -> kernels_cut.Described:
    """What is still to be said of so many facets."""
    described = kernels_cut.Described()
    described.normal, described.corner_normal = launcher.empty(count, wp.vec3d), launcher.empty(3 * count, wp.vec3d)
    described.open_sides, described.edge_sides, described.bent_sides = (
        launcher.empty(count, wp.int32) for _ in range(3)
    )
    described.area, described.longest = (launcher.empty(count, wp.float64) for _ in range(2))
    return described


def _sides_of_bits(bits: np.ndarray) -> np.ndarray:
    """Masks of sides, shape ``[f, 3]``, from bits of numbers, shape ``[f]``."""
    return (bits[:, None] >> np.arange(3) & 1).astype(bool)


def _order(place: np.ndarray, label: np.ndarray, part: np.ndarray | None) -> np.ndarray:
    """Order of facets: label after label, part after part, and in each by their places along curves (:func:`.places_of`)."""
    keys = [place]
    for number in (label,) if part is None else (part, label):
        if number.max() > number.min():
            keys.append(_rank(place, number))
    return np.lexsort(keys)


def _rank(place: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Numbers of parts in the order of where these are, shape ``[n]``: so few bodies on many of them are even, too."""
    first = np.full(int(number.max()) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, number, place & ((1 << 3 * kernels_cut.CURVE_BITS) - 1))
    return np.argsort(np.argsort(first, kind="stable"), kind="stable")[number]
