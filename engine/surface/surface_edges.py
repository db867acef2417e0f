"""Creases and borders of a surface, as kernels take them that look for what lies beside them."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..geometry.unit_vectors import unit_vectors
from ..problem.surface import Surface
from . import kernels_continuations
from .cut import bits_of_sides
from .edge_places import places_along

__all__ = ["Places", "SurfaceEdges"]

# Places along an edge that are looked at, in each unit of its length; and at most.
PLACES = 2.0
MOST_PLACES = 1000
# So many parts are told from each other by their bounds first.
MOST_BOUNDS = 64


class Places(NamedTuple):
    """Places along edges.

    Attributes:
        triangle: Triangle of every edge, shape ``[s]``.
        corner: The corner opposite of it.
        sides: The edges as kernels take them.
        side: The edge of every place, shape ``[n]``.
        point: In units, from the surface's middle, shape ``[n, 3]``.
        share: Length of edge that each stands for, shape ``[n]``.
    """

    triangle: np.ndarray
    corner: np.ndarray
    sides: kernels_continuations.EdgeSides
    side: np.ndarray
    point: np.ndarray
    share: np.ndarray


class SurfaceEdges:
    """Edges of a surface, in units from its middle.

    Args:
        launcher: Where to run.
        surface: The surface.
        unit: Meters per unit.
    """

    def __init__(self, launcher: Launcher, surface: Surface, unit: float) -> None:
        self.launcher, self._surface, self._unit = launcher, surface, unit

    @cached_property
    def place(self) -> np.ndarray:
        """Corners of its triangles, shape ``[t, 3, 3]``."""
        surface = self._surface
        return ((surface.position - 0.5 * (surface.low + surface.high)) / self._unit)[surface.triangle]

    @cached_property
    def mesh(self) -> wp.Mesh:
        """The triangles, which share no corners."""
        launcher, place = self.launcher, self.place
        corner = launcher.own_array(np.arange(place.size // 3, dtype=np.int32), wp.int32)
        return wp.Mesh(launcher.own_array(place.reshape(-1, 3).astype(np.float32), wp.vec3), corner)

    @cached_property
    def normal(self) -> wp.array:
        """Their normals."""
        return self.vectors(self._surface.normal)

    @cached_property
    def edge_sides(self) -> wp.array:
        """Which of their sides are edges: bit k is the side opposite of corner k."""
        return self.launcher.array(bits_of_sides(self._surface.edge_side), wp.int32)

    def places(self, part: np.ndarray, near: float, share_of_length: float) -> Places:
        """Places along the edges that may lie on another part.

        Args:
            part: Of every triangle, shape ``[t]``.
            near: What is no farther from an edge lies on it, in units.
            share_of_length: Nor may it be farther than this share of the edge's length.
        """
        place, launcher = self.place, self.launcher
        triangle, corner = np.nonzero(self._surface.edge_side & _beside_others(place, part, near)[:, None])
        start, end, apex = (place[triangle, (corner + k) % 3] for k in (1, 2, 0))
        side, point, share = places_along(start, end, PLACES, MOST_PLACES)
        along = unit_vectors(end - start)
        inward = apex - start
        inward = unit_vectors(inward - along * (inward * along).sum(axis=1)[:, None])
        nearest = np.minimum(near, share_of_length * np.linalg.norm(end - start, axis=1))
        sides = kernels_continuations.EdgeSides()
        sides.triangle = launcher.array(triangle.astype(np.int32), wp.int32)
        sides.along, sides.inward = self.vectors(along), self.vectors(inward)
        sides.near = launcher.array(nearest.astype(np.float32), wp.float32)
        return Places(triangle, corner, sides, side, point, share)

    def vectors(self, values: np.ndarray) -> wp.array:
        """Vectors, shape ``[n, 3]``, on the device."""
        return self.launcher.array(values.astype(np.float32), wp.vec3)


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
