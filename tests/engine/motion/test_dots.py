"""Dots that the CPU moves several at once go where each of them would go alone."""

from dataclasses import replace

import numpy as np
import pytest
from esh import BodyClass, Domain, FixedBodies, Line, Problem, Size, Solver

WIDE = Domain((40.0, 20.0))
# Two holes, so that dots slide along the edge of their support.
HOLES = np.ones((20, 40))
HOLES[5:9, 8:15] = HOLES[12:16, 20:38] = 0.0
SLOPE = np.linspace(0.1, 1.0, 32)[None, :]


def of_two_classes(**settings):
    classes = [
        BodyClass("a", [Size("s", 0.2, 301), Size("l", 0.6, 77)], density=HOLES),
        BodyClass("b", [Size("s", 0.3, 205)], density=SLOPE),
    ]
    return Problem(WIDE, classes, **settings)


def with_fixed():
    at = np.random.default_rng(1).random((23, 2)) * [40.0, 20.0]
    return of_two_classes(fixed=FixedBodies(at), seed=2)


def with_lines():
    classes = [
        BodyClass("dots", [Size("s", 0.3, 301)], density=SLOPE),
        BodyClass("lines", [Size("l", 0.5, 60, line=Line(1.5))]),
        BodyClass("more dots", [Size("s", 0.3, 99)]),
    ]
    return Problem(WIDE, classes, seed=4)


PROBLEMS = {
    "open": of_two_classes(),
    "periodic": replace(of_two_classes(), domain=Domain((40.0, 20.0), "periodic")),
    "in contact": of_two_classes(avoid_overlap=True),
    "beside fixed ones": with_fixed(),
    "beside lines": with_lines(),
    "few": Problem(WIDE, [BodyClass("a", [Size("s", 1.0, 5)])]),
}


def state_after(problem, steps, *, one_by_one):
    with Solver(problem, device="cpu") as solver:
        descent = solver.descent
        if one_by_one:
            descent.at_once = 1
            descent.step = solver.launcher.record(descent.take_step)
        else:
            assert descent.at_once > 1
        solver.step(steps)
        state = solver.state
        return [array.numpy().copy() for array in (state.pose, state.displacement, state.move, descent.charge_position)]


@pytest.mark.parametrize("name", PROBLEMS)
def test_dots_go_where_each_of_them_would_go_alone(name):
    together, alone = (state_after(PROBLEMS[name], 12, one_by_one=one_by_one) for one_by_one in (False, True))
    for here, there in zip(together, alone, strict=True):
        np.testing.assert_array_equal(here, there)
    assert np.abs(together[1]).max() > 0.0


def pushed(problem, *, as_discs):
    """Where bodies are after steps that start with three of them at one place."""
    with Solver(problem, device="cpu") as solver:
        start = solver.placement().position
        start[40] = start[41] = start[300] + 1e-9
        solver.start_at(start)
        descent = solver.descent
        assert descent.contact.discs
        if not as_discs:
            descent.contact.discs = False
            descent.step = solver.launcher.record(descent.take_step)
        before = descent.state.displacement.numpy().copy()
        solver.step(8)
        assert (descent.state.displacement.numpy() != before).any()
        return [array.numpy().copy() for array in (descent.state.pose, descent.state.displacement)]


@pytest.mark.parametrize("fixed", [False, True])
def test_discs_are_pushed_as_capsules_without_an_axis(fixed):
    at = np.random.default_rng(1).random((23, 2)) * [40.0, 20.0]
    given = {"fixed": FixedBodies(at)} if fixed else {}
    # Sizes so different that there are several levels of cells, so crowded that most touch.
    classes = [BodyClass("a", [Size("s", 0.5, 700), Size("m", 2.0, 80), Size("l", 12.0, 9)], density=SLOPE)]
    problem = Problem(WIDE, classes, avoid_overlap=True, seed=1, **given)
    for here, there in zip(pushed(problem, as_discs=True), pushed(problem, as_discs=False), strict=True):
        np.testing.assert_array_equal(here, there)


@pytest.mark.parametrize("kind", ["periodic", "lines"])
def test_what_wraps_or_has_an_axis_is_not_pushed_as_discs(kind):
    size = Size("s", 0.5, 60, line=Line(1.5) if kind == "lines" else None)
    domain = Domain((40.0, 20.0), "periodic" if kind == "periodic" else "open")
    with Solver(Problem(domain, [BodyClass("a", [size])], avoid_overlap=True), device="cpu") as solver:
        assert not solver.descent.contact.discs


def test_a_force_that_is_no_number_is_found_among_dots_that_move_together():
    with Solver(of_two_classes(), device="cpu") as solver:
        descent = solver.descent
        solver.step()
        broken = descent.field_at_charge.numpy()
        # Of one among those that move together; the last few of them all move alone.
        broken[17] = np.nan
        descent.field_at_charge.assign(broken)
        descent.propose()
        descent.decide()
        assert np.isnan(descent.direction.residual())
