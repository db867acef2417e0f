"""A mesh as triangles, whatever it was read from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["TriangleMesh", "triangle_areas"]


def triangle_areas(corner: np.ndarray) -> np.ndarray:
    """Areas of triangles, shape ``[t]``, from their corners ``[t, 3, 3]``."""
    a, b, c = corner.swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@dataclass
class TriangleMesh:
    """A mesh as triangles, with what can be interpolated over it.

    Attributes:
        name: How sentences name it.
        position: Vertices in the world [m], shape ``[v, 3]``, float64.
        triangle: Vertex indices, shape ``[t, 3]``, int32.
        corner: Face-corner indices, shape ``[t, 3]``, int32.
        face: Face that each triangle is part of, shape ``[t]``, int32.
        corner_normal: Shading normals of the face corners in the object's space, shape ``[c, 3]``, float32; empty when not read.
        normal_matrix: What turns normals into the world, shape ``[3, 3]``; their length means nothing then.
        uv_map: Name -> coordinates of the face corners, shape ``[c, 2]``.
        active_uv_map: Name of the active one; empty when there is none.
        vertex_group: Name -> weights, shape ``[v]``.
        attribute: Name -> (domain, values of shape ``[n]`` or colors of shape ``[n, 4]``).
        unusable_attribute: Name -> why it is no density.
        vector: Name -> (domain, vectors in the world, shape ``[n, 3]``).
        first_vertex: Of every mesh that was joined, its first vertex, shape ``[m]``.
        first_face: And its first face.
        corner_count: Number of face corners.
        face_count: Number of faces.
        material: Names of its materials, by number.
        material_of_face: Number of every face's material, -1 where it has none, shape ``[face_count]``.
        bounds: Smallest and largest coordinates [m], shape ``[2, 3]``, where they are not those of the triangles.
    """

    name: str
    position: np.ndarray
    triangle: np.ndarray
    corner: np.ndarray
    face: np.ndarray
    corner_normal: np.ndarray
    normal_matrix: np.ndarray = field(default_factory=lambda: np.eye(3))
    uv_map: dict[str, np.ndarray] = field(default_factory=dict)
    active_uv_map: str = ""
    vertex_group: dict[str, np.ndarray] = field(default_factory=dict)
    attribute: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    unusable_attribute: dict[str, str] = field(default_factory=dict)
    vector: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    first_vertex: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    first_face: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    corner_count: int = 0
    face_count: int = 0
    material: list[str] = field(default_factory=list)
    material_of_face: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    bounds: np.ndarray | None = None

    def areas(self) -> np.ndarray:
        """Area of every triangle [m²], shape ``[t]``."""
        return triangle_areas(self.position[self.triangle])

    def extent_of_triangles(self) -> np.ndarray:
        """Smallest and largest coordinates of what is part of a triangle [m], shape ``[2, 3]``."""
        used = np.zeros(len(self.position), bool)
        used[self.triangle.ravel()] = True
        corner = self.position[used]
        return np.stack([corner.min(axis=0), corner.max(axis=0)])
