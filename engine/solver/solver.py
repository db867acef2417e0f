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
from ..model.state import State
from ..model.state_arrays import StateArrays
from ..model.surface_places import PlacesOnSurface, spots_of_places
from ..motion.carried_lines import carry_lines
from ..motion.surface_state import SurfaceState
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

# What is said where numbers leave the range of float32 all the same.
OVERFLOW = (
    "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart; bring them "
    "nearer to each other"
)
CLOSED = "this Solver has given its last placement, or was closed; make another one to go on"
# After which shares of a run's steps targets on a surface are corrected, and the fewest steps of a run in which they are.
CORRECTED_AFTER = (0.3, 0.5, 0.7, 0.85, 0.93)
FEWEST_CORRECTED = 40
# Steps after an edit, behind those in which bodies settle.
EDIT_STEPS = 5
# An edit that makes so many times more or fewer charges gets another unit of length.
MOST_GROWTH = 1.5
# Steps on a GPU between two looks at how far bodies still move, where nobody wants to hear of each.
STEPS_UNWATCHED = 50
# Outlines that look past the point of their class are turned and parted again so many times at most: in crowds one body or the other
# is always moved far, and trading places is what makes room.
MOST_FACINGS = 4


class Edit(NamedTuple):
    """What an edit did to bodies, by their identities.

    Attributes:
        added: Those that are new.
        removed: Those that are gone.
        steps: Steps taken.
    """

    added: np.ndarray
    removed: np.ndarray
    steps: int


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A problem and its bodies as a :class:`Solver` had them before an edit, ready to go on: see :meth:`Solver.bookmark`."""

    model: Model
    descent: Descent | SurfaceDescent
    next_identity: int


class Solver:
    """Places the bodies of a problem, step by step; :func:`~esh.engine.solve.solve` does all of it at once.

    Use it in a ``with`` block, or call :meth:`close`: it has threads of its own. After that everything raises a ProblemError.

    Args:
        problem: What to place where.
        device: ``"auto"`` (an NVIDIA GPU where there is one), ``"cpu"`` or ``"cuda:0"``.
        state: Where to go on from, of a solver of the same problem; by default bodies start on a Hilbert curve.
        profile: Gets the seconds that every phase takes.
        flags: :class:`~.body_flags.BodyFlags` of every body, shape ``[body_count]``; by default none is special.
        launcher: Where to run, instead of ``device`` and ``profile``; it is left open.
        at: Where bodies are, by the names of what :meth:`start_at` takes: the same as calling that next, in half the time.

    Attributes:
        model: The compiled problem.
        launcher: Where it runs.
        descent: What its steps consist of.

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
        """Where the border is natural, let go of what was placed beyond it, and even out what that leaves along it."""
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
        """Forget what was placed beyond a natural border, and within it, for bodies to start elsewhere; tell whether that was done."""
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
        """Go on with another problem in the same domain from where bodies are.

        Other densities, counts, sizes, classes, obstacles and fixed bodies are followed. Where a class's density fell, its surplus is
        taken out, and set down where it rose. Then bodies settle, four fifths of them within a tenth of a spacing of where they were,
        fewer where more than a tenth of all came or went, or outlines that cover half of the ground are parted: see :mod:`.settling`.
        Bodies keep their :attr:`Placement.id`.

        Args:
            problem: What is to be placed now. Classes and sizes are the same as before if their names are; a fixed body with the
                ``id`` of one that is there is that body, pinned or moved.
            steps: Steps to take once bodies have settled, 0 or more; those of :meth:`run` leave all bodies free, and stir more of them
                for little. With 0 nobody settles, either.

        Returns:
            Who came and who went.

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
        """Return what :meth:`go_back` takes to have problem and bodies as they are now, whatever is edited until then.

        It holds all that steps need, until it is dropped or the solver closed. Steps that are taken before the next edit count.
        """
        self._cut()
        self._bookmarks.append(Bookmark(self.model, self.descent, self._next_identity))
        return self._bookmarks[-1]

    def go_back(self, bookmark: Bookmark) -> None:
        """Have problem and bodies as they were where the bookmark is; nothing needs to be set up for that.

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
        """Let go of what a bookmark holds.

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
        """Where the bodies are now; it changes with every step, so copy it to keep it.

        Where the border is natural, this lets go of what is beyond, as :meth:`placement` does.
        """
        self._cut()
        return self.descent.state

    def start_from(self, state: State | SurfaceState) -> None:
        """Go on from another state of the same problem."""
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
        """Go on from where somebody has put the bodies: from a placement that was kept without its state.

        Args:
            position: Where they are [m], in the order of a placement, shape ``[body_count, 2]``; those outside go to the border. On a
                surface shape ``[body_count, 3]``. Fixed bodies stay where the problem says.
            angle: How they lie [rad], as a placement says it, shape ``[body_count]``; None as they would begin.
            length: Lengths of lines [m], shape ``[body_count]``; None, or 0, as they would begin.
            identity: Their :attr:`Placement.id`, shape ``[body_count]``; None for those that they have.
            variant: Which of the outlines of their sizes they have, shape ``[body_count]``; None for those of the problem.
            scale: Factors on these outlines, shape ``[body_count]``; None for those of the problem.
            triangle: On a surface of one mesh, the triangles that they are on, -1 where that is not known, shape
                ``[body_count]``; None for those that are nearest.
            barycentric: Weights of these triangles' corners, shape ``[body_count, 3]``.

        Raises:
            ProblemError: Another number of bodies, a place that is no finite number or not on the surface, identities that are none.
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
        """Take steps; return the residual, see :class:`Progress`.

        Raises:
            ProblemError: A force is no finite number, or ``count`` is no number of steps.
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
        """Step until bodies have settled, ``max_steps`` are taken or ``progress`` returns False.

        Returns:
            The steps taken, and whether bodies have settled.
        """
        max_steps = check_count(max_steps, "`max_steps`")
        check_progress(progress)
        residuals: deque[float] = deque(maxlen=LAST_STEPS)
        step = 0
        corrections = self._corrections(max_steps)
        while step < max_steps:
            until = corrections[0] if corrections else max_steps
            # With nobody watching, steps follow each other without Python, and a GPU need not be asked after each how it goes.
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
        """Meshes that heat spreads on, for a report to take again; None in the plane."""
        return self.descent.heat if isinstance(self.descent, SurfaceDescent) else None

    def choose_start(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> int:
        """Of a few bodies, go to where the least energy is reached from within ``max_steps``; see :mod:`.choice_of_start`.

        Args:
            max_steps: Steps that the run will take at most.
            progress: Called between starts, with none of the run's steps taken; returning False leaves it at those that were tried.

        Returns:
            Which of several starts it is; 0 is the one that every run begins with.
        """
        descent = self.descent
        if not isinstance(descent, Descent):
            return 0

        def go_on() -> bool:
            assert progress is not None
            return not is_stop(progress(Progress(0, max_steps, descent.direction.residual(), self._position)))

        return choose_start(descent, max_steps, TOLERANCE, None if progress is None else go_on)

    def separate(self, go_on: Callable[[], bool] | None = None, *, again: bool = False) -> bool:
        """Part outlines that still overlap, where they are to keep apart at all; returns whether none do any more.

        On a surface points of one class are parted that are closer than any should be.

        Args:
            go_on: Called now and then; returning False ends it.
            again: Whether they were parted before, and what has changed since is to stir as few of them as it can.
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
        """The bodies where they are now; its report is empty.

        Where the border is natural, this lets go of the bodies beyond it: steps that are taken afterwards are those of an open border.

        Raises:
            ProblemError: A position is no finite number.
        """
        self._cut()
        placement = self.descent.placement()
        # One that is not makes their sum so, too.
        if not np.isfinite(placement.position.sum()):
            raise ProblemError(OVERFLOW, Refusal(Reason.FORCES_NOT_FINITE, 1, 0))
        drawn = bool(self.model.kinds) and not isinstance(self.model.problem.domain, Surface)
        # Ghosts, of which a placement has none, would be missing; and what is kept apart does not overlap.
        if drawn and not self.model.problem.avoid_overlap and not (self.model.body.flags & BodyFlags.GHOST).any():
            with self.launcher.phase("widths"):
                placement = replace(placement, width=with_widths(placement, self.launcher))
        return placement

    def last_placement(self) -> Placement:
        """Return what :meth:`placement` does, and let go of what steps need, so that a report can have the memory.

        Nothing can be stepped after that.
        """
        placement = self.placement()
        # Whoever was told how the run goes may ask where bodies are even now.
        self._left_at = placement.position
        self._let_go(self.descent)
        del self.descent
        return placement

    def close(self) -> None:
        """Give the threads back, unless they are somebody else's; of a solver that is closed nothing can be asked."""
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
