"""What the command says: its report to the standard output, and complaints to the standard error stream."""

from __future__ import annotations

import contextlib
import os
import sys

from ..errors import EshError

__all__ = ["close_output", "complain", "open_standard_streams", "say"]


def open_standard_streams() -> None:
    """Give streams that were closed nothing to write to, so that no file of ours gets their numbers, and what is meant for them."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def say(*parts: object, lost: str = "the files are written, but the report could not be printed") -> None:
    """Print what a run has to say once all is written. A reader who has had enough is no error.

    Args:
        parts: What is printed, each on a line of its own.
        lost: What to complain of where that fails.

    Raises:
        EshError: It cannot be printed for another reason.
    """
    if sys.stdout is None or not parts:
        return
    try:
        for part in parts:
            print(part)
        sys.stdout.flush()
    except BrokenPipeError:
        close_output()
    except (OSError, ValueError) as error:
        close_output()
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise EshError(f"{lost}: {reason.lower()}") from None


def close_output() -> None:
    """Send what still waits to be printed into nothing: Python tries it once more at its exit."""
    with contextlib.suppress(AttributeError, OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def complain(sentence: str) -> None:
    """Print a sentence to the standard error stream, where that can be done."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            print(f"esh-scatter: {' '.join(sentence.split())}", file=sys.stderr, flush=True)
