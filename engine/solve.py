"""solve(): from a problem to a placement with a report."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from .device.devices import resolve_device
from .device.launcher import Launcher
from .device.profile import Profile
from .errors import ProblemError
from .problem.domain import Domain
from .problem.given_values import check_is, check_progress, show
from .problem.placement import Placement
from .problem.problem import Problem
from .problem.settings import belongs_to
from .problem.validation import check_count
from .quality.measurement import measure
from .solver.progress import Progress, is_stop
from .solver.solver import Solver

__all__ = ["moved", "solve", "solve_on"]

# After a run was stopped, outlines are parted for about a second only. With more bodies than this it is not worth trying. Measured on
# two processors: of 10,000 boxes that cover half of their ground four of five overlaps go in a second, of 200,000 hardly any in three.
MOST_PARTED_AFTER_STOP = 30_000
# Seconds between two calls of the progress callback while outlines are being parted.
MOMENT = 0.1


@belongs_to("problem")
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
        progress: Called after every step with a :class:`Progress`. While outlines are parted after the last step, it is called
            with the last :class:`Progress` again, about every tenth of a second. With few bodies, it is called with step 0 while the
            best of several starts is chosen. Returning False stops the run. It then returns the placement reached so far, with
            ``report.converged`` False.
        profile: Records the seconds that every phase takes.

    Returns:
        The placement, with exact counts and its report. ``report.converged`` is True when both hold: the bodies came to rest, and no
        outlines overlap that are to keep apart. Bodies are at rest when the RMS of their moves, in most of the last steps (three, or
        15 of 90 and more), is below 0.005 of the local spacing. The limit is up to 0.02 where outlines keep apart and contact decides
        how far they move: beside obstacles, where they cover more than 75 % of their ground, or where a tenth of the bodies is much
        more crowded than all of them.

        More steps may still improve a converged placement a little. With 2,000 bodies, runs count as converged from 20 steps on, when
        coverage errors are up to a fifth above those after 400 steps.

    Raises:
        ProblemError: No problem, one that does not fit into memory or leaves the range of float32, a ``progress`` that cannot be
            called, or ``max_steps`` below 1.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    if not isinstance(problem, Problem):
        raise ProblemError(f"`problem` must be a Problem; got {show(problem)}")
    check_progress(progress)
    if profile is not None:
        check_is(profile, Profile, "`profile`")
    max_steps = check_count(max_steps, "`max_steps`")
    with closing(Launcher(resolve_device(device), profile)) as launcher:
        return solve_on(launcher, problem, max_steps, progress)


def solve_on(
    launcher: Launcher,
    problem: Problem,
    max_steps: int,
    progress: Callable[[Progress], bool | None] | None = None,
    parting: float = 0.0,
) -> Placement:
    """Do what :func:`solve` does with a launcher that stays open, so that the next problem can use its threads and caches.

    Args:
        launcher: Runs the kernels.
        problem: As for :func:`solve`.
        max_steps: As for :func:`solve`.
        progress: As for :func:`solve`.
        parting: About how many seconds outlines that overlap are parted after ``progress`` has stopped the run. With 0, or more than
            ``MOST_PARTED_AFTER_STOP`` bodies, overlaps are left.
    """
    with Solver(problem, launcher=launcher) as solver:
        watched = _Watched(progress)
        solver.choose_start(max_steps, None if progress is None else watched.at_times)
        solver.run(max_steps, None if progress is None else watched)
        stopped = not watched.go_on()
        if not stopped:
            solver.separate(None if progress is None else watched.go_on)
        elif parting and problem.body_count <= MOST_PARTED_AFTER_STOP:
            deadline = time.perf_counter() + parting
            # What takes longer than this by itself, and stirs more bodies, is left out.
            solver.separate(lambda: time.perf_counter() < deadline, again=True)
        return solver.last_placement(stopped=stopped)


def moved(placement: Placement, position: np.ndarray, device: str = "auto") -> Placement:
    """Return a copy of a placement with other positions, measured anew.

    Args:
        placement: A placement with a report, whose steps and seconds are kept.
        position: New positions [m], in the shape of ``placement.position``; clipped to a rectangular domain.
        device: As for :func:`solve`.
    """
    before = placement.report
    assert before is not None
    domain = placement.problem.domain
    inside = np.clip(position, 0.0, domain.size) if isinstance(domain, Domain) else position
    placement = replace(placement, position=inside, report=None)
    with closing(Launcher(resolve_device(device))) as launcher:
        report = measure(placement, launcher)
    converged = before.converged and (report.clean or not placement.problem.avoid_overlap)
    return replace(placement, report=replace(report, steps=before.steps, converged=converged, seconds=before.seconds))


class _Watched:
    """A progress callback, and what it was told last."""

    def __init__(self, progress: Callable[[Progress], bool | None] | None) -> None:
        self._progress = progress
        self._last: Progress | None = None
        self._time = time.perf_counter()
        self._stopped = False

    def __call__(self, state: Progress) -> bool | None:
        assert self._progress is not None
        if self._stopped:
            return False
        self._last = state
        answer = self._progress(state)
        self._stopped = is_stop(answer)
        self._time = time.perf_counter()
        return answer

    def at_times(self, state: Progress) -> bool | None:
        """Ask if it is a while since it was asked."""
        return self(state) if time.perf_counter() - self._time > MOMENT else not self._stopped

    def go_on(self) -> bool:
        """Ask again, if it is a while since it was asked; whoever has stopped the run once does not want to wait for contact."""
        if self._stopped or self._last is None:
            return not self._stopped
        if time.perf_counter() - self._time > MOMENT:
            self(self._last)
        return not self._stopped
