"""The benchmarks find what they time: what is renamed or moved elsewhere does not end them unnoticed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_timings_are_found_as_the_benchmark_starts_them():
    command = [sys.executable, "-m", "pytest", str(BENCHMARKS / "timings.py"), "-q", "-p", "no:cacheprovider"]
    command += [f"--confcutdir={BENCHMARKS}", "--collect-only", "--device", "cpu", "--bodies", "200"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "PYTEST_ADDOPTS": ""})
    assert run.returncode == 0, run.stdout[-2000:]
    assert "test_whole_run[" in run.stdout


def test_every_phase_of_a_scatter_in_blender_takes_its_time(monkeypatch):
    pytest.importorskip("bpy")
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import blender_overhead

    monkeypatch.setattr(blender_overhead, "VERTICES", 40)
    monkeypatch.setattr(blender_overhead, "PIXELS", 64)
    seconds = blender_overhead.measure(600, 1)
    assert set(blender_overhead.PHASES) < set(seconds)
    assert all(seconds[phase] > 0.0 for phase in blender_overhead.PHASES)
    assert seconds["the rest"] < 0.5 * seconds["**together**"]
