"""solve(): from a problem to a placement. The only file that knows the solver and the quality."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from .device.profile import Profile
from .errors import ProblemError
from .problem.placement import Placement
from .problem.problem import Problem
from .problem.validation import check_count, show
from .quality.measurement import measure
from .solver.solver import Progress, Solver

__all__ = ["solve"]


def solve(
    problem: Problem,
    *,
    device: str = "auto",
    max_steps: int = 100,
    progress: Callable[[Progress], bool | None] | None = None,
    profile: Profile | None = None,
) -> Placement:
    """Place the bodies of ``problem``.

    Args:
        problem: What to place where.
        device: ``"auto"`` (an NVIDIA GPU where there is one), ``"cpu"`` or ``"cuda:0"``.
        max_steps: Steps of the relaxation at most, >= 1.
        progress: Called after every step with a :class:`Progress`; returning False stops the run, which then returns what
            is there, with ``report.converged`` False.
        profile: Gets the seconds that every phase takes.

    Returns:
        The placement, with exact counts and its report. ``report.converged`` is True when the forces have little left to ask for: an
        RMS move below 0.005 of the local spacing.

    Raises:
        ProblemError: No problem, one that does not fit into memory or leaves the range of float32, a ``progress`` that cannot be
            called, or ``max_steps`` below 1.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    start_time = time.perf_counter()
    if not isinstance(problem, Problem):
        raise ProblemError(f"`problem` must be a Problem; got {show(problem)}")
    if progress is not None and not callable(progress):
        raise ProblemError(f"`progress` must be something to call, or None; got {show(progress)}")
    max_steps = check_count(max_steps, "`max_steps`")
    with Solver(problem, device=device, profile=profile) as solver:
        steps, converged = solver.run(max_steps, progress)
        solver.separate()
        with solver.launcher.phase("report"):
            placement = solver.placement()
            report = measure(placement, solver.launcher)
        seconds = time.perf_counter() - start_time
        return replace(placement, report=replace(report, steps=steps, converged=converged, seconds=seconds))
