"""Tables of bodies that say the same of many of them, without as much memory.

A scene of a million bodies of one size has a dozen tables of a million equal numbers each. NumPy's ``broadcast_to`` makes such a table
of one number, which nobody may write to; filling them all took as long as a tenth of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

__all__ = ["distinct", "is_same", "of_all", "of_bodies", "one_by_one"]


def of_bodies(values: Sequence[Any] | np.ndarray, counts: Sequence[int], kind: type) -> np.ndarray:
    """Repeat the value of every size for all its bodies, shape ``[sum(counts)]``; to read only, where all are equal."""
    each: np.ndarray = np.asarray(values, dtype=kind)
    if len(each) and (each == each[0]).all():
        return of_all(each[0], sum(counts))
    return np.repeat(each, counts)


def of_all(value: Any, count: int) -> np.ndarray:
    """The same value for ``count`` bodies, to read only."""
    return np.broadcast_to(value, count)


def is_same(values: np.ndarray) -> bool:
    """Whether a table is one value for all, as :func:`of_all` makes it."""
    return values.ndim == 1 and len(values) > 1 and values.strides == (0,)


def distinct(values: np.ndarray) -> np.ndarray:
    """A table without the copies of a value that it has for all, for what asks which values there are."""
    return values[:1] if is_same(values) else values


def one_by_one(function: Callable[..., np.ndarray], *tables: np.ndarray) -> np.ndarray:
    """``function(*tables)``, which works on every body alone; done once where each table says the same of all."""
    if all(is_same(table) for table in tables):
        return of_all(function(*(table[:1] for table in tables))[0], len(tables[0]))
    return function(*tables)
