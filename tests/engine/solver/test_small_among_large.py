"""Small bodies among much larger ones are spread, and an error that is that of the large ones is explained."""

import math

import numpy as np
import pytest
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.coverage import coverage_error
from esh.engine.solve import solve

SIDE, COVER, LARGE = 20.0, 0.4, 40


def square(area: float) -> Footprint:
    half = 0.5 * math.sqrt(area)
    return Footprint.polygon(np.array([(-half, -half), (half, -half), (half, half), (-half, half)]))


def collection(ratio: float, small: int, large: int = LARGE, domain: Domain | Surface | None = None) -> Problem:
    """Squares of two areas as one size, as objects of a collection are."""
    area = COVER * SIDE**2 / (large + small / ratio)
    variant = np.repeat([0, 1], [large, small])
    outlines = Footprints([square(area), square(area / ratio)], variant=variant, turn=0.0, may_turn=True)
    body_class = BodyClass("stone", [Size("all", count=len(variant), footprint=outlines)])
    return Problem(domain or Domain((SIDE, SIDE)), [body_class], avoid_overlap=True, seed=1)


def classes(ratio: float, small: int, separation: float) -> Problem:
    """The same as two classes."""
    area = COVER * SIDE**2 / (LARGE + small / ratio)
    made = [
        BodyClass(name, [Size("all", count=count, footprint=Footprints(square(one), turn=0.0, may_turn=True))])
        for name, count, one in (("large", LARGE, area), ("small", small, area / ratio))
    ]
    return Problem(Domain((SIDE, SIDE)), made, balance=Balance(class_separation=separation), avoid_overlap=True, seed=1)


def clumping(placement) -> float:
    """Usual distance between a small body and the nearest one of them, over that of as many even ones."""
    area = placement.area
    return usual_gap(placement.position[area < 0.5 * area.max()])


def usual_gap(position) -> float:
    """Usual distance to the nearest of some points, over that of as many even ones."""
    gap = np.linalg.norm(position[:, None] - position[None], axis=-1)
    np.fill_diagonal(gap, np.inf)
    return float(np.median(gap.min(axis=1)) / math.sqrt(SIDE**2 / len(position)))


# Huge and tiny ones, pebbles ten times as wide, as many tiny ones as huge ones, and three widths.
SCENES = {
    "huge and tiny": lambda: collection(1e4, 1000),
    "ten times as wide": lambda: collection(100.0, 400),
    "sixteen times as wide": lambda: collection(256.0, 600),
    "tiny pairs": lambda: collection(1e4, 100, 100),
    "classes": lambda: classes(1e4, 1000, 0.5),
    "classes that mix": lambda: classes(100.0, 400, 1.0),
}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_small_bodies_do_not_gather_between_large_ones(scene):
    """They lay in heaps in the gaps, nearest neighbors at a tenth of what they are for random points, which is 0.5."""
    problem = scene()
    placement = solve(problem, device="cpu")
    area = placement.area
    large = area > 0.5 * area.max()
    assert clumping(placement) > 0.55 and placement.report.overlaps == 0
    # And large ones are as even as without them.
    assert coverage_error(placement.position[large], area[large], np.ones((2, 2)), problem.domain) < 0.013


def test_on_a_surface_they_do_not_gather_either():
    corners = np.array([(0.0, 0.0, 0.0), (SIDE, 0.0, 0.0), (SIDE, SIDE, 0.0), (0.0, SIDE, 0.0)])
    surface = Surface(SurfaceMesh(corners, np.array([(0, 1, 2), (0, 2, 3)], np.int32)))
    placement = solve(collection(1e4, 600, domain=surface), device="cpu")
    assert clumping(placement) > 0.5 and placement.report.overlaps == 0


def test_three_widths_are_all_spread():
    """Stones between boulders, and sand between the stones."""
    sizes = [
        Size(str(area), count=count, footprint=Footprints(square(area), turn=0.0, may_turn=True))
        for area, count in ((4.0, 30), (0.04, 150), (4e-4, 900))
    ]
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass("stone", sizes)], avoid_overlap=True)
    placement = solve(problem, device="cpu")
    for size in (1, 2):
        assert usual_gap(placement.position[placement.size_index == size]) > 0.55


def test_an_error_that_is_large_because_of_large_bodies_is_explained():
    """They are as even as they can be: seen as coarsely as the large ones lie, hardly anything is left of the error."""
    problem = collection(100.0, 2000)
    placement = solve(problem, device="cpu")
    area = placement.area
    assert placement.report.coverage_error > 0.5
    coarse = math.sqrt(len(area) * np.square(area).sum()) / area.sum()
    assert coverage_error(placement.position, area, np.ones((2, 2)), problem.domain, coarse) < 0.03
    (note,) = placement.report.notes
    assert "each is one heavy spot; judge each class by its own" in note
    assert placement.report.classes[0].coverage_error < 0.06
    assert not solve(collection(4.0, 400), device="cpu").report.notes
