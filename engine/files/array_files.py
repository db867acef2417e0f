"""Files of several NumPy arrays."""

from __future__ import annotations

import zipfile
from collections.abc import Collection
from pathlib import Path

import numpy as np

from ..errors import InputFileError
from ..problem.given_values import show

__all__ = ["read_arrays"]


def read_arrays(path: Path, wanted: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Read a ``.npz`` that holds positions of bodies, ``position``.

    Args:
        path: The file.
        wanted: Names of the arrays that are read, if they are there; None for all.

    Raises:
        InputFileError: A missing or damaged file, or one that holds something else.
    """
    begin = f"{path} cannot be read as NumPy arrays"
    try:
        with path.open("rb") as file:
            # NumPy takes what is no archive for an object of Python, and says so.
            if not zipfile.is_zipfile(file):
                file.seek(0)
                held = "a single array" if file.read(6) == b"\x93NUMPY" else "something else, or is damaged"
                raise InputFileError(
                    f"{begin}: it must hold several named arrays, as np.savez writes them; it holds {held}"
                )
        with np.load(path, allow_pickle=False) as stored:
            if "position" not in stored.files:
                raise InputFileError(f"{path} must hold an array `position`; it holds {show(', '.join(stored.files))}")
            arrays = {name: stored[name] for name in stored.files if wanted is None or name in wanted}
    except InputFileError:
        raise
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        why = " ".join(str(error).split())[:200]
        if "allow_pickle" in why:
            why = "it holds objects of Python, which may be anything"
        raise InputFileError(f"{begin}: {why}") from None
    # Of other files in an archive NumPy returns the bytes.
    return {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}
