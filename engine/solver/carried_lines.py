"""What lines have beside their poses, after an edit: bends, and the factors of their lengths."""

from __future__ import annotations

import numpy as np
import warp as wp

from .line_rules import length_blocks
from .model import Model
from .state import State

__all__ = ["carry_bends", "carry_lines"]


def carry_lines(old: Model, state: State, model: Model, new_state: State, source: np.ndarray) -> None:
    """Bring what lines have beside their poses over to the state of another model: bends, and the factors of their lengths.

    ``source`` is every body's number before, -1 for new ones.
    """
    carry_bends(old, state.bend, model, new_state.bend, source)
    if old.kinds and len(old.kinds) == len(model.kinds):
        new_state.length_factor.assign(_length_factors(old, state.length_factor.numpy(), model))


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
    """Factors on lengths for the blocks of another model with as many kinds: every block has that of the one at its place."""
    kinds = len(model.kinds)
    before, start = length_blocks(old), kinds
    # Lengths that no force changes have no pressure to make up for.
    pressed = [kind.line.stretch_weights[0] > 0.0 for kind in model.kinds]
    result = [np.where(pressed, factor[:kinds], 1.0).astype(np.float32)]
    for kind, (rows, columns) in enumerate(length_blocks(model)):
        height, width = before[kind]
        stored = factor[start : start + height * width].reshape(height, width)
        start += height * width
        if not height:
            stored = factor[kind : kind + 1, None]
            height = width = 1
        at = np.ix_(np.arange(rows) * height // max(rows, 1), np.arange(columns) * width // max(columns, 1))
        result.append(stored[at].reshape(-1))
    return np.concatenate(result)
