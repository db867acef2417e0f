"""What somebody has given: of what kind it is, and how a sentence about it shows it.

Which values a problem may have, :mod:`.validation` says.
"""

from __future__ import annotations

import math
import numbers
import os
import reprlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from ..errors import ProblemError

__all__ = [
    "FOREIGN_ERRORS",
    "as_float",
    "as_path",
    "as_path_or_file",
    "as_reals",
    "as_tuple",
    "as_whole",
    "check_is",
    "check_progress",
    "check_unique",
    "is_function",
    "is_real",
    "nearest_name",
    "numbers_of",
    "perhaps_meant",
    "show",
]

Kind = TypeVar("Kind")
# What the `__array__`, `__iter__` or `__repr__` of somebody else's object may raise.
FOREIGN_ERRORS = (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError)


def show(value: object) -> str:
    """Return ``value`` as a sentence shows it: short, on one line, and never failing."""
    if isinstance(value, numbers.Integral) and is_real(value):
        whole = int(value)
        # Python refuses to print whole numbers of thousands of digits.
        return str(whole) if abs(whole) < 10**18 else f"{'-' if whole < 0 else ''}about 1e{_digits(abs(whole)) - 1}"
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.12g}"
    if isinstance(value, str):
        text = ascii(value) if not value.isprintable() else f'"{value}"'
        return text if len(text) <= 62 else f'{text[:58]}..."'
    if isinstance(value, np.ndarray) and value.ndim:
        # Of more than is shown there is enough to see that there is more.
        value = value[(slice(7),) * value.ndim]
        value = (value.astype(str) if value.dtype.kind in "mM" else value).tolist()
    try:
        text = " ".join(reprlib.repr(value).split())
    except FOREIGN_ERRORS:
        text = f"a {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:77]}..."


def _digits(whole: int) -> int:
    return int(math.log10(whole)) + 1


def is_real(value: object) -> bool:
    """Whether a value is a real number, and no truth value."""
    return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))


def as_float(value: object) -> float | None:
    """Return a real number as float (infinite where it is too large for one), None for anything else and for NaN."""
    if not is_real(value):
        return None
    try:
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        return math.inf if value > 0 else -math.inf  # type: ignore[operator]
    return None if math.isnan(number) else number


def as_whole(value: object, low: int, high: int) -> int | None:
    """Return a whole number within these bounds (3.0 is one, too), None for anything else."""
    number = as_float(value)
    if number is None or not math.isfinite(number) or number % 1.0:
        return None
    whole = int(value)  # type: ignore[call-overload]
    return whole if low <= whole <= high else None


def as_reals(value: object) -> np.ndarray:
    """Return a new float64 array of what is given; raises one of FOREIGN_ERRORS for anything else, complex numbers and times too."""
    given = np.array(value)
    if given.dtype.kind in "cmM":
        raise TypeError("complex numbers, or times")
    return given.astype(np.float64)


def is_function(value: object) -> bool:
    """Whether a value can be asked for values at points: a class, which can be called as well, would only make an object of them."""
    return callable(value) and not isinstance(value, type)


def numbers_of(values: object, what: str) -> np.ndarray:
    """Return what a function gave back as float64; raise ProblemError for something else than numbers."""
    try:
        given = np.asarray(values)
        if given.dtype.kind in "buif":
            return given.astype(np.float64, copy=False)
    except FOREIGN_ERRORS:
        pass
    raise ProblemError(f"{what} must return numbers; it returned {show(values)}")


def check_is(value: object, kind: type[Kind], key: str) -> Kind:
    """Return a value that is of a class; raise ProblemError for anything else."""
    if not isinstance(value, kind):
        name = kind.__name__
        raise ProblemError(f"{key} must be {'an' if name[0] in 'AEIOU' else 'a'} {name}; got {show(value)}")
    return value


def as_tuple(value: object, kind: type[Kind] | tuple[type[Kind], ...], key: str) -> tuple[Kind, ...]:
    """Return the entries of a list, all of one class (or of several); raise ProblemError for anything else."""
    try:
        entries = tuple(value) if isinstance(value, Iterable) and not isinstance(value, (str, bytes)) else None
    except FOREIGN_ERRORS:
        entries = None
    if entries is None or not all(isinstance(entry, kind) for entry in entries):
        name = (kind[0] if isinstance(kind, tuple) else kind).__name__
        raise ProblemError(f"{key} must be a list of {name}; got {show(value)}")
    return entries


def as_path(value: object, key: str = "`path`") -> Path:
    """Return the path of a file, which text may be; raise ProblemError for anything else."""
    if not isinstance(value, (str, os.PathLike)) or isinstance(os.fspath(value), bytes):
        raise ProblemError(f"{key} must be the path of a file; got {show(value)}")
    return Path(value)


def as_path_or_file(value: object, key: str = "`path`") -> Path | BinaryIO:
    """Return the path of a file, or a file that is open for writing; raise ProblemError for anything else."""
    return value if callable(getattr(value, "write", None)) else as_path(value, key)  # type: ignore[return-value]


def check_progress(value: object) -> None:
    """Raise ProblemError for what cannot be called after steps; None is nobody."""
    if value is not None and not callable(value):
        raise ProblemError(f"`progress` must be a function, or None; got {show(value)}")


def check_unique(names: Sequence[str], what: str) -> None:
    """Raise ProblemError if a name stands there twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ProblemError(f'{what} must differ from each other; "{name}" is used {names.count(name)} times')
        seen.add(name)


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Return how a sentence about a name that is not known ends: with the one that was probably meant, or with all."""
    known = tuple(known)
    nearest = _nearest(name, known)
    return f"did you mean `{nearest}`?" if nearest else f"known are {', '.join(known)}"


def perhaps_meant(value: object, words: Sequence[str]) -> str:
    """Return how a sentence goes on that has said which words there are, and what was given: with the one that was probably meant."""
    nearest = _nearest(value, words) if isinstance(value, str) else None
    return f'; did you mean "{nearest}"?' if nearest else ""


def _nearest(name: str, known: Sequence[str]) -> str | None:
    import difflib

    return next(iter(difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.6)), None)
