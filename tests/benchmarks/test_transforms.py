"""The transforms that are timed beside each other give the same; the table is one."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def test_the_table_of_transforms_has_a_row_for_each_number_of_bodies():
    if importlib.util.find_spec("scipy") is None:
        pytest.skip("needs SciPy")
    command = [sys.executable, str(BENCHMARKS / "transforms.py"), "--bodies", "200", "2000"]
    outcome = subprocess.run(command, capture_output=True, text=True, timeout=300)
    # A difference between ours and pocketfft's ends it.
    assert outcome.returncode == 0, outcome.stderr
    table = [line for line in outcome.stdout.splitlines() if line.startswith("|")]
    assert [line.split("|")[1].strip() for line in table[2:]] == ["200", "2,000"]
    assert len({line.count("|") for line in table}) == 1
