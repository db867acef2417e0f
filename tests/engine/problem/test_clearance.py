"""Distances from obstacles are what geometry says."""

import numpy as np
import pytest
from esh import Domain, Obstacle
from esh.engine.problem.clearance import MOST_KNOWN, _distances, clearance, distance_to

DOMAIN = Domain((8.0, 6.0))
SHAPE = (120, 160)


def centers(shape=SHAPE, domain=DOMAIN):
    x = (np.arange(shape[1]) + 0.5) / shape[1] * domain.size[0]
    y = domain.size[1] - (np.arange(shape[0]) + 0.5) / shape[0] * domain.size[1]
    return np.meshgrid(x, y)


def test_clearance_of_a_disc_with_a_margin():
    x, y = centers()
    found = clearance([Obstacle(disc=(3.0, 2.0, 1.5), margin=0.5)], DOMAIN, SHAPE, 1.0)
    np.testing.assert_allclose(found, np.minimum(np.hypot(x - 3.0, y - 2.0) - 2.0, 1.0), atol=1e-6)


def test_clearance_of_a_polygon_is_the_distance_from_its_edges():
    corners = np.array([[1.0, 1.0], [6.0, 1.5], [5.0, 5.0], [3.5, 2.5]])  # with a notch
    x, y = centers()
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    away = np.full(len(points), np.inf)
    inside = np.zeros(len(points), bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)[:, None]
        away = np.minimum(away, np.linalg.norm(points - a - t * (b - a), axis=1))
        above = (points[:, 1] < a[1]) != (points[:, 1] < b[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= above & (points[:, 0] < a[0] + (points[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
    expected = np.where(inside, -away, away).reshape(SHAPE)
    for order in (corners, corners[::-1]):
        found = clearance([Obstacle(polygon=order)], DOMAIN, SHAPE, 0.7)
        near = expected < 0.7
        np.testing.assert_allclose(found[near], np.maximum(expected[near], -0.7), atol=1e-5)
        assert (found[~near] > 0.7 - 1e-6).all()


def test_obstacles_go_on_across_a_periodic_border():
    x, y = centers()
    periodic = Domain(DOMAIN.size, "periodic")
    dx, dy = x - 0.2 - 8.0 * np.round((x - 0.2) / 8.0), y - 5.9 - 6.0 * np.round((y - 5.9) / 6.0)
    found = clearance([Obstacle(disc=(0.2, 5.9, 1.0))], periodic, SHAPE, 0.8)
    np.testing.assert_allclose(found, np.minimum(np.hypot(dx, dy) - 1.0, 0.8), atol=1e-6)
    square = Obstacle(polygon=[[-1, -1], [1, -1], [1, 1], [-1, 1]])
    inside = clearance([square], periodic, SHAPE, 0.5) < 0.0
    np.testing.assert_array_equal(inside, (np.abs((x + 4) % 8 - 4) < 1) & (np.abs((y + 3) % 6 - 3) < 1))


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("shape", "share"), [((12, 17), 0.04), ((75, 90), 0.001), ((75, 90), 0.3), ((40, 50), 0.0)])
def test_distance_from_a_mask_is_that_of_all_pairs(shape, share, periodic):
    rng = np.random.default_rng(0)
    mask = rng.random(shape) < share
    pixel = (0.5, 0.3)
    height, width = pixel[1] * shape[0], pixel[0] * shape[1]
    rows, columns = np.indices(mask.shape)
    nearest = np.full(mask.shape, np.inf)
    for row, column in np.argwhere(mask):
        dy, dx = (rows - row) * pixel[1], (columns - column) * pixel[0]
        if periodic:
            dy -= height * np.round(dy / height)
            dx -= width * np.round(dx / width)
        nearest = np.minimum(nearest, np.hypot(dx, dy))
    np.testing.assert_allclose(distance_to(mask, pixel, 1.2, periodic), np.minimum(nearest, 1.2), atol=1e-6)


def test_what_is_known_of_an_image_is_as_if_it_were_asked_afresh():
    image = np.random.default_rng(1).random((30, 40)) < 0.02
    kept = Obstacle(image=image, margin=0.1)
    others = [(0.5, (60 + n, 80)) for n in range(6)]
    for reach, shape in ((0.3, SHAPE), (0.9, SHAPE), (0.2, SHAPE), *others, (0.9, SHAPE)):
        found = clearance([kept], DOMAIN, shape, reach)
        np.testing.assert_array_equal(found, clearance([Obstacle(image=image, margin=0.1)], DOMAIN, shape, reach))
        # Nobody who writes it changes what the next one gets.
        found[:] = -1.0
    assert len(_distances[kept]) <= MOST_KNOWN
    periodic = Domain(DOMAIN.size, "periodic")
    found = clearance([kept], periodic, SHAPE, 0.9)
    np.testing.assert_array_equal(found, clearance([Obstacle(image=image, margin=0.1)], periodic, SHAPE, 0.9))


def test_an_image_is_an_obstacle_where_it_is_white():
    image = np.zeros((3, 4))
    image[0, 3] = 1.0  # the upper right: x from 6 on, y from 4 on
    x, y = centers()
    away = np.hypot(np.maximum(6.0 - x, 0.0), np.maximum(4.0 - y, 0.0))
    found = clearance([Obstacle(image=image, margin=0.25)], DOMAIN, SHAPE, 1.0)
    pixel = 0.05
    outside = away > 0.0
    np.testing.assert_allclose(found[outside], np.minimum(away[outside] - 0.25, 1.0), atol=0.75 * pixel)
    assert (found[~outside] < 0.0).all()
