"""Values and combinations at the edge of what float32 holds: a placement that is right, or one sentence."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp
from esh import Balance, BodyClass, Domain, Line, Problem, ProblemError, Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver


def problem_of(*sizes: Size, domain: Domain | None = None, **named) -> Problem:
    return Problem(domain or Domain((40.0, 30.0)), [BodyClass("pine", sizes)], **named)


def error_of_size(placement, index: int) -> float:
    position = placement.position[placement.size_index == index]
    return coverage_error(position, np.ones(len(position)), np.ones((1, 1)), placement.problem.domain)


@pytest.mark.parametrize("emphasis", [1e4, 1e7])
def test_a_huge_emphasis_spreads_the_large_ones_and_sends_nobody_into_the_corner(emphasis):
    sizes = [Size(f"{area}", float(area), 50) for area in (1, 4, 9)]
    placement = solve(problem_of(*sizes, balance=Balance(size_emphasis=emphasis)), device="cpu")
    # As evenly as these would be by themselves.
    assert error_of_size(placement, 2) < 0.012
    assert error_of_size(placement, 1) < 0.04


def test_areas_a_hundred_million_apart():
    placement = solve(problem_of(Size("sand", 1e-8, 40), Size("rock", 1.0, 40)), device="cpu")
    assert error_of_size(placement, 1) < 0.012
    assert np.isfinite(placement.position).all()


def test_an_interaction_scaled_by_a_power_of_two_gives_the_same_bytes(monkeypatch):
    from esh.engine.model import model

    problem = problem_of(Size("a", 1.0, 60), Size("b", 4.0, 20))
    expected = solve(problem, device="cpu", max_steps=12).position
    monkeypatch.setattr(model, "LARGEST_INTERACTION", 2.0**-2)
    # Sums over all bodies are in fixed point, which alone rounds otherwise; what that makes of positions grows from step to step.
    np.testing.assert_allclose(solve(problem, device="cpu", max_steps=12).position, expected, atol=1e-3)


REFUSED = {
    "emphasis by rank": (
        lambda: problem_of(*[Size(f"{k}", float(k), 9) for k in range(1, 8)], balance=Balance(size_emphasis=1e3)),
        '`balance.size_emphasis` must not give the largest bodies of class "pine" more than 1e+15 times the weight of its '
        "smallest; 1000 gives them 1e18 times as much",
    ),
    "emphasis of a range": (
        lambda: problem_of(Size("any", (1e-6, 10.0), 15), balance=Balance(size_emphasis=100.0)),
        "100 gives them 1e93 times as much",
    ),
    "emphasis in a list": (
        lambda: problem_of(Size("a", 1.0, 5), Size("b", 2.0, 5), balance=Balance(size_emphasis=[1e16])),
        "1e16 times as much",
    ),
    "areas apart": (
        lambda: problem_of(Size("a", 1e-9, 5), Size("b", 1.0, 5)),
        '`area` of size "b" of class "pine" must not be more than 1e+08 times that of size "a" of class "pine"; got 1 and 1e-09 m²',
    ),
    "a body that spans many periods": (
        lambda: problem_of(Size("a", 1e20, 1), domain=Domain((8.0, 8.0), "periodic")),
        '`area` of size "a" of class "pine" must not make bodies longer than 16 times the shorter side of the periodic domain, 8 m',
    ),
    "a thick line": (
        lambda: problem_of(Size("a", 1.0, 1, line=Line(1.0, width=1e9))),
        '`line` of size "a" of class "pine" must not make bodies longer than 10,000,000 times the longer side of the domain, 40 m',
    ),
    "a line that is a point": (
        lambda: problem_of(Size("a", 1.0, 1, line=Line(1e-8))),
        '`line.length` of size "a" of class "pine" must not be shorter than 1e-07 of the domain, 40 m; got 1e-08',
    ),
    "a long and narrow torus": (
        lambda: Domain((10_000.0, 1.0), "periodic"),
        'must not be more than 3,000 times longer than wide where the boundary is "periodic"; got (10000.0, 1.0)',
    ),
    "cover of tiny bodies": (
        lambda: Problem(Domain((1e6, 1e6)), [BodyClass("pine", [Size("a", 1e-18)], count="cover")]),
        '`count` of class "pine" is "cover", which takes about 1e+30 bodies of these areas; at most 2147483647 can be placed',
    ),
    "cover of more than any number": (
        lambda: Problem(Domain((1e12, 1e12)), [BodyClass("pine", [Size("a", 1e-18)], count="cover")]),
        "which takes about 1e+42 bodies",
    ),
    "a count beyond 63 bits": (
        lambda: Problem(Domain((1.0, 1.0)), [BodyClass("pine", [Size("a", 1e-3)], count=2**63 - 1)]),
        '`count` of class "pine" is too large (about 1e18): at most 2147483647 bodies can be placed',
    ),
    "footprints a thousand times the domain": (
        lambda: problem_of(Size("a", 12.0, 100_000), avoid_overlap=True),
        "`avoid_overlap` cannot keep footprints apart that add up to 1e+03 times the domain",
    ),
    "a middle without charge": (lambda: Line(1.0, middle_charge=1e-9), "must lie between 1e-06 and 1e+06; got 1e-09"),
    "an angle without meaning": (
        lambda: Line(1.0, 1e39),
        "must be an angle between -10000 and 10000 radians; got 1e+39",
    ),
    "angles without meaning": (
        lambda: Line(1.0, np.full((2, 2), 1e20)),
        "must hold angles between -10000 and 10000 radians everywhere",
    ),
    "lengths of nothing": (lambda: Line(np.full((2, 2), 1e-30)), "must lie between 1e-09 and 1e+12 meters everywhere"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_combinations_that_nothing_can_hold_are_refused_in_a_sentence(case):
    make, expected = REFUSED[case]
    with pytest.raises(ProblemError) as refused:
        make()
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("seed", range(12))
def test_bodies_of_a_periodic_domain_stay_in_it(seed):
    domain = Domain((40.0, 30.0), "periodic")
    placement = solve(
        problem_of(Size("stick", 2.0, 100, line=Line(10.0, "none")), domain=domain, seed=seed),
        device="cpu",
        max_steps=20,
    )
    assert (placement.position >= 0.0).all() and (placement.position < domain.size).all()


def test_thick_lines_that_fill_a_torus_many_times_do_no_harm():
    domain = Domain((40.0, 30.0), "periodic")
    thick = Size("plate", 3.0, 40, line=Line(30.0, 0.7, width=100.0))
    with pytest.raises(ProblemError, match="add up to 362 times the domain"):
        problem_of(thick, domain=domain, avoid_overlap=True)
    fewer = Size("plate", 3.0, 8, line=Line(30.0, 0.7, width=100.0))
    placement = solve(problem_of(fewer, domain=domain, avoid_overlap=True), device="cpu", max_steps=5)
    assert (placement.position >= 0.0).all() and (placement.position < domain.size).all()


@pytest.mark.parametrize("lines", [False, True])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_position_that_is_no_number_ends_the_run_in_a_sentence(lines, value):
    line = Line(2.0) if lines else None
    with Solver(problem_of(Size("a", 1.0, 50, line=line)), device="cpu") as solver:
        solver.step()
        pose = solver.state.pose.numpy()
        pose[7, 0] = value
        wp.copy(solver.state.pose, wp.array(pose, dtype=wp.vec4, device="cpu"))
        solver.descent.place_charges()
        if math.isnan(value):
            with pytest.raises(ProblemError, match="no longer finite numbers"):
                solver.placement()
        with pytest.raises(ProblemError, match="no longer finite numbers"):
            solver.step(3)


def test_forces_that_overflow_end_the_run_in_a_sentence(monkeypatch):
    from esh.engine.model import model

    monkeypatch.setattr(model, "_within_range", lambda matrix, charge: matrix * 1e38)
    with pytest.raises(ProblemError, match="bring them nearer to each other"):
        solve(problem_of(Size("a", 1.0, 200)), device="cpu")


@pytest.mark.parametrize("answer", [False, np.False_, np.array(False)])
def test_whatever_means_false_stops_a_run(answer):
    placement = solve(problem_of(Size("a", 1.0, 20)), device="cpu", progress=lambda now: answer)
    assert placement.report.steps == 1 and not placement.report.converged


@pytest.mark.parametrize("answer", [None, True, np.True_, 0, "no"])
def test_whatever_does_not_mean_false_goes_on(answer):
    assert (
        solve(problem_of(Size("a", 1.0, 20)), device="cpu", max_steps=3, progress=lambda now: answer).report.steps == 3
    )
