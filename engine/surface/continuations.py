"""Where parts of a surface that touch continue on each other: a crease or border of one lies on a crease or border of the other.

Pieces of a kit are like that, which stand side by side or on each other and share no corners: from outside they are one surface.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS
from ..geometry.connected import connected
from . import kernels_continuations
from .surface_edges import Places, SurfaceEdges

__all__ = ["continued_parts"]

# Edges that only cross, or of parts that run into each other, lie on each other for less than this, in units.
SHORTEST = 1.0
# Edges that are one lie nearer to each other than this share of their length, however short they are.
NEAR_FOR_LENGTH = 0.02


def continued_parts(edges: SurfaceEdges, part: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """Make one of the parts that continue on each other.

    Args:
        edges: Edges of the surface.
        part: Number of the part that every triangle is in, shape ``[t]``.
        near: Edges no farther apart are one, in units.

    Returns:
        The parts, shape ``[t]``, and whether the surface continues on another part at the side opposite of each corner,
        shape ``[t, 3]``.
    """
    continues = np.zeros((len(part), 3), bool)
    if part.max() == part.min():
        return part, continues
    places = edges.places(part, near, NEAR_FOR_LENGTH)
    side, point, share = places.side, places.point, places.share
    while len(side):
        found = _found(edges, places, part, side, point)
        hit = found >= 0
        side, point, share, other = side[hit], point[hit], share[hit], found[hit]
        own = places.triangle[side]
        couple, number = np.unique(np.sort(np.stack([part[own], part[other]], axis=1)), axis=0, return_inverse=True)
        joined = np.bincount(number.ravel(), share, len(couple)) >= SHORTEST
        if not joined.any():
            break
        crossed = side[joined[number.ravel()]]
        continues[places.triangle[crossed], places.corner[crossed]] = True
        # A place may lie beside several parts.
        part = connected(int(part.max()) + 1, *couple[joined].T)[part]
    return part, continues


def _found(edges: SurfaceEdges, places: Places, part: np.ndarray, side: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return a triangle of another part on which the surface continues at points of edges, or -1, shape ``[n]``.

    Args:
        edges: Edges of the surface.
        places: Those that are looked at.
        part: Of every triangle, shape ``[t]``.
        side: The edge of every point, shape ``[n]``.
        point: In units, from the surface's middle, shape ``[n, 3]``.
    """
    launcher = edges.launcher
    found = launcher.empty(len(side), wp.int32)
    own, numbers = launcher.array(part.astype(np.int32), wp.int32), launcher.array(side.astype(np.int32), wp.int32)
    inputs = [edges.mesh.id, edges.normal, own, edges.edge_sides, places.sides, numbers, edges.vectors(point)]
    launcher.launch(kernels_continuations.find_continuations, len(side), inputs, [found], grain=GRAIN_OF_NEIGHBORS)
    return found.numpy()
