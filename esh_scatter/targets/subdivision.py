"""Targets that may be subdivided further in renders than in the viewport, and which vertex there is which of those here.

Blender numbers the vertices of a subdivided mesh by what they are of the coarse one: its vertices come first, as they were numbered,
then those along its edges, then those within its faces. Those of a level are among those of every finer one, at the same places.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from .evaluated_mesh import evaluated_mesh
from .mesh_attributes import read_attribute

__all__ = ["DIVIDES", "FURTHER", "Subdivision", "levels", "read_subdivision"]

# Modifiers that divide faces, to one level in the viewport and to another one in renders.
DIVIDES = ("SUBSURF", "MULTIRES")
# To how many levels more than in the viewport.
FURTHER = 6
# As many vertices as Blender can number.
MOST_VERTICES = 2**31 - 1
# Modifiers that leave vertices their numbers, whatever they are told to do.
_KEEPS_NUMBERS = {
    *("ARMATURE", "CAST", "CLOTH", "COLLISION", "CORRECTIVE_SMOOTH", "CURVE", "DATA_TRANSFER", "DISPLACE", "HOOK"),
    *("LAPLACIANDEFORM", "LAPLACIANSMOOTH", "LATTICE", "MESH_CACHE", "MESH_DEFORM", "NORMAL_EDIT", "PARTICLE_SYSTEM"),
    *("SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY", "SURFACE", "SURFACE_DEFORM", "UV_PROJECT", "UV_WARP"),
    *("VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "WARP", "WAVE", "WEIGHTED_NORMAL"),
}


class Subdivision(NamedTuple):
    """How a mesh is divided, as far as the numbers of its vertices go.

    Attributes:
        level: How often its edges are halved.
        vertices: How many the coarse mesh has.
        edges: How many that has.
        sides: Of each of its faces, shape ``[n]``.
    """

    level: int
    vertices: int
    edges: int
    sides: np.ndarray

    def finer_counts(self) -> tuple[int, ...]:
        """Return how many vertices the mesh has at each finer level, as far as these can be numbered."""
        found = [self.vertices_at(self.level + more) for more in range(1, FURTHER + 1)]
        return tuple(count for count in found if count <= MOST_VERTICES)

    def vertices_at(self, level: int) -> int:
        """Return how many vertices the mesh has at a level."""
        parts = 2**level
        within = len(self.sides) + int(self.sides.sum(dtype=np.int64)) * (parts * (parts - 2) // 4) if level else 0
        return self.vertices + self.edges * (parts - 1) + within

    def finer_numbers(self, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what leads from the numbers of vertices, of any shape, to those at finer levels.

        Where edges are cut into 1 + t times as many parts, the number is ``vertex + t * (step + t * square)``.
        """
        count = self.vertices_at(self.level)
        if vertex.size <= count:
            return self._finer_numbers(vertex)
        step, square = self._finer_numbers(np.arange(count))
        return step[vertex], square[vertex]

    def _finer_numbers(self, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # All numbers are polynomials of how many times as many parts there are: these are their factors.
        once, square = (np.zeros(vertex.shape, np.int64) for _ in range(2))
        parts = 2**self.level
        within_faces = self.vertices + self.edges * (parts - 1)
        own = (vertex >= self.vertices) & (vertex < within_faces)
        if own.any():
            edge, part = np.divmod(vertex[own] - self.vertices, parts - 1)
            once[own] = edge * parts + part + 1
        own = vertex >= within_faces
        if own.any():
            half = parts // 2
            before = np.cumsum(self.sides, dtype=np.int64) - self.sides
            first = np.arange(len(self.sides)) + before * (half * (half - 1))
            number = vertex[own] - within_faces
            face = np.searchsorted(first, number, side="right") - 1
            inner_once, inner_square = _within_face(self.sides[face] == 4, number - first[face], parts)
            once[own] = self.edges * parts - before[face] * half + inner_once
            square[own] = before[face] * (half * half) + inner_square
        return (once + 2 * square).astype(np.int32), square.astype(np.int32)


def _within_face(quad: np.ndarray, number: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors of the numbers that vertices have among those within their faces, shape ``[n]`` each.

    Quads hold rows of vertices. Others have one in the middle, and then for each corner the rows of the quad between it and that.
    """
    half = parts // 2
    row, column = np.divmod(number, parts - 1)
    of_quad = column - row - parts, parts * (row + 1)
    corner, rest = np.divmod(number - 1, max(half * (half - 1), 1))
    row, column = np.divmod(rest, half)
    of_other = column + 1 - half * (corner + 1), half * (half * corner + row + 1)
    once, square = (np.where(quad, *pair) for pair in zip(of_quad, of_other, strict=True))
    middle = ~quad & (number == 0)
    return np.where(middle, 0, once), np.where(middle, 0, square)


def levels(target: bpy.types.Object, render: bpy.types.RenderSettings) -> list[tuple[int, int]]:
    """Return to which levels modifiers divide a target, in the viewport and in renders, of those that do."""
    found = (_levels(one, render) for one in target.modifiers if one.type in DIVIDES)
    return [one for one in found if one != (0, 0)]


def _levels(modifier: bpy.types.Modifier, render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Return to which level a modifier divides faces in the viewport, and in renders."""
    shown = modifier.levels if modifier.show_viewport else 0
    rendered = modifier.render_levels if modifier.show_render else 0
    if render.use_simplify:
        return min(shown, render.simplify_subdivision), min(rendered, render.simplify_subdivision_render)
    return shown, rendered


def read_subdivision(target: bpy.types.Object, context: bpy.types.Context) -> Subdivision | None:
    """Return how a target is divided; None where it is not, or where that says nothing of its vertices at finer levels."""
    if not _is_divided_last(target, context.scene.render):
        return None
    level = levels(target, context.scene.render)[-1][0]
    with evaluated_mesh(target, context) as mesh:
        if mesh is None or not len(mesh.polygons):
            return None
        return _divided(mesh, level) if level else _undivided(mesh)


def _is_divided_last(target: bpy.types.Object, render: bpy.types.RenderSettings) -> bool:
    """Tell whether a target is divided, and whether only the level of the last modifier that does so may give it other vertices."""
    shown = [one for one in target.modifiers if one.show_viewport or one.show_render]
    shown = [one for one in shown if one.type not in DIVIDES or _levels(one, render) != (0, 0)]
    at = max((k for k, one in enumerate(shown) if one.type in DIVIDES), default=None)
    if at is None:
        return False
    others = [one for one in (*shown[:at], *shown[at + 1 :]) if one.type not in _KEEPS_NUMBERS]
    # Where nothing is divided in the viewport, its mesh does not show what becomes of the numbers afterwards.
    if not _levels(shown[at], render)[0] and any(one.type not in _KEEPS_NUMBERS for one in shown[at + 1 :]):
        return False
    divides = [_levels(one, render) for one in others if one.type in DIVIDES]
    alike = all(one.type in DIVIDES or one.show_viewport == one.show_render for one in others)
    return alike and all(seen == rendered for seen, rendered in divides)


def _undivided(mesh: bpy.types.Mesh) -> Subdivision:
    """Return how a mesh is divided in renders that is not in the viewport."""
    sides = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    return Subdivision(0, len(mesh.vertices), len(mesh.edges), sides)


def _divided(mesh: bpy.types.Mesh, level: int) -> Subdivision | None:
    """Return how a mesh was divided whose last step that was; None where it is not numbered so."""
    parts = 2**level
    faces, half = len(mesh.polygons), parts // 2
    # Each corner of a coarse face has so many faces; between these are so many edges, and those along coarse edges besides.
    corners, odd = divmod(faces, half * half)
    edges, odd_edges = divmod(len(mesh.edges) - corners * parts * (parts - 1) // 2, parts)
    if odd or odd_edges or edges < 1 or len(mesh.loops) != 4 * faces:
        return None
    along = read_attribute(mesh, ".edge_verts")[: edges * parts].reshape(edges, parts, 2)
    vertices = int(along[0, 0, 1])
    expected = np.arange(vertices, vertices + edges * (parts - 1), dtype=np.int32).reshape(edges, parts - 1)
    ends = along[:, 0, 0], along[:, -1, 1]
    if (along[:, :-1, 1] != expected).any() or (along[:, 1:, 0] != expected).any() or np.max(ends) >= vertices:
        return None
    within_faces = vertices + edges * (parts - 1)
    corner = np.ascontiguousarray(read_attribute(mesh, ".corner_vert").reshape(-1, 4).T)
    highest = corner.max(axis=0)
    corner[corner < within_faces] = len(mesh.vertices)
    lowest = corner.min(axis=0)
    # The first one within a coarse face, and those that follow, have vertices of their own that none before it has.
    lowest = np.minimum.accumulate(lowest[::-1])[::-1]
    first = np.flatnonzero(lowest > np.concatenate([[-1], np.maximum.accumulate(highest)[:-1]]))
    sides, odd_sides = np.divmod(np.diff([*first, faces]), half * half)
    if odd_sides.any() or sides.sum() != corners:
        return None
    found = Subdivision(level, vertices, edges, sides.astype(np.int32))
    return found if found.vertices_at(level) == len(mesh.vertices) else None
