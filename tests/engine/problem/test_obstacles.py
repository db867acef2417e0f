"""Obstacles are cut out of densities exactly, whatever their shape; distances from them are what geometry says."""

import numpy as np
import pytest
from esh import BodyClass, Domain, Obstacle, Problem, ProblemError, Size
from esh.engine.problem.clearance import MOST_KNOWN, _distances, clearance, distance_to

DOMAIN = Domain((8.0, 6.0))
SHAPE = (120, 160)
ONE = BodyClass("k", [Size("a", 0.1, 50)])


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


def test_classes_that_share_an_image_share_what_obstacles_leave_of_it():
    density = np.linspace(0.1, 1.0, 16).reshape(4, 4)
    classes = [BodyClass(name, [Size("a", 0.01, 30)], density) for name in "kl"]
    classes.append(BodyClass("m", [Size("a", 0.01, 30)], density.T.copy()))
    problem = Problem(DOMAIN, classes, obstacles=[Obstacle(disc=(4.0, 3.0, 1.0))])
    one, same, other = (c.density_image for c in problem.classes)
    assert one is same and not np.array_equal(one, other)
    assert (one == 0.0).any() and (other == 0.0).any()


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


def test_density_is_cut_out_to_a_fraction_of_a_pixel_and_the_rest_is_as_it_was():
    density = np.array([[1.0, 2.0], [3.0, 4.0]])
    problem = Problem(
        DOMAIN, [BodyClass("k", [Size("a", 0.1, 50)], density)], obstacles=[Obstacle(disc=(4.0, 3.0, 1.0))]
    )
    image = problem.classes[0].density_image
    # The disc lies in the middle: a quarter of it in every pixel of the density.
    assert image.mean() == pytest.approx(2.5 * (1.0 - np.pi / 48.0), rel=1e-3)
    assert image[0, 0] == 1.0
    assert image[-1, -1] == 4.0
    assert image[image.shape[0] // 2, image.shape[1] // 2] == 0.0


def test_what_covers_the_density_is_counted_on_what_is_left():
    asked = BodyClass("k", [Size("a", 0.01)], 0.5, count="cover")
    assert Problem(DOMAIN, [asked]).body_count == 2400
    half = Obstacle(polygon=[[0, 0], [4, 0], [4, 6], [0, 6]])
    assert Problem(DOMAIN, [asked], obstacles=[half]).body_count == 1200


def test_obstacles_everywhere_are_refused():
    with pytest.raises(
        ProblemError, match='`obstacles` must leave some ground where the density of class "k" is above 0'
    ):
        Problem(DOMAIN, [ONE], obstacles=[Obstacle(disc=(4.0, 3.0, 9.0))])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "an obstacle must have one of `polygon`, `disc`, `image` and `ball`; got none of them"),
        ({"disc": (1, 1, 1), "image": np.ones((2, 2))}, "must have one of .*; got `disc` and `image`"),
        ({"polygon": [[0, 0], [1, 1]]}, "`obstacle.polygon` must be three or more corners, each x and y in meters"),
        ({"polygon": 3}, "`obstacle.polygon` must be three or more corners"),
        ({"disc": (1, 1, 0)}, "`obstacle.disc` must be x, y and a radius above 0, in meters"),
        ({"disc": (1, 1)}, "`obstacle.disc` must be x, y and a radius above 0"),
        ({"disc": "abc"}, "`obstacle.disc` must be x, y and a radius above 0"),
        ({"image": np.ones(3)}, r"`obstacle.image` must be an image of shape \[height, width\]"),
        ({"image": [[np.nan]]}, "`obstacle.image` must be finite everywhere"),
        ({"disc": (1, 1, 1), "margin": -1}, "`obstacle.margin` must be a number between 0 and"),
    ],
)
def test_values_that_are_none_are_refused_with_a_sentence(values, message):
    with pytest.raises(ProblemError, match=message):
        Obstacle(**values)


@pytest.mark.parametrize(("kind", "value"), [("disc", (5.0, 4.0, 1e-12)), ("ball", (5.0, 4.0, 0.0, 1e-12))])
def test_a_radius_below_every_length_is_named(kind, value):
    with pytest.raises(ProblemError, match=rf"{kind}` must have a radius of at least 1e-09 m; got 1e-12"):
        Obstacle(**{kind: value})


def star(corners, lobes):
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return (0.5 + 0.2 * np.cos(lobes * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("corners, most", [(10, 5), (24, 16), (50, 24), (100, 40), (200, 80)])
def test_polygons_are_cut_into_few_convex_pieces(corners, most):
    polygon = star(corners, 7)
    pieces = Obstacle(polygon=polygon).pieces
    assert 1 < len(pieces) <= most
    x, y = polygon.T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert sum(piece.area for piece in pieces) == pytest.approx(area, rel=1e-6)
    for piece in pieces:
        edge = np.roll(piece.corners, -1, axis=0) - piece.corners
        onwards = np.roll(edge, -1, axis=0)
        assert len(piece.corners) <= 16
        assert (edge[:, 0] * onwards[:, 1] - edge[:, 1] * onwards[:, 0]).min() > -1e-9


def test_edges_that_cross_leave_what_they_go_around():
    lobes = Obstacle(polygon=[[-1, -1], [1, 1], [1, -1], [-1, 1]]).pieces
    assert sum(piece.area for piece in lobes) == pytest.approx(2.0)
