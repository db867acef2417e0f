"""Several meshes as one, and the part of a mesh that is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..problem.image_filters import luminance
from .triangle_mesh import TriangleMesh

__all__ = ["joined", "part_of_mesh", "two_sided"]


def joined(meshes: Sequence[TriangleMesh], name: str) -> TriangleMesh:
    """Return meshes as one; what one of them lacks of the others' UV maps, vertex groups and attributes is 0 there.

    Args:
        meshes: At least one.
        name: How sentences name all of them.
    """
    if len(meshes) == 1:
        return meshes[0]
    counts = {
        "vertex": [len(mesh.position) for mesh in meshes],
        "corner": [mesh.corner_count for mesh in meshes],
        "face": [mesh.face_count for mesh in meshes],
    }
    first = {key: np.concatenate([[0], np.cumsum(count)[:-1]]) for key, count in counts.items()}

    def shifted(attribute: str, key: str) -> np.ndarray:
        return np.concatenate(
            [getattr(mesh, attribute) + start for mesh, start in zip(meshes, first[key], strict=True)]
        ).astype(np.int32)

    usable = {a for mesh in meshes for a in mesh.attribute}
    return TriangleMesh(
        name,
        np.concatenate([mesh.position for mesh in meshes]),
        shifted("triangle", "vertex"),
        shifted("corner", "corner"),
        shifted("face", "face"),
        np.concatenate([_world_normals(mesh) for mesh in meshes]),
        uv_map={
            key: _stacked([mesh.uv_map.get(key) for mesh in meshes], counts["corner"])
            for key in dict.fromkeys(key for mesh in meshes for key in mesh.uv_map)
        },
        active_uv_map=next((mesh.active_uv_map for mesh in meshes if mesh.active_uv_map), ""),
        vertex_group={
            key: _stacked([mesh.vertex_group.get(key) for mesh in meshes], counts["vertex"])
            for key in dict.fromkeys(key for mesh in meshes for key in mesh.vertex_group)
        },
        attribute={
            key: _joined_attribute(meshes, [mesh.attribute.get(key) for mesh in meshes]) for key in sorted(usable)
        },
        vector={
            key: _joined_attribute(meshes, [mesh.vector.get(key) for mesh in meshes])
            for key in sorted({key for mesh in meshes for key in mesh.vector})
        },
        unusable_attribute={
            key: why for mesh in meshes for key, why in mesh.unusable_attribute.items() if key not in usable
        },
        first_vertex=first["vertex"],
        first_face=first["face"],
        corner_count=sum(counts["corner"]),
        face_count=sum(counts["face"]),
        **_joined_materials(meshes),
    )


def part_of_mesh(mesh: TriangleMesh, chosen: np.ndarray) -> TriangleMesh:
    """Return the part of a mesh whose triangles are chosen, a mask of shape ``[t]``; its bounds stay those of all of it."""
    if chosen.all():
        return mesh
    return replace(
        mesh,
        triangle=mesh.triangle[chosen],
        corner=mesh.corner[chosen],
        face=mesh.face[chosen],
        bounds=mesh.bounds if mesh.bounds is not None else mesh.extent_of_triangles(),
    )


def two_sided(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh with every triangle once more, looking the other way."""
    return replace(
        mesh,
        triangle=np.concatenate([mesh.triangle, mesh.triangle[:, [0, 2, 1]]]),
        corner=np.concatenate([mesh.corner, mesh.corner[:, [0, 2, 1]]]),
        face=np.concatenate([mesh.face, mesh.face]),
    )


def _stacked(values: Sequence[np.ndarray | None], count: Sequence[int]) -> np.ndarray:
    """Return values one after the other, with 0 for what is missing; empty where all of them are, which have not been read."""
    known = [value for value in values if value is not None]
    if not any(len(value) for value in known):
        return known[0]
    shape, dtype = known[0].shape[1:], known[0].dtype
    return np.concatenate(
        [np.zeros((n, *shape), dtype) if v is None else v for v, n in zip(values, count, strict=True)]
    )


def _joined_attribute(
    meshes: Sequence[TriangleMesh], found: Sequence[tuple[str, np.ndarray] | None]
) -> tuple[str, np.ndarray]:
    """Return an attribute on the face corners of all meshes, whatever it is stored on; numbers where some are no colors."""
    known = [entry for entry in found if entry is not None]
    if not any(len(values) for _, values in known):
        return known[0]
    width = known[0][1].shape[1] if all(values.ndim == 2 for _, values in known) else 1
    parts = []
    for mesh, entry in zip(meshes, found, strict=True):
        shape = (mesh.corner_count,) if width == 1 else (mesh.corner_count, width)
        corner = np.zeros(shape, np.float32)
        if entry is not None:
            domain, values = entry
            if values.ndim > 1 and width == 1:
                values = luminance(values)
            if domain == "CORNER":
                corner[:] = values
            elif domain == "POINT":
                corner[mesh.corner] = values[mesh.triangle]
            else:
                corner[mesh.corner] = values[mesh.face][:, None]
        parts.append(corner)
    return "CORNER", np.concatenate(parts)


def _joined_materials(meshes: Sequence[TriangleMesh]) -> dict[str, Any]:
    names = list(dict.fromkeys(name for mesh in meshes for name in mesh.material))
    parts = []
    for mesh in meshes:
        # The last entry is for faces without one.
        number = np.array([*(names.index(name) for name in mesh.material), -1], np.int32)
        parts.append(number[mesh.material_of_face])
    return {"material": names, "material_of_face": np.concatenate(parts)}


def _world_normals(mesh: TriangleMesh) -> np.ndarray:
    """Return the shading normals of the face corners in the world, of length 1, shape ``[c, 3]``, float32."""
    normal = mesh.corner_normal @ mesh.normal_matrix.T
    return (normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)).astype(np.float32)
