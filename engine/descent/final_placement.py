"""Where the bodies end: a state, in meters."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.body_flags import BodyFlags
from ..model.looking import angle_within, facing_turns, looks_at_point, somebody_looks
from ..model.model import Model
from ..model.state import State
from ..problem.placement import Placement
from ..space.density import move_into_support
from . import kernels_end

__all__ = [
    "placement_of",
    "position_in_meters",
    "position_on_device",
]


def placement_of(model: Model, state: State, launcher: Launcher) -> Placement:
    """The bodies of a state, less the ghosts; the report is still to be measured."""
    body = model.body
    position = _settled(model, position_in_meters(model, state, launcher))
    angle, length, width = (np.zeros(len(position)) for _ in range(3))
    given = model.footprints.is_outline
    if model.footprints.has_outlines:
        angle[given] = angle_within(state.turn.numpy()[given].astype(np.float64), 2.0 * math.pi)
    if model.kinds:
        pose = state.pose.numpy().astype(np.float64)
        # A line has no front, unless its outline has one: angles within half a turn.
        line = (body.kind >= 0) & ~given
        angle[line] = angle_within(pose[line, 2], math.pi)
        turned = (body.kind >= 0) & given
        angle[turned] = angle_within(pose[turned, 2] + angle[turned], 2.0 * math.pi)
        length = pose[:, 3] * model.unit
        width = model.widths(length)
    if somebody_looks(model):
        looking = looks_at_point(model) & ~given
        angle[looking] = facing_turns(model, position)[looking]
    if model.has_fixed:
        fixed = model.problem.fixed
        # As they were given, not as float32 holds them.
        position[model.fixed], angle[model.fixed] = fixed.position, fixed.angle
        length[model.fixed] = np.where(np.isnan(fixed.length), length[model.fixed], fixed.length)
    bends = bends_of(model, _charge_positions(model, state, position)) if model.bends_any else None
    has_ghosts = body.flagged and bool((body.flags & BodyFlags.GHOST).any())
    ghosts = (body.flags & BodyFlags.GHOST) != 0 if has_ghosts else body.flags

    def made(values: np.ndarray) -> np.ndarray:
        return values[~ghosts] if has_ghosts else values

    def shown(values: np.ndarray) -> np.ndarray:
        # A copy in any case: the model goes on.
        return made(values) if has_ghosts else values.copy()

    return Placement(
        model.problem,
        made(position),
        shown(body.class_index),
        shown(body.size_index),
        made(angle),
        made(length),
        made(width),
        bends=None if bends is None else made(bends),
        id=made(body.identity).astype(np.int64),
        fixed=shown(model.fixed),
        variant=shown(model.footprints.variant),
        scale=shown(model.footprints.scale),
    )


def position_in_meters(model: Model, state: State, launcher: Launcher) -> np.ndarray:
    """Positions of all bodies [m], shape ``[n, 2]``, float64, inside the domain; a periodic one's far edges are not."""
    return position_on_device(model, state, launcher).numpy()


def position_on_device(model: Model, state: State, launcher: Launcher) -> wp.array:
    """The same for kernels, ``wp.vec2d``, shape ``[n]``."""
    n, domain = model.body_count, model.problem.rectangle
    position = launcher.empty(n, wp.vec2d)
    where = [state.pose, model.unit, wp.vec2d(*domain.size), model.space.for_kernels()]
    launcher.launch(kernels_end.place_in_meters, n, where, [position])
    return position


def bends_of(model: Model, charges: np.ndarray) -> np.ndarray:
    """Positions of the charges on bodies that may bend, of those of all bodies; see :class:`Placement`."""
    most = max(kind.line.charges for kind in model.kinds if kind.line.straightness is not None)
    body = model.charge.body
    bends = np.full((model.body_count, most, charges.shape[1]), np.nan)
    may_bend = model.may_bend[body]
    order = np.arange(len(body)) - model.charge.first[body]
    bends[body[may_bend], order[may_bend]] = charges[may_bend]
    return bends


def _charge_positions(model: Model, state: State, position: np.ndarray) -> np.ndarray:
    """Where all charges are [m], of bodies at positions, shape ``[charge_count, 2]``."""
    body = model.charge.body
    pose = state.pose.numpy()[body]
    along = 0.5 * pose[:, 3] * model.charge.axial.astype(np.float32)
    across = state.bend.numpy()
    angle = pose[:, 2]
    offset = np.stack(
        [along * np.cos(angle) - across * np.sin(angle), along * np.sin(angle) + across * np.cos(angle)], axis=1
    )
    return position[body] + offset * model.unit


def _settled(model: Model, position: np.ndarray) -> np.ndarray:
    """Undo what rounding to float32 did to bodies on the very edge of the support."""
    problem = model.problem
    for k, support in enumerate(model.supports):
        if (support > 0.0).all():
            continue
        own = (model.body.support == k) & ~model.fixed
        position[own] = move_into_support(support, position[own], problem.rectangle.size)
    return position
