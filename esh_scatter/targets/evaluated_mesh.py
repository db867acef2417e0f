"""Meshes as Blender evaluates them, and where their vertices are in the world."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from .depsgraph import evaluated_depsgraph
from .mesh_attributes import read_attribute

__all__ = ["evaluated_mesh", "in_world", "vertex_positions", "vertices_in_world"]


@contextmanager
def evaluated_mesh(item: bpy.types.Object, context: bpy.types.Context) -> Iterator[bpy.types.Mesh | None]:
    """Give the mesh of an object with its modifiers, for as long as it is looked at; None of what has none, as lights and cameras."""
    evaluated = item.evaluated_get(evaluated_depsgraph(context))
    try:
        mesh = evaluated.to_mesh()
    except RuntimeError:
        mesh = None
    try:
        yield mesh
    finally:
        evaluated.to_mesh_clear()


def vertices_in_world(mesh: bpy.types.Mesh, matrix: np.ndarray) -> np.ndarray:
    """Return where the vertices of a mesh that has some are, shape ``[n, 3]``; see :func:`in_world`."""
    return in_world(vertex_positions(mesh), matrix)


def vertex_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return where the vertices of a mesh that has some are, as it sees them itself, shape ``[n, 3]``, float32."""
    # As an attribute, which is copied as a whole; vertices are asked one after the other.
    return read_attribute(mesh, "position")


def in_world(position: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return positions ``[n, 3]`` as the matrix of an object ``[4, 4]`` puts them into the world, float64, whatever they were."""
    # Those that are not finite stay so, and are told by whoever needs them.
    with np.errstate(invalid="ignore"):
        return position.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
