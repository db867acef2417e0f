"""Distances to shapes, and the inside of outlines, against the plainest arithmetic."""

import numpy as np
import pytest
import trimesh
from esh.engine.surface.near_shapes import NearShapes
from esh.engine.surface.shapes_from_above import draw_shapes, inside_outlines


def to_segment(point, a, b):
    way = b - a
    t = np.clip((point - a) @ way / max(way @ way, 1e-300), 0.0, 1.0)
    return np.linalg.norm(point - a - t[:, None] * way, axis=1)


def to_triangle(point, triangle):
    a, b, c = triangle
    side = [(q - p)[0] * (point - p)[:, 1] - (q - p)[1] * (point - p)[:, 0] for p, q in ((a, b), (b, c), (c, a))]
    within = (np.array(side) > 0).all(axis=0) | (np.array(side) < 0).all(axis=0)
    return np.where(within, 0.0, np.min([to_segment(point, *ends) for ends in ((a, b), (b, c), (c, a))], axis=0))


def points(rng, count, low, high):
    return np.column_stack([rng.uniform(low, high, (count, 2)), rng.uniform(-50.0, 50.0, count)])


@pytest.mark.parametrize("middle", [0.0, 5e4])
def test_distances_to_triangles_segments_and_points(middle):
    rng = np.random.default_rng(4)
    triangle = rng.uniform(0.0, 10.0, (60, 1, 2)) + rng.normal(0.0, 0.6, (60, 3, 2))
    triangle[10:20, 2] = triangle[10:20, 1]
    triangle[20:30, 1:] = triangle[20:30, :1]
    # An upright wall, seen from above.
    triangle[30:40, 2] = 0.3 * triangle[30:40, 0] + 0.7 * triangle[30:40, 1]
    where = points(rng, 5000, -3.0, 13.0)
    expected = np.min([to_triangle(where[:, :2], one) for one in triangle], axis=0)
    shift = np.array([middle, -middle, 0.0])
    found = NearShapes(triangle + shift[:2]).distance(where + shift, 100.0)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert (found == 0.0).any()
    np.testing.assert_allclose(NearShapes(triangle + shift[:2]).distance(where + shift, 0.5), np.minimum(found, 0.5))


@pytest.mark.parametrize("middle", [0.0, 5e4])
def test_distances_in_space(middle):
    """To triangles, segments and points, those that stand or lie in one plane among them."""
    rng = np.random.default_rng(5)
    triangle = rng.uniform(0.0, 10.0, (60, 1, 3)) + rng.normal(0.0, 0.6, (60, 3, 3))
    triangle[10:30, 2] = triangle[10:30, 1]
    triangle[20:25, :, :2] = triangle[20:25, :1, :2]
    triangle[30:40, 1:] = triangle[30:40, :1]
    triangle[40:50, :, 2] = 0.0
    where = rng.uniform(-3.0, 13.0, (3000, 3))
    flat = np.concatenate([triangle[:10], triangle[40:]])
    near = [trimesh.triangles.closest_point(np.broadcast_to(one, (len(where), 3, 3)), where) for one in flat]
    to_faces = np.linalg.norm(np.array(near) - where, axis=2).min(axis=0)
    to_lines = np.min([to_segment(where, *one[:2]) for one in triangle[10:40]], axis=0)
    shift = np.array([middle, -middle, 0.5 * middle])
    found = NearShapes(triangle + shift).distance(where + shift, 100.0)
    np.testing.assert_allclose(found, np.minimum(to_faces, to_lines), atol=1e-3)


def test_what_is_out_of_reach_is_as_far_as_that():
    one = np.zeros((1, 3, 2))
    assert NearShapes(one).distance(np.array([[30.0, 40.0, 7.0]]), 100.0) == pytest.approx([50.0])
    assert NearShapes(one).distance(np.array([[30.0, 40.0, 7.0]]), 20.0) == pytest.approx([20.0])


def ring(radius, count=400, center=(0.0, 0.0)):
    angle = np.arange(count) * 2.0 * np.pi / count
    corner = np.column_stack([np.cos(angle), np.sin(angle)]) * radius(angle)[:, None] + center
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)


def test_a_star_with_a_hole():
    def star(angle):
        return 3.0 + np.sin(5.0 * angle)

    outline = np.concatenate([ring(star), ring(lambda angle: np.full(len(angle), 1.0))])
    where = points(np.random.default_rng(2), 50_000, -5.0, 5.0)
    radius, angle = np.hypot(where[:, 0], where[:, 1]), np.arctan2(where[:, 1], where[:, 0])
    sure = (np.abs(radius - star(angle)) > 0.01) & (np.abs(radius - 1.0) > 0.01)
    expected = (radius < star(angle)) & (radius > 1.0)
    np.testing.assert_array_equal(inside_outlines(outline, where)[sure], expected[sure])


def test_rays_through_corners_count_them_once():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    turned = np.array([[0, 0.5], [0.5, 0], [1, 0.5], [0.5, 1]])
    for corner in (square, turned):
        outline = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
        where = np.array([[0.5, 0.5, 0], [-1, 0.5, 0], [2, 0.5, 0], [-1, 0, 0], [-1, 1, 0], [0.5, 7, 0], [0.5, -7, 0]])
        assert inside_outlines(outline, where).tolist() == [True] + [False] * 6


def test_nothing_is_inside_of_nothing():
    where = np.zeros((3, 3))
    assert not inside_outlines(np.empty((0, 2, 2)), where).any()
    assert not inside_outlines(np.zeros((5, 2, 2)), where).any()


@pytest.mark.parametrize("reach", [0.02, 0.4])
def test_shapes_are_drawn_where_they_are_near(reach):
    """Triangles, segments and points, also those that lie across the edges and beyond; cells are wider than high."""
    rng = np.random.default_rng(11)
    size, shape = np.array([12.0, 7.0]), (90, 70)
    triangle = rng.uniform(-2.0, 13.0, (24, 1, 2)) + rng.normal(0.0, 1.5, (24, 3, 2))
    triangle[:8, 2] = triangle[:8, 1]
    triangle[:4, 1:] = triangle[:4, :1]
    image = np.zeros(shape, bool)
    image[3, 4] = True
    draw_shapes(image, triangle, reach, size)
    row, column = np.indices(shape)
    middle = np.stack([(column.ravel() + 0.5) / shape[1], (row.ravel() + 0.5) / shape[0]], axis=-1) * size
    expected = np.min([to_triangle(middle, one) for one in triangle], axis=0).reshape(shape) <= reach
    assert 0.02 < expected.mean() < 0.9 and not expected[3, 4]
    expected[3, 4] = True
    assert (image == expected).all()
