"""Outlines in slopes, against rotations in space."""

import math

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.body_footprints import footprints_of
from esh.engine.problem.cover import cover_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.slopes import (
    foreshortened,
    lengthened,
    level_share,
    mean_cosine,
    normal_of_slope,
    slope_at,
    slope_of_normal,
    tilted,
    tilts,
)

BOX = Footprint.rectangle(0.8, 0.6)


def normals(count=50):
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.7]
    normal[:, 2] = np.abs(normal[:, 2]) + 0.1
    normal[0] = [0.0, 0.0, 1.0]
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def leaning(normal, align):
    """Matrices that turn z by a share of the shortest way towards a normal, by Rodrigues' formula."""
    sine = math.hypot(normal[0], normal[1])
    if sine == 0.0:
        return np.eye(3)
    x, y = -normal[1] / sine, normal[0] / sine
    cross = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    angle = align * math.atan2(sine, normal[2])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


@pytest.mark.parametrize("align", [1.0, 0.4])
def test_what_is_seen_from_above_is_what_leans_in_space(align):
    normal = normals()
    slope = slope_of_normal(normal, align)
    vector = np.random.default_rng(2).normal(size=(len(normal), 2))
    flat = np.column_stack([vector, np.zeros(len(normal))])
    turned = np.array([leaning(n, align) @ v for n, v in zip(normal, flat, strict=True)])
    np.testing.assert_allclose(foreshortened(vector, slope), turned[:, :2], atol=1e-12)
    np.testing.assert_allclose(lengthened(turned[:, :2], slope), vector, atol=1e-12)
    area = [np.linalg.det(leaning(n, align)[:2, :2]) for n in normal]
    np.testing.assert_allclose(level_share(slope), area, atol=1e-6)
    np.testing.assert_allclose(normal_of_slope(slope, align), normal, atol=1e-6)


def test_what_leans_over_on_a_slope_lies_in_the_plane_of_both_turns():
    normal = normals()
    tilt = tilts(0.6, np.arange(len(normal)), 4)
    up = np.array([[math.sin(a) * math.cos(d), math.sin(a) * math.sin(d), math.cos(a)] for a, d in tilt])
    axis = np.array([leaning(n, 1.0) @ u for n, u in zip(normal, up, strict=True)])
    upright = axis[:, 2] > 0.1
    assert upright.sum() > 30
    expected = -axis[upright, :2] / axis[upright, 2:]
    np.testing.assert_allclose(tilted(slope_of_normal(normal), tilt)[upright], expected, rtol=1e-9, atol=1e-9)


def test_bodies_lean_by_at_most_the_tilt_in_all_directions():
    tilt = tilts(0.3, np.arange(5000), 1)
    assert tilt[:, 0].min() >= 0.0 and 0.29 < tilt[:, 0].max() <= 0.3
    assert (tilt[:, 0] < 0.15).mean() == pytest.approx(0.25, abs=0.02), "as many as the area of the cone says"
    assert np.hypot(np.cos(tilt[:, 1]).mean(), np.sin(tilt[:, 1]).mean()) < 0.03
    np.testing.assert_array_equal(tilts(0.3, np.array([7, 3]), 1), tilt[[7, 3]])


def test_what_is_turned_over_lies_in_the_same_plane():
    level = np.zeros((2, 2))
    lean = np.array([[0.4, 1.0], [0.4 - math.pi, 1.0]])
    upright, over = tilted(level, lean)
    assert upright == pytest.approx(over)


@pytest.mark.parametrize("most", [0.0, 0.5, 1.4, 0.5 * math.pi])
def test_the_mean_of_what_leans_is_seen(most):
    seen = np.cos(tilts(most, np.arange(100_000), 2)[:, 0]).mean()
    assert mean_cosine(most) == pytest.approx(seen, abs=2e-3)


def test_cover_is_that_of_leaning_outlines():
    """Leaning planks that all fitted were said not to fit."""
    footprints = [Footprints([Footprint.rectangle(2.0, 0.5)], turn="random", tilt=tilt) for tilt in (0.0, 1.2)]
    covers = [
        cover_of(Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", count=80, footprint=f)])])).covered
        for f in footprints
    ]
    assert covers[1] == pytest.approx(covers[0] * mean_cosine(1.2), rel=1e-3)


def test_slopes_are_blended_between_the_middles_of_pixels():
    rows, columns, size = 5, 8, (4.0, 3.0)
    x = (np.arange(columns) + 0.5) * size[0] / columns
    y = (rows - np.arange(rows) - 0.5) * size[1] / rows
    image = np.stack(np.broadcast_arrays(2.0 * x[None] - y[:, None], 0.5 * y[:, None] + 1.0), axis=-1)
    position = np.random.default_rng(3).uniform([0.3, 0.35], [3.7, 2.65], (40, 2))
    expected = np.stack([2.0 * position[:, 0] - position[:, 1], 0.5 * position[:, 1] + 1.0], axis=1)
    np.testing.assert_allclose(slope_at(image, position, size), expected, atol=1e-12)
    np.testing.assert_array_equal(slope_at(image, np.array([[0.0, 3.0], [4.0, 0.0]]), size), image[[0, -1], [0, -1]])


def problem_on(slope, count=100, density=1.0, side=10.0):
    footprints = Footprints(BOX, turn="random", slope=slope)
    body_class = BodyClass("a", [Size("s", count=count, footprint=footprints)], density)
    return Problem(Domain((side, side)), [body_class], avoid_overlap=True)


def test_cover_is_that_of_the_ground():
    """What leans by 60 degrees covers half as much as it is seen from above; half of the ground is level."""
    slope = np.zeros((4, 8, 2))
    slope[:, 4:, 0] = math.sqrt(3.0)
    assert cover_of(problem_on(None)).covered == pytest.approx(0.48)
    assert cover_of(problem_on(slope)).covered == pytest.approx(0.36)
    left = np.zeros((1, 2))
    left[0, 1] = 1.0
    assert cover_of(problem_on(slope, density=left)).covered == pytest.approx(0.48)
    assert footprints_of(problem_on(slope)).seen == pytest.approx(np.full(100, 0.75))


@pytest.mark.parametrize(
    ("slope", "said"),
    [
        (3.0, "got 3"),
        (np.zeros((3, 3)), "must be an image of slopes"),
        (np.full((2, 2, 2), np.nan), "of at most 100 meters per meter; it holds nan"),
        (np.full((2, 2, 2), 200.0), "it holds 200"),
        ("slope.npy", 'got "slope.npy"'),
    ],
)
def test_a_slope_without_meaning_is_refused(slope, said):
    with pytest.raises(ProblemError, match="`slope` of footprints must be") as refused:
        Footprints(BOX, slope=slope)
    assert said in str(refused.value)
