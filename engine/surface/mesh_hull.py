"""The convex hull of a mesh by few of its corners, as shapes in space are compared."""

from __future__ import annotations

import numpy as np

from ..geometry.unit_vectors import spread_directions
from .triangle_mesh import TriangleMesh

__all__ = ["MOST_CORNERS", "hull_corners"]

# A hull has at most so many corners; between those of a ball it is up to 5 % of the radius inside.
MOST_CORNERS = 128
# Directions that the farthest points of a mesh are looked for in, spread over all of them alike.
DIRECTIONS = 512
# Corners are left out where the hull is cut off by less than this share of its extent.
CLOSE_ENOUGH = 1e-4
# Points that are looked at together.
AT_ONCE = 65_536


def hull_corners(mesh: TriangleMesh) -> np.ndarray:
    """Return corners of the convex hull of a mesh's triangles [m], shape ``[k, 3]``, k at most 128; none of a mesh without triangles.

    They are points of the mesh, so that nothing sticks out of it. Chosen are those without which most would be cut off.
    """
    used = np.zeros(len(mesh.position), bool)
    used[mesh.triangle] = True
    points = mesh.position[used].astype(np.float64)
    if not len(points):
        return np.empty((0, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    # Of what is long, directions are as close to each other as if it were not.
    unit = np.where(extent > 0.0, extent, 1.0)
    scaled = ((points - 0.5 * (low + high)) / unit).astype(np.float32)
    direction = np.concatenate([np.eye(3), -np.eye(3), spread_directions(DIRECTIONS)]).astype(np.float32)
    corner, reach = _farthest(scaled, direction)
    candidates = scaled[corner]
    chosen = [0]
    reached = direction @ candidates[0]
    while len(chosen) < MOST_CORNERS:
        missing = reach - reached
        worst = int(np.argmax(missing))
        if missing[worst] <= CLOSE_ENOUGH:
            break
        chosen.append(worst)
        reached = np.maximum(reached, direction @ candidates[worst])
    return points[np.unique(corner[chosen])]


def _farthest(points: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which point is farthest along every direction, and how far that is."""
    corner, reach = np.zeros(len(direction), np.int64), np.full(len(direction), -np.inf)
    for start in range(0, len(points), AT_ONCE):
        along = direction @ points[start : start + AT_ONCE].T
        best = along.argmax(axis=1)
        far = along[np.arange(len(direction)), best]
        corner = np.where(far > reach, start + best, corner)
        reach = np.maximum(reach, far)
    return corner, reach
