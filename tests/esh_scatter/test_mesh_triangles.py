"""Triangles of a mesh are those that Blender draws."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh  # noqa: E402
from esh.esh_scatter.targets import mesh_triangles  # noqa: E402
from esh.esh_scatter.targets.target import read_triangles  # noqa: E402


def told(mesh):
    """Return what Blender tells of every triangle: its vertices and its face."""
    mesh.calc_loop_triangles()
    return [(*one.vertices, one.polygon_index) for one in mesh.loop_triangles]


def read(mesh):
    found = read_triangles(mesh, np.eye(4), "mesh")
    assert (found.triangle == np.array([loop.vertex_index for loop in mesh.loops])[found.corner]).all()
    return [(*triangle, face) for triangle, face in zip(found.triangle.tolist(), found.face.tolist(), strict=True)]


def rough_mesh(kind):
    """Return a mesh whose quads are pulled about so far that many are concave, with other faces among them."""
    work = bmesh.new()
    bmesh.ops.create_grid(work, x_segments=12, y_segments=12, size=5.0)
    rng = np.random.default_rng(3)
    for vertex in work.verts:
        vertex.co += type(vertex.co)(rng.normal(0.0, 0.35, 3))
    faces = list(work.faces)
    if kind in ("mixed", "triangles"):
        chosen = faces if kind == "triangles" else faces[::3]
        bmesh.ops.triangulate(work, faces=chosen)
    if kind == "ngons":
        bmesh.ops.dissolve_verts(work, verts=[list(work.verts)[70]])
    mesh = bpy.data.meshes.new(kind)
    work.to_mesh(mesh)
    work.free()
    return mesh


@pytest.mark.parametrize("kind", ["quads", "triangles", "mixed", "ngons"])
def test_triangles_are_those_that_blender_draws(empty_file, kind, monkeypatch):
    mesh = rough_mesh(kind)
    asked = []
    as_told = mesh_triangles._as_told
    monkeypatch.setattr(mesh_triangles, "_as_told", lambda one: asked.append(one) or as_told(one))
    assert read(mesh) == told(mesh)
    assert bool(asked) == (kind == "ngons")


def test_concave_quads_are_divided_within_them(empty_file):
    """By the line from the second corner to the fourth, where the other one would leave them."""
    mesh = bpy.data.meshes.new("Arrow")
    mesh.from_pydata([(0, 0, 0), (2, -1, 0), (0.5, 0, 0), (2, 1, 0)], [], [(1, 2, 3, 0), (0, 1, 2, 3)])
    found = read(mesh)
    assert found == told(mesh) == [(1, 2, 0, 0), (2, 3, 0, 0), (0, 1, 2, 1), (0, 2, 3, 1)]


@pytest.mark.parametrize("kind", ["quads", "mixed"])
def test_flat_and_broken_faces_are_taken(empty_file, kind):
    mesh = rough_mesh(kind)
    for vertex in list(mesh.vertices)[:40]:
        vertex.co = (0.0, 0.0, 0.0)
    mesh.vertices[60].co.x = float("nan")
    assert len(read(mesh)) == len(told(mesh))
