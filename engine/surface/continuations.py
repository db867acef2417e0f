"""Where parts of a surface that touch continue on each other: a crease or border of one lies on a crease or border of the other.

Pieces of a kit are like that, which stand side by side or on each other and share no corners: from outside they are one surface.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.connected import connected
from ..problem.surface import Surface
from ..problem.unit_vectors import unit_vectors
from . import kernels_continuations
from .cut import bits_of_sides
from .edge_places import places_along

__all__ = ["continued_parts"]

# Places along an edge that are looked at, in each unit of its length; and at most.
PLACES = 2.0
MOST_PLACES = 1000
# Edges that only cross, or of parts that run into each other, lie on each other for less than this, in units.
SHORTEST = 1.0
# Edges that are one lie nearer to each other than this share of their length, however short they are.
NEAR_FOR_LENGTH = 0.02
# So many parts are told from each other by their bounds first.
MOST_BOUNDS = 64


def continued_parts(
    launcher: Launcher, surface: Surface, unit: float, part: np.ndarray, near: float
) -> tuple[np.ndarray, np.ndarray]:
    """Make one of the parts that continue on each other.

    Args:
        launcher: Where to run.
        surface: The surface.
        unit: Meters per unit.
        part: Number of the part that every triangle is in, shape ``[t]``.
        near: Edges no farther apart are one, in units.

    Returns:
        The parts, shape ``[t]``, and whether the surface continues on another part at the side opposite of each corner,
        shape ``[t, 3]``.
    """
    continues = np.zeros((len(part), 3), bool)
    if part.max() == part.min():
        return part, continues
    place = ((surface.position - 0.5 * (surface.low + surface.high)) / unit)[surface.triangle]
    triangle, corner = np.nonzero(surface.edge_side & _beside_others(place, part, near)[:, None])
    start, end, apex = (place[triangle, (corner + k) % 3] for k in (1, 2, 0))
    side, point, share = places_along(start, end, PLACES, MOST_PLACES)
    nearest = np.minimum(near, NEAR_FOR_LENGTH * np.linalg.norm(end - start, axis=1))
    find = _Finder(launcher, surface, place, triangle, (start, end, apex), nearest)
    while len(side):
        found = find(part, side, point)
        hit = found >= 0
        side, point, share, other = side[hit], point[hit], share[hit], found[hit]
        own = triangle[side]
        couple, number = np.unique(np.sort(np.stack([part[own], part[other]], axis=1)), axis=0, return_inverse=True)
        joined = np.bincount(number.ravel(), share, len(couple)) >= SHORTEST
        if not joined.any():
            break
        crossed = side[joined[number.ravel()]]
        continues[triangle[crossed], corner[crossed]] = True
        # A place may lie beside several parts.
        part = connected(int(part.max()) + 1, *couple[joined].T)[part]
    return part, continues


def _beside_others(place: np.ndarray, part: np.ndarray, near: float) -> np.ndarray:
    """Return which triangles reach into the bounds of another part, shape ``[t]``; all of them where parts are many.

    Args:
        place: Their corners, shape ``[t, 3, 3]``.
        part: The part of each, shape ``[t]``.
        near: What is no farther away counts, too.
    """
    count = int(part.max()) + 1
    if count > MOST_BOUNDS:
        return np.ones(len(part), bool)
    low, high = place.min(axis=1), place.max(axis=1)
    result = np.zeros(len(part), bool)
    for k in range(count):
        own = part == k
        if own.any():
            reaches = (high >= low[own].min(axis=0) - near) & (low <= high[own].max(axis=0) + near)
            result |= ~own & reaches.all(axis=1)
    return result


class _Finder:
    """Finds triangles that a surface continues on across its edges.

    Args:
        launcher: Where to run.
        surface: The surface.
        place: Corners of its triangles, in units, from its middle, shape ``[t, 3, 3]``.
        triangle: Triangle of every edge, shape ``[s]``.
        ends: Where each begins and ends, and the corner opposite of it, three of shape ``[s, 3]``.
        near: Others no farther from each are one with it, in units, shape ``[s]``.
    """

    def __init__(
        self,
        launcher: Launcher,
        surface: Surface,
        place: np.ndarray,
        triangle: np.ndarray,
        ends: tuple[np.ndarray, np.ndarray, np.ndarray],
        near: np.ndarray,
    ) -> None:
        self._launcher = launcher
        start, end, apex = ends
        along = unit_vectors(end - start)
        inward = apex - start
        inward = unit_vectors(inward - along * (inward * along).sum(axis=1)[:, None])
        self._sides = kernels_continuations.EdgeSides()
        self._sides.triangle = launcher.array(triangle.astype(np.int32), wp.int32)
        self._sides.along, self._sides.inward = self._vectors(along), self._vectors(inward)
        self._sides.near = launcher.array(near.astype(np.float32), wp.float32)
        corner = launcher.own_array(np.arange(place.size // 3, dtype=np.int32), wp.int32)
        self._mesh = wp.Mesh(launcher.own_array(place.reshape(-1, 3).astype(np.float32), wp.vec3), corner)
        self._normal = self._vectors(surface.normal)
        self._edge_sides = launcher.array(bits_of_sides(surface.edge_side), wp.int32)

    def __call__(self, part: np.ndarray, side: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return a triangle of another part for points of edges, or -1, shape ``[n]``.

        Args:
            part: Of every triangle, shape ``[t]``.
            side: The edge of every point, shape ``[n]``.
            point: In units, from the surface's middle, shape ``[n, 3]``.
        """
        launcher = self._launcher
        found = launcher.empty(len(side), wp.int32)
        own, numbers = launcher.array(part.astype(np.int32), wp.int32), launcher.array(side.astype(np.int32), wp.int32)
        inputs = [self._mesh.id, self._normal, own, self._edge_sides, self._sides, numbers, self._vectors(point)]
        launcher.launch(kernels_continuations.find_continuations, len(side), inputs, [found], grain=GRAIN_OF_NEIGHBORS)
        return found.numpy()

    def _vectors(self, values: np.ndarray) -> wp.array:
        return self._launcher.array(values.astype(np.float32), wp.vec3)
