"""Where parts of a surface stand on one another: an edge of one lies within a face of the other, as of a box on the ground.

They are not one part, which would make one of all that stands on the same thing, or lies on it: a carpet and the floor are apart, and
the wall that both end at has to do with both.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS
from . import kernels_standing
from .surface_edges import SurfaceEdges

__all__ = ["standing_pairs"]

# An edge no farther from a face lies in it, in units.
NEAR = 0.1
# A part that stands on another does so by edges of this length, in units.
SHORTEST = 1.0


def standing_pairs(edges: SurfaceEdges, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the parts that stand on one another.

    Args:
        edges: Edges of the surface.
        part: Number of the part that every triangle is in, shape ``[t]``.

    Returns:
        Pairs of parts, the smaller number first, shape ``[p, 2]``; and places along the lines where they do, in units from the
        surface's middle, shape ``[m, 3]``.
    """
    if part.max() == part.min():
        return np.zeros((0, 2), np.int64), np.zeros((0, 3))
    places, launcher = edges.places(part, NEAR, np.inf), edges.launcher
    count = len(places.side)
    found = launcher.empty((count, kernels_standing.MOST_AT_PLACE), wp.int32)
    own, side = launcher.array(part.astype(np.int32), wp.int32), launcher.array(places.side.astype(np.int32), wp.int32)
    inputs = [edges.mesh.id, edges.normal, own, places.sides, side, edges.vectors(places.point)]
    launcher.launch(kernels_standing.find_grounds, count, inputs, [found], grain=GRAIN_OF_NEIGHBORS)
    ground = found.numpy()
    place, slot = np.nonzero(ground >= 0)
    couple = np.stack([part[places.triangle[places.side[place]]], ground[place, slot]], axis=1)
    pair, number = np.unique(np.sort(couple, axis=1), axis=0, return_inverse=True)
    stands = np.bincount(number.ravel(), places.share[place], len(pair)) >= SHORTEST
    return pair[stands], places.point[place[stands[number.ravel()]]]
