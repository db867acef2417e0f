"""Problems and bodies that a solver can return to."""

from __future__ import annotations

from dataclasses import dataclass

from ..descent.descent import Descent
from ..descent.surface_descent import SurfaceDescent
from ..device.launcher import Launcher
from ..errors import ProblemError
from ..model.model import Model
from ..problem.given_values import check_is
from .record import Record

__all__ = ["Bookmark", "Bookmarks"]


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A solver's problem and bodies at some point, kept so that it can return there: see :meth:`.Solver.bookmark`.

    Attributes:
        model: The compiled problem.
        descent: The descent, with the state of the bodies.
        next_identity: The identity that the next new body would have got.
        record: What was done to the bodies.
    """

    model: Model
    descent: Descent | SurfaceDescent
    next_identity: int
    record: Record


class Bookmarks:
    """The bookmarks of a solver. What they hold keeps its memory, whoever else lets go of it."""

    def __init__(self, launcher: Launcher) -> None:
        self._launcher = launcher
        self._all: list[Bookmark] = []

    def __len__(self) -> int:
        return len(self._all)

    def add(self, bookmark: Bookmark) -> Bookmark:
        """Hold a bookmark; return it."""
        self._all.append(bookmark)
        return bookmark

    def check(self, bookmark: object) -> None:
        """Raise ProblemError unless a bookmark is held here."""
        check_is(bookmark, Bookmark, "`bookmark`")
        if all(one is not bookmark for one in self._all):
            raise ProblemError("`bookmark` must be one of this Solver that was not dropped")

    def drop(self, bookmark: Bookmark, current: Descent | SurfaceDescent | None) -> None:
        """Forget a bookmark, and release its descent unless that is the current one."""
        self.check(bookmark)
        self._all = [one for one in self._all if one is not bookmark]
        if bookmark.descent is not current:
            self.let_go(bookmark.descent)

    def drop_all(self, current: Descent | SurfaceDescent | None) -> None:
        """Forget them all."""
        for bookmark in self._all.copy():
            self.drop(bookmark, current)

    def let_go(self, descent: Descent | SurfaceDescent) -> None:
        """Release a descent that the solver does not need, unless a bookmark holds it."""
        if all(one.descent is not descent for one in self._all):
            self._launcher.release(descent.step)
