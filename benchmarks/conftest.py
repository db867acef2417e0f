"""Options of the timings; see :mod:`timings`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# Benchmarks import each other as scripts do, which pytest's way of importing leaves to us.
sys.path.insert(0, str(Path(__file__).parent))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what a run of the timings can be told."""
    parser.addoption("--device", default="auto", help="auto, cpu or cuda:0")
    parser.addoption("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000], help="sizes of problems")
    parser.addoption("--repeat", type=int, default=3, help="warm runs of each, of which the median counts")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Time every size that was asked for."""
    if "count" in metafunc.fixturenames:
        metafunc.parametrize("count", metafunc.config.getoption("--bodies"))
