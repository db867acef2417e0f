"""Counts that no machine holds are refused at once, with how much they would take."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from esh import BodyClass, Domain, Problem, ProblemError, Size
from esh.engine.model import memory
from esh.engine.model.memory import check_memory, required_memory
from esh.engine.problem.machine_memory import format_bytes, machine_memory


def problem_of(*counts: int) -> Problem:
    sizes = [Size(f"size {index}", 1.0, count) for index, count in enumerate(counts)]
    return Problem(Domain((10.0, 10.0)), [BodyClass("pine", sizes)])


@pytest.mark.alone
@pytest.mark.parametrize("count", [10**12, 10**400, pytest.param(10**5000, id="1e5000"), 1.7e308])
def test_absurd_counts_are_refused_at_once_and_say_how_much_they_would_take(count):
    start = time.perf_counter()
    with pytest.raises(ProblemError) as refusal:
        check_memory(problem_of(5, count))
    assert time.perf_counter() - start < 0.5
    sentence = str(refusal.value)
    assert '`count` of size "size 1" of class "pine" is too large' in sentence
    assert re.search(
        r"would take about \S.* [TPE]B of memory, this machine has [\d.]+ [MGT]B, enough for about [\d,]+$", sentence
    )
    assert len(sentence) < 300


def test_the_limit_lies_at_what_the_machine_has(monkeypatch):
    problem = problem_of(1000, 500)
    monkeypatch.setattr(memory, "machine_memory", lambda: required_memory(problem))
    check_memory(problem)
    monkeypatch.setattr(memory, "machine_memory", lambda: required_memory(problem) - 1)
    with pytest.raises(ProblemError, match="1500 bodies in all"):
        check_memory(problem)


def test_where_the_machine_does_not_tell_the_kernels_numbering_is_the_limit(monkeypatch):
    monkeypatch.setattr(memory, "machine_memory", lambda: None)
    check_memory(problem_of(2**31 - 1))
    with pytest.raises(ProblemError, match="at most 2147483647 bodies can be placed"):
        check_memory(problem_of(2**31))


def test_ordinary_problems_pass_and_need_more_for_more():
    check_memory(problem_of(1000))
    assert (
        required_memory(problem_of(1000)) < required_memory(problem_of(2000)) < required_memory(problem_of(1000, 1000))
    )


def test_this_machine_tells_its_memory():
    assert 2**28 < machine_memory() < 2**50


@pytest.mark.parametrize(
    ("amount", "text"),
    [
        (0, "0 bytes"),
        (999, "999 bytes"),
        (1000, "1 kB"),
        (1_500_000_000, "1.5 GB"),
        (10**15, "1 PB"),
        (10**19, "10 EB"),
    ],
)
def test_amounts_read_as_people_say_them(amount, text):
    assert format_bytes(amount) == text


MEASURED = {
    "few bodies": "[BodyClass('a', [Size('s', 1e-4, 100)])]",
    "many bodies": "[BodyClass('a', [Size('s', 1e-6, 400_000)])]",
    "clumps": "[BodyClass('a', [Size('s', 1e-4, 100)], clustering=0.5, clump_size=0.015)]",
    "clumps in an image": (
        "[BodyClass('a', [Size('s', 1e-4, 3000)], 0.1 + np.random.default_rng(0).random((2000, 2000)), clustering=0.8)]"
    ),
    "clumps in a corner of an image": (
        "[BodyClass('a', [Size('s', 1e-4, 100)], np.pad(np.ones((400, 400)), (0, 2600)), clustering=0.8)]"
    ),
    "ranges": "[BodyClass(f'{k}', [Size('s', (1e-3, 1e-2), 3000)]) for k in range(6)]",
    "rare classes beside a frequent one": (
        "[BodyClass('a', [Size('s', 1e-5, 100_000)]), *(BodyClass(f'{k}', [Size('s', 1e-4, 60)]) for k in range(12))]"
    ),
    "images": (
        "[BodyClass(f'{k}', [Size('s', 1e-4, 100)], density=np.random.default_rng(k).random((2000, 2000)) > 0.5)"
        " for k in range(4)]"
    ),
    "an image without empty pixels": "[BodyClass('a', [Size('s', 1e-4, 100)], 0.1 + np.random.default_rng(0).random((4000, 4000)))]",
    "lines along an image": (
        "[BodyClass('a', [Size('s', 1e-5, 300, line=Line(0.02))], 0.1 + np.random.default_rng(0).random((2500, 2500)))]"
    ),
}


# The peak of a process in bytes. What the system's own call tells on Linux is never below that of the process that started it.
PEAK = """
def peak_memory():
    with open("/proc/self/status") as status:
        return next(1024 * int(line.split()[1]) for line in status if line.startswith("VmHWM"))
"""


@pytest.fixture(scope="module")
def measured() -> dict[str, list[int]]:
    """What is foretold for each, the peak of a process that solves it, and that of one that has solved next to nothing [bytes].

    They are forks of one process that is ready to solve, since getting ready takes seconds. A fork has a peak of its own, which begins
    without the files that its parent has mapped: only what it grows by counts.
    """
    script = f"""
import json, os
import numpy as np
from esh import *
from esh.engine.model import memory
{PEAK}
problem = Problem(Domain((4.0, 3.0)), [BodyClass("a", [Size("s", 1e-4, 10)])])
solve(problem, device="cpu", max_steps=1)
idle = peak_memory()
for name, classes in {MEASURED!r}.items():
    if os.fork():
        os.wait()
        continue
    before = peak_memory()
    problem = Problem(Domain((4.0, 3.0)), eval(classes))
    solve(problem, device="cpu", max_steps=2)
    print(json.dumps([name, memory.required_memory(problem), idle + peak_memory() - before, idle]), flush=True)
    os._exit(0)
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=400)
    return {name: numbers for name, *numbers in map(json.loads, finished.stdout.splitlines())}


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is told otherwise elsewhere")
@pytest.mark.parametrize("name", MEASURED)
def test_memory_is_foretold(name, measured):
    foretold, peak, idle = measured[name]
    # What the libraries take is not the problem's, and differs from system to system.
    of_problem = foretold - memory.BYTES_FIXED
    assert foretold < 1.5 * peak and peak < 1.5 * max(foretold, of_problem + idle)


SMALL = {
    "dots": "[Size('s', 1e-4, 10)]",
    "more dots": "[Size('s', 1e-6, 20_000)]",
    "lines": "[Size('s', 1e-4, 300, line=Line(0.02))]",
    "planks": "[Size('s', count=300, footprint=Footprint.rectangle(0.2, 0.03))]",
}


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is told otherwise elsewhere")
@pytest.mark.parametrize("name", SMALL)
def test_memory_of_small_runs_is_foretold_with_all_that_a_process_takes(name):
    """In a process that holds nothing else, as that of the command: without Blender's module."""
    script = f"""
import sys
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.model.memory import required_memory
{PEAK}
problem = Problem(Domain((4.0, 3.0)), [BodyClass("a", {SMALL[name]})], avoid_overlap=True)
solve(problem, device="cpu", max_steps=20)
assert "bpy" not in sys.modules
print(required_memory(problem), peak_memory())
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=200)
    foretold, peak = map(int, finished.stdout.split()[-2:])
    assert foretold < 1.5 * peak and peak < 1.5 * foretold


def test_groups_on_long_meshes_are_refused_before_any_is_laid(monkeypatch):
    ranges = [BodyClass(f"{k}", [Size("s", (1e-3, 1e-2), 3000)]) for k in range(12)]
    problem = Problem(Domain((3000.0, 1.0), "periodic"), ranges)
    required = required_memory(problem)
    assert required > 5e9
    monkeypatch.setattr(memory, "machine_memory", lambda: required - 1)
    with pytest.raises(
        ProblemError, match=r"most of it for the meshes of its 288 groups .* or a less elongated domain"
    ):
        check_memory(problem)


def test_densities_are_refused_before_they_are_looked_at(monkeypatch):
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("pine", [Size("s", 1e-3, 10)], density=np.ones((3000, 2000)))])
    monkeypatch.setattr(memory, "machine_memory", lambda: memory.BYTES_FIXED + 10**8)
    monkeypatch.setattr(memory, "required_memory", lambda problem: pytest.fail("not asked for"))
    with pytest.raises(ProblemError, match=r'`density` of class "pine" is too large \(2000 x 3000 pixels\)'):
        check_memory(problem)
