"""The corners of a mesh that stand for its convex hull."""

import numpy as np
import pytest
from esh.engine.geometry.unit_vectors import spread_directions
from esh.engine.surface.mesh_hull import MOST_CORNERS, hull_corners
from esh.engine.surface.triangle_mesh import TriangleMesh


def mesh_of(position):
    """A mesh whose triangles have these corners, and one vertex more that is far off and belongs to none."""
    position = np.vstack([position, [[100.0, 100.0, 100.0]]]).astype(np.float32)
    triangle = np.arange(3 * ((len(position) + 1) // 3)).reshape(-1, 3) % (len(position) - 1)
    corner = np.arange(triangle.size, dtype=np.int32).reshape(-1, 3)
    face = np.arange(len(triangle), dtype=np.int32)
    return TriangleMesh("mesh", position, triangle.astype(np.int32), corner, face, np.empty((0, 3), np.float32))


def test_of_a_box_with_much_inside_its_eight_corners_are_left():
    box = np.array(np.meshgrid([-1.0, 1.0], [-0.2, 0.2], [0.0, 3.0])).reshape(3, -1).T
    inside = np.random.default_rng(1).uniform(-1.0, 1.0, (1000, 3)) * [0.9, 0.15, 1.4] + [0.0, 0.0, 1.5]
    found = hull_corners(mesh_of(np.vstack([inside, box])))
    assert sorted(map(tuple, found.round(5).tolist())) == sorted(map(tuple, box.round(5).tolist()))


@pytest.mark.parametrize("stretched", [(1.0, 1.0, 1.0), (1.0, 0.1, 10.0)])
def test_of_a_ball_little_is_cut_off_however_it_is_stretched(stretched):
    ball = spread_directions(5000) * stretched
    found = hull_corners(mesh_of(ball))
    assert len(found) == MOST_CORNERS
    assert set(map(tuple, found.tolist())) <= set(map(tuple, ball.astype(np.float32).astype(float).tolist()))
    direction = spread_directions(1000) / stretched
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    assert ((direction @ found.T).max(axis=1) / (direction @ ball.T).max(axis=1)).min() > 0.95


def test_flat_and_empty_meshes_have_what_they_have():
    card = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.5]])
    assert len(hull_corners(mesh_of(card))) == 4
    nothing = TriangleMesh("mesh", card[:0], *([np.empty((0, 3), np.int32)] * 2), np.empty(0, np.int32), card[:0])
    assert hull_corners(nothing).shape == (0, 3)
