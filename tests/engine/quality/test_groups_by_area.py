"""Large and small bodies of one class are measured as if they were of two."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from esh import BodyClass, Domain, Problem, Size, Surface, SurfaceMesh, solve
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.quality.groups_by_area import groups_by_area
from esh.engine.quality.measurement import measure

SIDE = 40.0
TUFTS = Size("tuft", 0.05, 2500)
BOULDERS = Size("boulder", 40.0, 7)


@pytest.fixture
def launcher():
    with closing(Launcher(resolve_device("cpu"))) as made:
        yield made


def domain_of(kind):
    if kind == "plane":
        return Domain((SIDE, SIDE))
    ball = trimesh.creation.icosphere(4, radius=SIDE / np.sqrt(4.0 * np.pi))
    return Surface(SurfaceMesh(ball.vertices, ball.faces))


@pytest.mark.parametrize("kind", ["plane", "surface"])
def test_boulders_among_tufts_of_one_class_are_measured_as_two_classes(kind, launcher):
    domain = domain_of(kind)
    placement = solve(Problem(domain, [BodyClass("all", [BOULDERS, TUFTS])], avoid_overlap=True), device="cpu")
    classes = [BodyClass("boulder", [BOULDERS]), BodyClass("tuft", [TUFTS])]
    apart = replace(
        placement,
        problem=Problem(domain, classes, avoid_overlap=True),
        class_index=placement.size_index,
        size_index=np.zeros_like(placement.size_index),
    )
    of_boulders, of_tufts = measure(apart, launcher).classes
    error = placement.report.classes[0].coverage_error
    expected = np.average([of_boulders.coverage_error, of_tufts.coverage_error], weights=[7 * 40.0, 2500 * 0.05])
    assert error == pytest.approx(expected, rel=1e-3) and error < 0.06
    # All together they are one heavy spot each, whatever class they are of.
    assert placement.report.coverage_error == pytest.approx(measure(apart, launcher).coverage_error, rel=1e-3)
    assert placement.report.coverage_error > 2.0
    assert any("judge each class by its own" in note for note in placement.report.notes)


def test_boulders_that_lie_in_a_corner_are_seen(launcher):
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass("all", [BOULDERS, TUFTS])], avoid_overlap=True)
    placement = solve(problem, device="cpu", max_steps=30)
    position = placement.position.copy()
    position[:7] = 4.0 + 8.0 * np.array([[x, y] for x in range(2) for y in range(4)][:7])
    error = measure(replace(placement, position=position), launcher).classes[0].coverage_error
    assert error > 0.3 > 5.0 * placement.report.classes[0].coverage_error


@pytest.mark.parametrize(("large", "apart", "together"), [(8.9, True, True), (9.1, True, False), (800.0, False, True)])
def test_similar_sizes_and_those_that_may_overlap_are_measured_together(large, apart, together):
    sizes = [Size("large", 0.05 * large, 7), TUFTS]
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass("all", sizes)], avoid_overlap=apart)
    placement = solve(problem, device="cpu", max_steps=2)
    groups = groups_by_area(placement, placement.area)
    assert (len(groups.own) == 1) == together
    assert (placement.report.classes[0].coverage_error == placement.report.coverage_error) == together


def test_groups_are_as_large_as_each_other_and_come_class_by_class():
    sizes = [Size("boulder", 10.0, 2), Size("stone", 0.5, 20), Size("rubble", 0.1, 40), Size("gravel", 0.02, 300)]
    classes = [BodyClass("one", sizes), BodyClass("other", [Size("s", 1.0, 5)])]
    placement = solve(Problem(Domain((SIDE, SIDE)), classes, avoid_overlap=True), device="cpu", max_steps=1)
    groups = groups_by_area(placement, placement.area)
    assert groups.of_class == [0, 0, 0, 1]
    assert [sorted(set(placement.area[own])) for own in groups.own] == [[0.02, 0.1], [0.5], [10.0], [1.0]]
    assert all((groups.index[own] == number).all() for number, own in enumerate(groups.own))
    assert groups.total == pytest.approx([10.0, 10.0, 20.0, 5.0])
    assert groups.of_classes([1.0, 2.0, 3.0, 4.0]) == [2.25, 4.0]
