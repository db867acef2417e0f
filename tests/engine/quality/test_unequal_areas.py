"""Small bodies that gather between large ones are told of, with what helps; and it helps."""

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
    position = placement.position[area < 0.5 * area.max()]
    gap = np.linalg.norm(position[:, None] - position[None], axis=-1)
    np.fill_diagonal(gap, np.inf)
    return float(np.median(gap.min(axis=1)) / math.sqrt(SIDE**2 / len(position)))


@pytest.mark.parametrize(
    ("problem", "gathers", "words"),
    [
        (
            collection(1e4, 1000),
            True,
            "1,000 of 1,040 bodies are so small that all of them are 0.25% of the footprints",
        ),
        (collection(100.0, 400), True, "make them a class of their own, and lower `class_separation` to 0"),
        (classes(1e4, 1000, 0.5), True, "to spread them, lower `class_separation` to 0"),
        (classes(1e4, 1000, 0.0), False, ""),
        (classes(100.0, 400, 0.0), False, ""),
        # One in each gap, or as many as fill it, are even.
        (collection(1e4, 100, 100), True, "100 of 200 bodies are so small"),
        (collection(1e4, 40, 80), False, ""),
        (collection(100.0, 100, 100), False, ""),
        (collection(100.0, 2000), False, ""),
        (collection(4.0, 400), False, ""),
    ],
    ids=["huge and tiny", "ten times as wide", "classes", "apart", "wide and apart"]
    + ["tiny pairs", "one for two", "pairs", "filled", "alike"],
)
def test_small_bodies_that_gather_are_told_of(problem, gathers, words):
    placement = solve(problem, device="cpu")
    told = [note for note in placement.report.notes if "gather" in note]
    assert bool(told) == gathers and all(words in note for note in told)
    # That of random points is about 0.5.
    assert (clumping(placement) < 0.35) == gathers


def test_an_error_that_is_large_because_of_large_bodies_is_explained():
    """They are as even as they can be: seen as coarsely as the large ones lie, hardly anything is left of the error."""
    problem = collection(100.0, 2000)
    placement = solve(problem, device="cpu")
    area = placement.area
    assert placement.report.coverage_error > 0.5
    coarse = math.sqrt(len(area) * np.square(area).sum()) / area.sum()
    assert coverage_error(placement.position, area, np.ones((2, 2)), problem.domain, coarse) < 0.03
    (note,) = placement.report.notes
    assert "the space around them counts as uneven" in note
    assert not solve(collection(4.0, 400), device="cpu").report.notes


def test_on_a_surface_it_is_told_too():
    square_of = np.array([(0.0, 0.0, 0.0), (SIDE, 0.0, 0.0), (SIDE, SIDE, 0.0), (0.0, SIDE, 0.0)])
    surface = Surface(SurfaceMesh(square_of, np.array([(0, 1, 2), (0, 2, 3)], np.int32)))
    report = solve(collection(1e4, 600, domain=surface), device="cpu").report
    assert [note for note in report.notes if note.startswith("600 of 640 bodies are so small")]
