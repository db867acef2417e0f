"""Bodies where somebody has put them, as in a placement that was kept without its state; see :meth:`.solver.Solver.start_at`."""

from __future__ import annotations

import numpy as np

from ..descent.descent import Descent
from ..errors import ProblemError
from ..model.model import Model
from ..model.state import State
from ..problem.body_footprints import BodyFootprints
from ..problem.given_values import show
from ..problem.surface import Surface
from .places_in_support import in_support

__all__ = ["checked_identities", "checked_places", "given_outlines", "given_poses", "lay_outlines"]


def checked_places(model: Model, position: np.ndarray) -> np.ndarray:
    """Return where bodies are put [m], shape ``[body_count, 2]``, on a surface ``[body_count, 3]``.

    Raises:
        ProblemError: Another number of bodies, or a place that is no finite number.
    """
    on_surface = isinstance(model.problem.domain, Surface)
    axes = "x, y and z" if on_surface else "x and y"
    position = np.asarray(position, np.float64)
    fits = position.shape == (model.body_count, 2 + on_surface)
    if not fits or not np.isfinite(position).all():
        got = f"{show(position[~np.isfinite(position)][0])} among them" if fits else f"shape {list(position.shape)}"
        raise ProblemError(f"`position` must hold {axes} of {model.body_count} bodies, all finite; got {got}")
    return position


def checked_identities(model: Model, identity: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return identities for all bodies, shape ``[body_count]``: those that are given, but where ``own`` those that they have.

    Raises:
        ProblemError: One is below 0, or two are the same.
    """
    identity = np.where(own, model.body.identity, identity)
    if (identity < 0).any() or (np.diff(np.sort(identity)) == 0).any():
        raise ProblemError("`identity` must be a whole number of 0 or more for every body that no other one has")
    return identity.astype(np.int32)


def given_outlines(model: Model, variant: np.ndarray | None, scale: np.ndarray | None) -> BodyFootprints:
    """Return outlines with other variants, as far as their sizes have so many, and other scales; fixed bodies keep theirs.

    Args:
        model: What is placed.
        variant: Numbers of the variants, shape ``[body_count]``; None for those that they have.
        scale: Factors on the outlines, shape ``[body_count]``; None for those that they have.
    """
    outlines, fixed = model.footprints, model.fixed
    if variant is not None:
        first = outlines.shape - outlines.variant
        # Sizes have their shapes one after the other.
        most = np.zeros(len(outlines.shapes) + 1, np.int64)
        np.maximum.at(most, first, outlines.variant)
        variant = np.where(fixed | (variant > most[first]), outlines.variant, variant).astype(np.int32)
    else:
        variant = outlines.variant
    scale = outlines.factor if scale is None else np.where(fixed, outlines.factor, scale)
    return outlines.with_outlines(variant, scale)


def given_poses(
    model: Model,
    position: np.ndarray,
    angle: np.ndarray | None,
    length: np.ndarray | None,
    before: State | None,
) -> np.ndarray:
    """Return poses in units for a descent to start with, shape ``[body_count, 4]``; NaN for what it is to choose.

    Args:
        model: What is placed, in a rectangle.
        position: Where bodies are put [m], shape ``[body_count, 2]``. Fixed ones stay where the problem says.
        angle: How they lie [rad], shape ``[body_count]``, or None.
        length: Lengths of lines [m], shape ``[body_count]``, 0 where not known; or None. They count with an angle only.
        before: Where bodies were that have no length given, or None.
    """
    pose = np.full((model.body_count, 4), np.nan)
    # Where a density has become 0 since, nobody would find out of it.
    pose[:, :2] = in_support(model, position.copy()) / model.unit
    pose[model.fixed, :2] = model.problem.fixed.position / model.unit
    is_line = model.body.kind >= 0
    if angle is not None:
        pose[is_line, 2] = angle[is_line]
        if before is not None:
            pose[is_line, 3] = before.pose.numpy()[is_line, 3]
        if length is not None:
            given = is_line & (length > 0.0)
            pose[given, 3] = length[given] / model.unit
    return pose


def lay_outlines(descent: Descent, angle: np.ndarray) -> None:
    """Turn outlines that are not fixed as they are to lie [rad], shape ``[body_count]``; a line's angle says how its outline lies."""
    model = descent.model
    is_line = model.body.kind >= 0
    given = model.footprints.is_outline & ~is_line & ~model.fixed
    turn = descent.state.turn.numpy().copy()
    turn[given] = angle[given]
    turn[is_line & ~model.fixed] = 0.0
    descent.state.turn.assign(turn)
