"""A solver that stays, in a thread of its own: it goes on from one problem to the next. Knows nothing of Blender's data."""

from __future__ import annotations

import copy
import threading
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...engine.errors import EshError
from ...engine.problem.placement import Placement
from ...engine.problem.problem import Problem
from ...engine.problem.surface import Surface
from ...engine.solver.bookmarks import Bookmark
from ...engine.solver.solver import Solver
from ..classes.survey import Survey
from ..result.words import EVEN, unevenness
from .earlier_results import MOST_BODIES_EARLIER, EarlierResult, EarlierResults
from .strokes import Stroke

if TYPE_CHECKING:
    from ..result.kept_ground import KeptPlaces
    from .job import ScatterJob

__all__ = ["LiveWorker", "Outcome", "Request"]

# What looks uneven after the few steps of an edit, and so many times as uneven as it was, takes as many steps as a run.
MUCH_LESS_EVEN = 2.0
# Seconds that the thread rests at most before whoever asked for it comes back, and after which it looks again.
LONGEST_REST, A_REST = 0.2, 0.05


@dataclass(frozen=True, eq=False)
class Request:
    """What is to be solved next.

    Attributes:
        job: Read from Blender, not prepared yet.
        anew: Whether to begin from nothing, not from where bodies are.
        start: Where bodies are that the solver has not placed itself, or None.
        before: Where they are other ones than this request asks for: a job that asks for just these, and where these are; or None.
        few_steps: Whether nothing but counts and classes are other ones, so that few steps will do, and what is far stays.
        ready_only: Whether they are where this request would have them, so that there is nothing to solve yet.
        back_to: The job that has placed them where they are, if it was one of this worker.
        again: Whether what ``back_to`` has placed is to be shown once more, as something else stands there.
        stroke: Which part of a stroke it follows; None for none.
    """

    job: ScatterJob
    anew: bool = False
    start: KeptPlaces | None = None
    before: tuple[ScatterJob, KeptPlaces] | None = None
    few_steps: bool = False
    ready_only: bool = False
    back_to: ScatterJob | None = None
    again: bool = False
    stroke: Stroke | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a request.

    Attributes:
        request: The request.
        job: What has been solved of it; None where that failed.
        placement: Where bodies are; with its report once that is measured. None where nothing is to be shown.
        error: What is wrong with it, or None.
        seconds: Time from the request's beginning [s].
    """

    request: Request
    job: ScatterJob | None = None
    placement: Placement | None = None
    error: EshError | None = None
    seconds: float = 0.0


class _DroppedError(Exception):
    """Raised in what nobody waits for any more: a report, or anything once the worker is to end."""


class _Beginning(NamedTuple):
    """What bodies were placed with when a stroke began, and where the solver goes back to for following it as one."""

    made_with: str
    bookmark: Bookmark
    unevenness: float


class LiveWorker:
    """Solves requests one after the other; of those that wait only the last one.

    Args:
        survey: What the jobs' preparation has worked out; used by the thread only.
    """

    def __init__(self, survey: Survey) -> None:
        self._survey = survey
        self._change = threading.Condition()
        self._waiting: Request | None = None
        self._outcome: Outcome | None = None
        self._busy = self._shows_nothing = False
        # Whether the thread is asked to rest, does so, and has to until it is told to go on.
        self._asked_to_rest = self._rests = self._held = False
        self._ended = False
        self._solver: Solver | None = None
        self._made: ScatterJob | None = None
        # The job that was shown last, if nothing has moved since; and those before it.
        self._shown: ScatterJob | None = None
        self._earlier = EarlierResults()
        # Where a stroke began.
        self._beginning: _Beginning | None = None
        # Steps of an edit that a solver began with.
        self._edited = 0
        # How uneven the last placement was that was measured.
        self._unevenness = 0.0
        self._thread = threading.Thread(target=self._work, name="ESH Scatter live", daemon=True)
        self._thread.start()

    @property
    def has_solver(self) -> bool:
        """Whether there is a state to go on from."""
        return self._made is not None

    @property
    def knows_beginning(self) -> bool:
        """Whether a stroke can be followed as one, from where bodies were when it began."""
        return self._beginning is not None

    @property
    def busy(self) -> bool:
        """Whether it solves, or is about to."""
        return self._busy or self._waiting is not None

    @property
    def has_outcome(self) -> bool:
        """Whether something has come out that nobody has taken yet."""
        return self._outcome is not None

    @property
    def takes_edits(self) -> bool:
        """Whether what was asked for last has come out, but for its report and further steps, which the next request ends."""
        return not self._shows_nothing and self._waiting is None

    def rests(self) -> bool:
        """Have the thread rest until :meth:`go_on`, so that Blender's data can be read; tell whether it does, or has nothing to do.

        Otherwise both would wait for Python's lock in turns. What it is asked for meanwhile, it begins with when it goes on: operators
        may only be called while it rests. Where they look into a context that was overridden, Blender with Python 3.11 takes itself
        to have that lock if any thread has it, and crashes once the other one lets go of it.
        """
        with self._change:
            # What it was asked for, it begins with at any moment.
            self._asked_to_rest = self.busy
            self._held = self._rests or not self._asked_to_rest
            return self._held

    def go_on(self) -> None:
        """Let the thread go on, once what was to be read has been."""
        with self._change:
            self._asked_to_rest = self._held = False
            self._change.notify()

    def submit(self, request: Request) -> None:
        """Have a request solved; one that still waits is forgotten."""
        with self._change:
            self._waiting = request
            self._change.notify()

    def take(self) -> Outcome | None:
        """Return what has come out since the last call."""
        with self._change:
            outcome, self._outcome = self._outcome, None
        return outcome

    def end(self) -> None:
        """Let the thread come to its end at its next step; returns at once."""
        with self._change:
            self._ended = True
            self._waiting = self._outcome = None
            self._change.notify()

    def join(self, seconds: float) -> None:
        """Wait for the end of the thread, ``seconds`` at most."""
        self._thread.join(seconds)

    def _work(self) -> None:
        while True:
            with self._change:
                self._busy = self._shows_nothing = False
                while (self._waiting is None or self._held) and not self._ended:
                    self._change.wait()
                if self._ended:
                    break
                request, self._busy, self._shows_nothing, self._waiting = self._waiting, True, True, None
            assert request is not None
            try:
                self._solve(request)
            except _DroppedError:
                pass
            except EshError as error:
                self._publish(Outcome(request, error=error))
            except BaseException as error:  # nobody else would hear of it
                self._publish(Outcome(request, error=EshError(f"Live stopped: {type(error).__name__}: {error}")))
                self._close()
        self._close()

    def _solve(self, request: Request) -> None:
        start = time.perf_counter()
        job = request.job
        if request.stroke not in (Stroke.GOES_ON, Stroke.ENDS):
            self._forget_beginning()
        job.survey = self._survey
        job.prepare()
        in_full = False
        if self._goes_back(request):
            if request.ready_only and not request.again:
                return
            steps = 0 if request.again else self._edit(request)
        elif request.stroke is Stroke.ENDS and (beginning := self._back_to_beginning(request)) is not None:
            steps = 0 if job.made_with == beginning.made_with else self._edit(request)
        elif self._can_go_on(request):
            steps = self._edit(request)
        else:
            self._unevenness = 0.0
            started = self._begin(request)
            self._made = job
            if started and request.ready_only:
                return
            assert self._solver is not None
            steps = self._edited
            in_full = not steps
            self._shown = None
            if in_full:
                steps, _ = self._solver.run(job.settings.max_steps, lambda _progress: self._go_on())
                self._solver.separate(self._go_on, again=started)
        self._made = job
        assert self._solver is not None
        before = self._unevenness
        measured = self._show(request, job, steps, start)
        # What is only shown once more stays as it was.
        if in_full or not steps or not measured or self._unevenness <= max(EVEN, MUCH_LESS_EVEN * before):
            return
        self._shown = None
        more, _ = self._solver.run(job.settings.max_steps, lambda _progress: self._go_on())
        self._solver.separate(self._go_on, again=True)
        if self._go_on():
            # Somebody may be writing the one that was shown.
            self._made = copy.copy(job)
            self._show(request, self._made, steps + more, start)

    def _show(self, request: Request, job: ScatterJob, steps: int, start: float) -> bool:
        """Publish where bodies are, and their report once that is measured: False where somebody wants something else by then."""
        assert self._solver is not None
        placement = self._solver.placement()
        job.stand(placement)
        self._publish(Outcome(request, job, placement, seconds=time.perf_counter() - start))
        self._shown, self._shows_nothing = job, False
        try:
            with self._solver.launcher.interruptible(self._drop_if_unwanted):
                placement = self._solver.measured(placement)
        except _DroppedError:
            return False
        assert placement.report is not None
        # An edit has done what it is to do, and reading Blender's data counts for whoever waits.
        report = replace(placement.report, steps=steps, converged=True, seconds=time.perf_counter() - start)
        job.placement = job.with_leaning(replace(placement, report=report))
        self._publish(Outcome(request, job, job.placement, seconds=report.seconds))
        self._unevenness = unevenness(report.to_dict())
        return True

    def _edit(self, request: Request) -> int:
        assert self._solver is not None
        if self._beginning is None:
            # Undo does not lead to what the parts of a stroke have left.
            self._remember()
            self._mark_beginning(request)
        self._shown = None
        try:
            with self._solver.launcher.interruptible(self._drop_if_ended):
                return self._solver.edit(request.job.problem).steps
        except EshError:
            # Who knows how far it came.
            self._close()
            raise

    def _mark_beginning(self, request: Request) -> None:
        """Know where bodies are before a stroke is followed, if few enough are to be held on to for that."""
        if self._solver is None or self._made is None or request.stroke not in (Stroke.BEGINS, Stroke.GOES_ON):
            return
        if self._solver.model.body_count <= MOST_BODIES_EARLIER:
            self._beginning = _Beginning(self._made.made_with, self._solver.bookmark(), self._unevenness)

    def _back_to_beginning(self, request: Request) -> _Beginning | None:
        """Go back to where a stroke began, if that is known and can be gone on from; return where that is."""
        beginning = self._beginning
        if self._solver is None or beginning is None or request.anew:
            return None
        if not self._is_alike(request, beginning.bookmark.model.problem):
            return None
        self._shown, self._unevenness = None, beginning.unevenness
        self._solver.go_back(beginning.bookmark)
        self._forget_beginning()
        return beginning

    def _forget_beginning(self) -> None:
        if self._solver is not None and self._beginning is not None:
            self._solver.drop(self._beginning.bookmark)
        self._beginning = None

    def _remember(self, wanted: EarlierResult | None = None) -> None:
        """Let undo come back to what was shown last, with as much of what was before as there is room for, and all that is wanted."""
        if self._solver is not None and self._shown is not None:
            self._earlier.remember(self._solver, self._shown, self._unevenness, wanted=wanted)

    def _goes_back(self, request: Request) -> bool:
        """Go back to the job that has placed bodies where they are, if that can be gone on from; tell whether it is so."""
        earlier = self._earlier.of(request.back_to)
        is_there = request.back_to is not None and request.back_to is self._shown
        if self._solver is None or request.anew or not (earlier or is_there):
            return False
        if not self._is_alike(request, earlier.bookmark.model.problem if earlier else self._solver.model.problem):
            return False
        if earlier is not None and not is_there:
            # Redo may come back to what is there now.
            self._remember(earlier)
            self._earlier.renew(earlier, request.job if request.again else earlier.job)
            self._solver.go_back(earlier.bookmark)
            self._unevenness = earlier.unevenness
        # What is shown once more is known by the job that shows it.
        self._shown = request.job if request.again else request.back_to
        self._made = request.job if request.again or request.ready_only else request.back_to
        return True

    def _can_go_on(self, request: Request) -> bool:
        if self._solver is None or request.anew or request.start is not None:
            return False
        return self._is_alike(request, self._solver.model.problem)

    def _is_alike(self, request: Request, before: Problem) -> bool:
        """Tell whether a request is for the same ground and device as a problem of this solver."""
        domain, now = before.domain, request.job.problem.domain
        same = domain is now if isinstance(domain, Surface) else domain == now
        return self._made is not None and same and request.job.device == self._made.device

    def _begin(self, request: Request) -> bool:
        """Make a solver for the request; tell whether it starts where bodies are."""
        self._close()
        self._edited = 0
        problem, places = request.job.problem, request.start
        if places is not None and self._are_those(problem, places):
            at = request.job.start_of(places)
            self._solver = Solver(problem, device=request.job.settings.device, at=at)
            self._shown = request.job
            return True
        if request.before is None:
            self._solver = Solver(problem, device=request.job.settings.device)
            return False
        before, places = request.before
        before.survey = self._survey
        before.prepare()
        if not self._are_those(before.problem, places):
            self._solver = Solver(problem, device=request.job.settings.device)
            return False
        self._solver = Solver(before.problem, device=before.settings.device, at=before.start_of(places))
        self._shown = before
        self._remember()
        self._edited = self._solver.edit(problem, **({} if request.few_steps else {"steps": 0})).steps
        return True

    @staticmethod
    def _are_those(problem: Problem, places: KeptPlaces) -> bool:
        """Tell whether a problem asks for just these bodies."""
        there = places.class_index, places.size_index
        return all(np.array_equal(one, two) for one, two in zip(problem.body_indices(), there, strict=True))

    def _go_on(self) -> bool:
        """Whether nobody wants something else by now; rests first, where it is asked to."""
        with self._change:
            until = time.monotonic() + LONGEST_REST
            while not self._ended and (self._held or (self._asked_to_rest and time.monotonic() < until)):
                self._rests = True
                self._change.wait(A_REST)
            self._asked_to_rest = self._rests = self._held = False
            return not self._ended and self._waiting is None

    def _drop_if_unwanted(self) -> None:
        if not self._go_on():
            raise _DroppedError

    def _drop_if_ended(self) -> None:
        if self._ended:
            raise _DroppedError

    def _publish(self, outcome: Outcome) -> None:
        with self._change:
            if not self._ended:
                self._outcome = outcome

    def _close(self) -> None:
        solver, self._solver, self._made, self._shown = self._solver, None, None, None
        self._earlier.clear()
        self._beginning = None
        if solver is not None:
            solver.close()
