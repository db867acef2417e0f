"""Outlines: their figures against shapely, polygons that hold what they were made from, and what every body is drawn."""

import math

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.body_footprints import CAPSULE, footprints_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import MOST_CORNERS, Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays


def shape_of(footprint):
    shapely = pytest.importorskip("shapely")
    kind = (shapely.Point, shapely.LineString, shapely.Polygon)[min(len(footprint.corners), 3) - 1]
    core = kind(footprint.corners)
    return core.buffer(footprint.rounding, quad_segs=400) if footprint.rounding else core


SHAPES = {
    "disc": Footprint.disc(0.7),
    "capsule": Footprint.capsule(2.0, 0.3),
    "rectangle": Footprint.rectangle(2.0, 0.3),
    "rounded": Footprint.rectangle(2.0, 0.5, 0.2),
    "off its origin": Footprint.polygon([[1.0, 0.0], [3.0, 0.5], [2.0, 2.0]], 0.1),
}


@pytest.mark.parametrize("name", SHAPES)
def test_area_width_reach_and_moment_are_those_of_the_outline(name):
    footprint = SHAPES[name]
    shape = shape_of(footprint)
    assert footprint.area == pytest.approx(shape.area, rel=1e-4)
    points = np.array((shape.exterior if shape.geom_type == "Polygon" else shape).coords)
    assert footprint.circumradius == pytest.approx(np.hypot(*points.T).max(), rel=1e-4)
    angle = np.linspace(0.0, math.pi, 2001)
    extent = np.ptp(points @ np.stack([np.cos(angle), np.sin(angle)]), axis=0)
    assert footprint.width == pytest.approx(extent.min(), rel=1e-3)
    # By points on a fine lattice.
    shapely = pytest.importorskip("shapely")
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (a + (np.arange(600) + 0.5) / 600 * (b - a) for a, b in zip(low, high, strict=True))
    x, y = np.meshgrid(x, y)
    inside = shapely.contains_xy(shape, x, y)
    moment = ((x**2 + y**2) * inside).mean() * np.prod(high - low)
    assert footprint.moment == pytest.approx(moment, rel=0.01)
    twice = footprint.scaled(2.0)
    assert twice.area == pytest.approx(4.0 * footprint.area)
    assert twice.moment == pytest.approx(16.0 * footprint.moment)
    outline = footprint.outline(200)
    assert shapely.Polygon(outline).area == pytest.approx(footprint.area, rel=1e-3)


points = arrays(np.float64, st.tuples(st.integers(3, 60), st.just(2)), elements=st.floats(-5.0, 5.0, width=32))


@settings(max_examples=60, deadline=None)
@given(points)
def test_a_polygon_holds_all_its_points_with_16_corners_at_most(points):
    try:
        footprint = Footprint.polygon(points)
    except ProblemError as error:
        assert " must " in str(error)
        return
    corners = footprint.corners
    assert len(corners) <= MOST_CORNERS
    edge = np.roll(corners, -1, axis=0) - corners
    normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.hypot(*edge.T)[:, None]
    beyond = (points[:, None] - corners) * normal
    assert beyond.sum(axis=2).max() <= 1e-6 * np.ptp(points, axis=0).max()


def test_a_circle_of_points_becomes_a_polygon_little_larger_than_it():
    angle = np.arange(200) * (2.0 * math.pi / 200)
    footprint = Footprint.polygon(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert len(footprint.corners) == MOST_CORNERS
    assert math.pi < footprint.area < 1.02 * math.pi


def test_rounded_points_on_a_line_are_capsules_and_one_is_a_disc():
    assert len(Footprint.polygon([[0, 0], [1, 0], [2, 0]], 0.1).corners) == 2
    assert len(Footprint.polygon([[1, 2], [1, 2], [1, 2]], 0.1).corners) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Footprint.disc(0.0), "`radius` of a disc must be a number in meters above 0"),
        (lambda: Footprint.capsule(1.0, 2.0), "`width` of a capsule must be at most its length, 1"),
        (lambda: Footprint.polygon([[0, 0], [1, 1], [2, 2]]), "must not lie on one line without a `rounding`"),
        (lambda: Footprint.polygon([[1, 1], [1, 1]]), "must not all be the same"),
        (lambda: Footprint.polygon([[0, 0], [math.nan, 1], [1, 0]]), "must be finite"),
        (lambda: Footprint.polygon("round"), "must be points"),
        (lambda: Footprint([[0, 0], [0, 1], [1, 0]]), "counter-clockwise"),
        (lambda: Footprint([[0, 0], [1, 0]]), "`rounding` of a footprint of 2 corners must be above 0"),
        (lambda: Footprint.rectangle(1.0, 1.0, -1.0), "`rounding` of a polygon must be a number of 0 or more"),
        (lambda: Footprint.disc(1.0).scaled(-1.0), "`factor` of a footprint must be a number above 0"),
        (lambda: Footprints([]), "must hold at least one Footprint"),
        (lambda: Footprints("disc"), "`variants` of footprints must be a list of Footprint"),
        (lambda: Footprints(SHAPES["disc"], weights=[1.0, 2.0]), "for each of the 1 variants"),
        (lambda: Footprints(SHAPES["disc"], variant=[0, 1]), "whole numbers from 0 to 0"),
        (lambda: Footprints(SHAPES["disc"], scale=[1.0, 0.0]), "`scale` of footprints must lie between"),
        (lambda: Footprints(SHAPES["disc"], scale_jitter=1.0), "must be below 1"),
        (lambda: Footprints(SHAPES["disc"], turn="left"), "`turn` of footprints must be"),
        (lambda: Footprints(SHAPES["disc"], turn=math.nan), "`turn` of footprints must be"),
        (lambda: Footprints(SHAPES["disc"], turn=[0.0, math.inf]), "must be finite"),
        (lambda: Footprints(SHAPES["disc"], room=0.0), "`room` of footprints must be a number between 0.01 and 100"),
        (lambda: Footprints(SHAPES["disc"], room=2.0, gap=1.0), "cannot be combined with a `gap`"),
        (lambda: Footprints(SHAPES["disc"], turn=[0.0, 1.0], scale=[1.0]), "must all have one entry per body"),
        (lambda: Size("s"), "`area` of size"),
        (lambda: Size("s", footprint=3.0), "must be a Footprint"),
        (lambda: Size("s", count=3, footprint=Footprints(SHAPES["disc"], turn=[0.0])), "one entry per body, 3; got 1"),
        (
            lambda: Size("s", count=3, line=Line(1.0), footprint=Footprints(SHAPES["capsule"], turn=0.5)),
            "because its bodies are lines",
        ),
    ],
)
def test_what_makes_no_outline_is_refused_with_a_sentence(make, message):
    with pytest.raises(ProblemError) as caught:
        make()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def problem_of(*sizes, **kwargs):
    return Problem(Domain((40.0, 30.0)), [BodyClass("a", list(sizes))], seed=5, **kwargs)


def test_a_longer_list_of_bodies_leaves_the_earlier_ones_as_they_are():
    footprints = Footprints([SHAPES["disc"], SHAPES["rectangle"]], weights=[1, 3], scale_jitter=0.4, turn="random")
    few, many = (footprints_of(problem_of(Size("s", count=n, footprint=footprints))) for n in (200, 500))
    for name in ("variant", "scale", "turn"):
        np.testing.assert_array_equal(getattr(few, name), getattr(many, name)[:200])
    assert np.bincount(many.variant)[1] == pytest.approx(375, abs=40)
    assert 0.6 <= many.scale.min() < 0.65 and 1.35 < many.scale.max() <= 1.4
    assert not many.free.any()
    # Bodies of two sizes draw from streams of their own.
    both = footprints_of(problem_of(*(Size(name, count=50, footprint=footprints) for name in "xy")))
    assert (both.scale[:50] != both.scale[50:]).any()


def test_what_is_given_for_every_body_arrives():
    turn, scale, variant = np.array([0.0, 1.0, -2.0]), np.array([1.0, 2.0, 0.5]), np.array([1, 0, 1])
    given = Footprints([SHAPES["disc"], SHAPES["rectangle"]], variant=variant, scale=scale, turn=turn)
    bodies = footprints_of(problem_of(Size("s", count=3, footprint=given)))
    for name, value in (("turn", turn), ("scale", scale), ("variant", variant)):
        np.testing.assert_array_equal(getattr(bodies, name), value)


def test_charges_are_the_areas_of_the_outlines_unless_an_area_is_given():
    footprints = Footprints([SHAPES["disc"], SHAPES["rectangle"]], scale_jitter=0.3)
    problem = problem_of(Size("s", count=40, footprint=footprints), Size("t", 2.5, 10, footprint=footprints))
    bodies = footprints_of(problem)
    area = np.array([SHAPES["disc"].area, SHAPES["rectangle"].area])[bodies.variant] * bodies.scale**2
    np.testing.assert_allclose(problem.body_areas()[:40], area[:40])
    np.testing.assert_array_equal(problem.body_areas()[40:], 2.5)
    size = Size("s", count=100_000, footprint=footprints)
    assert size.mean_area == pytest.approx(problem_of(size).body_areas().mean(), rel=0.01)


def test_outlines_of_a_range_have_the_areas_of_their_bodies():
    size = Size("s", (0.5, 2.0), 30, footprint=SHAPES["rectangle"])
    problem = problem_of(size)
    bodies = footprints_of(problem)
    np.testing.assert_allclose(bodies.scale**2 * SHAPES["rectangle"].area, problem.body_areas())
    np.testing.assert_allclose(bodies.areas(np.zeros(30), np.zeros(30), apart=False), problem.body_areas())


def test_areas_that_differ_much_are_a_range_to_the_solver_and_alike_ones_are_not():
    assert Size("s", count=3, footprint=[Footprint.disc(1.0), Footprint.disc(0.1)]).is_range
    assert not Size("s", count=3, footprint=Footprints(Footprint.disc(1.0), scale_jitter=0.1)).is_range


def test_bodies_without_outlines_are_discs_of_their_area_and_lines_capsules():
    bodies = footprints_of(problem_of(Size("dot", 2.0, 4), Size("line", 1.0, 2, line=Line(1.5, width=0.2))))
    assert bodies.shape.tolist() == [0, 0, 0, 0, CAPSULE, CAPSULE]
    length, width = np.array([0.0] * 4 + [1.5] * 2), np.array([0.0] * 4 + [0.2] * 2)
    capsule = 1.5 * 0.2 + math.pi * 0.01
    np.testing.assert_allclose(bodies.areas(length, width, apart=True), [2.0] * 4 + [capsule] * 2)
    assert bodies.scale.tolist() == [1.0] * 6
