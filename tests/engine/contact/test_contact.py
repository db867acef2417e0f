"""Overlaps against a count over all pairs, and bodies that push each other apart."""

import math

import numpy as np
import pytest
from esh.engine.contact.contact import keeps_apart
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.model import Model
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver


@pytest.fixture(scope="module")
def launcher():
    return Launcher(resolve_device("cpu"))


def test_overlaps_equal_a_count_over_all_pairs(launcher, overlap_count):
    rng = np.random.default_rng(1)
    for boundary in ("open", "periodic"):
        domain = Domain((5.0, 2.0), boundary)
        position = rng.random((400, 2)) * domain.size
        area = rng.random(400) * 0.02 + 1e-4
        difference = position[:, None] - position[None]
        if domain.periodic:
            difference -= np.array(domain.size) * np.round(difference / domain.size)
        radius = np.sqrt(area / np.pi)
        depth = radius[:, None] + radius[None] - np.hypot(*np.moveaxis(difference, -1, 0))
        close = depth > 1e-3 * 2.0 * np.minimum(radius[:, None], radius[None])
        expected = (close.sum() - 400) // 2
        assert overlap_count(position, area, domain, launcher) == expected
        assert expected > 100


def distance_of_segments(p, q, r, s):
    """Distance of the segments pq and rs: 0 where they cross, else from an end of one to the other."""

    def cross(a, b):
        return a[0] * b[1] - a[1] * b[0]

    def from_end(e, a, b):
        t = np.clip(np.dot(e - a, b - a) / max(np.dot(b - a, b - a), 1e-30), 0.0, 1.0)
        return np.linalg.norm(a + t * (b - a) - e)

    if cross(q - p, r - p) * cross(q - p, s - p) < 0 and cross(s - r, p - r) * cross(s - r, q - r) < 0:
        return 0.0
    return min(from_end(p, r, s), from_end(q, r, s), from_end(r, p, q), from_end(s, p, q))


def test_overlaps_of_capsules_and_discs_equal_a_count_over_all_pairs(launcher, overlap_count):
    rng = np.random.default_rng(5)
    n = 160
    domain = Domain((6.0, 4.0))
    position, angle = rng.random((n, 2)) * domain.size, rng.random(n) * math.pi
    length = np.where(rng.random(n) < 0.5, rng.random(n), 0.0)
    width = np.where(length > 0.0, 0.02 + 0.1 * rng.random(n), 0.0)
    area = 0.01 + 0.02 * rng.random(n)
    radius = np.where(width > 0.0, width / 2, np.sqrt(area / math.pi))
    axis = 0.5 * length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    expected = sum(
        distance_of_segments(position[i] - axis[i], position[i] + axis[i], position[j] - axis[j], position[j] + axis[j])
        < radius[i] + radius[j] - 2e-3 * min(radius[i], radius[j])
        for i in range(n)
        for j in range(i)
    )
    counted = overlap_count(position, area, domain, launcher, angle=angle, length=length, width=width)
    assert counted == expected
    assert expected > 50


def test_footprints_far_too_large_are_counted_without_looking_at_every_pair(launcher, overlap_count):
    """Every one of 30,000 discs overlaps every other: half a thousand million pairs, of which 200 a body are counted."""
    domain = Domain((1.0, 1.0))
    position = np.random.default_rng(2).random((30_000, 2))
    assert overlap_count(position, np.full(30_000, 10.0), domain, launcher) == 30_000 * 200 // 2


def area_of(diameter):
    return math.pi * diameter**2 / 4


@pytest.mark.parametrize(("side", "covered"), [(10.0, 0.45), (8.65, 0.60), (7.6, 0.78)])
def test_discs_of_three_sizes_never_touch_where_the_space_holds_them(side, covered):
    sizes = [Size("large", area_of(1.0), 19), Size("medium", area_of(0.5), 76), Size("small", area_of(0.25), 306)]
    placement = solve(Problem(Domain((side, side)), [BodyClass("disc", sizes)], avoid_overlap=True), device="cpu")
    assert placement.report.covered == pytest.approx(covered, abs=0.01)
    radius = np.sqrt(placement.area / math.pi)
    difference = placement.position[:, None] - placement.position[None]
    gap = np.hypot(*np.moveaxis(difference, -1, 0)) - radius[:, None] - radius[None]
    np.fill_diagonal(gap, 1.0)
    assert gap.min() >= 0.0
    assert placement.report.overlaps == 0
    assert np.bincount(placement.size_index).tolist() == [19, 76, 306]


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_capsules_and_discs_part_and_lines_keep_their_length(boundary, launcher):
    image = np.ones((40, 60))
    image[:, :20] = 0.0
    line = Line(1.5, direction=0.7, width=0.2, stretch_weights=(0.0, 0.1))
    sizes = [Size("stick", 0.33, 60, line=line), Size("disc", area_of(0.5), 80)]
    problem = Problem(Domain((12.0, 8.0), boundary), [BodyClass("a", sizes, image)], avoid_overlap=True)
    placement = solve(problem, device="cpu")
    assert placement.report.overlaps == 0
    stick = placement.size_index == 0
    np.testing.assert_allclose(placement.length[stick], 1.5, rtol=1e-4)
    axis = 0.75 * np.stack([np.cos(placement.angle[stick]), np.sin(placement.angle[stick])], axis=1)
    for end in (placement.position[stick] - axis, placement.position[stick] + axis):
        inside = end % problem.domain.size if boundary == "periodic" else end
        assert (inside[:, 0] >= 4.0 - 1e-4).all()
        assert (inside >= -1e-4).all()
        assert (inside <= np.array(problem.domain.size) + 1e-4).all()


def test_what_cannot_fit_is_reported():
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.1, 14)])], avoid_overlap=True)
    report = solve(problem, device="cpu", max_steps=20).report
    assert report.overlaps > 0
    assert ["at most about" in note for note in report.notes].count(True) == 1, "said once"
    assert report.classes[0].sizes[0].placed == 14


def test_overlaps_are_counted_where_there_is_room_elsewhere():
    corner = np.zeros((4, 4), np.float32)
    corner[0, 0], corner[1:] = 1.0, 1e-6
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.03, 14)], corner)], avoid_overlap=True)
    report = solve(problem, device="cpu", max_steps=2).report
    assert report.overlaps > 0 and report.covered < 1.0
    assert ["still overlap" in note for note in report.notes] == [True]


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("steps", [60, 150])
def test_lines_whose_width_follows_from_their_length_do_not_overlap_either(boundary, steps):
    sizes = [Size("line", 0.3, 220, line=Line(1.2)), Size("dot", 0.2, 300)]
    problem = Problem(Domain((20.0, 15.0), boundary), [BodyClass("a", sizes)], avoid_overlap=True)
    assert solve(problem, device="cpu", max_steps=steps).report.overlaps == 0


def test_lines_that_lie_on_each_other_hundreds_of_times_are_not_pushed():
    """Each of them touches thousands of others: a step took minutes."""
    line = Line(0.1, "none", width=0.1)
    for count, kept in ((500, True), (20_000, False)):
        problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 1e-5, count, line=line)])])
        with Solver(problem, device="cpu") as solver:
            assert (solver.descent.contact is not None) == kept
            solver.step()
            assert np.isfinite(solver.placement().position).all()


@pytest.mark.parametrize(("boundary", "count"), [("open", 2000), ("periodic", 9000)])
def test_lines_that_may_overlap_cross_where_each_has_too_many_around_it(boundary, count):
    """As many as each would cross if they were strewn at random: counted by shapely."""
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(3)

    def pushes(crossings, avoid=False):
        length = math.sqrt(0.5 * math.pi * crossings / count)
        line = Size("s", length * 1e-5, count, line=Line(length))
        problem = Problem(Domain((1.0, 1.0), boundary), [BodyClass("a", [line])], avoid_overlap=avoid)
        return length, keeps_apart(Model(problem))

    length, few = pushes(95.0)
    assert few and not pushes(105.0)[1] and pushes(105.0, avoid=True)[1]
    middle, angle = rng.random((count, 2)), rng.uniform(0.0, math.pi, count)
    half = 0.5 * length * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    shift = np.array([[x, y] for x in (-1, 0, 1) for y in (-1, 0, 1)]) if boundary == "periodic" else np.zeros((1, 2))
    lines = [shapely.linestrings(np.stack([middle + s - half, middle + s + half], axis=1)) for s in shift]
    tree = shapely.STRtree(np.concatenate(lines))
    crossed = len(tree.query(shapely.linestrings(np.stack([middle - half, middle + half], axis=1)), "crosses")[0])
    assert crossed / count == pytest.approx(95.0, rel=0.2 if boundary == "open" else 0.05)


def test_many_long_thin_lines_end_soon(monkeypatch):
    """What lies around each of them is not looked through, again and again: no kernel of contact is started."""
    from esh.engine.contact import contact

    monkeypatch.setattr(contact.Contact, "push", lambda *_: pytest.fail("pushed"))
    line = Size("s", 1e-5, 3000, line=Line(0.5))
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [line])])
    assert np.isfinite(solve(problem, device="cpu", max_steps=2).position).all()
