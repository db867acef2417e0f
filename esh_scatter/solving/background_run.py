"""A solve in a thread of its own, watched from the main thread. Knows nothing of Blender."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...engine.solver.progress import Progress

__all__ = ["BackgroundRun"]


class _AbandonedError(Exception):
    """Raised in a run whose answer nobody wants any more, so that nothing is done for it."""


class BackgroundRun:
    """Runs ``solve(progress)`` in a daemon thread, so that quitting Blender never waits for it.

    Args:
        solve: Called once, in the thread, with a progress callback that answers False once the run was stopped.

    Attributes:
        progress: The last :class:`~esh.engine.solver.progress.Progress`, None before the first.
        error: What ``solve`` raised, or None.
        stopped: Whether :meth:`stop` or :meth:`abandon` was called.
    """

    def __init__(self, solve: Callable[[Callable[[Progress], bool]], object]) -> None:
        self.progress: Progress | None = None
        self.error: BaseException | None = None
        self.stopped = self._abandoned = False
        self._started = time.monotonic()
        self._solve = solve
        self._thread = threading.Thread(target=self._work, name="ESH Scatter", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._started

    @property
    def running(self) -> bool:
        """Whether the thread is still at work; it can be for a moment after :meth:`stop`."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Ask the run to end at its next step, with an answer; returns at once."""
        self.stopped = True

    def abandon(self) -> None:
        """Have the run end without an answer, at its next step or where it next asks; returns at once."""
        self.stopped = self._abandoned = True

    def ask(self) -> None:
        """End the run where it was abandoned; called by ``solve``, in the thread, as often as it likes."""
        if self._abandoned:
            raise _AbandonedError

    def join(self, seconds: float) -> None:
        """Wait for the end of the run, ``seconds`` at most."""
        self._thread.join(seconds)

    def _keep_progress(self, progress: Progress) -> bool:
        self.ask()
        self.progress = progress
        return not self.stopped

    def _work(self) -> None:
        try:
            self._solve(self._keep_progress)
        except _AbandonedError:  # its traceback would hold all that the solver held
            pass
        except BaseException as error:  # handed to the main thread, which tells the user
            self.error = error
