"""Directions of the smooth surface that a mesh stands for: exact on a ball, sharp at creases, and those of triangles elsewhere."""

import numpy as np
import pytest
import trimesh
from esh.engine.geometry.smooth_normals import MOST_AROUND
from esh.engine.problem.surface import Surface, SurfaceMesh


def of_mesh(mesh):
    surface = Surface(SurfaceMesh(mesh.vertices, mesh.faces))
    return surface, surface.corner_normal


def test_a_ball_looks_outwards_at_every_corner():
    surface, normal = of_mesh(trimesh.creation.icosphere(subdivisions=3))
    place = surface.position[surface.triangle]
    np.testing.assert_allclose(normal, place / np.linalg.norm(place, axis=2, keepdims=True), atol=6e-3)
    # The triangles themselves look somewhere else.
    assert np.abs(normal - surface.normal[:, None]).max() > 0.05


def test_a_box_keeps_its_creases():
    surface, normal = of_mesh(trimesh.creation.box())
    np.testing.assert_allclose(normal, np.repeat(surface.normal[:, None], 3, axis=1), atol=1e-12)


def test_a_can_is_smooth_round_its_side_and_sharp_at_its_rims():
    surface, normal = of_mesh(trimesh.creation.cylinder(radius=1.0, height=1.0, sections=30))
    on_side = np.abs(surface.normal[:, 2]) < 0.5
    place = surface.position[surface.triangle] * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(normal[on_side], place[on_side], atol=1e-6)
    np.testing.assert_allclose(np.abs(normal[~on_side, :, 2]), 1.0, atol=1e-12)


def test_edges_are_creases_and_ends_and_no_diagonals():
    box = of_mesh(trimesh.creation.box())[0]
    # Every face is two triangles; their common side is no edge.
    np.testing.assert_array_equal(box.edge_side.sum(axis=1), 2)
    assert not of_mesh(trimesh.creation.icosphere(subdivisions=3))[0].edge_side.any()
    can = of_mesh(trimesh.creation.cylinder(radius=1.0, height=1.0, sections=30))[0]
    assert can.edge_side.sum() == 4 * 30
    mesh = trimesh.creation.box()
    lid = of_mesh(trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.face_normals[:, 2] > 0.5], process=False))[0]
    assert lid.edge_side.sum() == 4
    np.testing.assert_array_equal(lid.edge_side, lid.open_side)


def test_meshes_in_pieces_are_as_smooth_as_whole_ones():
    # Every triangle has vertices of its own, as files for games have.
    ball = trimesh.creation.icosphere(subdivisions=2)
    whole = Surface(SurfaceMesh(ball.vertices, ball.faces)).corner_normal
    apart = ball.vertices[ball.faces].reshape(-1, 3)
    pieces = Surface(SurfaceMesh(apart, np.arange(len(apart)).reshape(-1, 3))).corner_normal
    np.testing.assert_allclose(pieces, whole, atol=1e-12)


@pytest.mark.parametrize("sections", [MOST_AROUND - 1, MOST_AROUND + 1])
def test_the_tip_of_a_steep_cone_has_a_direction(sections):
    surface, normal = of_mesh(trimesh.creation.cone(radius=0.2, height=2.0, sections=sections))
    np.testing.assert_allclose(np.linalg.norm(normal, axis=2), 1.0)
    assert ((normal * surface.normal[:, None]).sum(axis=2) > 0.7).all()
