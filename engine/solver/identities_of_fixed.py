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
    if len(before):
        now, then = _places(model, unnamed), _places(old, before)
        known = {place: identity for place, identity in zip(then, _fixed_of(old)[before].tolist(), strict=True)}
        # Of several in one place each is another.
        result[unnamed] = [known.pop(place, -1) for place in now]
        result[unnamed[np.isin(result[unnamed], model.problem.fixed.id)]] = -1
    new = np.flatnonzero(result < 0)
    result[new] = first + np.arange(len(new))
    return result, first + len(new)


def _fixed_of(model: Model) -> np.ndarray:
    """Identities of the fixed bodies of a model."""
    return model.body.identity[model.fixed].astype(np.int64)


def _places(model: Model, chosen: np.ndarray) -> list[tuple[object, ...]]:
    """Class, size and place of some of the fixed bodies."""
    rows = np.flatnonzero(model.fixed)[chosen]
    classes = model.problem.classes
    return [
        (classes[c].name, classes[c].sizes[s].name, *place)
        for c, s, place in zip(
            model.body.class_index[rows].tolist(),
            model.body.size_index[rows].tolist(),
            model.problem.fixed.position[chosen].tolist(),
            strict=True,
        )
    ]
