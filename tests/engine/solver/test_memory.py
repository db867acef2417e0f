"""Counts that no machine holds are refused at once, with how much they would take."""

from __future__ import annotations

import re
import time

import pytest
from esh import BodyClass, Domain, Problem, ProblemError, Size
from esh.engine.solver import memory
from esh.engine.solver.memory import check_memory, format_bytes, machine_memory, required_memory


def problem_of(*counts: int) -> Problem:
    sizes = [Size(f"size {index}", 1.0, count) for index, count in enumerate(counts)]
    return Problem(Domain((10.0, 10.0)), [BodyClass("pine", sizes)])


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
