"""A run, step by step: compile the problem, take or make a state, step until settled, read the placement."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import TracebackType
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ..descent.convergence import LAST_STEPS, TOLERANCE, is_settled
from ..descent.descent import Descent
from ..descent.surface_descent import SurfaceDescent
from ..descent.surface_least_spacing import keep_least_spacing
from ..descent.surface_placement import points_of
from ..device.devices import resolve_device
from ..device.launcher import Launcher
from ..device.profile import Profile
from ..edits.carried_descent import carried_poses, carry_turns, go_on_from
from ..edits.edit import EditInPlane, in_order
from ..edits.given_places import checked_identities, checked_places, given_outlines, given_poses, lay_outlines
from ..edits.plane_settling import settle_in_plane
from ..edits.spread import Spreading
from ..edits.surface_edit import carry_over_on_surface
from ..edits.surface_settling import settle_on_surface
from ..edits.surface_spreading import SpreadingOnSurface
from ..errors import ProblemError, Reason, Refusal
from ..heat.heat_mesh import HeatMeshes
from ..model.body_flags import BodyFlags, checked_flags
from ..model.carried_over import CarriedInPlane, CarriedOver
from ..model.identities_of_fixed import identities_of_fixed
from ..model.looking import LOOKS_AWAY, angle_within, looks_at_point, somebody_looks
from ..model.memory import check_memory
from ..model.model import Model
from ..model.natural_border import STEPS_WITHIN, Kept, NaturalBorder, smoothing
from ..model.state import State, StateArrays, SurfaceState
from ..model.surface_places import PlacesOnSurface, spots_of_places
from ..motion.carried_lines import carry_lines
from ..problem.domain import Domain
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.surface import Surface
from ..problem.validation import check_count, check_is, check_progress
from ..space.part import Part
from .choice_of_start import choose_start, number_of_starts
from .ink import with_widths
from .progress import Progress, is_stop
from .rare_start import rare_starts, start_some
from .surface_rare_start import rare_start_on_surface

__all__ = ["Bookmark", "Edit", "Solver"]

# Message of the error that is raised when forces overflow float32, although the problem was checked before.
OVERFLOW = (
    "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart; bring them "
    "nearer to each other"
)
CLOSED = "this Solver has given its last placement, or was closed; make another one to go on"
# Targets on a surface are corrected after these shares of a run's steps, and only in runs of at least so many steps.
CORRECTED_AFTER = (0.3, 0.5, 0.7, 0.85, 0.93)
FEWEST_CORRECTED = 40
# Steps after an edit, behind those in which bodies settle.
EDIT_STEPS = 5
# If an edit changes the number of charges by more than this factor, up or down, the model gets another unit of length.
MOST_GROWTH = 1.5
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


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A solver's problem and bodies at some point, kept so that it can return there: see :meth:`Solver.bookmark`.

    Attributes:
        model: The compiled problem.
        descent: The descent, with the state of the bodies.
        next_identity: The identity that the next new body would have got.
    """

    model: Model
    descent: Descent | SurfaceDescent
    next_identity: int


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
        model: The compiled problem.
        launcher: Runs the kernels, on threads or on a GPU.
        descent: The bodies' state, and the kernels that one step launches.

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
        self._bookmarks: list[Bookmark] = []
        try:
            check_is(problem, Problem, "`problem`")
            if state is not None:
                check_is(state, SurfaceState if isinstance(problem.domain, Surface) else State, "`state`")
            if flags is not None:
                flags = checked_flags(flags, problem.body_count)
            check_memory(problem)
            with self.launcher.phase("set-up"):
                self.model = placed = Model(problem, flags)
                on_surface = isinstance(problem.domain, Surface)
                afresh = state is None and flags is None and at is None
                self._border: NaturalBorder | None = None
                if afresh and isinstance(problem.domain, Domain) and problem.domain.natural:
                    self._border = NaturalBorder(self.launcher, problem)
                    problem = self._border.problem
                    check_memory(problem)
                    placed = Model(problem)
                rare = None
                self.descent: Descent | SurfaceDescent
                self._spreading = SpreadingOnSurface()
                self._spreads, self._next_identity = 0, int(self.model.body.identity.max()) + 1
                if at is not None:
                    self.start_at(**at)
                elif on_surface:
                    start = rare_start_on_surface(self.launcher, problem) if afresh else None
                    self.descent = SurfaceDescent(placed, self.launcher, start)
                else:
                    # Of a few bodies the best of several starts is found.
                    if afresh and number_of_starts(placed) < 2:
                        rare = rare_starts(self.launcher, problem)
                    self.descent = Descent(placed, self.launcher)
                if state is not None:
                    self.start_from(state)
                elif rare is not None:
                    assert isinstance(self.descent, Descent)
                    start_some(self.descent, rare)
        except BaseException:
            self.close()
            raise

    def _cut(self) -> None:
        """With a natural border, drop the bodies beyond it and even out the charge along the cut. Does nothing the second time."""
        if self._border is None:
            return
        with self.launcher.phase("border"):
            border, kept, before = self._border, self._cut_position(), self.descent
            assert isinstance(before, Descent)
            self._border = None
            blur, steps = smoothing(self.model.charge.charge)
            smooth = go_on_from(before, self.model, kept.position, kept.source, turned=border.turn, smooth=blur)
            smooth.step.play(steps)
            position = smooth.positions()
            close = position[smooth.close_bodies()]
            self.descent = go_on_from(smooth, self.model, position, np.arange(self.model.body_count), close=close)
            self.descent.step.play(STEPS_WITHIN)

    def _leave_beyond(self) -> bool:
        """With a natural border, discard all bodies placed so far, as new positions follow; return whether there was a border."""
        if self._border is None:
            return False
        self._border = None
        self.launcher.release(self.descent.step)
        return True

    def _cut_position(self) -> Kept:
        """Which bodies are within a natural border, and where."""
        assert self._border is not None and isinstance(self.descent, Descent)
        return self._border.cut(self.descent.positions(), self.model)

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
        self._cut()
        domain = self.model.problem.domain
        if isinstance(domain, Surface) and problem.domain is not domain:
            raise ProblemError("`domain` must stay the same Surface in an edit; got another one")
        if problem.domain != domain:
            raise ProblemError(f"`domain` must stay what it was in an edit, {domain}; got {problem.domain}")
        check_memory(problem)
        with self.launcher.phase("set-up"):
            if isinstance(self.descent, SurfaceDescent):
                added, removed, take_steps = self._edit_on_surface(problem, self.descent)
            else:
                before = self.model
                carried = self._edit_in_rectangle(problem, self.descent)
                added, removed = carried.came, carried.went
                take_steps = partial(settle_in_plane, self.descent, carried, before)
        self._next_identity = max(self._next_identity, int(added.max(initial=-1)) + 1)
        if steps:
            take_steps(steps)
            self._stepped(steps)
        if steps or problem.avoid_overlap:
            self.separate(again=True)
        return Edit(in_order(added), in_order(removed), steps)

    def _edit_on_surface(
        self, problem: Problem, before_edit: SurfaceDescent
    ) -> tuple[np.ndarray, np.ndarray, Callable[[int], None]]:
        """Make a model and a descent of what is to be placed now.

        Returns the identities of bodies that are new, and gone; and what takes the steps after the edit.
        """
        before, old = self.model, before_edit.state
        model = Model(problem, unit=before.unit)
        self._name_fixed(before, model)
        points = points_of(self.launcher, before_edit.facets, old)
        self._spreads += 1
        rng = np.random.default_rng([problem.seed, 4, self._spreads])
        made: list[tuple[CarriedOver, np.ndarray]] = []

        def start(new: SurfaceDescent) -> None:
            carried, spots = carry_over_on_surface(
                before, points, model, new.facets, new.share, self._next_identity, rng, self._spreading
            )
            model.carry(before, carried)
            made.append((carried, new.take_over(carried.source, spots, before, old)))

        descent = SurfaceDescent(model, self.launcher, start, before_edit)
        # Not before: what is refused leaves the solver as it is.
        self._let_go(before_edit)
        self.model, self.descent = model, descent
        carried, stood = made[0]
        take_steps = partial(settle_on_surface, self.descent, stood, carried.left)
        return model.body.identity[carried.source < 0], before.body.identity[carried.gone], take_steps

    def _edit_in_rectangle(self, problem: Problem, before_edit: Descent) -> CarriedInPlane:
        """The same in the plane."""
        before = self.model
        ratio = problem.charge_count / before.charge_count
        model = Model(problem, unit=before.unit if 1.0 / MOST_GROWTH < ratio < MOST_GROWTH else None)
        self._name_fixed(before, model)
        old = before_edit.state
        edit = EditInPlane(self.launcher, before, old.pose, model, self._spread)
        natural = problem.rectangle.natural
        if model.kinds or model.footprints.has_outlines or before.body.flagged or natural:
            carried = edit.finish(self._next_identity)
            model.carry(before, carried)
            descent = Descent(
                model,
                self.launcher,
                pose=carried_poses(before, old, model, carried),
                stirred=carried.pose.numpy()[carried.new, :2] if natural else None,
            )
            if before.kinds and model.kinds:
                carry_lines(before, old, model, descent.state, carried.source)
            carry_turns(before, old, model, descent.state, carried)
        else:
            # All that such bodies bring with them is where they are: the rest is made while a GPU spreads points.
            descent = Descent(model, self.launcher, pose=edit.pose)
            carried = edit.finish(self._next_identity)
            model.carry(before, carried)
        self._let_go(self.descent)
        self.model, self.descent = model, descent
        descent.place_charges()
        return carried

    def _name_fixed(self, before: Model, model: Model) -> None:
        """Give the fixed bodies of an edit's model identities that nobody else has."""
        if model.has_fixed:
            fixed, self._next_identity = identities_of_fixed(before, model, self._next_identity)
            identity = model.body.identity.copy()
            identity[model.fixed] = fixed
            model.body = replace(model.body, identities=identity)

    def bookmark(self) -> Bookmark:
        """Return a bookmark of the problem and its bodies, which :meth:`go_back` returns to after any number of edits.

        It keeps the memory that steps need, until it is dropped or the solver is closed. It does not copy the bodies: steps taken
        before the next edit move those of the bookmark, too.
        """
        self._cut()
        self._bookmarks.append(Bookmark(self.model, self.descent, self._next_identity))
        return self._bookmarks[-1]

    def go_back(self, bookmark: Bookmark) -> None:
        """Return to the problem and the bodies of a bookmark. Takes no time, as nothing is compiled or computed again.

        Raises:
            ProblemError: It is another solver's, or was dropped.
        """
        self._check_bookmark(bookmark)
        self._border, before = None, self.descent
        self.model, self.descent = bookmark.model, bookmark.descent
        # Who came since has an identity that nobody else gets.
        self._next_identity = max(self._next_identity, bookmark.next_identity)
        if before is not self.descent:
            self._let_go(before)

    def drop(self, bookmark: Bookmark) -> None:
        """Delete a bookmark and release its memory.

        Raises:
            ProblemError: It is another solver's, or was dropped.
        """
        self._check_bookmark(bookmark)
        self._bookmarks = [one for one in self._bookmarks if one is not bookmark]
        if bookmark.descent is not vars(self).get("descent"):
            self._let_go(bookmark.descent)

    def _check_bookmark(self, bookmark: object) -> None:
        self._check_open()
        check_is(bookmark, Bookmark, "`bookmark`")
        if all(one is not bookmark for one in self._bookmarks):
            raise ProblemError("`bookmark` must be one of this Solver that was not dropped")

    def _let_go(self, descent: Descent | SurfaceDescent) -> None:
        """Release a descent that this solver does not need, unless a bookmark holds it."""
        if all(one.descent is not descent for one in self._bookmarks):
            self.launcher.release(descent.step)

    @property
    def state(self) -> State | SurfaceState:
        """The current state. It changes with every step, so copy it to keep it.

        With a natural border, this drops the bodies beyond it, as :meth:`placement` does.
        """
        self._cut()
        return self.descent.state

    def start_from(self, state: State | SurfaceState) -> None:
        """Continue from another state of the same problem; its values are copied."""
        if self._leave_beyond():
            self.descent = Descent(self.model, self.launcher)
        on_surface = isinstance(self.descent, SurfaceDescent)
        check_is(state, SurfaceState if on_surface else State, "`state`")
        own: StateArrays = self.descent.state
        own.check(state)
        if state.unit[0] != self.model.unit:
            # One that has seen edits may be in that of the problem before them.
            self._let_go(self.descent)
            self.model = self.model.in_unit(float(state.unit[0]))
            self.descent = (SurfaceDescent if on_surface else Descent)(self.model, self.launcher)
            own = self.descent.state
        own.assign(state)
        self.descent.place_charges()

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
            identity = checked_identities(model, identity)
            model.body = replace(model.body, identities=identity)
            self._next_identity = int(identity.max()) + 1
        if variant is not None or scale is not None:
            model.take_outlines(given_outlines(model, variant, scale))
        before = vars(self).get("descent")
        if not isinstance(model.problem.domain, Surface):
            # Of those that are placed beyond a border, too, nothing is known here.
            self._start_in_rectangle(None if self._leave_beyond() else before, position, angle, length)
            return
        if before is not None:
            self._let_go(before)
        n = model.body_count
        known = PlacesOnSurface(
            position,
            np.zeros(n, np.int64),
            np.full(n, -1) if triangle is None or barycentric is None else triangle,
            np.zeros((n, 3)) if barycentric is None else barycentric,
        )

        def start(new: SurfaceDescent) -> None:
            new.put_at(spots_of_places(self.launcher, new.facets, known, "`position`"), angle, length)

        self.descent = SurfaceDescent(model, self.launcher, start)

    def _start_in_rectangle(
        self, before: Descent | None, position: np.ndarray, angle: np.ndarray | None, length: np.ndarray | None
    ) -> None:
        """See :meth:`start_at`."""
        pose = given_poses(self.model, position, angle, length, None if before is None else before.state)
        if before is not None:
            self._let_go(before)
        self.descent = Descent(self.model, self.launcher, pose=pose)
        if angle is not None:
            lay_outlines(self.descent, angle)
        self.descent.place_charges()

    def step(self, count: int = 1) -> float:
        """Take ``count`` steps, and return the residual after the last one: see :attr:`Progress.residual`.

        Raises:
            ProblemError: A force is not finite, or ``count`` is not a valid number of steps.
        """
        count = check_count(count, "`count`")
        self.descent.step.play(count)
        return self._stepped(count)

    def _stepped(self, count: int) -> float:
        """Count steps that were taken, and return the residual."""
        self.descent.state.steps += count
        with self.launcher.phase("readback"):
            residual = self.descent.direction.residual()
        if math.isnan(residual):
            raise ProblemError(OVERFLOW, Refusal(Reason.FORCES_NOT_FINITE, 1, 0))
        return residual

    def run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> tuple[int, bool]:
        """Take steps until bodies have settled, ``max_steps`` are taken or ``progress`` returns False.

        Returns:
            The number of steps taken, and whether bodies have settled.
        """
        max_steps = check_count(max_steps, "`max_steps`")
        check_progress(progress)
        residuals: deque[float] = deque(maxlen=LAST_STEPS)
        step = 0
        corrections = self._corrections(max_steps)
        while step < max_steps:
            until = corrections[0] if corrections else max_steps
            # Without a progress callback, many steps run without returning to Python, and a GPU's residual is not read after each.
            many = 1
            if progress is None:
                unwatched = max(min(until, max_steps - LAST_STEPS) - step, 1)
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
                assert isinstance(self.descent, SurfaceDescent)
                self.descent.correct_targets()
            elif rests:
                return step, True
        return max_steps, step > 1 and is_settled(self.model, float(np.median(residuals)))

    def _corrections(self, max_steps: int) -> list[int]:
        """After which steps of a run the targets are corrected, in their order; sooner where bodies have come to rest."""
        descent = self.descent
        if max_steps < FEWEST_CORRECTED or not isinstance(descent, SurfaceDescent) or not descent.corrects_targets:
            return []
        return [round(share * max_steps) for share in CORRECTED_AFTER]

    @property
    def heat(self) -> HeatMeshes | None:
        """Meshes for smoothing along the surface, which the report can use again; None in the plane."""
        return self.descent.heat if isinstance(self.descent, SurfaceDescent) else None

    def choose_start(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> int:
        """With few bodies, choose the one of several starts from which the least energy is reached; see :mod:`.choice_of_start`.

        Args:
            max_steps: Steps that the run will take at most.
            progress: Called between starts, with step 0. Returning False ends the search, and the best of those tried is taken.

        Returns:
            Number of the chosen start. 0 is the first one, which all runs of many bodies use.
        """
        descent = self.descent
        if not isinstance(descent, Descent):
            return 0

        def go_on() -> bool:
            assert progress is not None
            return not is_stop(progress(Progress(0, max_steps, descent.direction.residual(), self._position)))

        return choose_start(descent, max_steps, TOLERANCE, None if progress is None else go_on)

    def separate(self, go_on: Callable[[], bool] | None = None, *, again: bool = False) -> bool:
        """Part outlines that still overlap, if the problem avoids overlap. On a surface, part bodies of a class that are too close.

        Args:
            go_on: Called now and then; returning False stops.
            again: Whether outlines were parted before. Then as few bodies as possible are moved.

        Returns:
            Whether no outlines overlap that are to keep apart; True if the problem allows overlap.
        """
        self._cut()
        self._face(0.0)
        if isinstance(self.descent, SurfaceDescent):
            keep_least_spacing(self.descent, go_on)
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

    def placement(self) -> Placement:
        """Return the bodies where they are now, without a report.

        With a natural border, this drops the bodies beyond it for good: later steps treat the border as open.

        Raises:
            ProblemError: A position is not finite.
        """
        self._cut()
        placement = self.descent.placement()
        # A single position that is not finite makes the sum not finite.
        if not np.isfinite(placement.position.sum()):
            raise ProblemError(OVERFLOW, Refusal(Reason.FORCES_NOT_FINITE, 1, 0))
        drawn = bool(self.model.kinds) and not isinstance(self.model.problem.domain, Surface)
        # Ghosts cover ground but are not in the placement, so widths would come out wrong; bodies that keep apart need no correction.
        if drawn and not self.model.problem.avoid_overlap and not (self.model.body.flags & BodyFlags.GHOST).any():
            with self.launcher.phase("widths"):
                placement = replace(placement, width=with_widths(placement, self.launcher))
        return placement

    def last_placement(self) -> Placement:
        """Return :meth:`placement`, and release the memory that steps need, so that the report can use it.

        The solver can take no steps after that.
        """
        placement = self.placement()
        # Whoever was told how the run goes may ask where bodies are even now.
        self._left_at = placement.position
        self._let_go(self.descent)
        del self.descent
        return placement

    def close(self) -> None:
        """Release memory and threads; a ``launcher`` that was passed in stays open. See :class:`Solver` for what fails afterwards."""
        if self._closed:
            return
        for bookmark in self._bookmarks.copy():
            self.drop(bookmark)
        if "descent" in vars(self):
            self.launcher.release(self.descent.step)
            del self.descent
        if not self._is_shared:
            self.launcher.close()
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise ProblemError(CLOSED)

    def __getattr__(self, name: str) -> NoReturn:
        # Only what is missing is asked for here.
        if name == "descent":
            raise ProblemError(CLOSED)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __enter__(self) -> Solver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _spread(
        self, densities: list[np.ndarray], counts: list[int], part: Part | None
    ) -> Callable[[], list[np.ndarray]]:
        # Equal edits one after the other are to differ.
        self._spreads += 1
        problem = self.model.problem
        seed = int(np.random.default_rng([problem.seed, 4, self._spreads]).integers(1 << 31))
        return Spreading(self.launcher, problem.rectangle, densities, counts, seed, part).points

    def _position(self) -> np.ndarray:
        if self._left_at is not None:
            return self._left_at.copy()
        if self._border is not None:
            return self._cut_position().position
        return self.descent.positions()
