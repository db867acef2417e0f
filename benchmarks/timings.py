"""What the solver takes, timed by pytest-benchmark.

    pytest benchmarks/timings.py --device cpu --bodies 10000 100000 --repeat 3 --benchmark-json timings.json

`make bench` does that, compares with others, and writes it all down; here one can ask for a part (-k evaluation), or whether anything
got slower since (--benchmark-autosave, then --benchmark-compare).
"""

from __future__ import annotations

import math
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Recording
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver
from problems import problem_of

TINY = """
version = 1
[domain]
size = [1.0, 1.0]
[[class]]
name = "a"
density = 1.0
[[class.size]]
name = "s"
area = 0.01
count = 9
"""


@pytest.fixture
def device(request: pytest.FixtureRequest) -> wp.Device:
    """The device asked for."""
    return resolve_device(request.config.getoption("--device"))


@pytest.fixture
def repeat(request: pytest.FixtureRequest) -> int:
    """How often each is timed."""
    return request.config.getoption("--repeat")


@pytest.mark.parametrize("groups", [1, 6])
def test_whole_run(benchmark, device: wp.Device, repeat: int, count: int, groups: int) -> None:
    """A run of at most 100 steps with its report."""
    problem = problem_of(count, groups)
    # More steps than a GPU takes before it looks at how far bodies move: its graph is recorded, too.
    solve(problem, device=device.alias, max_steps=12)
    report = benchmark.pedantic(solve, (problem,), {"device": device.alias}, rounds=repeat).report
    assert report.coverage_error < 0.05
    benchmark.extra_info.update(
        steps=report.steps, coverage_error=report.coverage_error, memory=peak_memory(count, groups, device.alias)
    )


def test_evaluation_of_all_forces(benchmark, device: wp.Device, repeat: int, count: int) -> None:
    """Forces on bodies of one group, at random places."""
    with Solver(problem_of(count), device=device.alias) as solver:
        descent = solver.descent
        position = (np.random.default_rng(0).random((count, 2)) * solver.model.size).astype(np.float32)
        points = wp.array(position, dtype=wp.vec2, device=device)
        evaluation = solver.launcher.record(lambda: descent.field.evaluate(points, descent.field_at_charge))
        for _ in range(2):
            evaluation.play()
        benchmark.pedantic(play, (evaluation, device), rounds=5 * repeat)
        assert np.isfinite(descent.field_at_charge.numpy()).all()


def play(recording: Recording, device: wp.Device) -> None:
    """Carry out what was recorded, to the end."""
    recording.play()
    wp.synchronize_device(device)


def test_start_of_the_command(benchmark, repeat: int, tmp_path: Path) -> None:
    """`esh-scatter solve` on a tiny problem, as a process."""
    recipe = tmp_path / "tiny.toml"
    recipe.write_text(TINY, encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "esh.engine.cli.command_line",
        "solve",
        str(recipe),
        "-o",
        str(tmp_path / "tiny.csv"),
    ]
    run = partial(subprocess.run, check=True, capture_output=True, cwd=tmp_path)
    run(command)
    benchmark.pedantic(run, (command,), rounds=repeat)


def peak_memory(count: int, groups: int, device: str) -> float:
    """Peak memory [GB] of a process that solves a problem of this size: resident, or on a GPU what it has allocated there."""
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); from problems import problem_of; from timings import own_peak; "
        "from esh.engine.solve import solve; "
        f"solve(problem_of({count}, {groups}), device='{device}', max_steps=3); "
        f"print(own_peak('{device}'))"
    )
    command = [sys.executable, "-c", script, str(Path(__file__).parent)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def own_peak(device: str) -> float:
    """Peak memory [GB] of this process; not ru_maxrss, which starts from that of the process that started it."""
    if device != "cpu":
        return wp.get_mempool_used_mem_high(device) / 1e9
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) * 1024.0 / 1e9
    return math.nan
