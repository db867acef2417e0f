"""What ties the points of a result to its target, so that the node group can move them with it."""

from __future__ import annotations

import numpy as np

from ..engine.surface.surface_points import SurfacePoints
from .node_group import ALIGN, CORNERS, EDGE, FACE_NORMAL, GROUND_POINT, WEIGHTS

__all__ = ["follow_attributes"]


def follow_attributes(points: SurfacePoints, align: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes that tie points to the triangles that they stand on.

    Args:
        points: Where they stand on the target.
        align: How far the objects follow the slope, 0..1, shape ``[n]``.
    """
    mesh = points.view.mesh
    corner = mesh.triangle[points.triangle]
    a, b, c = (mesh.position[corner[:, k]] for k in range(3))
    edge = b - a
    normal = np.cross(edge, c - a)
    return {
        **{name: ("INT", corner[:, k]) for k, name in enumerate(CORNERS)},
        WEIGHTS: ("FLOAT_VECTOR", points.weight),
        GROUND_POINT: ("FLOAT_VECTOR", points.position),
        EDGE: ("FLOAT_VECTOR", _of_length_1(edge)),
        FACE_NORMAL: ("FLOAT_VECTOR", _of_length_1(normal)),
        ALIGN: ("FLOAT", align),
    }


def _of_length_1(vector: np.ndarray) -> np.ndarray:
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-300)
