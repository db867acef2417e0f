"""Results that undo and redo can go back to without anything being set up anew. Knows nothing of Blender's data."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ...engine.solver.bookmarks import Bookmark
from ...engine.solver.solver import Solver

if TYPE_CHECKING:
    from .job import ScatterJob

__all__ = ["MOST_BODIES_EARLIER", "MOST_EARLIER", "EarlierResult", "EarlierResults"]

# So many results, and how many objects they have together at most.
MOST_EARLIER, MOST_BODIES_EARLIER = 4, 100_000


class EarlierResult(NamedTuple):
    """A job that was shown, where its solver goes back to for going on from there, and how uneven it was."""

    job: ScatterJob
    bookmark: Bookmark
    unevenness: float


class EarlierResults:
    """Those of one solver, the newest last."""

    def __init__(self) -> None:
        self._results: list[EarlierResult] = []

    def __len__(self) -> int:
        return len(self._results)

    def of(self, job: ScatterJob | None) -> EarlierResult | None:
        """Return what is known of a job; None where that is nothing."""
        return next((one for one in self._results if one.job is job), None)

    def remember(
        self, solver: Solver, job: ScatterJob, unevenness: float, *, wanted: EarlierResult | None = None
    ) -> None:
        """Let undo come back to where the solver's bodies are; what is too much is forgotten, the oldest first, but nothing wanted."""
        if self.of(job) is not None:
            return
        self._results.append(EarlierResult(job, solver.bookmark(), unevenness))
        for oldest in self._results.copy():
            if len(self._results) <= MOST_EARLIER and self._body_count() <= MOST_BODIES_EARLIER:
                break
            if oldest is not wanted:
                self._results.remove(oldest)
                solver.drop(oldest.bookmark)

    def renew(self, result: EarlierResult, job: ScatterJob) -> None:
        """Take one of them for the newest, known by a job from now on."""
        self._results.remove(result)
        self._results.append(result._replace(job=job))

    def clear(self) -> None:
        """Forget all of them, once their solver is closed."""
        self._results.clear()

    def _body_count(self) -> int:
        return sum(one.bookmark.model.body_count for one in self._results)
