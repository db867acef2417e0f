"""What of a surface is near: its nearest places, on the right side of thin walls, and what closed meshes and flat shapes cover."""

import esh
import numpy as np
import pytest
import shapely
import trimesh
from esh.engine.surface.near_surface import COVERS_STEP, NearSurface, is_inside, samples_of


def surface_of(mesh):
    return esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))


def test_the_nearest_places_are_those_of_trimesh():
    mesh = trimesh.creation.icosphere(3)
    rng = np.random.default_rng(1)
    position = rng.uniform(-1.5, 1.5, (300, 3))
    found = NearSurface(surface_of(mesh)).nearest(position, np.full(300, 0.4))
    nearest, distance, _ = trimesh.proximity.closest_point_naive(mesh, position)
    np.testing.assert_array_equal(found.row, np.flatnonzero(distance < 0.4))
    np.testing.assert_allclose(found.position, nearest[found.row], atol=1e-5)
    # On the triangle that is told.
    away = trimesh.triangles.closest_point(mesh.triangles[found.triangle], found.position) - found.position
    assert np.abs(away).max() < 1e-5


def test_of_two_sides_of_a_wall_it_is_the_one_that_looks_there():
    mesh = trimesh.creation.box((0.02, 2.0, 2.0))
    surface = surface_of(mesh)
    rng = np.random.default_rng(2)
    place = rng.uniform(-0.9, 0.9, (50, 2))
    # Nearer to the front, but on the back.
    position = np.column_stack([np.full(50, 0.008), place])
    looks = np.tile([-1.0, 0.0, 0.0], (50, 1))
    found = NearSurface(surface).towards(position, looks, np.full(50, 0.1))
    assert len(found.row) == 50
    np.testing.assert_allclose(found.position, np.column_stack([np.full(50, -0.01), place]), atol=1e-6)
    np.testing.assert_allclose(surface.normal[found.triangle], looks, atol=1e-12)
    assert len(NearSurface(surface).towards(position, looks, np.full(50, 0.01)).row) == 0


def test_a_surface_of_two_sides_in_one_place_is_met_on_the_side_that_sees_what_is_there():
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    surface = esh.Surface(esh.SurfaceMesh(corners, [[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]]))
    position = np.array([[0.5, 0.4, 0.1], [0.5, 0.4, -0.1], [0.5, 0.4, 0.0]])
    found = NearSurface(surface).nearest(position, np.full(3, 0.2))
    sides = [sorted(surface.normal[found.triangle[found.row == row], 2]) for row in range(3)]
    assert sides == [[1.0], [-1.0], [-1.0, 1.0]]


@pytest.mark.parametrize("turned", [False, True])
def test_what_lies_inside_closed_meshes(turned):
    mesh = trimesh.creation.torus(1.0, 0.3)
    triangle = mesh.triangles[:, ::-1] if turned else mesh.triangles
    position = np.random.default_rng(3).uniform(-1.4, 1.4, (2000, 3)) * [1.0, 1.0, 0.3]
    away = np.hypot(np.hypot(*position[:, :2].T) - 1.0, position[:, 2])
    clear = np.abs(away - 0.3) > 0.02
    np.testing.assert_array_equal(is_inside(triangle, position)[clear], (away < 0.3)[clear])
    # A sheet has no inside.
    sheet = np.array([[[-9, -9, 0], [9, -9, 0], [0, 9, 0.001]]], np.float64)
    assert not is_inside(sheet, position).any()


def test_samples_cover_triangles_and_hardly_more():
    triangle = np.array([[[0, 0, 0], [3, 0, 0], [1, 2, 0]]], np.float64)
    step = 0.1
    place = samples_of(triangle, step)[:, :2]
    ground = shapely.union_all(shapely.buffer(shapely.points(place), COVERS_STEP * step))
    polygon = shapely.Polygon(triangle[0, :, :2])
    # Corners of flat triangles lie a little farther off.
    assert polygon.buffer(-0.02).difference(ground).area < 1e-3 * polygon.area
    assert ground.difference(polygon.buffer(0.06)).area < 1e-9
    line = samples_of(np.array([[[0, 0, 0], [1, 0, 0], [1, 0, 0]], [[5, 5, 5], [5, 5, 5], [5, 5, 5]]], np.float64), 0.3)
    np.testing.assert_allclose(line[line[:, 0] < 2.0][:, 0], [0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_array_equal(line[line[:, 0] > 2.0][0], [5.0, 5.0, 5.0])
