"""Targets that are subdivided further in renders than in the viewport, and which vertex there is which of those here.

Blender numbers the vertices of a subdivided mesh by what they are of the coarse one: its vertices come first, as they were numbered,
then those along its edges, then those within its faces. Those of a level are among those of every finer one, at the same places.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from .evaluated_mesh import evaluated_mesh

__all__ = ["DIVIDES", "Subdivision", "levels_apart", "read_subdivision"]

# Modifiers that divide faces, to one level in the viewport and to another one in renders.
DIVIDES = ("SUBSURF", "MULTIRES")
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
        level: How often its edges are halved in the viewport.
        rendered: How often in renders: more often.
        vertices: How many the coarse mesh has.
        edges: How many that has.
        sides: Of each of its faces, shape ``[n]``.
    """

    level: int
    rendered: int
    vertices: int
    edges: int
    sides: np.ndarray

    @property
    def vertices_in_renders(self) -> int:
        """How many vertices the mesh has in renders."""
        return self._vertices_at(self.rendered)

    def _vertices_at(self, level: int) -> int:
        parts = 2**level
        within = int(_within(self.sides, parts).sum()) if level else 0
        return self.vertices + self.edges * (parts - 1) + within

    def numbers_in_renders(self, vertex: np.ndarray) -> np.ndarray:
        """Return the numbers that vertices have in renders, of any shape, from those in the viewport."""
        count = self._vertices_at(self.level)
        if vertex.size > count:
            return self._numbers(np.arange(count, dtype=np.int32))[vertex]
        return self._numbers(vertex)

    def _numbers(self, vertex: np.ndarray) -> np.ndarray:
        parts, finer = 2**self.level, 2**self.rendered
        times = finer // parts
        within_faces = self.vertices + self.edges * (parts - 1)
        found = vertex.astype(np.int32)
        own = (vertex >= self.vertices) & (vertex < within_faces)
        if own.any():
            edge, step = np.divmod(found[own] - self.vertices, parts - 1)
            found[own] = self.vertices + edge * (finer - 1) + (step + 1) * times - 1
        own = vertex >= within_faces
        if own.any():
            first, first_finer = (np.cumsum(_within(self.sides, n)) - _within(self.sides, n) for n in (parts, finer))
            number = vertex[own] - within_faces
            face = np.searchsorted(first, number, side="right") - 1
            inner = _finer_within(self.sides[face] == 4, number - first[face], parts, times)
            found[own] = self.vertices + self.edges * (finer - 1) + first_finer[face] + inner
        return found


def _within(sides: np.ndarray, parts: int) -> np.ndarray:
    """Return how many vertices faces have within them whose edges are cut into so many parts."""
    half = parts // 2
    return 1 + sides.astype(np.int64) * (half * (half - 1))


def _finer_within(quad: np.ndarray, number: np.ndarray, parts: int, times: int) -> np.ndarray:
    """Return the numbers of vertices among those within their faces, where edges have so many times as many parts, shape ``[n]``.

    Quads hold rows of vertices. Others have one in the middle, and then for each corner the rows of the quad between it and that.
    """
    half, finer = parts // 2, parts * times
    row, column = np.divmod(number, parts - 1)
    of_quad = ((row + 1) * times - 1) * (finer - 1) + (column + 1) * times - 1
    corner, rest = np.divmod(number - 1, max(half * (half - 1), 1))
    row, column = np.divmod(rest, half)
    size = finer // 2
    of_other = 1 + corner * (size * (size - 1)) + ((row + 1) * times - 1) * size + (column + 1) * times - 1
    return np.where(quad, of_quad, np.where(number == 0, 0, of_other))


def levels_apart(target: bpy.types.Object, render: bpy.types.RenderSettings) -> list[tuple[int, int]]:
    """Return to which levels modifiers divide a target, in the viewport and in renders, of those where these are not the same."""
    found = (_levels(one, render) for one in target.modifiers if one.type in DIVIDES)
    return [(shown, rendered) for shown, rendered in found if shown != rendered]


def _levels(modifier: bpy.types.Modifier, render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Return to which level a modifier divides faces in the viewport, and in renders."""
    shown = modifier.levels if modifier.show_viewport else 0
    rendered = modifier.render_levels if modifier.show_render else 0
    if render.use_simplify:
        return min(shown, render.simplify_subdivision), min(rendered, render.simplify_subdivision_render)
    return shown, rendered


def read_subdivision(target: bpy.types.Object, context: bpy.types.Context) -> Subdivision | None:
    """Return how a target is divided that is so further in renders than in the viewport; None where that cannot be told."""
    apart = levels_apart(target, context.scene.render)
    if len(apart) != 1 or apart[0][0] >= apart[0][1]:
        return None
    level, rendered = apart[0]
    if not _is_otherwise_alike(target, context.scene.render, apart[0]):
        return None
    with evaluated_mesh(target, context) as mesh:
        if mesh is None or not len(mesh.polygons):
            return None
        found = _divided(mesh, level, rendered) if level else _undivided(mesh, rendered)
    return found if found is not None and found.vertices_in_renders <= MOST_VERTICES else None


def _is_otherwise_alike(target: bpy.types.Object, render: bpy.types.RenderSettings, apart: tuple[int, int]) -> bool:
    """Tell whether only the levels of one modifier have the vertices of a target be others in renders; it is the last to divide."""
    shown = [one for one in target.modifiers if one.show_viewport or one.show_render]
    levels = [_levels(one, render) if one.type in DIVIDES else None for one in shown]
    at = levels.index(apart)
    after = [one for one, level in zip(shown[at + 1 :], levels[at + 1 :], strict=True) if level != (0, 0)]
    others = [one for one in (*shown[:at], *after) if one.type not in _KEEPS_NUMBERS]
    # Where nothing is divided in the viewport, its mesh does not show what becomes of the numbers afterwards.
    lost = any(one.type in DIVIDES or (not apart[0] and one.type not in _KEEPS_NUMBERS) for one in after)
    return not lost and all(one.type in DIVIDES or one.show_viewport == one.show_render for one in others)


def _undivided(mesh: bpy.types.Mesh, rendered: int) -> Subdivision:
    """Return how a mesh is divided in renders that is not in the viewport."""
    sides = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    return Subdivision(0, rendered, len(mesh.vertices), len(mesh.edges), sides)


def _divided(mesh: bpy.types.Mesh, level: int, rendered: int) -> Subdivision | None:
    """Return how a mesh was divided whose last step that was; None where it is not numbered so."""
    parts = 2**level
    faces, half = len(mesh.polygons), parts // 2
    # Each corner of a coarse face has so many faces; between these are so many edges, and those along coarse edges besides.
    corners, odd = divmod(faces, half * half)
    edges, odd_edges = divmod(len(mesh.edges) - corners * parts * (parts - 1) // 2, parts)
    if odd or odd_edges or edges < 1 or len(mesh.loops) != 4 * faces:
        return None
    along = _read(mesh, ".edge_verts", 2 * len(mesh.edges)).reshape(-1, 2)[: edges * parts].reshape(edges, parts, 2)
    vertices = int(along[0, 0, 1])
    expected = (vertices + np.arange(edges * (parts - 1))).reshape(edges, parts - 1)
    ends = along[:, 0, 0], along[:, -1, 1]
    if (along[:, :-1, 1] != expected).any() or (along[:, 1:, 0] != expected).any() or np.max(ends) >= vertices:
        return None
    within_faces = vertices + edges * (parts - 1)
    corner = _read(mesh, ".corner_vert", len(mesh.loops)).reshape(-1, 4)
    highest = corner.max(axis=1)
    lowest = np.where(corner < within_faces, len(mesh.vertices), corner).min(axis=1)
    # The first one within a coarse face, and those that follow, have vertices of their own that none before it has.
    lowest = np.minimum.accumulate(lowest[::-1])[::-1]
    first = np.flatnonzero(lowest > np.concatenate([[-1], np.maximum.accumulate(highest)[:-1]]))
    sides, odd_sides = np.divmod(np.diff([*first, faces]), half * half)
    found = Subdivision(level, rendered, vertices, edges, sides.astype(np.int32))
    count = within_faces + int(_within(sides, parts).sum())
    return None if odd_sides.any() or sides.sum() != corners or count != len(mesh.vertices) else found


def _read(mesh: bpy.types.Mesh, name: str, count: int) -> np.ndarray:
    """Return the values of an attribute of so many whole numbers."""
    values = np.empty(count, np.int32)
    mesh.attributes[name].data.foreach_get("value", values)
    return values
