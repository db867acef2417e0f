"""When bodies count as settled whose steps have run out."""

import math

import numpy as np
import pytest
from esh import BodyClass, Domain, Problem, Size, cover_of, solve
from esh.engine.descent.convergence import is_settled
from esh.engine.model.model import Model


def pebbles_among_boulders(most, seed=1):
    """Pebbles that are to cover up to so much of the ground on a hill, and boulders on a fifth of it."""
    rows, columns = np.mgrid[0:100, 0:160]
    away = np.hypot((columns + 0.5) / 4.0 - 20.0, (rows + 0.5) / 4.0 - 12.5)
    hill = 0.05 + 0.95 * np.exp(-0.5 * (away / 8.0) ** 2)
    count = round(most * 1000.0 * hill.mean() / 0.25)
    pebbles = BodyClass("pebble", [Size("s", 0.25, count)], hill)
    boulders = BodyClass("boulder", [Size("s", math.pi * 2.0**2, 16)])
    return Problem(Domain((40.0, 25.0)), [pebbles, boulders], avoid_overlap=True, seed=seed)


def test_what_jostles_in_a_crowded_place_has_settled_once_nothing_changes():
    problem = pebbles_among_boulders(0.75)
    assert cover_of(problem).covered < 0.6 < cover_of(problem).pressed
    reports = [
        [solve(pebbles_among_boulders(0.75, seed), device="cpu", max_steps=steps).report for steps in (100, 250)]
        for seed in range(1, 5)
    ]
    # One step in ten is so long that it may hide that.
    assert sum(report.converged for of_seed in reports for report in of_seed) >= 7
    for of_seed in reports:
        pebbles, boulders = np.array([[entry.coverage_error for entry in report.classes] for report in of_seed]).T
        # Boulders that are a little elsewhere leave pebbles, which are placed around them, other places.
        np.testing.assert_allclose(*pebbles, atol=0.015)
        np.testing.assert_allclose(*boulders, rtol=0.1)
        assert pebbles.max() < 0.1
    assert not solve(problem, device="cpu", max_steps=4).report.converged


def test_how_much_of_the_ground_the_densest_tenth_is_to_cover():
    def pressed(density, avoid=True):
        body_class = BodyClass("a", [Size("s", 0.1, 2000)], density)
        return cover_of(Problem(Domain((20.0, 20.0)), [body_class], avoid_overlap=avoid)).pressed

    assert pressed(1.0) == pytest.approx(0.5)
    # Nine tenths of the bodies stand on half of the ground.
    assert pressed(np.array([[9.0, 1.0]])) == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("residual", "steps", "expected"), [(0.004, 15, True), (0.015, 15, True), (0.03, 15, False), (0.015, 3, False)]
)
def test_what_counts_as_settled_where_some_are_crowded(residual, steps, expected):
    assert is_settled(Model(pebbles_among_boulders(0.75)), [residual] * steps) == expected


@pytest.mark.parametrize("cover", [0.5, 0.65, 0.72])
def test_even_ground_is_no_crowd(cover):
    count = round(cover * 400.0 / 0.1)
    problem = Problem(Domain((20.0, 20.0)), [BodyClass("a", [Size("s", 0.1, count)])], avoid_overlap=True)
    assert not is_settled(Model(problem), [0.008] * 15)
    assert is_settled(Model(problem), [0.004] * 15)
