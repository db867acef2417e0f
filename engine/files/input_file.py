"""Whether there is a file to read, and what a reader says of one that it cannot read."""

from __future__ import annotations

import stat
from pathlib import Path

from ..errors import InputFileError

__all__ = ["check_is_file", "kind_and_reason_of", "reason_of"]


def check_is_file(path: Path, accepted: str) -> None:
    """Raise InputFileError where there is no file, or a folder, or a pipe, which would be waited for.

    Args:
        path: Where it should be.
        accepted: What it is, which ends the sentence.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            return
        what = "is a folder" if stat.S_ISDIR(mode) else "is not a regular file"
    except (FileNotFoundError, NotADirectoryError):
        what = "does not exist"
    except (OSError, ValueError) as error:  # no right to look, or a name that no file can have
        what = f"cannot be read ({reason_of(error)})"
    raise InputFileError(f"{path} {what}; {accepted}")


def reason_of(error: Exception) -> str:
    """Return what an error says, on one line."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()).rstrip(".") or type(error).__name__


def kind_and_reason_of(error: Exception) -> str:
    """Return what kind of error it is and what it says, on one line, of 200 characters at most."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]
