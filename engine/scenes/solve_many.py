"""solve_many(): from many problems to their placements, on all processors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..device.devices import core_count, gpu_environments, processes_on_gpus, resolve_device
from ..device.launcher import launcher_of_process
from ..errors import EshError, ProblemError
from ..problem.given_values import check_progress, show
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.settings import belongs_to
from ..problem.validation import check_count
from ..solve import solve, solve_on
from .warm_pools import warm_pool
from .worker import Failure

__all__ = ["Processes", "processes_for", "quicker_device", "solve_many"]

# Fewer are solved sooner in this process than others are started.
WORTH_PROCESSES = 8
# Many problems of so many charges for each processor take as long on the processors as on a GPU, where most of their time is spent
# beside it: measured with 15 and an H200, 100 problems of 200 take 0.23 s and 1.5 s, 60 of 10,000 take 1.2 s and 1.4 s.
CHARGES_PER_PROCESSOR = 700
# What a charge of the largest problem takes of a GPU's memory [bytes].
GPU_CHARGE = 4000.0


class Processes(NamedTuple):
    """With how many processes problems are best solved.

    Attributes:
        workers: Their number, beside this one; 0 for this one alone.
        threads: Of each.
        environments: See :class:`~.worker_pool.WorkerPool`.
    """

    workers: int
    threads: int = 1
    environments: Sequence[Mapping[str, str]] = ()


@belongs_to("problem", named=False)
def solve_many(
    problems: Iterable[Problem],
    *,
    device: str = "auto",
    max_steps: int = 100,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Placement]:
    """Place the bodies of many problems: the same placements as of :func:`~esh.solve`, in less time.

    There is one process for each processor. Each solves one problem after the other with one thread, because threads that share a
    small problem wait for each other, and processes do not. A GPU is shared by as many processes as fit into its memory, because most
    of a small problem's time is spent outside the GPU. Several GPUs are all used. Processes stay alive for half a minute, so that the
    next call finds them warm.

    Args:
        problems: What to place where.
        device: ``"auto"``, ``"cpu"`` or ``"cuda:0"``. For many small problems ``"auto"`` chooses the CPU even if there is a GPU, as
            they are solved sooner there.
        max_steps: Steps of the relaxation at most, >= 1.
        workers: Number of processes. 0 solves in the calling process; None chooses a number.
        progress: Called after every problem with the number of problems that are done, and the number of all.

    Returns:
        A placement for each problem, in the order of ``problems``.

    Raises:
        ProblemError: A problem cannot be solved. The message has its number, counted from 0; problems that are left are not solved.
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
    charges = max((problem.charge_count for problem in problems), default=0)
    many = processes_for(workers, device, len(problems), charges)
    if not many.workers:
        for number, problem in enumerate(problems):
            try:
                answers[number] = solve(problem, device=device, max_steps=max_steps)
            except EshError as error:
                raise type(error)(f"problem {number}: {error}") from None
            if progress is not None:
                progress(len(answers), len(problems))
        return list(answers.values())
    with warm_pool(*many) as (pool, is_warm):
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


def processes_for(workers: int | None, device: str, count: int, charges: int) -> Processes:
    """Return the processes that ``count`` problems of at most about ``charges`` charges each are best solved with.

    Args:
        workers: How many, as whoever asks wants it; None chooses.
        device: Where they are solved.
        count: Number of problems.
        charges: Of the largest.

    Raises:
        ProblemError: ``workers`` is no whole number of 0 or more.
        DeviceError: An unknown device.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 0):
        raise ProblemError(f"`workers` must be a whole number of at least 0, or None; got {show(workers)}")
    on_gpu = resolve_device(device).is_cuda
    if not _can_start():
        return Processes(0)
    if workers is None:
        workers = 0
        if count >= WORTH_PROCESSES:
            workers = processes_on_gpus(device, GPU_CHARGE * charges) if on_gpu else core_count()
        if workers == 1:
            workers = 0
    workers = min(workers, count)
    if not workers:
        return Processes(0)
    if on_gpu:
        return Processes(workers, 1, gpu_environments(device))
    return Processes(workers, max(1, core_count() // workers))


def _can_start() -> bool:
    """Whether another Python finds this package: inside an installed extension of Blender it does not."""
    return not (__package__ or "").startswith("bl_ext.")


def _solve(problem: Problem, device: str, max_steps: int) -> Placement:
    placement = solve_on(launcher_of_process(device), problem, max_steps)
    # Whoever asked has the problem; its images need not travel back.
    return replace(placement, problem=None)  # type: ignore[arg-type]
