"""A handful of bodies: several starts, and the energy by which the best of them is chosen."""

import itertools

import numpy as np
import pytest
from esh.engine.descent import initial_placement
from esh.engine.field.direct_sum import direct_field
from esh.engine.model.attraction import group_targets
from esh.engine.model.body_flags import BodyFlags
from esh.engine.model.energy import Energy
from esh.engine.model.model import Model
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver

SIDE = 8.0


def problem_of(counts, seed=0, boundary="open", density=1.0, **options):
    classes = [BodyClass(name, [Size("s", 1.0, n)], density) for name, n in zip("abc", counts, strict=False)]
    return Problem(Domain((SIDE, SIDE), boundary), classes, seed=seed, **options)


def energy_per_body(placement):
    model = Model(placement.problem)
    return Energy(model).of(placement.position / model.unit) / len(placement.position)


def own_spacing(position):
    """Smallest distance between two."""
    return min(np.linalg.norm(a - b) for a, b in itertools.combinations(position, 2))


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_forces_are_its_slopes(boundary):
    """Against direct summation, whose targets and charges are hardly blurred here."""
    image = np.array([[1.0, 2.0, 0.5], [3.0, 1.0, 1.0]])
    problem = problem_of([4, 3], boundary=boundary, density=image, seed=3)
    model = Model(problem)
    energy = Energy(model)
    rng = np.random.default_rng(5)
    cell = np.array(model.size) / [4, 2]
    places = np.array([(x, y) for x in range(4) for y in range(2)])[:7]
    position = (places + 0.5 + 0.25 * rng.uniform(-1, 1, (7, 2))) * cell
    force = direct_field(
        position,
        space=model.space,
        interaction=model.interaction,
        targets=group_targets(model),
        charge=model.charge.charge,
        charge_group=model.body.group,
        blur=0.02 if boundary == "open" else 0.15 * np.sqrt(2.0),
    )
    slope = np.empty((7, 2))
    step = 1e-4
    for i, k in itertools.product(range(7), range(2)):
        moved = [position.copy(), position.copy()]
        moved[0][i, k] -= step
        moved[1][i, k] += step
        slope[i, k] = (energy.of(moved[1]) - energy.of(moved[0])) / (2.0 * step)
    np.testing.assert_allclose(-slope, force, atol=0.02 * np.abs(force).max())


def test_a_mirrored_domain_is_a_quarter_of_a_periodic_one():
    image = np.array([[1.0, 2.0], [0.5, 1.0]])
    inner = Model(problem_of([5], boundary="mirror", density=image))
    whole = np.block([[image[::-1], image[::-1, ::-1]], [image, image[:, ::-1]]])
    domain = Domain((2 * SIDE, 2 * SIDE), "periodic")
    outer = Model(Problem(domain, [BodyClass("a", [Size("s", 1.0, 20)], whole)]))
    found = []
    for seed in range(2):
        position = np.random.default_rng(seed).uniform(0.0, 1.0, (5, 2)) * inner.size
        x, y = position.T
        w, h = outer.size
        copies = np.concatenate([np.stack([a, b], axis=1) for a in (x, w - x) for b in (y, h - y)])
        found.append((Energy(inner).of(position), Energy(outer).of(copies)))
    assert found[0][0] - found[1][0] == pytest.approx((found[0][1] - found[1][1]) / 4.0, rel=1e-6)


@pytest.mark.parametrize("count", [5, 10, 20])
def test_a_few_bodies_end_in_the_best_order(count):
    """From one start half of all runs with five bodies ended 0.007 a body above."""
    best = np.inf
    for seed in range(25):
        with Solver(problem_of([count], 100 + seed), device="cpu") as solver:
            solver.run(100)
            best = min(best, energy_per_body(solver.placement()))
    for seed in range(4):
        placement = solve(problem_of([count], seed), device="cpu")
        assert energy_per_body(placement) <= best + 1e-3
        assert placement.report.steps <= 100


@pytest.mark.parametrize("counts", [(5, 5), (10, 10, 10)])
def test_each_of_a_few_small_classes_is_nearly_as_even_as_alone(counts):
    alone = own_spacing(solve(problem_of(counts[:1]), device="cpu").position)
    for seed in range(3):
        placement = solve(problem_of(counts, seed), device="cpu")
        for c in range(len(counts)):
            assert own_spacing(placement.position[placement.class_index == c]) >= 0.85 * alone


@pytest.mark.parametrize("size", [(9.0, 5.0), (10.0, 3.0)])
def test_so_is_each_on_a_ground_that_is_not_square(size):
    """There the least energies have classes with two bodies that are near each other: .80 of what they have alone."""

    def solved(names, seed):
        classes = [BodyClass(name, [Size("s", 1e-4, 10)]) for name in names]
        return solve(Problem(Domain(size), classes, seed=seed), device="cpu")

    alone = own_spacing(solved("a", 1).position)
    for seed in (40, 42, 45):
        placement = solved("abc", seed)
        for c in range(3):
            assert own_spacing(placement.position[placement.class_index == c]) >= 0.85 * alone


@pytest.mark.parametrize("boundary", ["open", "periodic", "mirror"])
def test_a_chosen_start_is_an_ordinary_one(boundary):
    """What is watched are the steps from it to what is returned, and it is the same every time."""
    problem = problem_of([5, 7], 4, boundary)
    seen = []
    first = solve(problem, device="cpu", progress=lambda state: seen.append((state.step, state.position)))
    steps = [step for step, _ in seen if step > 0]
    assert steps == list(range(1, first.report.steps + 1)) and [step for step, _ in seen][-len(steps) :] == steps
    np.testing.assert_array_equal(seen[-1][1], first.position)
    np.testing.assert_array_equal(solve(problem, device="cpu").position, first.position)


def test_many_bodies_and_those_that_cannot_move_have_one_start():
    pinned = np.full(5, int(BodyFlags.PINNED))
    for counts, flags, few in (([51], None, False), ([5], None, True), ([5], pinned, False)):
        found = set()
        for seed in range(6):
            with Solver(problem_of(counts, seed), device="cpu", flags=flags) as solver:
                before = solver.state.pose.numpy().copy()
                start = solver.choose_start(20)
                assert np.array_equal(before, solver.state.pose.numpy()) == (start == 0)
                found.add(start)
        assert (len(found) > 1) == few and (few or found == {0})


@pytest.mark.parametrize(("classes", "starts"), [(1, 10), (3, 20), (10, 6), (20, 3), (40, 0)])
def test_the_more_groups_there_are_the_fewer_starts(monkeypatch, classes, starts):
    """As many for each class, 200 bodies of 40 classes took 200 times as long as from one start."""
    tried = []
    monkeypatch.setattr(Energy, "of", lambda energy, position: float(tried.append(0) is None))
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass(str(c), [Size("s", 0.1, 5)]) for c in range(classes)])
    with Solver(problem, device="cpu") as solver:
        solver.choose_start(1)
    assert len(tried) == starts


@pytest.mark.parametrize(("length", "starts"), [(1.0, 10), (30.0, 10), (100.0, 5), (1000.0, 0)])
def test_the_longer_a_periodic_strip_is_the_fewer_starts(monkeypatch, length, starts):
    """Its mesh is as fine as it is narrow: from ten starts, a strip of 1 by 3,000 took half a minute."""
    tried = []
    monkeypatch.setattr(Energy, "of", lambda energy, position: float(tried.append(0) is None))
    problem = Problem(Domain((1.0, length), "periodic"), [BodyClass("a", [Size("s", 0.001, 40)])])
    with Solver(problem, device="cpu") as solver:
        solver.choose_start(1)
    assert len(tried) == starts


def test_whoever_watches_can_stop_while_a_start_is_chosen(monkeypatch):
    """Nobody was asked before the first step, which could be minutes away."""
    monkeypatch.setattr("esh.engine.solve.MOMENT", 0.0)
    seen = []

    def stop_at_the_third(state):
        seen.append((state.step, np.isfinite(state.position).all()))
        return len(seen) < 3

    placement = solve(problem_of([5, 7]), device="cpu", progress=stop_at_the_third)
    assert seen == [(0, True)] * 3
    assert not placement.report.converged and placement.report.steps == 1 and len(placement.position) == 12


def test_starts_read_a_density_twice_however_many_they_are(monkeypatch):
    """For each start anew, 50 bodies on an image of nine million pixels took a third longer."""
    read = []
    integrate = initial_placement.integrate_boxes
    monkeypatch.setattr(initial_placement, "integrate_boxes", lambda *given: read.append(given) or integrate(*given))
    with Solver(problem_of([20], density=np.eye(9)), device="cpu") as solver:
        solver.choose_start(5)
    assert len(read) == 2
