"""Loads what computes before anybody waits for it: Warp and all that is built on it take Python a second.

A thread does that as soon as the panel is seen. Whoever needs it earlier, in a window, waits in a run of its own.
"""

from __future__ import annotations

import importlib
import threading

__all__ = ["Loading", "begin", "end", "is_done"]

# What is loaded, below the package that this one is in.
_NEEDED = ("api", "classes.survey", "editing.selection", "solving.live_worker")
_thread: threading.Thread | None = None


class Loading:
    """Loading as what comes before a run; see :class:`~.running.Session`."""

    device = ""

    def solve(self, _progress: object = None, _ask: object = None) -> None:
        """Wait until all is loaded; touches nothing of Blender."""
        begin().join()


def begin() -> threading.Thread:
    """Load in a thread, unless that was begun already; return the thread."""
    global _thread
    if _thread is None:
        _thread = threading.Thread(target=_load, name="ESH Scatter loads", daemon=True)
        _thread.start()
    return _thread


def is_done() -> bool:
    """Tell whether all is loaded, or could not be: whoever needs it will say why."""
    return _thread is not None and not _thread.is_alive()


def end() -> None:
    """Wait for the end of it: Python must not go while modules are being loaded."""
    if _thread is not None:
        _thread.join()


def _load() -> None:
    package = __package__.rpartition(".")[0]
    for name in _NEEDED:
        try:
            importlib.import_module(f"{package}.{name}")
        except Exception:
            return
