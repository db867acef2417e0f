"""Placing in the plane: a start for few and for rare bodies, natural borders, and edits."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from ..descent.convergence import TOLERANCE
from ..descent.descent import Descent
from ..device.launcher import Launcher
from ..edits.carried_descent import carried_poses, carry_turns, go_on_from, go_on_within
from ..edits.edit import EditInPlane
from ..edits.given_places import given_poses, lay_outlines
from ..edits.plane_settling import settle_in_plane
from ..edits.spread import spread_points
from ..errors import ProblemError
from ..model.body_flags import BodyFlags
from ..model.memory import check_memory
from ..model.model import Model
from ..model.natural_border import Kept, NaturalBorder
from ..model.state import State, StateArrays
from ..motion.carried_lines import carry_lines
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..space.part import Part
from .bookmarks import Bookmark
from .choice_of_start import choose_start, number_of_starts
from .ink import with_widths
from .placing import EditedBodies, GivenPlaces, Placing
from .rare_start import rare_starts, start_some
from .small_among_large import SmallAmongLarge, least_large_area, small_among_large

__all__ = ["PlacingInPlane"]

# If an edit changes the number of charges by more than this factor, up or down, the model gets another unit of length.
MOST_GROWTH = 1.5
# Steps that bodies take at most that are placed around large ones.
STEPS_OF_SMALL = 40
# Steps of these between two questions whether to go on.
WATCHED_STEPS = 4


class PlacingInPlane(Placing[Descent]):
    """Places bodies in a rectangle.

    With a natural border, bodies are placed beyond it as well, until :meth:`cut` drops them.
    """

    STATE: ClassVar[type[StateArrays]] = State

    def __init__(self, model: Model, launcher: Launcher) -> None:
        super().__init__(model, launcher)
        self._border: NaturalBorder | None = None
        self._is_fresh = False

    def new_descent(self) -> Descent:
        """A descent of the model whose bodies are where they start."""
        return Descent(self.model, self.launcher)

    def start(self, *, afresh: bool) -> None:
        """Make a descent. With a natural border its bodies are also those beyond; of a few the best of several starts is found."""
        problem, placed, rare = self.model.problem, self.model, None
        self._is_fresh = afresh
        if afresh and problem.rectangle.natural:
            self._border = NaturalBorder(self.launcher, problem)
            problem = self._border.problem
            check_memory(problem)
            placed = Model(problem)
        if afresh and number_of_starts(placed) < 2:
            rare = rare_starts(self.launcher, problem)
        self._descent = Descent(placed, self.launcher)
        if rare is not None:
            start_some(self._descent, rare)

    def start_from(self, state: StateArrays) -> None:
        """Continue from another state of the same problem; its values are copied."""
        self._is_fresh = self.has_run = False
        if self._leave_beyond():
            self._descent = self.new_descent()
        super().start_from(state)

    def start_at(self, places: GivenPlaces) -> None:
        """Make a descent whose bodies are at places.

        Without given angles and lengths they lie as they did. Of those that were placed beyond a border nothing is known.
        """
        self._is_fresh = self.has_run = False
        self._leave_beyond()
        before = None if self._descent is None else self._descent.state
        pose = given_poses(self.model, places.position, places.angle, places.length, before)
        self.let_go()
        self._descent = Descent(self.model, self.launcher, pose=pose)
        if places.angle is not None:
            lay_outlines(self._descent, places.angle)
        self._descent.place_charges()

    def edit(self, problem: Problem) -> EditedBodies:
        """Make the model and the descent of another problem in the same domain, with the bodies that are there."""
        before, old = self.model, self.descent.state
        small = self._small_among_large()
        problem = problem.with_clumps_of(before.problem)
        ratio = problem.charge_count / before.charge_count
        model = Model(problem, unit=before.unit if 1.0 / MOST_GROWTH < ratio < MOST_GROWTH else None)
        self._name_fixed(model)
        edit = EditInPlane(self.launcher, before, old.pose, model, self._spread)
        natural = problem.rectangle.natural
        if model.kinds or model.footprints.has_outlines or before.body.flagged or natural:
            carried = edit.finish(self.next_identity)
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
            carried = edit.finish(self.next_identity)
            model.carry(before, carried)
        descent.take_over_targets(self.descent)
        self._take(model, descent)
        descent.place_charges()
        settle = partial(settle_in_plane, descent, carried, before)
        if small is not None:
            # Whoever comes while these settle has a number that nobody has by now.
            self.next_identity = max(self.next_identity, int(carried.came.max(initial=-1)) + 1)
            return EditedBodies(carried.came, carried.went, partial(self._settle_small, settle, small))
        return EditedBodies(carried.came, carried.went, settle)

    def cut(self, go_on: Callable[[], bool] | None = None) -> None:
        """With a natural border, drop the bodies beyond it and even out the charge along the cut. Does nothing the second time.

        After a run, bodies that are much smaller than others are placed around these as well; see :mod:`.small_among_large`.

        Args:
            go_on: Called now and then; where it returns False small bodies stay where they are.
        """
        if self._border is not None:
            with self.launcher.phase("border"):
                border, self._border = self._border, None
                self._descent = go_on_within(self.descent, border, self.model)
        if self.has_run:
            self.has_run = False
            self._place_small_bodies(go_on)

    def _place_small_bodies(self, go_on: Callable[[], bool] | None) -> None:
        """Place small bodies around large ones: anew after a first run, from where they are after all others."""
        small, afresh = self._small_among_large(), self._is_fresh
        self._is_fresh = False
        if small is None:
            return
        # Where a class has no place beside large bodies, or memory is short, they stay as they came to lie while all moved at once.
        with suppress(ProblemError), self.launcher.phase("small bodies"), closing(self._around(small)) as around:
            if afresh:
                around.start(afresh=True)
            else:
                around.start_at(GivenPlaces(small.placement.position[small.rows], None, None, None, None))
            if around._take_steps(STEPS_OF_SMALL, go_on):
                around.cut(go_on)
                self._put(small.rows, around)

    def _small_among_large(self) -> SmallAmongLarge | None:
        """What is to be placed around large bodies; None where all are alike, or the large ones leave no place."""
        model = self.model
        if not math.isfinite(least_large_area(model.problem)):
            return None
        # Ghosts are in no placement, and whom somebody else holds stays where he is.
        if (model.body.flags & ~np.where(model.fixed, BodyFlags.PINNED, 0)).any():
            return None
        with suppress(ProblemError):
            small = small_among_large(self.descent.placement())
            if small is not None:
                check_memory(small.problem)
            return small
        return None

    def _around(self, small: SmallAmongLarge) -> PlacingInPlane:
        """A placing of small bodies under the numbers that they have here."""
        around = PlacingInPlane(Model(small.problem), self.launcher)
        around.take_identities(small.placement.id[small.rows], np.zeros(len(small.rows), bool))
        around.next_identity = max(self.next_identity, around.next_identity)
        return around

    def _put(self, rows: np.ndarray, around: PlacingInPlane) -> None:
        """Put bodies where another placing has them; fixed ones stay."""
        state, free = self.descent.state, ~self.model.fixed[rows]
        pose = state.pose.numpy().copy()
        pose[rows[free], :2] = around.positions()[free] / self.model.unit
        state.pose.assign(pose)
        if self.model.footprints.has_outlines:
            turn = state.turn.numpy().copy()
            turn[rows[free]] = around.descent.state.turn.numpy()[free]
            state.turn.assign(turn)
        self.descent.place_charges()

    def _settle_small(
        self, settle: Callable[[int], object], before: SmallAmongLarge, steps: int
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Settle after an edit; then small bodies do so around the large ones, as those who were placed around them before.

        Args:
            settle: Takes so many steps with all bodies.
            before: What was placed around large bodies before the edit.
            steps: To take.

        Returns:
            Identities of bodies that have come and gone in the edit; None where they are those that came and went before.
        """
        settle(steps)
        after = self._small_among_large()
        if after is None:
            return None
        with suppress(ProblemError), self.launcher.phase("small bodies"), closing(self._around(before)) as around:
            around.start_at(GivenPlaces(before.placement.position[before.rows], None, None, None, None))
            around.edit(after.problem).settle(steps)
            self._take_over(after.rows, around)
            now, then = self.model.body.identity, before.placement.id
            return np.setdiff1d(now, then), np.setdiff1d(then, now)
        return None

    def _take_over(self, rows: np.ndarray, around: PlacingInPlane) -> None:
        """Have some rows be the bodies of another placing after an edit of that: their places, numbers and outlines."""
        model, free = self.model, ~self.model.fixed[rows]
        identity = np.array(model.body.identity, np.int32)
        identity[rows[free]] = around.model.body.identity[free]
        model.body = replace(model.body, identities=identity)
        self.next_identity = max(self.next_identity, around.next_identity)
        if model.footprints.has_outlines:
            variant, scale = np.array(model.footprints.variant), np.array(model.footprints.scale)
            variant[rows[free]] = around.model.footprints.variant[free]
            scale[rows[free]] = around.model.footprints.scale[free]
            model.take_outlines(model.footprints.with_outlines(variant, scale))
            # Kernels have outlines, and how these lean, from the start of a descent.
            before = self.descent
            self._descent = go_on_from(before, model, self.positions(), np.arange(model.body_count))
            self._descent.take_over_targets(before)
        self._put(rows, around)

    def _take_steps(self, most: int, go_on: Callable[[], bool] | None = None) -> bool:
        """Take steps until bodies have settled, or ``most`` are taken; return False where ``go_on`` did before."""
        descent, corrections, step = self.descent, self.corrections(most), 0
        while step < most:
            if go_on is not None and not go_on():
                return False
            until = corrections[0] if corrections else most
            many = until - step if go_on is None else min(until - step, WATCHED_STEPS)
            # Before the second step nothing has shown yet whether bodies rest.
            many = many if step else 1
            step += descent.step.play(many, descent.direction.settled(TOLERANCE))
            rests = step > 1 and descent.direction.residual() < TOLERANCE
            if corrections and (rests or step >= until):
                del corrections[0]
                descent.correct_targets()
            elif rests:
                break
        self.has_run = True
        return True

    def return_to(self, bookmark: Bookmark) -> None:
        """Return to the problem and the bodies of a bookmark, which knows no border."""
        self._border, self._is_fresh, self.has_run = None, False, False
        super().return_to(bookmark)

    def positions(self) -> np.ndarray:
        """Where the bodies are [m], shape ``[body_count, 2]``; with a natural border those within."""
        return super().positions() if self._border is None else self._kept(self._border).position

    def choose_start(self, max_steps: int, go_on: Callable[[], bool] | None) -> int:
        """With few bodies, choose the best of several starts, and return its number."""
        return choose_start(self.descent, max_steps, TOLERANCE, go_on)

    def finished(self, placement: Placement) -> Placement:
        """A placement whose lines are as wide as their ink asks for, where they may overlap."""
        model = self.model
        # Ghosts cover ground but are not in the placement, so widths would come out wrong; bodies that keep apart need no correction.
        if not model.kinds or model.problem.avoid_overlap or (model.body.flags & BodyFlags.GHOST).any():
            return placement
        with self.launcher.phase("widths"):
            return replace(placement, width=with_widths(placement, self.launcher))

    def _kept(self, border: NaturalBorder) -> Kept:
        """Which bodies are within a natural border, and where."""
        return border.cut(self.descent.positions(), self.model)

    def _leave_beyond(self) -> bool:
        """With a natural border, discard all bodies placed so far, as new positions follow; return whether there was a border."""
        if self._border is None:
            return False
        self._border = None
        self.let_go()
        return True

    def _spread(
        self, densities: list[np.ndarray], counts: list[int], part: Part | None
    ) -> Callable[[], list[np.ndarray]]:
        problem = self.model.problem
        seed = int(self._randomness(problem).integers(1 << 31))
        return spread_points(self.launcher, problem.rectangle, densities, counts, seed, part)
