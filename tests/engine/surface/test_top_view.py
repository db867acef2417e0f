"""What a mesh shows from above, against every triangle tried in turn."""

import numpy as np
import pytest
import trimesh
from esh.engine.surface.top_view import TopView
from esh.engine.surface.triangle_mesh import TriangleMesh

# Far from the world's origin, where float32 alone would be a centimeter off.
FAR = np.array([30_000.0, -50_000.0, 800.0])


@pytest.fixture
def soup():
    """Triangles through one another, seen from both sides, some of them upright; and a vertex that belongs to none."""
    rng = np.random.default_rng(5)
    position = rng.uniform(-1.0, 1.0, (120, 3))
    upright = position[:30].reshape(-1, 3, 3)
    upright[:, 2, :2] = 0.3 * upright[:, 0, :2] + 0.7 * upright[:, 1, :2]
    position = np.concatenate([position + FAR, [FAR + 100.0]])
    triangle = np.arange(120, dtype=np.int32).reshape(-1, 3)
    normal = rng.normal(size=(120, 3)).astype(np.float32)
    return TriangleMesh("soup", position, triangle, triangle, np.arange(40, dtype=np.int32), normal)


def heights(mesh, xy):
    """Z of every triangle at every place, shape ``[places, triangles]``; minus infinity beside it."""
    a, b, c = (mesh.position[mesh.triangle[10:, k]] for k in range(3))
    (ab, ac), ap = (b - a, c - a), xy[:, None] - a[:, :2]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    second = (ap[..., 0] * ac[:, 1] - ap[..., 1] * ac[:, 0]) / area
    third = (ab[:, 0] * ap[..., 1] - ab[:, 1] * ap[..., 0]) / area
    inside = (second >= 0.0) & (third >= 0.0) & (second + third <= 1.0)
    z = np.where(inside, a[:, 2] + second * ab[:, 2] + third * ac[:, 2], -np.inf)
    return np.concatenate([np.full((len(xy), 10), -np.inf), z], axis=1)


def test_the_topmost_triangle_is_seen(soup):
    view = TopView(soup)
    np.testing.assert_allclose([view.low, view.high], [soup.position[:-1].min(axis=0), soup.position[:-1].max(axis=0)])
    xy = np.random.default_rng(6).uniform(-1.0, 1.0, (5000, 2)) + FAR[:2]
    triangle, weight, position = view.cast(xy)
    expected = heights(soup, xy)
    met = triangle >= 0
    np.testing.assert_array_equal(met, np.isfinite(expected).any(axis=1))
    assert 0.2 < met.mean() < 1.0
    np.testing.assert_array_equal(triangle[met], expected[met].argmax(axis=1))
    np.testing.assert_allclose(position[met, :2], xy[met], rtol=0, atol=1e-9)
    np.testing.assert_allclose(position[met, 2], expected[met].max(axis=1), rtol=0, atol=1e-9)
    blended = np.einsum("nk,nkc->nc", weight[met], soup.position[soup.triangle[triangle[met]]] - FAR)
    np.testing.assert_allclose(blended + FAR, position[met], rtol=0, atol=1e-6)


@pytest.mark.parametrize("down", [1.0, -1.0])
def test_a_grid_sees_what_its_points_see_one_by_one(soup, down):
    view = TopView(soup)
    step = np.array([2.0 / 90, down * 2.0 / 70])
    # It begins beside the mesh and ends within it, or the other way.
    first = FAR[:2] + [-1.1, -down * 1.2]
    triangle, weight, position = view.cast_grid(first, step, (70, 90))
    x, y = first[0] + np.arange(90) * step[0], first[1] + np.arange(70) * step[1]
    one_by_one = view.cast(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    np.testing.assert_array_equal(triangle, one_by_one[0])
    met = triangle >= 0
    assert 0.2 < met.mean() < 1.0
    np.testing.assert_allclose(weight[met], one_by_one[1][met], atol=1e-6)
    np.testing.assert_allclose(position[met], one_by_one[2][met], rtol=0, atol=1e-9)


def test_a_grid_leaves_no_gaps_between_triangles_and_sees_the_first_of_equally_high_ones():
    rng = np.random.default_rng(8)
    # Corners lie on points of the grid, edges go through some; each triangle is there twice.
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    position = np.stack([x, y, rng.uniform(0.0, 3.0, x.shape)], axis=-1).reshape(-1, 3) * [0.1, 0.3, 1.0] + FAR
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 22], corner[:, None] + [0, 22, 21]]).astype(np.int32)
    faces = np.concatenate([faces, faces])
    mesh = TriangleMesh(
        "sheet", position, faces, faces, np.arange(len(faces), dtype=np.int32), np.zeros((0, 3), np.float32)
    )
    triangle, _, lifted = TopView(mesh).cast_grid(FAR[:2], np.array([0.05, 0.15]), (41, 41))
    assert triangle.min() >= 0 and triangle.max() < 800
    np.testing.assert_allclose(lifted.reshape(41, 41, 3)[::2, ::2].reshape(-1, 3), position, rtol=0, atol=1e-9)


def test_the_nearest_point_is_found(soup):
    view = TopView(soup)
    place = np.random.default_rng(7).uniform(-2.0, 2.0, (300, 3)) + FAR
    triangle, _, position = view.nearest(place)
    seen = trimesh.Trimesh(soup.position - FAR, soup.triangle[10:], process=False)
    expected, _, number = trimesh.proximity.closest_point_naive(seen, place - FAR)
    np.testing.assert_allclose(position - FAR, expected, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(triangle, number + 10)


def test_normals_look_to_the_side_that_is_seen_and_never_down(soup):
    soup.normal_matrix = np.diag([1.0, 2.0, 3.0])
    view = TopView(soup)
    triangle = np.repeat(np.arange(10, 40, dtype=np.int32), 3)
    weight = np.tile(np.eye(3, dtype=np.float32), (30, 1))
    normal = view.normals(triangle, weight)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)
    given = soup.corner_normal[30:] * [1.0, 2.0, 3.0]
    edge = soup.position[soup.triangle[10:, 1:]] - soup.position[soup.triangle[10:, :1]]
    given *= np.sign(np.cross(edge[:, 0], edge[:, 1])[:, 2]).repeat(3)[:, None]
    given[:, 2] = np.maximum(given[:, 2], 0.0)
    np.testing.assert_allclose(normal, given / np.linalg.norm(given, axis=1, keepdims=True), atol=1e-5)


def test_a_normal_that_points_down_counts_as_up(soup):
    soup.corner_normal[:] = [0.0, 0.0, -1.0]
    view = TopView(soup)
    upper = np.flatnonzero(view.cosine > 1e-5).astype(np.int32)
    np.testing.assert_array_equal(
        view.normals(upper, np.full((len(upper), 3), 1 / 3, np.float32)), [[0, 0, 1]] * len(upper)
    )
