"""What a solver does alike in the plane and on a surface, and what each of them does in its own way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, Generic, NamedTuple, TypeVar, cast

import numpy as np

from ..descent.descent import Descent
from ..descent.surface_descent import SurfaceDescent
from ..device.launcher import Launcher
from ..edits.given_places import checked_identities
from ..errors import ProblemError
from ..heat.heat_mesh import HeatMeshes
from ..model.identities_of_fixed import identities_of_fixed
from ..model.model import Model
from ..model.state import StateArrays
from ..problem.given_values import check_is
from ..problem.placement import Placement
from ..problem.problem import Problem
from .bookmarks import Bookmark, Bookmarks

__all__ = ["CLOSED", "EditedBodies", "GivenPlaces", "Placing"]

CLOSED = "this Solver has given its last placement, or was closed; make another one to go on"

# Targets are corrected after these shares of a run's steps, and only in runs of at least so many steps.
CORRECTED_AFTER = (0.3, 0.5, 0.7, 0.85, 0.93)
FEWEST_CORRECTED = 40

AnyDescent = TypeVar("AnyDescent", Descent, SurfaceDescent)


class GivenPlaces(NamedTuple):
    """Where somebody puts the bodies: see :meth:`.Solver.start_at`."""

    position: np.ndarray
    angle: np.ndarray | None
    length: np.ndarray | None
    triangle: np.ndarray | None
    barycentric: np.ndarray | None


class EditedBodies(NamedTuple):
    """What an edit changed.

    Attributes:
        added: Identities of bodies that are new.
        removed: Identities of bodies that are gone.
        settle: Takes so many steps after the edit. It returns who is new and who is gone then, or None where that has not changed.
    """

    added: np.ndarray
    removed: np.ndarray
    settle: Callable[[int], tuple[np.ndarray, np.ndarray] | None]


class Placing(ABC, Generic[AnyDescent]):
    """Places the bodies of a model in one kind of domain, for a :class:`~.solver.Solver`.

    Args:
        model: The compiled problem.
        launcher: Runs the kernels.

    Attributes:
        model: The compiled problem; another one after an edit.
        next_identity: The identity that the next new body gets.
        bookmarks: What the solver can return to.
        has_run: Whether a run has come to its end since the bodies were last cut.
        STATE: What a state is here.
    """

    STATE: ClassVar[type[StateArrays]]

    def __init__(self, model: Model, launcher: Launcher) -> None:
        self.model, self.launcher = model, launcher
        self.next_identity = int(model.body.identity.max()) + 1
        self.bookmarks = Bookmarks(launcher)
        self._descent: AnyDescent | None = None
        self.has_run = False
        self._edits = 0

    @property
    def descent(self) -> AnyDescent:
        """The bodies' state, and the kernels that one step launches."""
        if self._descent is None:
            raise ProblemError(CLOSED)
        return self._descent

    @abstractmethod
    def new_descent(self) -> AnyDescent:
        """A descent of the model whose bodies are where they start."""

    @abstractmethod
    def start(self, *, afresh: bool) -> None:
        """Make a descent. ``afresh`` is whether bodies find their own start, and no state or flags are given."""

    @abstractmethod
    def start_at(self, places: GivenPlaces) -> None:
        """Make a descent whose bodies are at places."""

    @abstractmethod
    def edit(self, problem: Problem) -> EditedBodies:
        """Make the model and the descent of another problem in the same domain, with the bodies that are there."""

    def start_from(self, state: StateArrays) -> None:
        """Continue from another state of the same problem; its values are copied."""
        check_is(state, self.STATE, "`state`")
        own: StateArrays = self.descent.state
        own.check(state)
        if state.identity is not None and state.identity.shape != (self.model.body_count,):
            raise ProblemError("`identity` must have one number for every body: this is the state of another problem")
        if state.unit[0] != self.model.unit:
            # One that has seen edits may be in that of the problem before them.
            self.let_go()
            self.model = self.model.in_unit(float(state.unit[0]))
            self._descent = self.new_descent()
        if state.identity is None:
            self.model.body = replace(self.model.body, identities=self.model.given_identities())
        else:
            # Fixed bodies have the identities that the problem names, if it names any.
            named = self.model.fixed.copy()
            named[named] = self.model.problem.fixed.id >= 0
            self.take_identities(state.identity, named)
        self.descent.continue_from(state)

    def take_identities(self, identity: np.ndarray, own: np.ndarray) -> None:
        """Give bodies identities, shape ``[body_count]``, except where they keep their ``own``."""
        identity = checked_identities(self.model, identity, own)
        self.model.body = replace(self.model.body, identities=identity)
        self.next_identity = max(self.next_identity, int(identity.max()) + 1)

    def check_domain(self, problem: Problem) -> None:
        """Raise ProblemError if an edit changes the domain."""
        domain = self.model.problem.domain
        if problem.domain != domain:
            raise ProblemError(f"`domain` must stay what it was in an edit, {domain}; got {problem.domain}")

    def cut(self, go_on: Callable[[], bool] | None = None) -> None:
        """Drop bodies beyond the domain for good, if any were placed there.

        Args:
            go_on: Called now and then; where it returns False nothing more is improved.
        """

    def positions(self) -> np.ndarray:
        """Where the bodies are [m], shape ``[body_count, 2]``; on a surface ``[body_count, 3]``."""
        return self.descent.positions()

    def choose_start(self, max_steps: int, go_on: Callable[[], bool] | None) -> int:
        """Choose the best of several starts, and return its number: see :meth:`.Solver.choose_start`."""
        return 0

    def corrections(self, max_steps: int) -> list[int]:
        """After which steps of a run the targets are corrected, in their order; sooner where bodies have come to rest."""
        if max_steps < FEWEST_CORRECTED or not self.descent.corrects_targets:
            return []
        return [round(share * max_steps) for share in CORRECTED_AFTER]

    def keep_least_spacing(self, go_on: Callable[[], bool] | None) -> None:
        """Part bodies of a class that are too close, before outlines are parted."""

    @property
    def heat(self) -> HeatMeshes | None:
        """Meshes for smoothing along the surface, which the report can use again; None in the plane."""
        return None

    def finished(self, placement: Placement) -> Placement:
        """A placement with what is measured on the whole of it."""
        return placement

    def drop(self, bookmark: Bookmark) -> None:
        """Delete a bookmark and release its memory."""
        self.bookmarks.drop(bookmark, self._descent)

    def return_to(self, bookmark: Bookmark) -> None:
        """Return to the problem and the bodies of a bookmark."""
        before = self.descent
        # A solver's own bookmarks are in its own kind of domain.
        self.model, self._descent = bookmark.model, cast("AnyDescent", bookmark.descent)
        # Who came since has an identity that nobody else gets.
        self.next_identity = max(self.next_identity, bookmark.next_identity)
        if before is not self._descent:
            self.bookmarks.let_go(before)

    def let_go(self) -> None:
        """Release the descent, if there is one, unless a bookmark holds it."""
        if self._descent is not None:
            self.bookmarks.let_go(self._descent)
            self._descent = None

    def close(self) -> None:
        """Release all memory."""
        self.bookmarks.drop_all(self._descent)
        self.let_go()

    def _take(self, model: Model, descent: AnyDescent) -> None:
        """Go on with another model and descent."""
        self.let_go()
        self.model, self._descent = model, descent

    def _name_fixed(self, model: Model) -> None:
        """Give the fixed bodies of an edit's model identities that nobody else has."""
        if model.has_fixed:
            fixed, self.next_identity = identities_of_fixed(self.model, model, self.next_identity)
            identity = model.body.identity.copy()
            identity[model.fixed] = fixed
            model.body = replace(model.body, identities=identity)

    def _randomness(self, problem: Problem) -> np.random.Generator:
        """What is random in an edit: equal edits one after the other are to differ."""
        self._edits += 1
        return np.random.default_rng([problem.seed, 4, self._edits])
