"""Recipes that cover the whole engine give the same bytes on any number of threads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
RECIPES = sorted((ROOT / "tests" / "recipes").glob("*.toml"))


def hashes(threads: int, folder: Path) -> str:
    """What `benchmarks/placement_hashes.py` prints for all recipes, solved by so many threads."""
    # A fifth of the usual steps: every kernel has run by then, and contact has its last rounds in any case.
    script = ROOT / "benchmarks" / "placement_hashes.py"
    command = [sys.executable, str(script), "--max-steps", "20", *map(str, RECIPES)]
    environment = {**os.environ, "ESH_THREADS": str(threads)}
    return subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=folder, env=environment, timeout=300
    ).stdout


def test_there_are_recipes():
    assert len(RECIPES) >= 20


def test_bytes_do_not_depend_on_the_number_of_threads(tmp_path):
    # Three: several, no power of two. Threads that wait for a processor take its time, and what many of them do is looked at
    # in tests/engine/solver/test_solve.py.
    alone = hashes(1, tmp_path)
    assert len(alone.splitlines()) >= len(RECIPES)
    assert hashes(3, tmp_path) == alone
