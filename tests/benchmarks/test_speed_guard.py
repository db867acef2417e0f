"""A solver that got slower is seen here, by what it does and by how long that takes beside a direct sum.

Seconds mean nothing on a shared machine. Operations are counted exactly; times are processor times of this process, the smallest of
several, as a ratio of two that alternate.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from esh.engine.descent.descent import Descent
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.kernels_field import COLUMNS_PER_CUTOFF, ROWS_PER_CUTOFF
from esh.engine.model.model import Model
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.solver import placing
from esh.engine.solver.solver import Solver

# An evaluation for 20,000 bodies beside a direct float32 sum over 8,192.
MEASURED_RATIO = 0.46
# Above what machines of continuous integration show, which share their memory with others (0.32 to 0.76 within minutes);
# other processors have other ratios (1.33 on sixteen cores of a Xeon). Smaller losses are seen by the counts above this test.
SLACK = 2.2 if "CI" in os.environ else 3.0
BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def problem_of(count, groups):
    sizes = [Size("s", 0.5, count // groups), Size("l", 1.5, count // groups)][: min(groups, 2)]
    return Problem(Domain((64.0, 64.0)), [BodyClass(f"c{k}", sizes) for k in range(max(1, groups // 2))])


def operations(count, groups):
    """Additions and multiplications, roughly, of one evaluation of the forces: transforms, splines and pairs."""
    with Solver(problem_of(count, groups), device="cpu") as solver:
        field, size = solver.descent.field, solver.model.size
        rows, columns = field.layout.padded
        transforms = groups * 5 * rows * columns * np.log2(rows * columns)
        mixing = groups**2 * field.layout.node_count * 2
        splines = count * (16 * 4 + 2 * 16 * 8)
        cell = (size[0] / field.cells.count_x) * (size[1] / field.cells.count_y)
        # Every pair once, and what it does to the second body is added to a sum in memory.
        pairs = 0.5 * (2 * ROWS_PER_CUTOFF + 1) * (2 * COLUMNS_PER_CUTOFF + 1) * cell * count * 44
        return (transforms + mixing + splines + pairs) / count


# Operations per body when this was written, which do not scatter.
@pytest.mark.parametrize(
    ("count", "groups", "budget"), [(10_000, 1, 2560), (10_000, 6, 5820), (100_000, 1, 2570), (100_000, 6, 5840)]
)
def test_an_evaluation_takes_no_more_operations_than_it_did(count, groups, budget):
    assert operations(count, groups) <= 1.1 * budget


class CountingLauncher(Launcher):
    """Counts launches, and the elements that they run over."""

    def __init__(self, device):
        super().__init__(device)
        self.launches, self.elements = 0, 0

    def launch(self, kernel, count, *arguments, **options):
        self.launches += 1
        self.elements += count
        super().launch(kernel, count, *arguments, **options)


# Launches of one evaluation, and the elements they run over per body, when this was written: a pass more is seen here, which
# the operations above, reckoned from the mesh, do not show.
@pytest.mark.parametrize(
    ("count", "groups", "launches", "elements"), [(10_000, 1, 17, 3.2), (10_000, 6, 19, 5.2), (100_000, 1, 17, 3.2)]
)
def test_an_evaluation_makes_no_more_passes_than_it_did(count, groups, launches, elements):
    launcher = CountingLauncher(resolve_device("cpu"))
    try:
        descent = Descent(Model(problem_of(count, groups)), launcher)
        position = np.random.default_rng(0).random((descent.model.body_count, 2)) * descent.model.size
        points = wp.array(position.astype(np.float32), dtype=wp.vec2, device="cpu")
        launcher.launches, launcher.elements = 0, 0
        descent.field.evaluate(points, descent.field_at_charge)
        print(f"{launcher.launches} launches, {launcher.elements / count:.2f} elements per body")
        assert 0 < launcher.launches <= launches
        assert 0 < launcher.elements / count <= 1.1 * elements
    finally:
        launcher.close()


@pytest.mark.parametrize("lines", [False, True])
def test_a_step_costs_python_one_launch_however_many_kernels_it_has(lines):
    line = Line(1.0, "none") if lines else None
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 0.5, 2000, line=line)])], avoid_overlap=True)
    with Solver(problem, device="cpu") as solver:
        before = solver.launcher.python_launches
        for _ in range(6):
            solver.step()
        assert solver.launcher.python_launches - before == 6


def test_steps_that_nobody_watches_follow_each_other_without_python(monkeypatch):
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 0.5, 500)])], avoid_overlap=True)

    def run(progress):
        with Solver(problem, device="cpu") as solver:
            before = solver.launcher.python_launches
            start = time.perf_counter()
            steps, settled = solver.run(400, progress)
            tenths = int(10.0 * (time.perf_counter() - start))
            return solver.placement().position, steps, settled, solver.launcher.python_launches - before - tenths

    # Targets are corrected in between, by a few launches each.
    monkeypatch.setattr(placing, "CORRECTED_AFTER", ())
    position, steps, settled, launches = run(None)
    watched, steps_watched, settled_watched, _ = run(lambda progress: None)
    np.testing.assert_array_equal(position, watched)
    assert (steps, settled) == (steps_watched, settled_watched)
    assert steps > 50
    # The first step, the others, and where rounding ends them too early once more.
    assert launches <= 4


def test_easy_problems_stop_early_and_no_problem_takes_more_steps_than_asked():
    crowd = Problem(Domain((2.0, 2.0)), [BodyClass("a", [Size("s", 0.01, 9)])])
    assert solve(crowd, device="cpu").report.steps < 120
    assert solve(problem_of(4096, 1), device="cpu").report.steps <= 150


@pytest.mark.alone
def test_an_evaluation_takes_no_longer_beside_a_direct_sum_than_it_did(monkeypatch):
    """A machine that is busy at first gets more rounds."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.delitem(sys.modules, "direct_summation", raising=False)
    from direct_summation import DirectSummation

    with Solver(problem_of(20_000, 1), device="cpu") as solver:
        descent, launcher = solver.descent, solver.launcher
        position = (np.random.default_rng(0).random((20_000, 2)) * descent.model.size).astype(np.float32)
        points = wp.array(position, dtype=wp.vec2, device="cpu")
        sums = DirectSummation(problem_of(8192, 1), launcher, double=False)
        at = np.random.default_rng(0).random((8192, 2)) * sums.size

        def seconds(run, repeat):
            start = time.process_time()
            for _ in range(repeat):
                run()
            return (time.process_time() - start) / repeat

        ours, direct = [], []
        evaluation = launcher.record(lambda: descent.field.evaluate(points, descent.field_at_charge))
        evaluation.play()
        sums.repulsion(at)
        ratio = np.inf
        while len(ours) < 9 or (len(ours) < 90 and ratio >= SLACK * MEASURED_RATIO):
            ours.append(seconds(evaluation.play, 3))
            direct.append(seconds(lambda: sums.repulsion(at), 3))
            ratio = min(ours) / min(direct)
        print(f"ratio {ratio:.2f}")
        assert ratio < SLACK * MEASURED_RATIO
