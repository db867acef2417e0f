"""A run, step by step: compile the problem, take or make a state, step until settled, read the placement."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from ..descent.convergence import TOLERANCE, is_settled, last_steps
from ..descent.descent import Descent
from ..descent.surface_descent import SurfaceDescent
from ..device.devices import resolve_device
from ..device.launcher import Launcher
from ..device.profile import Profile
from ..edits.edit import in_order
from ..edits.given_places import checked_places, given_outlines
from ..errors import ProblemError, Reason, Refusal
from ..heat.heat_mesh import HeatMeshes
from ..model.body_flags import checked_flags
from ..model.looking import LOOKS_AWAY, angle_within, looks_at_point, somebody_looks
from ..model.memory import check_memory
from ..model.model import Model
from ..model.state import State, SurfaceState
from ..problem.given_values import check_is, check_progress, show
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.settings import belongs_to
from ..problem.surface import Surface
from ..problem.validation import check_count
from ..quality.measurement import Parting, measure
from .bookmarks import Bookmark
from .placing import CLOSED, GivenPlaces
from .placing_in_plane import PlacingInPlane
from .placing_on_surface import PlacingOnSurface
from .progress import Progress, is_stop
from .record import Record

__all__ = ["Edit", "Solver"]

# Message of the error that is raised when forces overflow float32, although the problem was checked before.
OVERFLOW = (
    "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart; bring them "
    "nearer to each other"
)
# Steps after an edit, behind those in which bodies settle.
EDIT_STEPS = 5
# Steps on a GPU between two readings of the residual, if there is no progress callback.
STEPS_UNWATCHED = 50
# Bodies whose class looks at a point are turned towards it and parted again at most so many times. In crowds some body is always moved
# far, because trading places is what makes room, and so looks past the point again.
MOST_FACINGS = 4


class Edit(NamedTuple):
    """What :meth:`Solver.edit` changed. Bodies are told apart by their identities, see :attr:`Placement.id`.

    Attributes:
        added: Identities of new bodies, in rising order, shape ``[added_count]``.
        removed: Identities of bodies that are gone, in rising order, shape ``[removed_count]``.
        steps: Steps taken, as asked for.
    """

    added: np.ndarray
    removed: np.ndarray
    steps: int


@belongs_to("problem", named=False, instead={"max_steps": "its method `run` takes it: solver.run(max_steps=...)"})
class Solver:
    """Places the bodies of a problem, step by step; :func:`~esh.engine.solve.solve` does all of it at once.

    A solver owns threads. Use it in a ``with`` block, or call :meth:`close`. A closed solver can take no more steps and give no more
    placements: these methods then raise a ProblemError.

    Args:
        problem: What to place where.
        device: ``"auto"`` (an NVIDIA GPU where there is one), ``"cpu"`` or ``"cuda:0"``.
        state: State of a solver of the same problem, to continue from. By default bodies start along a Hilbert curve.
        profile: Records the seconds that every phase takes.
        flags: :class:`~.body_flags.BodyFlags` of every body, shape ``[body_count]``; all 0 by default.
        launcher: Runs the kernels, instead of one made from ``device`` and ``profile``. The solver does not close it.
        at: Arguments of :meth:`start_at` by name. The same as calling that method next, in half the time.

    Attributes:
        launcher: Runs the kernels, on threads or on a GPU.

    Raises:
        ProblemError: The problem does not fit into memory.
        DeviceError: An unknown device, or CUDA asked for and absent.

    Example:
        >>> with Solver(problem) as solver:
        ...     while solver.step() > 0.005:
        ...         print(solver.placement().position)
    """

    def __init__(
        self,
        problem: Problem,
        *,
        device: str = "auto",
        state: State | SurfaceState | None = None,
        profile: Profile | None = None,
        flags: np.ndarray | None = None,
        launcher: Launcher | None = None,
        at: Mapping[str, Any] | None = None,
    ) -> None:
        if profile is not None:
            check_is(profile, Profile, "`profile`")
        if launcher is not None:
            check_is(launcher, Launcher, "`launcher`")
        self.launcher = launcher or Launcher(resolve_device(device), profile)
        self._is_shared, self._closed = launcher is not None, False
        self._left_at: np.ndarray | None = None
        self._record = Record()
        try:
            check_is(problem, Problem, "`problem`")
            placing = PlacingOnSurface if isinstance(problem.domain, Surface) else PlacingInPlane
            if state is not None:
                check_is(state, placing.STATE, "`state`")
            if flags is not None:
                flags = checked_flags(flags, problem.body_count)
            check_memory(problem)
            with self._record, self.launcher.phase("set-up"):
                self._placing: PlacingInPlane | PlacingOnSurface = placing(Model(problem, flags), self.launcher)
                if at is not None:
                    self.start_at(**at)
                else:
                    self._placing.start(afresh=state is None and flags is None)
                if state is not None:
                    self._placing.start_from(state)
        except BaseException:
            self.close()
            raise

    @property
    def model(self) -> Model:
        """The compiled problem."""
        return self._placing.model

    @property
    def descent(self) -> Descent | SurfaceDescent:
        """The bodies' state, and the kernels that one step launches."""
        return self._placing.descent

    def edit(self, problem: Problem, *, steps: int = EDIT_STEPS) -> Edit:
        """Continue with another problem in the same domain, from where the bodies are.

        Densities, counts, sizes, classes, obstacles and fixed bodies may differ. Where a class's density fell, its surplus bodies are
        removed; where it rose, bodies are added. Then bodies settle. Four fifths of them stay within a tenth of a spacing of where
        they were, fewer if more than a tenth of all were added or removed, or if outlines that cover half of the ground are parted:
        see :mod:`.settling`. Bodies that stay keep their :attr:`Placement.id`.

        Args:
            problem: What to place now. Classes and sizes are matched with those before by their names. A fixed body whose ``id`` is
                that of an existing body is that body, pinned or moved.
            steps: Steps to take after bodies have settled, 0 or more. With 0 they do not settle either. Steps of :meth:`run` instead
                would leave all bodies free, and move more of them for little gain.

        Returns:
            Which bodies were added and removed.

        Raises:
            ProblemError: Another domain, or a problem that does not fit into memory.
        """
        self._check_open()
        check_is(problem, Problem, "`problem`")
        placing = self._placing
        placing.cut()
        placing.check_domain(problem)
        check_memory(problem)
        record = Record()
        with record:
            with self.launcher.phase("set-up"):
                added, removed, settle = placing.edit(problem)
            # What was refused has changed nothing.
            self._record = record
            placing.next_identity = max(placing.next_identity, int(added.max(initial=-1)) + 1)
            if steps:
                changed = settle(steps)
                added, removed = (added, removed) if changed is None else changed
                self._stepped(steps)
            if steps or problem.avoid_overlap:
                self.separate(again=True)
        return Edit(in_order(added), in_order(removed), steps)

    def bookmark(self) -> Bookmark:
        """Return a bookmark of the problem and its bodies, which :meth:`go_back` returns to after any number of edits.

        It keeps the memory that steps need, until it is dropped or the solver is closed. It does not copy the bodies: steps taken
        before the next edit move those of the bookmark, too.
        """
        placing = self._placing
        placing.cut()
        return placing.bookmarks.add(Bookmark(placing.model, placing.descent, placing.next_identity, self._record))

    def go_back(self, bookmark: Bookmark) -> None:
        """Return to the problem and the bodies of a bookmark. Takes no time, as nothing is compiled or computed again.

        Raises:
            ProblemError: It is another solver's, or was dropped.
        """
        self._check_open()
        self._placing.bookmarks.check(bookmark)
        self._placing.return_to(bookmark)
        self._record = bookmark.record

    def drop(self, bookmark: Bookmark) -> None:
        """Delete a bookmark and release its memory.

        Raises:
            ProblemError: It is another solver's, or was dropped.
        """
        self._check_open()
        self._placing.drop(bookmark)

    @property
    def state(self) -> State | SurfaceState:
        """The current state. It changes with every step, so copy it to keep it.

        With a natural border, this drops the bodies beyond it, and after a run it places small bodies, as :meth:`placement` does.
        """
        self._placing.cut()
        state, body = self.descent.state, self.model.body
        state.identity = None if isinstance(body.identities, range) else body.identity
        return state

    def start_from(self, state: State | SurfaceState) -> None:
        """Continue from another state of the same problem; its values are copied. Bodies get the identities that they had in it.

        Raises:
            ProblemError: It is the state of another problem.
        """
        self._placing.start_from(state)
        self._record = Record()

    def start_at(
        self,
        position: np.ndarray,
        *,
        angle: np.ndarray | None = None,
        length: np.ndarray | None = None,
        identity: np.ndarray | None = None,
        variant: np.ndarray | None = None,
        scale: np.ndarray | None = None,
        triangle: np.ndarray | None = None,
        barycentric: np.ndarray | None = None,
    ) -> None:
        """Continue from given positions, for example those of a placement that was saved without its state.

        Args:
            position: Positions [m] in the order of a placement, shape ``[body_count, 2]``; on a surface ``[body_count, 3]``. Positions
                outside the domain are moved to its border. Fixed bodies stay where the problem says.
            angle: Angles [rad] as in :attr:`Placement.angle`, shape ``[body_count]``; None for those that bodies start with.
            length: Lengths of lines [m], shape ``[body_count]``; None, or 0 for a body, for the length that it starts with.
            identity: New :attr:`Placement.id` of the bodies, shape ``[body_count]``; None keeps those that they have.
            variant: Index of every body's outline among those of its size, shape ``[body_count]``; None keeps the problem's.
            scale: Factors on these outlines, shape ``[body_count]``; None keeps the problem's.
            triangle: On a surface of one mesh: index of the triangle that every body is on, -1 where unknown, shape
                ``[body_count]``; None for the nearest ones.
            barycentric: Weights of these triangles' corners, shape ``[body_count, 3]``; without them ``triangle`` is not used.

        Raises:
            ProblemError: Another number of bodies, a position that is not finite or not on the surface, or invalid identities.
        """
        self._check_open()
        model = self.model
        position = checked_places(model, position)
        if identity is not None:
            self._placing.take_identities(identity, model.fixed)
        if variant is not None or scale is not None:
            model.take_outlines(given_outlines(model, variant, scale))
        record = Record()
        with record:
            self._placing.start_at(GivenPlaces(position, angle, length, triangle, barycentric))
        self._record = record

    def step(self, count: int = 1) -> float:
        """Take ``count`` steps, and return the residual after the last one: see :attr:`Progress.residual`.

        Raises:
            ProblemError: A force is not finite, or ``count`` is not a valid number of steps.
        """
        count = check_count(count, "`count`")
        with self._record:
            self.descent.step.play(count)
            return self._stepped(count)

    def _stepped(self, count: int) -> float:
        """Count steps that were taken, and return the residual."""
        self.descent.state.steps += count
        with self.launcher.phase("readback"):
            residual = self.descent.direction.residual()
        if math.isnan(residual):
            raise ProblemError(OVERFLOW, Refusal(Reason.FORCES_NOT_FINITE, 1, 0))
        self._record.stepped(count, residual)
        return residual

    def run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> tuple[int, bool]:
        """Take steps until bodies have settled, ``max_steps`` are taken or ``progress`` returns False.

        Returns:
            The number of steps taken, and whether bodies have settled.
        """
        max_steps = check_count(max_steps, "`max_steps`")
        check_progress(progress)
        with self._record:
            steps, settled = self._run(max_steps, progress)
        self._record.rests = settled
        return steps, settled

    def _run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None) -> tuple[int, bool]:
        """Do what :meth:`run` does, with arguments that were checked."""
        residuals: deque[float] = deque(maxlen=last_steps(max_steps))
        step = 0
        corrections = self._placing.corrections(max_steps)
        while step < max_steps:
            until = corrections[0] if corrections else max_steps
            # Without a progress callback, many steps run without returning to Python, and a GPU's residual is not read after each.
            many = 1
            if progress is None:
                unwatched = max(min(until, max_steps - last_steps(max_steps)) - step, 1)
                if self.launcher.device.is_cuda:
                    many = 1 if self.launcher.profiled else min(STEPS_UNWATCHED, unwatched)
                elif step > 0:
                    many = unwatched
            taken = self.descent.step.play(many, self.descent.direction.settled(TOLERANCE))
            residual = self._stepped(taken)
            residuals.append(residual)
            step += taken
            if progress is not None:
                with self.launcher.phase("progress"):
                    go_on = progress(Progress(step, max_steps, residual, self._position))
                if is_stop(go_on):
                    return step, False
            # Before the second step nothing has shown yet whether contact lets bodies move.
            rests = residual < TOLERANCE and step > 1
            if corrections and (rests or step >= until):
                del corrections[0]
                self._placing.descent.correct_targets()
            elif rests:
                self._placing.has_run = True
                return step, True
        self._placing.has_run = True
        return max_steps, step > 1 and is_settled(self.model, list(residuals))

    @property
    def heat(self) -> HeatMeshes | None:
        """Meshes for smoothing along the surface, which the report can use again; None in the plane."""
        return self._placing.heat

    def choose_start(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> int:
        """With few bodies, choose the one of several starts from which the least energy is reached; see :mod:`.choice_of_start`.

        Args:
            max_steps: Steps that the run will take at most.
            progress: Called between starts, with step 0. Returning False ends the search, and the best of those tried is taken.

        Returns:
            Number of the chosen start. 0 is the first one, which all runs of many bodies use.
        """

        def go_on() -> bool:
            assert progress is not None
            return not is_stop(progress(Progress(0, max_steps, self.descent.direction.residual(), self._position)))

        with self._record:
            return self._placing.choose_start(max_steps, None if progress is None else go_on)

    def separate(self, go_on: Callable[[], bool] | None = None, *, again: bool = False) -> bool:
        """Part outlines that still overlap, if the problem avoids overlap. On a surface, part bodies of a class that are too close.

        Args:
            go_on: Called now and then; returning False stops.
            again: Whether outlines were parted before. Then as few bodies as possible are moved.

        Returns:
            Whether no outlines overlap that are to keep apart; True if the problem allows overlap.
        """
        with self._record:
            parted = self._separate(go_on, again)
        self._record.parted = True
        return parted

    def _separate(self, go_on: Callable[[], bool] | None, again: bool) -> bool:
        """Do what :meth:`separate` does."""
        self._placing.cut(go_on)
        self._face(0.0)
        self._placing.keep_least_spacing(go_on)
        if self.descent.contact is None or not self.model.problem.avoid_overlap:
            return True
        with self.launcher.phase("contact"):
            parted = self.descent.separate(go_on, again=again)
            for _ in range(MOST_FACINGS):
                # Who was parted looks from elsewhere now.
                if not self._face(LOOKS_AWAY) or (go_on is not None and not go_on()):
                    break
                parted = self.descent.separate(go_on, again=True)
            self.descent.place_charges()
        return parted

    def _face(self, past: float) -> bool:
        """Turn outlines that look past the point of their class by more than this [rad]; tell whether there were any.

        They keep these turns while they are parted.
        """
        model = self.model
        if not somebody_looks(model):
            return False
        looking = looks_at_point(model) & model.footprints.is_outline
        if not looking.any():
            return False
        turns, wanted = self.descent.facing()
        turn = turns.numpy().copy()
        away = looking & (np.abs(angle_within(wanted - turn, 2.0 * math.pi)) > past)
        turn[away] = wanted[away]
        turns.assign(turn)
        return bool(away.any())

    def placement(self, *, report: bool = False) -> Placement:
        """Return the bodies where they are now.

        With a natural border, this drops the bodies beyond it for good: later steps treat the border as open. After a :meth:`run`,
        bodies that are much smaller than others, which they may not overlap, are first placed around these; the first time anew.

        Args:
            report: Whether to measure them, too, as :meth:`measured` does. Of many bodies that takes longer than an edit of a few.

        Raises:
            ProblemError: A position is not finite.
        """
        with self._record:
            self._placing.cut()
            placement = self.descent.placement()
            # A single position that is not finite makes the sum not finite.
            if not np.isfinite(placement.position.sum()):
                raise ProblemError(OVERFLOW, Refusal(Reason.FORCES_NOT_FINITE, 1, 0))
            placement = self._placing.finished(placement)
        return self.measured(placement) if report else placement

    def measured(self, placement: Placement) -> Placement:
        """Return a placement of this solver with its report, made as :func:`~esh.solve` makes it.

        The report's steps, seconds and ``converged`` are those until now of what was done since the solver was made, or since its
        last :meth:`edit`; waiting between the calls does not count. After an edit ``converged`` is False where more steps of
        :meth:`run` would still move bodies a little.

        Args:
            placement: What :meth:`placement` has returned, since the last edit.

        Raises:
            ProblemError: It has other classes, numbers of bodies or another domain than the solver's problem; or some bodies are
                ghosts (:class:`BodyFlags`): what remains without them is not what the problem asks for.
        """
        self._check_open()
        check_is(placement, Placement, "`placement`")
        own, given = self.model.problem, placement.problem
        same = given.domain is own.domain or (not isinstance(own.domain, Surface) and given.domain == own.domain)
        if not same or _numbers(given) != _numbers(own):
            raise ProblemError(
                f"`placement` must be one of this solver since its last edit, with {_in_words(own)}, in the same domain; "
                f"got one with {_in_words(given)}"
            )
        if len(placement.position) != placement.problem.body_count:
            raise ProblemError("a placement without its ghosts has no report")
        return self._with_report(placement, self.heat)

    def _with_report(self, placement: Placement, heat: HeatMeshes | None, stopped: bool = False) -> Placement:
        done = self._record
        parting = Parting.DONE if done.parted else Parting.STOPPED if stopped else Parting.TO_COME
        with done:
            with self.launcher.phase("report"):
                report = measure(placement, self.launcher, heat, parting)
            converged = done.has_settled(self.model) and (report.clean or not placement.problem.avoid_overlap)
            report = replace(report, steps=done.steps, converged=converged, seconds=done.seconds)
        return replace(placement, report=report)

    def last_placement(self, *, stopped: bool = False) -> Placement:
        """Return :meth:`placement` with its report, for which it releases the memory that steps need.

        The solver can take no steps after that.

        Args:
            stopped: Whether somebody has stopped the run, as the report then says where bodies were not parted.
        """
        heat = self.heat
        if stopped:
            # Nothing more is improved then.
            self._placing.has_run = False
        placement = self.placement()
        # Whoever was told how the run goes may ask where bodies are even now.
        self._left_at = placement.position
        self._placing.let_go()
        return self._with_report(placement, heat, stopped)

    def close(self) -> None:
        """Release memory and threads; a ``launcher`` that was passed in stays open. See :class:`Solver` for what fails afterwards."""
        if self._closed:
            return
        # It may have failed before there was any.
        if placing := vars(self).get("_placing"):
            placing.close()
        if not self._is_shared:
            self.launcher.close()
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise ProblemError(CLOSED)

    def __enter__(self) -> Solver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _position(self) -> np.ndarray:
        return self._placing.positions() if self._left_at is None else self._left_at.copy()


def _numbers(problem: Problem) -> dict[str, int]:
    """How many bodies each class has, by its name."""
    return {body_class.name: body_class.body_count for body_class in problem.classes}


def _in_words(problem: Problem) -> str:
    """Number of bodies of every class: '120 of "pine" and 30 of "beech"'."""
    parts = [f"{count} of {show(name)}" for name, count in _numbers(problem).items()]
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))
