"""What ties the points of a result to its target, so that the node group can move them with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from ...engine.geometry.unit_vectors import unit_vectors
from ...engine.surface.surface_points import SurfacePoints
from ...engine.surface.triangle_mesh import TriangleMesh
from ..targets.subdivision import Subdivision
from .attributes import ALIGN, CORNERS, EDGE, FACE_NORMAL, FINER_CORNERS, GROUND_POINT, TARGET
from .node_group_contents import Finer, Followed, Rest

__all__ = ["finer_attributes", "follow_attributes", "followed"]


def followed(
    targets: Sequence[bpy.types.Object],
    mesh: TriangleMesh,
    stood: Sequence[np.ndarray],
    divided: Sequence[Subdivision | None],
) -> list[Followed]:
    """Return what the points on targets follow, each with the vertices that it had.

    Args:
        targets: In the order of ``esh_target``.
        mesh: All of them as one.
        stood: Their matrices when they were read, shape ``[4, 4]``.
        divided: How they are subdivided; None where they are not.
    """
    finer = [one and Finer(one.level, one.finer_counts()) for one in divided]
    count = np.diff([*mesh.first_vertex, len(mesh.position)])
    return [
        Followed(item, int(n), bool(np.linalg.det(matrix[:3, :3]) < 0.0), _rest(matrix), further)
        for item, n, matrix, further in zip(targets, count, stood, finer, strict=True)
    ]


def _rest(matrix: np.ndarray) -> Rest:
    """Return how a target stood, as nodes hold it; a flat one has no way back from its plane, and needs none."""
    rows = [matrix[:3, 3], *np.linalg.pinv(matrix[:3, :3])]
    return Rest(*(tuple(row.astype(np.float32).tolist()) for row in rows))


def follow_attributes(points: SurfacePoints, align: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """Return what is to be known of the triangles that points stand on, besides which they are, to follow them.

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
        GROUND_POINT: ("FLOAT_VECTOR", points.position),
        EDGE: ("FLOAT_VECTOR", unit_vectors(edge)),
        FACE_NORMAL: ("FLOAT_VECTOR", unit_vectors(normal)),
        ALIGN: ("FLOAT", align),
    }


def finer_attributes(
    stuck: Mapping[str, tuple[str, np.ndarray]], divided: Sequence[Subdivision | None]
) -> dict[str, tuple[str, np.ndarray]]:
    """Return what leads to the vertices around points where targets are subdivided further; nothing where none is at all.

    Args:
        stuck: The attributes that say which vertices these are, and on which of several targets.
        divided: How the targets are subdivided; None where they are not.
    """
    if not any(divided):
        return {}
    corner = np.stack([stuck[name][1] for name in CORNERS])
    found = np.zeros((2, *corner.shape), np.int32)
    for number, one in enumerate(divided):
        if one is not None:
            own = np.flatnonzero(stuck[TARGET][1] == number) if TARGET in stuck else slice(None)
            found[:, :, own] = one.finer_numbers(corner[:, own])
    return {
        name: ("INT", values)
        for names, all_values in zip(FINER_CORNERS, found, strict=True)
        for name, values in zip(names, all_values, strict=True)
    }
