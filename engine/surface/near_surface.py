"""What of a surface is near other things: where these lie on it, and what of it solids and flat shapes cover."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import warp as wp

from ..problem.surface import Surface
from . import kernels_near_surface
from .launching import launch_on_cpu, mesh_on_cpu

__all__ = ["NearSurface", "PlacesNear", "is_inside", "samples_of"]

# What lies on a surface that has two sides in one place is on both where it is no farther off than this share of the extent.
ON_BOTH = 1e-6
# A shape covers what is as near to its points as this, in steps between these, so that nothing between them stays free.
COVERS_STEP = 0.6
# Steps along the longest side of a triangle at most.
MOST_STEPS = 512


class PlacesNear(NamedTuple):
    """Places on a surface.

    Attributes:
        row: Which of the things that were looked for each belongs to, shape ``[k]``: of some there is none, of others two.
        triangle: Which of the surface's triangles it is on, shape ``[k]``.
        position: Where it is [m], shape ``[k, 3]``, float64.
    """

    row: np.ndarray
    triangle: np.ndarray
    position: np.ndarray


class NearSurface:
    """Finds what of a surface is near.

    Args:
        surface: The surface.
    """

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self._middle = 0.5 * (surface.low + surface.high)
        self._extent = float((surface.high - surface.low).max())
        self._mesh = mesh_on_cpu(surface.position[surface.triangle] - self._middle)
        self._twin = _twins(surface)

    def towards(self, position: np.ndarray, normal: np.ndarray, within: np.ndarray) -> PlacesNear:
        """Return the nearest places of the surface that look along normals.

        Args:
            position: Of what is looked for [m], shape ``[n, 3]``.
            normal: Where the surface is to look to, shape ``[n, 3]``.
            within: How far each looks [m], shape ``[n]``.
        """
        return self._nearest(position, normal, within)

    def nearest(self, position: np.ndarray, within: np.ndarray) -> PlacesNear:
        """Return the nearest places of the surface, of one with two sides in one place those on the side that sees what is there."""
        found = self._nearest(position, np.zeros((len(position), 3)), within)
        if self._twin is None:
            return found
        other = self._twin[found.triangle]
        way = np.asarray(position, np.float64)[found.row] - found.position
        height = np.einsum("nd,nd->n", way, self.surface.normal[found.triangle])
        on = np.abs(height) <= ON_BOTH * self._extent
        triangle = np.where((height < 0.0) & (other >= 0) & ~on, other, found.triangle)
        both = np.flatnonzero(on & (other >= 0))
        return PlacesNear(
            np.concatenate([found.row, found.row[both]]),
            np.concatenate([triangle, other[both]]),
            np.concatenate([found.position, found.position[both]]),
        )

    def _nearest(self, position: np.ndarray, looks: np.ndarray, within: np.ndarray) -> PlacesNear:
        n = len(position)
        face, nearest = np.empty(n, np.int32), np.zeros((n, 3), np.float32)
        if n:
            inputs = [self._mesh.id, _single(position - self._middle), _single(looks), within.astype(np.float32)]
            launch_on_cpu(kernels_near_surface.find_nearest, n, inputs, [face, nearest])
        row = np.flatnonzero(face >= 0)
        return PlacesNear(row, face[row].astype(np.int64), nearest[row].astype(np.float64) + self._middle)

    def covered_by(
        self, places: PlacesNear, radius: float, position: np.ndarray, normal: np.ndarray, covered: np.ndarray
    ) -> None:
        """Mark the points of the surface that discs of this radius [m] about places on it cover, on the same side.

        Args:
            places: The middles of the discs.
            radius: Theirs.
            position: The points [m], shape ``[n, 3]``.
            normal: Where the surface looks to there, shape ``[n, 3]``.
            covered: Gets 1 for what is covered, shape ``[n]``, uint8.
        """
        if not len(places.row):
            return
        low, high = places.position.min(axis=0) - radius, places.position.max(axis=0) + radius
        near = np.flatnonzero(((position >= low) & (position <= high)).all(axis=1))
        if not len(near):
            return
        disc = wp.array(_single(places.position - self._middle), dtype=wp.vec3, device="cpu")
        cells = int(np.clip(np.ceil((high - low).max() / radius), 1, 256))
        grid = wp.HashGrid(cells, cells, cells, device="cpu")
        grid.build(disc, radius)
        found = covered[near]
        inputs = [
            grid.id,
            disc,
            _single(self.surface.normal[places.triangle]),
            radius,
            _single(position[near] - self._middle),
            _single(normal[near]),
        ]
        launch_on_cpu(kernels_near_surface.find_covered, len(near), inputs, [found])
        covered[near] = found


def is_inside(triangle: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return which places lie inside a closed mesh, shape ``[n]``, bool: of one that is open nothing does that it does not surround.

    Args:
        triangle: Corners of its triangles [m], shape ``[t, 3, 3]``, which may all look inside.
        position: The places [m], shape ``[n, 3]``.
    """
    low, high = triangle.min(axis=(0, 1)), triangle.max(axis=(0, 1))
    found = np.zeros(len(position), bool)
    near = np.flatnonzero(((position >= low) & (position <= high)).all(axis=1))
    if not len(near) or not (high > low).all():
        return found
    middle = 0.5 * (low + high)
    corner = triangle - middle
    volume = float(np.einsum("nd,nd->n", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum())
    mesh = mesh_on_cpu(corner if volume >= 0.0 else corner[:, [0, 2, 1]], winding=True)
    inside = np.zeros(len(near), np.uint8)
    launch_on_cpu(kernels_near_surface.find_inside, len(near), [mesh.id, _single(position[near] - middle)], [inside])
    found[near] = inside != 0
    return found


def samples_of(triangle: np.ndarray, step: float) -> np.ndarray:
    """Return points spread over triangles, segments and points ``[t, 3, 3]``, about so far apart [m], shape ``[k, 3]``.

    Discs of :data:`COVERS_STEP` such steps about them cover the triangles and hardly more. Of segments, two of whose corners are the
    same, both ends are among them.
    """
    side = triangle - np.roll(triangle, -1, axis=1)
    length = np.linalg.norm(side, axis=2)
    longest = length.max(axis=1)
    flat = length.min(axis=1) <= 1e-9 * longest
    cuts = np.clip(np.ceil(longest / step), 1, MOST_STEPS).astype(np.int64)
    found = [np.empty((0, 3))]
    for number in np.unique(cuts).tolist():
        own = np.flatnonzero((cuts == number) & ~flat)
        if len(own):
            found.append(np.einsum("kc,ncd->nkd", _middles(number), triangle[own]).reshape(-1, 3))
        lines = np.flatnonzero((cuts == number) & flat)
        if len(lines):
            share = np.linspace(0.0, 1.0, number + 1)[:, None]
            # Of the three corners two are ends.
            end = np.where((length[lines, 0] > 0.0)[:, None], triangle[lines, 1], triangle[lines, 2])
            found.append((triangle[lines, None, 0] * (1.0 - share) + end[:, None] * share).reshape(-1, 3))
    return np.concatenate(found)


def _middles(cuts: int) -> np.ndarray:
    """Weights of a triangle's corners at the middles of the triangles that it is cut into, shape ``[cuts², 3]``."""
    row, column = np.divmod(np.arange(cuts * cuts), cuts)
    # Cells of a square, of which those beyond the diagonal are the other halves.
    u, v = (column + 1.0 / 3.0) / cuts, (row + 1.0 / 3.0) / cuts
    beyond = column + row >= cuts
    u, v = np.where(beyond, 1.0 - u, u), np.where(beyond, 1.0 - v, v)
    return np.stack([1.0 - u - v, u, v], axis=1)


def _single(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32)


def _twins(surface: Surface) -> np.ndarray | None:
    """Which triangle is the other side of each, -1 where there is none; None where no triangle has another side."""
    _, number, count = np.unique(np.sort(surface.welded, axis=1), axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    if count.max() < 2:
        return None
    order = np.argsort(number, kind="stable")
    same = number[order[1:]] == number[order[:-1]]
    twin = np.full(len(number), -1)
    one, other = order[:-1][same], order[1:][same]
    looking_away = np.einsum("nd,nd->n", surface.normal[one], surface.normal[other]) < 0.0
    twin[one[looking_away]], twin[other[looking_away]] = other[looking_away], one[looking_away]
    return twin
