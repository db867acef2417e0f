"""Bodies that look at a point: turned from where they end, in a rectangle and on a surface; lines and fixed bodies are not."""

import math

import esh
import numpy as np
import pytest

POINT = (7.0, -2.0, 0.0)
DOMAIN = esh.Domain((10.0, 8.0))
CHAIR = esh.Footprints(esh.Footprint.rectangle(0.5, 0.3))


def solved(*classes, **more):
    return esh.solve(esh.Problem(DOMAIN, list(classes), **more), device="cpu", max_steps=15)


def looks(angle, position, front=0.0, point=POINT):
    """How far bodies look past the point [rad], shape ``[n]``."""
    way = np.array(point[:2]) - position
    past = angle + front - np.arctan2(way[:, 1], way[:, 0])
    return np.mod(past + math.pi, 2.0 * math.pi) - math.pi


@pytest.mark.parametrize(
    ("front", "angle"), [("x", 0.0), ("-x", math.pi), ("y", 0.5 * math.pi), ("-y", -0.5 * math.pi)]
)
def test_every_front_looks_at_the_point(front, angle):
    placement = solved(esh.BodyClass("a", [esh.Size("s", 0.02, 60)], look_at=esh.LookAt(POINT, front=front)))
    assert np.abs(looks(placement.angle, placement.position, angle)).max() < 1e-9
    assert np.abs(placement.angle).max() <= math.pi


def test_they_look_past_it_by_the_spread_and_only_those_of_the_class():
    look = esh.LookAt(POINT, 0.4, "x")
    classes = [
        esh.BodyClass("a", [esh.Size("s", 0.02, 200)], look_at=look),
        esh.BodyClass("b", [esh.Size("s", 0.02, 50)]),
    ]
    placement = solved(*classes)
    own = placement.class_index == 0
    past = looks(placement.angle[own], placement.position[own])
    assert -0.4 <= past.min() < -0.38 and 0.38 < past.max() <= 0.4 and abs(past.mean()) < 0.05
    assert not placement.angle[~own].any()
    without = solved(esh.BodyClass("a", [esh.Size("s", 0.02, 200)]), classes[1])
    np.testing.assert_array_equal(placement.position, without.position, "where they are does not depend on it")


def test_outlines_that_look_are_kept_apart_as_they_are_turned():
    look = esh.LookAt((5.0, 30.0, 0.0), front="y")
    sizes = [esh.Size("s", 0.15, 320, footprint=CHAIR)]
    placement = solved(esh.BodyClass("chair", sizes, look_at=look), avoid_overlap=True)
    assert placement.report.overlaps == 0 and placement.report.covered > 0.55
    # Parted, they have moved on from where they were turned.
    past = np.abs(looks(placement.angle, placement.position, 0.5 * math.pi, (5.0, 30.0)))
    assert past.max() < 0.05 and np.median(past) < 0.01
    free = solved(esh.BodyClass("chair", sizes), avoid_overlap=True)
    assert np.abs(looks(free.angle, free.position, 0.5 * math.pi, (5.0, 30.0))).max() > 1.0


def test_lines_and_fixed_bodies_keep_their_angles():
    look = esh.LookAt(POINT, front="x")
    line = esh.Size("s", 0.1, 20, line=esh.Line(0.8, 0.3))
    along = solved(esh.BodyClass("a", [line], look_at=look))
    without = solved(esh.BodyClass("a", [line]))
    np.testing.assert_array_equal(along.angle, without.angle)
    fixed = esh.FixedBody((2.0, 2.0), "a", "s", angle=1.25)
    placement = solved(esh.BodyClass("a", [esh.Size("s", 0.02, 60)], look_at=look), fixed=[fixed], include_fixed=True)
    assert placement.angle[placement.fixed].tolist() == [1.25]
    assert np.abs(looks(placement.angle, placement.position)[~placement.fixed]).max() < 1e-9


def test_an_edit_has_them_look_elsewhere():
    def problem(point):
        sizes = [esh.Size("s", 0.15, 60, footprint=CHAIR)]
        return esh.Problem(
            DOMAIN, [esh.BodyClass("a", sizes, look_at=esh.LookAt(point, front="x"))], avoid_overlap=True
        )

    with esh.Solver(problem(POINT), device="cpu") as solver:
        solver.run(15)
        solver.separate()
        before = solver.placement()
        solver.edit(problem((-3.0, 9.0, 0.0)))
        after = solver.placement()
    assert np.abs(looks(before.angle, before.position)).max() < 0.2
    assert np.abs(looks(after.angle, after.position, point=(-3.0, 9.0))).max() < 0.2


def test_on_a_surface_they_look_as_well_as_they_can_about_their_own_axes():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3)
    surface = esh.Surface(esh.SurfaceMesh(ball.vertices, ball.faces))
    moss = esh.BodyClass("a", [esh.Size("s", 0.01, 100)], look_at=esh.LookAt((0.0, 0.0, 9.0), front="x"))
    placement = esh.solve(esh.Problem(surface, [moss]), device="cpu", max_steps=10)
    way = np.array([0.0, 0.0, 9.0]) - placement.position
    way -= (way * placement.normal).sum(axis=1, keepdims=True) * placement.normal
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    # At the pole itself the way has no direction along the surface.
    seen = np.abs(placement.position[:, 2]) < 0.99
    np.testing.assert_allclose((way * placement.tangent).sum(axis=1)[seen], 1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point": (1.0, 2.0)}, r"`look_at\.point` must be 3 numbers; got \(1\.0, 2\.0\)"),
        ({"spread": -1.0}, r"`look_at\.spread` must be a number between 0 and 3\.14159"),
        ({"front": "z"}, r'`look_at\.front` must be "-y", "y", "x" or "-x"; got "z"'),
    ],
)
def test_what_has_no_meaning_is_named(changes, words):
    with pytest.raises(esh.ProblemError, match=words):
        esh.LookAt(**changes)
