"""Which fixed bodies of an edit are those that were fixed before, where nobody says so by an identity."""

from __future__ import annotations

import numpy as np

from .model import Model

__all__ = ["identities_of_fixed"]


def identities_of_fixed(old: Model, model: Model, first: int) -> tuple[np.ndarray, int]:
    """Return the identities of all fixed bodies after an edit, int64, and the first one that is still free.

    Who was given one has it. Others are who they were if one of their class and size was fixed in the same place, or else new.

    Args:
        old: The model before the edit.
        model: The model after it.
        first: Identities from here on are free, but for those that are given.
    """
    result = model.problem.fixed.id.copy()
    if ((result >= first) & (result < first + model.body_count)).any():
        # Whoever is new would get one of these.
        first = int(result.max()) + 1
    unnamed = np.flatnonzero(result < 0)
    if not len(unnamed):
        return result, first
    before = np.flatnonzero(old.problem.fixed.id < 0)
    numbers = _numbers_of_places(_places(old, old, before), _places(model, old, unnamed))
    _, then, now = np.intersect1d(*numbers, assume_unique=True, return_indices=True)
    identity = old.body.identity[old.fixed][before[then]].astype(np.int64)
    # Who was given one now may be who was fixed here then.
    is_free = ~np.isin(identity, result)
    result[unnamed[now[is_free]]] = identity[is_free]
    new = np.flatnonzero(result < 0)
    result[new] = first + np.arange(len(new))
    return result, first + len(new)


def _places(model: Model, old: Model, chosen: np.ndarray) -> np.ndarray:
    """Size, numbered by the names of an old model, and place of some fixed bodies, shape ``[n, 1 + dimensions]``."""
    known = {
        (c.name, size.name): number
        for number, (c, size) in enumerate((c, size) for c in old.problem.classes for size in c.sizes)
    }
    rows = np.flatnonzero(model.fixed)[chosen]
    number = np.full(len(rows), -1.0)
    for c, body_class in enumerate(model.problem.classes):
        for s, size in enumerate(body_class.sizes):
            own = (model.body.class_index[rows] == c) & (model.body.size_index[rows] == s)
            number[own] = known.get((body_class.name, size.name), -1)
    return np.column_stack([number, model.problem.fixed.position[chosen]])


def _numbers_of_places(then: np.ndarray, now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number two lists of places, shapes ``[n, d]`` and ``[m, d]``, alike; of several in one place each has another number."""
    both = np.concatenate([then, now])
    order = np.lexsort(both.T)
    is_new = np.ones(len(both), bool)
    is_new[1:] = (both[order[1:]] != both[order[:-1]]).any(axis=1)
    place = np.empty(len(both), np.int64)
    place[order] = np.cumsum(is_new)
    return tuple(own * (len(both) + 1) + _how_many_before(own) for own in (place[: len(then)], place[len(then) :]))


def _how_many_before(values: np.ndarray) -> np.ndarray:
    """How many of the values before each are the same, shape ``[n]``."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    result = np.empty(len(values), np.int64)
    result[order] = np.arange(len(values)) - np.searchsorted(ordered, ordered)
    return result
