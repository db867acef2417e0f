"""What Ctrl-C and signals that end a process do to the command once it is under way."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn

from .first_signals import ENDING, INTERRUPTING, leave, said_to

__all__ = [
    "INTERRUPTED",
    "Ended",
    "after_all_is_written",
    "answered_here",
    "end",
    "interrupt",
    "loading",
    "on_signals",
    "received",
    "writing",
]

# What shells report for a program that Ctrl-C ended.
INTERRUPTED = 130

# Signals that came: what was under way may raise anything, and libraries that are being imported turn our exceptions into theirs.
received: list[int] = []


class Ended(BaseException):
    """A signal that asks the process to end."""

    def __init__(self, number: int) -> None:
        self.number = number


def end(number: int, frame: object) -> NoReturn:
    """Handle a signal by raising Ended."""
    received.append(number)
    raise Ended(number)


def interrupt(number: int, frame: object) -> NoReturn:
    """Handle Ctrl-C by raising KeyboardInterrupt."""
    received.append(number)
    raise KeyboardInterrupt


@contextlib.contextmanager
def answered_here() -> Iterator[None]:
    """Raise what :func:`~.command_line.main` answers where a signal comes; other programs' handlers of Ctrl-C stay."""
    received.clear()
    ours = signal.getsignal(signal.SIGINT) in (signal.default_int_handler, leave)
    with on_signals(INTERRUPTING if ours else (), interrupt), on_signals(ENDING, end):
        yield


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """End the process at once where a signal comes, as long as libraries are loaded and nothing is written.

    Modules whose import is interrupted raise errors of their own about that, or swallow what our handlers raise.
    """
    with on_signals((*INTERRUPTING, *ENDING) if said_to else (), leave):
        yield


@contextlib.contextmanager
def writing() -> Iterator[Callable[[], None]]:
    """Let the first signal stop what is written, and no other disturb that this is then taken away.

    Yields:
        What is to be called when all files are complete: it raises what a signal asked for that a library swallowed, as those in C
        do with what they do not expect. From then on signals are not heard: all files take their places, in a moment, or none.
    """
    settled = False

    def stop(number: int, frame: object) -> None:
        if not (settled or received):
            (end if number in ENDING else interrupt)(number, frame)

    def settle() -> None:
        nonlocal settled
        for number in received:
            raise Ended(number) if number in ENDING else KeyboardInterrupt
        settled = True

    # Other programs' handlers of Ctrl-C stay.
    ours = INTERRUPTING if signal.getsignal(signal.SIGINT) is interrupt else ()
    with on_signals((*ours, *ENDING), stop):
        yield settle


@contextlib.contextmanager
def after_all_is_written() -> Iterator[None]:
    """Let signals end the process without a word, because all that it was to write is there."""
    with on_signals((*INTERRUPTING, *ENDING) if said_to else (), signal.SIG_DFL):
        yield


@contextlib.contextmanager
def on_signals(numbers: Sequence[int], handler: Any) -> Iterator[None]:
    """Handle signals in this way for a while; those that are ignored stay so (``nohup``)."""
    before = {}
    try:
        for number in numbers:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    except ValueError:  # called from another thread than the main one, where no signal arrives
        yield
        return
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)
