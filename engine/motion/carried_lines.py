"""What lines have beside their poses, after an edit: bends, and the factors of their lengths."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..model.model import Model
from ..model.state import State, SurfaceState
from ..problem.surface import Surface
from .line_rules import length_blocks

__all__ = ["carry_bends", "carry_lines", "rows_of_carried_lines"]


def carry_lines(
    old: Model,
    state: State | SurfaceState,
    model: Model,
    new_state: State | SurfaceState,
    source: np.ndarray,
) -> None:
    """Bring what lines have beside their poses over to the state of another model: bends, and the factors of their lengths.

    ``source`` is every body's number before, -1 for new ones, shape ``[body_count]``.
    """
    carry_bends(old, state.bend, model, new_state.bend, source)
    if old.kinds and model.kinds:
        new_state.length_factor.assign(_length_factors(old, state.length_factor.numpy(), model))


def rows_of_carried_lines(old: Model, model: Model, source: np.ndarray) -> np.ndarray:
    """Which lines were lines before: what was a dot has neither angle nor length; ``source`` as above."""
    came = np.flatnonzero((source >= 0) & (model.body.kind >= 0))
    return came[old.body.kind[source[came]] >= 0]


def carry_bends(old: Model, bent: wp.array, model: Model, bent_now: wp.array, source: np.ndarray) -> None:
    """Bring the bends of lines over to those of another model; ``source`` as above."""
    if not old.kinds or not model.kinds:
        return
    count, count_before = model.charge.per_body, old.charge.per_body
    same = np.flatnonzero((source >= 0) & (count == count_before[source]) & ~model.fixed)
    bend, bend_before = bent_now.numpy(), bent.numpy()
    for charges in np.unique(count[same]).tolist():
        rows = same[count[same] == charges]
        number = np.arange(charges)
        before = old.charge.first[source[rows]][:, None] + number
        bend[model.charge.first[rows][:, None] + number] = bend_before[before] * (old.unit / model.unit)
    bent_now.assign(bend)


def _length_factors(old: Model, factor: np.ndarray, model: Model) -> np.ndarray:
    """Factors on lengths for the kinds of another model and, in the plane, for its blocks: each has that of the one at its place."""
    sources = _kinds_before(old, model)
    # Lengths that no force changes have no pressure to make up for, nor is any known of kinds that are new.
    known = [
        before >= 0 and kind.line.stretch_weights[0] > 0.0 for before, kind in zip(sources, model.kinds, strict=True)
    ]
    result = [np.where(known, factor[sources], 1.0).astype(np.float32)]
    if isinstance(model.problem.domain, Surface):
        return result[0]
    before = length_blocks(old)
    starts = len(old.kinds) + np.cumsum([0] + [height * width for height, width in before])
    for number, (rows, columns) in enumerate(length_blocks(model)):
        height, width = before[sources[number]]
        stored = result[0][number : number + 1, None]
        if known[number] and height:
            start = starts[sources[number]]
            stored = factor[start : start + height * width].reshape(height, width)
        height, width = stored.shape
        at = np.ix_(np.arange(rows) * height // max(rows, 1), np.arange(columns) * width // max(columns, 1))
        result.append(stored[at].reshape(-1))
    return np.concatenate(result)


def _kinds_before(old: Model, model: Model) -> list[int]:
    """Which of the old model's kinds of lines each one is by its names, or where there are as many its number; -1 for new ones."""
    names = {(kind.body_class.name, kind.size_name): number for number, kind in enumerate(old.kinds)}
    as_many = len(old.kinds) == len(model.kinds)
    return [
        names.get((kind.body_class.name, kind.size_name), number if as_many else -1)
        for number, kind in enumerate(model.kinds)
    ]
