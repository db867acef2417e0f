"""What Ctrl-C and signals that end a process do to the command before it is under way.

Imports nothing but ``os`` and ``signal``: until it is loaded, Ctrl-C shows a traceback.
"""

from __future__ import annotations

import os
import signal

__all__ = ["ENDING", "INTERRUPTING", "leave", "leave_on_signals", "said_to"]

INTERRUPTING = (signal.SIGINT,)
# A process manager's way to end a program, and that of a terminal that is closed.
ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
DEFAULTS = (signal.default_int_handler, signal.SIG_DFL)

# Of the standard error stream, which is redirected at times; empty where this process is not the command.
said_to: list[int] = []


def leave(number: int, frame: object) -> None:
    """End the process at once: nothing has been written, and nothing waits to be taken away."""
    name = "stopped by Ctrl-C" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
    try:
        os.write(said_to[0], f"esh-scatter: {name}; nothing was written\n".encode())
    finally:
        os._exit(128 + number)


def leave_on_signals() -> None:
    """Have signals end this process, which is the command and nothing else, with a sentence."""
    try:
        said_to[:] = [os.dup(2)]
    except OSError:  # closed: there is nobody to tell
        said_to[:] = [-1]
    for number in (*INTERRUPTING, *ENDING):
        if signal.getsignal(number) in DEFAULTS:
            signal.signal(number, leave)
