"""Signals that come while compiled code is at work, which does not know of them."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator

from .first_signals import ENDING, INTERRUPTING
from .streams import complain

__all__ = ["ends_in_compiled_code"]

# Seconds that a step may go on after a signal before the process is ended in its middle.
PATIENCE = 1.0


@contextlib.contextmanager
def ends_in_compiled_code(answered: Callable[[], bool]) -> Iterator[None]:
    """See to it that signals end the process also while Python cannot handle them, because compiled code is at work.

    Python's own handlers run between two of its instructions. Nothing is being written meanwhile.

    Args:
        answered: Whether a handler has run.
    """
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def watch() -> None:
        while number := os.read(reader, 1):
            if number[0] not in (*INTERRUPTING, *ENDING):
                continue
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until:
                time.sleep(0.02)
                if answered():
                    return
            name = "Ctrl-C" if number[0] == signal.SIGINT else signal.Signals(number[0]).name
            complain(f"stopped by {name} in the middle of a step; nothing was written")
            os._exit(128 + number[0])

    watcher = threading.Thread(target=watch, name="ESH Scatter signals", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writer)
        watcher.join()
        os.close(reader)
