"""Obstacles are cut out of densities exactly, whatever their shape, and cut into convex pieces."""

import numpy as np
import pytest
from esh import BodyClass, Domain, Obstacle, Problem, ProblemError, Size

DOMAIN = Domain((8.0, 6.0))
ONE = BodyClass("k", [Size("a", 0.1, 50)])


def test_classes_that_share_an_image_share_what_obstacles_leave_of_it():
    density = np.linspace(0.1, 1.0, 16).reshape(4, 4)
    classes = [BodyClass(name, [Size("a", 0.01, 30)], density) for name in "kl"]
    classes.append(BodyClass("m", [Size("a", 0.01, 30)], density.T.copy()))
    problem = Problem(DOMAIN, classes, obstacles=[Obstacle(disc=(4.0, 3.0, 1.0))])
    one, same, other = (c.density_image for c in problem.classes)
    assert one is same and not np.array_equal(one, other)
    assert (one == 0.0).any() and (other == 0.0).any()


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
