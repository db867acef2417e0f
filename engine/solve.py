"""solve(): from a problem to a placement. The only file that knows the solver and the quality."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from .device.launcher import Launcher, resolve_device
from .device.profile import Profile
from .problem.placement import Placement
from .problem.problem import Problem
from .problem.validation import check_count
from .quality.measurement import measure
from .solver.memory import check_memory
from .solver.relaxation import Progress, Relaxation, placement_of

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
        ProblemError: The problem does not fit into memory, or ``max_steps`` is below 1.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    start_time = time.perf_counter()
    max_steps = check_count(max_steps, "`max_steps`")
    launcher = Launcher(resolve_device(device), profile)
    try:
        check_memory(problem)
        with launcher.phase("set-up"):
            relaxation = Relaxation(problem, launcher)
        steps, converged = relaxation.run(max_steps, progress)
        with launcher.phase("contact"):
            if relaxation.contact is not None and problem.avoid_overlap:
                relaxation.contact.separate(relaxation.pose, relaxation.bend)
        with launcher.phase("report"):
            placement = placement_of(problem, relaxation)
            report = measure(placement, launcher)
        seconds = time.perf_counter() - start_time
        report = replace(report, steps=steps, converged=converged, seconds=seconds)
        return replace(placement, report=report)
    finally:
        launcher.close()
