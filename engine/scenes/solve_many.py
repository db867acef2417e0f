"""solve_many(): from many problems to their placements, on all processors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from ..device.launcher import core_count, resolve_device
from ..errors import EshError, ProblemError
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.validation import check_count, show
from ..solve import solve
from .worker import Failure
from .worker_pool import WorkerPool

__all__ = ["make_pool", "solve_many"]

# Fewer are solved sooner in this process than others are started.
WORTH_PROCESSES = 8


def solve_many(
    problems: Iterable[Problem],
    *,
    device: str = "auto",
    max_steps: int = 100,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Placement]:
    """Place the bodies of many problems: the same placements as of :func:`~esh.solve`, in less time.

    On the CPU there is one process for each processor, which solves one problem after the other with one thread: threads that share a
    small problem wait for each other, processes do not. On a GPU, whose threads are many, the problems are solved one after the other.

    Args:
        problems: What to place where.
        device: ``"auto"``, ``"cpu"`` or ``"cuda:0"``.
        max_steps: Steps of the relaxation at most, >= 1.
        workers: Processes; 0 solves in this one. None chooses.
        progress: Called after every problem with the number of those that are done, and of all.

    Returns:
        A placement for each problem, in their order.

    Raises:
        ProblemError: A problem that cannot be solved; its number (from 0) is said. The others are not finished.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    problems = list(problems)
    for number, problem in enumerate(problems):
        if not isinstance(problem, Problem):
            raise ProblemError(f"`problems[{number}]` must be a Problem; got {show(problem)}")
    max_steps = check_count(max_steps, "`max_steps`")
    pool = make_pool(workers, device, len(problems))
    answers: dict[int, Placement] = {}
    if pool is None:
        for number, problem in enumerate(problems):
            try:
                answers[number] = solve(problem, device=device, max_steps=max_steps)
            except EshError as error:
                raise type(error)(f"problem {number}: {error}") from None
            if progress is not None:
                progress(len(answers), len(problems))
        return list(answers.values())
    for number, answer in pool.map(_solve, ((problem, device, max_steps) for problem in problems)):
        if isinstance(answer, Failure):
            pool.close()
            raise ProblemError(f"problem {number}: {answer.text}")
        answers[number] = replace(answer, problem=problems[number])
        if progress is not None:
            progress(len(answers), len(problems))
    return [answers[number] for number in range(len(problems))]


def make_pool(workers: int | None, device: str, count: int) -> WorkerPool | None:
    """Return the processes that ``count`` problems are best solved with; None for this process alone.

    Raises:
        ProblemError: ``workers`` is no whole number of 0 or more.
        DeviceError: An unknown device.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 0):
        raise ProblemError(f"`workers` must be a whole number of at least 0, or None; got {show(workers)}")
    on_cpu = resolve_device(device).is_cpu
    if workers is None:
        workers = core_count() if on_cpu and count >= WORTH_PROCESSES else 0
        if workers == 1:
            workers = 0
    workers = min(workers, count) if _can_start() else 0
    return WorkerPool(workers, max(1, core_count() // workers)) if workers else None


def _can_start() -> bool:
    """Whether another Python finds this package: inside an installed extension of Blender it does not."""
    return not (__package__ or "").startswith("bl_ext.")


def _solve(problem: Problem, device: str, max_steps: int) -> Placement:
    placement = solve(problem, device=device, max_steps=max_steps)
    # Whoever asked has the problem; its images need not travel back.
    return replace(placement, problem=None)  # type: ignore[arg-type]
