"""Keeping what native libraries print out of the user's sight."""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import sys
from collections.abc import Iterator

__all__ = ["muted"]


@contextlib.contextmanager
def muted() -> Iterator[None]:
    """Send everything printed meanwhile, by C++ code too, nowhere.

    For the few calls whose library prints what it also raises, or what the caller says better.

    **Limitations**: holds for the whole process, other threads included; keep it short.
    """
    _flush()
    saved: list[tuple[int, int]] = []
    try:
        for number in (1, 2):
            with contextlib.suppress(OSError):  # a descriptor that is not open prints nothing anyway
                saved.append((number, os.dup(number)))
                with open(os.devnull, "wb") as nowhere:
                    os.dup2(nowhere.fileno(), number)
        # Some print through Python, whose stream may lead elsewhere than the descriptor (a notebook, Blender's console).
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        _flush()  # into nothing: what still waits in a buffer would come out later
        for number, copy in saved:
            os.dup2(copy, number)
            os.close(copy)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # absent (a program without console) or closed
            stream.flush()
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush(None)
