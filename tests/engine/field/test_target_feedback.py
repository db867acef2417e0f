"""Targets that are changed until bodies, seen over some spacings, are as dense as was asked for."""

import numpy as np
import pytest
from esh.engine.descent.descent import Descent
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.target_feedback import feedback_widths
from esh.engine.model.model import Model
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.fixed_bodies import FixedBodies
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.solver import placing
from esh.engine.solver.solver import Solver
from scipy.ndimage import gaussian_filter

SIDE, COUNT = 64.0, 2048
Y, X = (np.indices((128, 128)) + 0.5) / 128
WAVE = (1.05 + np.cos(2.0 * np.pi * X)).astype(np.float32)
HILL = (0.2 + np.sin(3.0 * X) * np.cos(4.0 * Y) ** 2).astype(np.float32)


def problem_of(density, boundary="periodic", count=COUNT, seed=0, **more):
    return Problem(
        Domain((SIDE, SIDE), boundary), [BodyClass("a", [Size("s", 1e-3, count)], density, **more)], seed=seed
    )


def error(problem, density, spacings=4.0):
    with Solver(problem, device="cpu") as solver:
        solver.run(100)
        placement = solver.placement()
    return coverage_error(placement.position, placement.area, density, problem.domain, spacings)


def off_at_large(problem, density, spacings):
    """RMS of what is off, blurred by so many spacings with what mirrors at the border would show, or wrapped; over the mean."""
    with Solver(problem, device="cpu") as solver:
        solver.run(100)
        position = solver.placement().position
    cells, periodic = 512, problem.domain.periodic
    low, share = np.divmod(position / SIDE * cells - 0.5, 1.0)
    found = np.zeros((cells, cells))
    for corner in np.ndindex(2, 2):
        column, row = (low + corner).astype(int).T
        column, row = (np.mod(k, cells) if periodic else np.clip(k, 0, cells - 1) for k in (column, row))
        np.add.at(found, (cells - 1 - row, column), np.abs(1.0 - np.array(corner) - share).prod(axis=1))
    asked = np.kron(density, np.ones((cells // len(density),) * 2))
    width = spacings * cells / np.sqrt(COUNT)
    difference = found / found.mean() - asked / asked.mean()
    return np.sqrt(
        (gaussian_filter(difference, width, mode="wrap" if periodic else "reflect", truncate=6.0) ** 2).mean()
    )


@pytest.mark.parametrize(("boundary", "density"), [("periodic", WAVE), ("open", HILL)])
@pytest.mark.parametrize(("spacings", "most"), [(2.0, 0.85), (4.0, 0.5)])
def test_bodies_are_as_dense_as_asked_over_some_spacings(monkeypatch, boundary, density, spacings, most):
    """They push each other out of where they are crowded, which no force tells."""

    def off():
        return np.mean([off_at_large(problem_of(density, boundary, seed=seed), density, spacings) for seed in range(3)])

    corrected = off()
    monkeypatch.setattr(placing, "CORRECTED_AFTER", ())
    assert corrected < most * off()


def test_what_is_near_is_as_even_as_before(monkeypatch):
    found = {}
    for corrected in (True, False):
        if not corrected:
            monkeypatch.setattr(placing, "CORRECTED_AFTER", ())
        found[corrected] = [
            np.mean([error(problem_of(d, b, seed=seed), d, 1.0) for seed in range(3)])
            for d, b in ((WAVE, "periodic"), (HILL, "open"), (HILL, "mirror"))
        ]
    assert (np.array(found[True]) < 1.03 * np.array(found[False])).all()


def test_clumps_keep_the_density_at_large_on_a_ground_that_repeats():
    """Without, they have two and a half times the error of bodies that stand evenly."""
    even = np.ones((128, 128), np.float32)
    errors = [
        np.mean([error(problem_of(even, count=4096, seed=seed, clustering=c), even) for seed in range(4)])
        for c in (0.0, 1.0)
    ]
    assert errors[1] < 2.0 * errors[0]


def descent_at(problem, position, device="cpu"):
    launcher = Launcher(resolve_device(device))
    model = Model(problem)
    pose = np.zeros((len(position), 4))
    pose[:, :2] = position / model.unit
    return Descent(model, launcher, pose=pose), launcher


@pytest.mark.parametrize("boundary", ["open", "periodic", "mirror"])
def test_a_lattice_needs_no_correction_up_to_its_border(boundary):
    at = (np.arange(48) + 0.5) * SIDE / 48
    position = np.stack(np.meshgrid(at, at), axis=2).reshape(-1, 2)
    descent, launcher = descent_at(problem_of(np.ones((1, 1)), boundary, 48**2), position)
    try:
        descent.correct_targets()
        assert np.abs(descent.state.target_factor.numpy()).max() < 1e-4
    finally:
        launcher.close()


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
@pytest.mark.parametrize("boundary", ["open", "periodic", "mirror"])
def test_where_bodies_are_too_dense_less_is_asked_for_and_as_much_in_all(boundary, device):
    """Some hundredths: those that are off by more than a tenth cannot follow their density."""
    across = (np.arange(48) + 0.5) / 48
    across = across - 0.01 * np.sin(2.0 * np.pi * across) if boundary == "periodic" else across**1.03
    position = SIDE * np.stack(np.meshgrid(across, (np.arange(48) + 0.5) / 48), axis=2).reshape(-1, 2)
    descent, launcher = descent_at(problem_of(np.ones((1, 1)), boundary, 48**2), position, device)
    try:
        asked = descent.field.attraction.numpy().copy()
        descent.correct_targets()
        factor = descent.state.target_factor.numpy()
        assert factor.min() < -0.01 and factor.max() > 0.005
        changed = descent.field.attraction.numpy()
        assert changed.sum() == pytest.approx(asked.sum(), rel=1e-5)
        assert np.abs(changed - asked).max() > 0.005 * asked.max()
    finally:
        launcher.close()


def test_a_state_holds_what_targets_were_changed_by(tmp_path):
    problem = problem_of(HILL, "open")
    with Solver(problem, device="cpu") as solver:
        solver.run(60)
        state = solver.state.copy()
        assert np.abs(state.target_factor.numpy()).max() > 1e-3
        solver.step(5)
        after = solver.placement().position
    state.save(tmp_path / "state.npz")
    with Solver(problem, device="cpu", state=type(state).load(tmp_path / "state.npz")) as other:
        other.step(5)
        np.testing.assert_array_equal(other.placement().position, after)


@pytest.mark.parametrize("count", [COUNT, COUNT + 200])
def test_an_edit_goes_on_with_them(count):
    problem = problem_of(HILL, "open")
    with Solver(problem, device="cpu") as solver:
        solver.run(60)
        before = solver.state.target_factor.numpy()
        solver.edit(problem_of(HILL, "open", count))
        after = solver.state.target_factor.numpy()
    assert (len(after) == len(before)) == (count == COUNT)
    assert after.min() == pytest.approx(before.min(), rel=0.2) and after.max() == pytest.approx(before.max(), rel=0.2)


def test_few_bodies_and_pinned_ones_leave_targets_as_they_are():
    with Solver(problem_of(HILL, "open", 200), device="cpu") as solver:
        assert not solver.descent.corrects_targets
    pinned = FixedBodies(np.full((1, 2), 0.5 * SIDE))
    with Solver(
        Problem(Domain((SIDE, SIDE)), [BodyClass("a", [Size("s", 1e-3, COUNT)])], fixed=pinned), device="cpu"
    ) as solver:
        assert not solver.descent.corrects_targets
    assert not feedback_widths(np.array([100_000]), (1.0, 0.001)).any()
    assert (feedback_widths(np.array([4000, 400, 40, 0]), (64.0, 64.0)) > 0.0).tolist() == [True, True, False, False]
