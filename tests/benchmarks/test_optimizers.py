"""The optimizers that the benchmarks compare: each lowers the error, and keeps the rules that the engine's own keeps."""

from pathlib import Path

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


@pytest.fixture(scope="module")
def optimizers():
    pytest.importorskip("skimage")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import optimizers

        yield optimizers


def names():
    return [
        "the engine as it is",
        "direct descent",
        "Nesterov, step 0.5",
        "Nesterov",
        "FIRE",
        "Barzilai-Borwein",
        "L-BFGS",
        "memoryless BFGS",
        "multi-level, memoryless BFGS",
        "far field every 2nd time, Nesterov",
        "shaken, Nesterov",
    ]


def test_all_methods_are_tested(optimizers):
    assert list(optimizers.METHODS) == names()


@pytest.mark.parametrize("name", names())
def test_every_setting_lowers_the_error(optimizers, launcher, name):
    problem = optimizers.scenes(256, 0)["uniform"]
    system = optimizers.Dots(problem, launcher)
    before = system.errors(system.start)
    for setting in optimizers.METHODS[name]:
        after = optimizers.errors_along(problem, launcher, setting, (60,))[0]
        assert np.all(after < 0.7 * before)


@pytest.mark.parametrize("name", ["Nesterov", "FIRE", "memoryless BFGS"])
def test_lines_are_evened_out_too(optimizers, launcher, name):
    problem = optimizers.scenes(384, 0)["lines"]
    system = optimizers.Lines(problem, launcher)
    before = system.errors(system.start)
    states = optimizers.METHODS[name][-1](system, system.start)
    x = [next(states) for _ in range(40)][-1]
    # Lines start short, as dots almost: half of the error at the narrowest blur is that they are not lines yet.
    assert np.all(system.errors(x) < 0.6 * before)


def test_a_pull_on_lines_is_the_engines_own_move(optimizers, launcher):
    problem = optimizers.scenes(384, 0)["lines"]
    system, own = (optimizers.Lines(problem, launcher) for _ in range(2))
    own.descent.contact = None
    expected = next(optimizers.engine(own, own.start)) - own.start
    move, weight = system.pull(system.start)
    assert np.abs(expected).max() > 0.1
    wanted = system.limited(system.start, optimizers.SAFE_STEP * move)
    wanted[:, 2] = np.clip(wanted[:, 2], -0.5, 0.5)
    # Lines at the border are kept inside.
    reach = 0.5 * (system.start + wanted)[:, 3:]
    after = (system.start + wanted)[:, :2]
    free = np.all((after > reach) & (after < system.size - reach), axis=1)
    assert np.mean(free) > 0.8
    np.testing.assert_allclose(wanted[free], expected[free], atol=1e-4)
    assert np.all(weight > 0.0)
    assert system.evaluations == 1.0


@pytest.mark.parametrize("name", ["Nesterov", "L-BFGS", "memoryless BFGS", "shaken, Nesterov"])
def test_no_dot_enters_an_empty_pixel_or_jumps(optimizers, launcher, name):
    density = np.kron([[1.0, 0.0, 1.0], [0.0, 1.0, 0.3]], np.ones((3, 3))).astype(np.float32)
    problem = Problem(Domain((60.0, 40.0)), [BodyClass("a", [Size("dot", 1.0, 200)], density)])
    system = optimizers.Dots(problem, launcher)
    limit = 0.5 * system.spacing(system.start).max() * (1.0 + 1e-9)
    x = system.start
    for new in optimizers.METHODS[name][0](system, x):
        share = new / system.size
        row = np.minimum((6 * (1.0 - share[:, 1])).astype(int), 5)
        assert np.all(density[row, np.minimum((9 * share[:, 0]).astype(int), 8)] > 0.0)
        # Momentum, unlike the force, is not limited.
        if "Nesterov" not in name:
            assert np.hypot(*(new - x).T).max() <= limit
        x = new
        if system.evaluations >= 20:
            break


def test_the_last_step_alone_is_limited_memory_of_one_pair(optimizers, launcher):
    problem = optimizers.scenes(256, 1)["uniform"]
    found = []
    # A scale that both clamp to the same value: then both are the same formula.
    for method in (
        lambda system, x: optimizers.limited_memory(system, x, pairs=1, largest=0.3),
        lambda system, x: optimizers.memoryless_bfgs(system, x, largest=0.3),
    ):
        system = optimizers.Dots(problem, launcher)
        states = method(system, system.start)
        found.append([next(states) for _ in range(6)])
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)


def test_evaluations_to_reach_an_error(optimizers):
    marks = (10, 20, 40)
    falling = np.array([0.4, 0.2, 0.1])
    assert optimizers.evaluations_to_reach(falling, marks, 0.2) == "20"
    assert optimizers.evaluations_to_reach(falling, marks, 0.1) == "40"
    assert optimizers.evaluations_to_reach(falling, marks, 0.05) == "> 40"
    assert optimizers.evaluations_to_reach(falling, marks, 0.5) == "< 10"
    # Halved whenever the evaluations double: a straight line between logarithms.
    assert optimizers.evaluations_to_reach(falling, marks, 0.4 / 1.4) == "14"
