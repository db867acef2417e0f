"""The table of many processors, which nobody tries before it is wanted: what it times, and that it needs the engine only."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
# What is not there where the script is to run.
ABSENT = ("trimesh", "shapely", "png", "bpy", "scipy", "pytest", "numba")


@pytest.fixture
def many_cores(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import many_cores

    yield many_cores
    for name in ("many_cores", "problems"):
        sys.modules.pop(name, None)


def test_the_most_important_comes_first_and_nothing_twice(many_cores):
    plan = many_cores.plan(16)
    assert plan[0] == (16, [*many_cores.FIRST, *many_cores.MORE])
    timed = [(number, case) for number, cases in plan for case in cases]
    assert len(timed) == len({(number, str(case)) for number, case in timed})
    for number in (2, 4, 8, 16):
        for bodies in (10_000, 100_000, 1_000_000):
            for groups in (1, 6):
                assert (number, f"{bodies:,} bodies, {groups} group{'s' * (groups > 1)}") in [
                    (n, str(case)) for n, case in timed
                ]
    assert [number for number, _ in many_cores.plan(2)] == [2, 2]


def test_a_case_is_timed_with_its_phases(many_cores, capsys):
    case = many_cores.Case(400, 6, contact=True, phases=True, chunks=2)
    many_cores.run_cases([case, many_cores.Case(300)], 2, time.time() + 60.0)
    first, second = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert 0.0 < first["least"] <= first["seconds"] <= first["most"]
    assert {"set-up", "contact", "report"} <= set(first["phases"])
    assert all(0.0 <= serial <= 1.1 * spent + 1e-3 for spent, _, serial in first["phases"].values())
    assert "phases" not in second
    many_cores.show(2, first)
    assert "all phases" in capsys.readouterr().out
    assert "| 400 bodies, 6 groups, contact, 2 chunks a thread |" in many_cores.table({2: [first], 4: [second]})
    # No time is left for another.
    many_cores.run_cases([case], 2, time.time())
    assert capsys.readouterr().out == ""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be bound to processors here")
def test_it_runs_without_an_installation_and_ends_in_time(tmp_path):
    """In a Python that finds neither this package nor what only others of its parts need."""
    blocked = tmp_path / "sitecustomize.py"
    blocked.write_text(f"import sys\nsys.modules.update(dict.fromkeys({ABSENT!r}))\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(BENCHMARKS / "many_cores.py"), "--seconds", "25", "--bodies", "10000", "--repeat", "1"],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment,
        cwd=tmp_path,
    )
    assert done.returncode == 0 and not done.stderr, done.stderr[-2000:]
    assert time.perf_counter() - start < 60.0
    assert "processors" in done.stdout and "|---|" in done.stdout
