"""Descents in the plane whose bodies were those of another one: after an edit, or cut out of what was placed beyond a border."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..descent.descent import Descent
from ..model.carried_over import CarriedInPlane
from ..model.model import Model
from ..model.natural_border import STEPS_WITHIN, NaturalBorder, smoothing
from ..model.state import State
from ..motion.carried_lines import carry_lines, rows_of_carried_lines
from ..motion.forces import FieldSettings

__all__ = ["carried_poses", "carry_turns", "go_on_from", "go_on_within"]


def go_on_from(
    before: Descent,
    model: Model,
    position: np.ndarray,
    source: np.ndarray,
    *,
    turned: float = 0.0,
    smooth: float | None = None,
    close: np.ndarray | None = None,
) -> Descent:
    """Return a descent of bodies of another one, which is let go of.

    Args:
        before: The other one.
        model: What is to be placed.
        position: Where the bodies are [m], shape ``[body_count, 2]``.
        source: Which of that descent's they are, shape ``[body_count]``.
        turned: By how much they were turned there [rad].
        smooth: See :class:`~.forces.FieldSettings`.
        close: Where bodies stand too close to others [m], shape ``[m, 2]``: all forces count there.
    """
    launcher, old, state = before.launcher, before.model, before.state
    launcher.release(before.step)
    pose = np.zeros((model.body_count, 4))
    pose[:, :2] = position / model.unit
    is_line = model.body.kind >= 0
    pose[is_line, 2:] = state.pose.numpy()[source[is_line], 2:]
    pose[is_line, 2] -= turned
    pose[is_line, 3] *= old.unit / model.unit
    # Where bodies were placed beyond a border there are obstacles in the density only, for which a line's charges count.
    stirred = None if close is None else close / model.unit
    descent = Descent(model, launcher, pose=pose, field_settings=FieldSettings(smooth=smooth), stirred=stirred)
    carry_lines(old, state, model, descent.state, source)
    if old is model:
        descent.state.turn.assign(state.turn)
    elif model.footprints.free.any():
        turn, free = descent.state.turn.numpy().copy(), model.footprints.free & ~model.fixed
        turn[free] = state.turn.numpy()[source[free]] - turned
        descent.state.turn.assign(turn)
    descent.state.steps[:] = state.steps
    descent.place_charges()
    return descent


def go_on_within(before: Descent, border: NaturalBorder, model: Model) -> Descent:
    """Return a descent of the bodies that a natural border keeps, evened out along it; that of all is let go of.

    Args:
        before: Of the border's problem.
        border: What is kept.
        model: Of the problem that was asked for.
    """
    kept = border.cut(before.positions(), model)
    blur, steps = smoothing(model.charge.charge)
    smooth = go_on_from(before, model, kept.position, kept.source, turned=border.turn, smooth=blur)
    smooth.step.play(steps)
    position = smooth.positions()
    close = position[smooth.close_bodies()]
    within = go_on_from(smooth, model, position, np.arange(model.body_count), close=close)
    within.step.play(STEPS_WITHIN)
    return within


def carried_poses(old: Model, before: State, model: Model, carried: CarriedInPlane) -> wp.array | np.ndarray:
    """Where bodies begin after an edit, and how lines lie that were there, shape ``[body_count, 4]``; NaN for how others do."""
    if not model.kinds:
        return carried.pose
    pose = carried.pose.numpy().astype(np.float64)
    pose[:, 2:] = np.nan
    came = rows_of_carried_lines(old, model, carried.source)
    pose[came, 2:] = before.pose.numpy()[carried.source[came], 2:]
    pose[came, 3] *= old.unit / model.unit
    return pose


def carry_turns(old: Model, before: State, model: Model, state: State, carried: CarriedInPlane) -> None:
    """Let bodies that were there before lie as they lay."""
    if not model.footprints.has_outlines:
        return
    came = np.flatnonzero((carried.source >= 0) & model.footprints.is_outline & ~model.fixed)
    came = came[old.footprints.is_outline[carried.source[came]]]
    turn = state.turn.numpy().copy()
    turn[came] = before.turn.numpy()[carried.source[came]]
    state.turn.assign(turn)
