"""Many problems at once: the same bytes as one by one, whoever solves them, and whatever ends on the way."""

from __future__ import annotations

import functools
import importlib
import os
import signal
from pathlib import Path
from types import SimpleNamespace

import esh
import numpy as np
import pytest
from esh.engine.scenes.worker import Failure
from esh.engine.scenes.worker_pool import WorkerPool

# The package has a function of this name, too.
solving_many = importlib.import_module("esh.engine.scenes.solve_many")


def problem(seed: int, count: int = 40) -> esh.Problem:
    slope = np.linspace(0.0, 1.0, 8)[None, :]
    classes = [
        esh.BodyClass("a", [esh.Size("one", 0.01, count)], slope),
        esh.BodyClass("b", [esh.Size("one", 0.02, count // 2)]),
    ]
    return esh.Problem(esh.Domain((2.0, 2.0)), classes, seed=seed)


def seen_of(seen: list, done: int, count: int) -> None:
    seen.append((done, count))


def test_placements_are_those_of_solve_in_their_order():
    problems = [problem(seed, 40 + 3 * seed) for seed in range(5)]
    alone = [esh.solve(each, device="cpu", max_steps=6) for each in problems]
    for workers in (0, 2):
        seen = []
        watch = functools.partial(seen_of, seen)
        many = esh.solve_many(problems, device="cpu", max_steps=6, workers=workers, progress=watch)
        assert seen == [(n, 5) for n in range(1, 6)]
        for one, other, asked in zip(alone, many, problems, strict=True):
            assert other.problem is asked
            np.testing.assert_array_equal(other.position, one.position)
            assert other.report.coverage_error == one.report.coverage_error
    assert esh.solve_many([]) == []


def test_a_problem_that_cannot_be_solved_is_said_by_number():
    huge = esh.Problem(esh.Domain((2.0, 2.0)), [esh.BodyClass("a", [esh.Size("one", 1e-12, 10**13)])])
    for workers in (0, 1):
        with pytest.raises(esh.ProblemError, match=r"^problem 1: .*memory"):
            esh.solve_many([problem(1), huge], device="cpu", max_steps=2, workers=workers)
    with pytest.raises(esh.ProblemError, match=r"`problems\[0\]` must be a Problem; got 3"):
        esh.solve_many([3])
    with pytest.raises(esh.ProblemError, match="`workers` must be a whole number of at least 0, or None; got -1"):
        esh.solve_many([problem(1)], workers=-1)
    with pytest.raises(esh.DeviceError):
        esh.solve_many([problem(1)], device="cuda:99")


def die_once(marker: str, number: int) -> int:
    """For a worker: it is killed in the first call with this number, and answers the next."""
    path = Path(marker)
    if number == 2 and not path.exists():
        path.write_bytes(b"")
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die_always(number: int) -> int:
    if number == 1:
        raise SystemExit("bad luck")
    return number


def complain(number: int) -> int:
    raise (esh.EshError("two\nlines") if number else ZeroDivisionError("nought"))


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_process_that_is_killed_is_replaced(tmp_path):
    marker = str(tmp_path / "died")
    answers = dict(WorkerPool(2).map(die_once, ((marker, number) for number in range(6))))
    assert answers == {number: number * number for number in range(6)}
    assert Path(marker).exists()


def test_a_call_that_ends_every_process_fails_alone():
    answers = dict(WorkerPool(1).map(die_always, ((number,) for number in range(3))))
    assert answers[0] == 0 and answers[2] == 2
    assert isinstance(answers[1], Failure) and not answers[1].expected
    assert answers[1].text.startswith("its process ended 3 times")


def test_mistakes_in_calls_are_answers():
    answers = dict(WorkerPool(1).map(complain, ((number,) for number in range(2))))
    assert answers[0] == Failure("ZeroDivisionError: nought", False)
    assert answers[1] == Failure("two lines", True)


def test_a_mistake_in_the_arguments_is_raised():
    def arguments():
        yield (0,)
        raise LookupError("no more")

    with pytest.raises(LookupError, match="no more"):
        dict(WorkerPool(1).map(die_always, arguments()))


@pytest.mark.parametrize(
    ("charges", "processors", "device"),
    [(200, 16, "cpu"), (20_000, 16, "auto"), (20_000, 64, "cpu"), (5000, 2, "auto")],
)
def test_many_small_problems_are_solved_on_the_processors_even_where_there_is_a_gpu(
    charges, processors, device, monkeypatch
):
    monkeypatch.setattr(solving_many, "resolve_device", lambda name: SimpleNamespace(is_cuda=name != "cpu"))
    monkeypatch.setattr(solving_many, "core_count", lambda: processors)
    assert solving_many.quicker_device("auto", charges) == device
    # Whoever names a device gets it.
    for named in ("cpu", "cuda:0"):
        assert solving_many.quicker_device(named, charges) == named


@pytest.mark.parametrize(
    ("count", "workers", "expected"), [(100, None, 4), (3, None, 0), (100, 2, 2), (100, 0, 0), (2, 5, 2)]
)
def test_batches_on_a_gpu_have_processes_that_share_it(count, workers, expected, monkeypatch, tmp_path):
    from esh.engine.scenes import batch, worker_pool
    from esh.engine.scenes.worker import Failure

    monkeypatch.setattr(solving_many, "resolve_device", lambda name: SimpleNamespace(is_cuda=True))
    asked = []
    monkeypatch.setattr(solving_many, "processes_on_gpus", lambda name, each: asked.append((name, each)) or 4)
    monkeypatch.setattr(solving_many, "gpu_environments", lambda name: [{"CUDA_VISIBLE_DEVICES": "7"}])
    many = solving_many.processes_for(workers, "cuda", count, 1000)
    assert many.workers == expected and many.threads == 1
    assert list(many.environments) == ([{"CUDA_VISIBLE_DEVICES": "7"}] if expected else [])
    assert asked == ([("cuda", 1000 * solving_many.GPU_CHARGE)] if count == 100 and workers is None else [])

    # A batch starts as many.
    started = []

    class Pool:
        def __init__(self, *arguments, **more):
            started.append((arguments, more))

        def map(self, function, calls):
            return ((number, Failure("", True)) for number, _ in enumerate(calls))

    monkeypatch.setattr(worker_pool, "WorkerPool", Pool)
    monkeypatch.setattr(batch, "carry_out", lambda *_: Failure("", True))
    scene = batch.Scene(0, 0, {}, None, tmp_path, tmp_path, "cuda", 1, (".npz",))
    assert len(list(batch._solve([scene] * count, {}, 1000, "cuda", workers, None, 0.0))) == count
    assert started == ([((expected, 1), {"environments": many.environments})] if expected else [])
