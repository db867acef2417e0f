"""The table that compares values of a constant has a row for each, and knows which constants there are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("shapely")
SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "constants.py"


def run(*arguments):
    command = [sys.executable, str(SCRIPT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_a_row_for_each_value():
    found = run("contact.crowding.MOST_ROUNDS", "1", "--scenes", "jittered discs", "--bodies", "60", "--seeds", "1")
    assert found.returncode == 0, found.stderr
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in found.stdout.splitlines()[2:]]
    assert [row[0] for row in rows] == ["2500 (as it is)", "1"]
    # One round parts nothing: the value that was given is the one that counted.
    assert rows[0][2] == "1 of 1" and rows[1][2] == "0 of 1"
    assert float(rows[0][5]) == 1.0


def test_without_contact_a_row_says_how_well_bodies_follow_and_how_settled_they_are():
    found = run(
        "motion.kernels_direction.LARGEST_SHARE",
        "0.31",
        "--descent",
        "--scenes",
        "dots",
        "--bodies",
        "60",
        "--seeds",
        "1",
    )
    assert found.returncode == 0, found.stderr
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in found.stdout.splitlines()[2:]]
    assert [row[0] for row in rows] == ["2.0 (as it is)", "0.31"]
    # Steps that are all but a fixed share of the moves do not settle as fast: kernels have the value that was given.
    assert float(rows[1][3]) != float(rows[0][3])
    assert all(0.0 < float(row[1]) < 1.0 for row in rows)


def test_a_constant_that_is_not_there_is_refused():
    found = run("contact.separation.NONE", "1")
    assert found.returncode == 2 and "there is no contact.separation.NONE" in found.stderr
