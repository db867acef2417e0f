"""Points of triangles that are nearest to others: of all triangles, found by blocks of them."""

import numpy as np
import pytest
from esh.engine.geometry.nearest_on_triangles import nearest_in, nearest_on_triangles


def distances(corner, point):
    weights = nearest_in(corner, point)
    return np.linalg.norm(np.einsum("nk,nkd->nd", weights, corner) - point, axis=1)


@pytest.mark.parametrize("count", [1, 31, 32, 33, 700])
@pytest.mark.parametrize("spread", [0.05, 1.0, 20.0])
def test_no_triangle_is_nearer(count, spread):
    rng = np.random.default_rng(count)
    corner = rng.normal(size=(count, 1, 3)) + 0.1 * rng.normal(size=(count, 3, 3))
    position = spread * rng.normal(size=(30, 3))
    triangle, weight = nearest_on_triangles(corner, position, np.zeros((30, 3)))
    found = np.linalg.norm(np.einsum("nk,nkd->nd", weight, corner[triangle]) - position, axis=1)
    np.testing.assert_allclose(found, [distances(corner, point).min() for point in position], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(weight.sum(axis=1), 1.0)


def test_triangles_without_area_are_not_found_and_of_two_sides_the_one_that_looks_there_is():
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    corner = np.concatenate([np.zeros((5, 3, 3)), flat, flat[:, [0, 2, 1]]])
    place = np.array([[0.2, 0.2, 0.0], [0.2, 0.2, 0.0]])
    triangle, _ = nearest_on_triangles(corner, place, np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    assert triangle.tolist() == [5, 6]
