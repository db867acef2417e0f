"""solve_many(): from many problems to their placements, on all processors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from ..device.devices import core_count, gpu_environments, processes_on_gpus, resolve_device
from ..device.launcher import launcher_of_process
from ..errors import EshError, ProblemError
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.validation import check_count, check_progress, show
from ..solve import solve, solve_on
from .warm_pools import warm_pool
from .worker import Failure
from .worker_pool import WorkerPool

__all__ = ["make_pool", "quicker_device", "solve_many"]

# Fewer are solved sooner in this process than others are started.
WORTH_PROCESSES = 8
# Many problems of so many charges for each processor take as long on the processors as on a GPU, where most of their time is spent
# beside it: measured with 15 and an H200, 100 problems of 200 take 0.23 s and 1.5 s, 60 of 10,000 take 1.2 s and 1.4 s.
CHARGES_PER_PROCESSOR = 700
# What a charge of the largest problem takes of a GPU's memory [bytes].
GPU_CHARGE = 4000.0


def solve_many(
    problems: Iterable[Problem],
    *,
    device: str = "auto",
    max_steps: int = 100,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Placement]:
    """Place the bodies of many problems: the same placements as of :func:`~esh.solve`, in less time.

    There is one process for each processor, which solves one problem after the other with one thread: threads that share a small
    problem wait for each other, processes do not. On a GPU they share it, as many as it has the memory for, and several GPUs are all
    used: most of a small problem's time is spent beside it. Processes stay for half a minute, so that the next call finds them warm.

    Args:
        problems: What to place where.
        device: ``"auto"``, ``"cpu"`` or ``"cuda:0"``. ``"auto"`` takes the processors for many small problems, even where there is a
            GPU: they are done sooner there.
        max_steps: Steps of the relaxation at most, >= 1.
        workers: Processes; 0 solves in this one. None chooses.
        progress: Called after every problem with the number of those that are done, and of all.

    Returns:
        A placement for each problem, in their order.

    Raises:
        ProblemError: A problem that cannot be solved; its number (from 0) is said. The others are not finished.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    check_progress(progress)
    if not isinstance(problems, Iterable) or (isinstance(problems, np.ndarray) and not problems.ndim):
        raise ProblemError(f"`problems` must be a list of Problem; got {show(problems)}")
    problems = list(problems)
    for number, problem in enumerate(problems):
        if not isinstance(problem, Problem):
            raise ProblemError(f"`problems[{number}]` must be a Problem; got {show(problem)}")
    max_steps = check_count(max_steps, "`max_steps`")
    if len(problems) >= WORTH_PROCESSES:
        device = quicker_device(device, max(problem.charge_count for problem in problems))
    answers: dict[int, Placement] = {}
    many = _process_count(workers, device, problems)
    if not many:
        for number, problem in enumerate(problems):
            try:
                answers[number] = solve(problem, device=device, max_steps=max_steps)
            except EshError as error:
                raise type(error)(f"problem {number}: {error}") from None
            if progress is not None:
                progress(len(answers), len(problems))
        return list(answers.values())
    on_gpu = resolve_device(device).is_cuda
    threads = 1 if on_gpu else max(1, core_count() // many)
    with warm_pool(many, threads, gpu_environments(device) if on_gpu else ()) as (pool, is_warm):
        calls = ((problem, device, max_steps) for problem in problems)
        for number, answer in pool.map(_solve, calls, first_alone=not is_warm):
            if isinstance(answer, Failure):
                raise ProblemError(f"problem {number}: {answer.text}")
            answers[number] = replace(answer, problem=problems[number])
            if progress is not None:
                progress(len(answers), len(problems))
    return [answers[number] for number in range(len(problems))]


def quicker_device(device: str, charges: int) -> str:
    """The device on which many problems of so many charges each are done sooner; one that is not ``"auto"`` stays.

    Raises:
        DeviceError: An unknown device.
    """
    if device != "auto" or not resolve_device(device).is_cuda:
        return device
    return "cpu" if charges <= CHARGES_PER_PROCESSOR * core_count() and _can_start() else device


def _process_count(workers: int | None, device: str, problems: list[Problem]) -> int:
    """Processes that problems are best solved with; 0 for this one alone. Arguments and errors as of :func:`make_pool`."""
    pool = make_pool(workers, device, len(problems))
    if pool is not None or workers is not None or not problems:
        return 0 if pool is None else pool.workers
    found = resolve_device(device)
    if not found.is_cuda or len(problems) < WORTH_PROCESSES or not _can_start():
        return 0
    largest = max(problem.charge_count for problem in problems)
    many = min(len(problems), processes_on_gpus(device, GPU_CHARGE * largest))
    return many if many > 1 else 0


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
    placement = solve_on(launcher_of_process(device), problem, max_steps)
    # Whoever asked has the problem; its images need not travel back.
    return replace(placement, problem=None)  # type: ignore[arg-type]
