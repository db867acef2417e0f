"""The state of a run in the plane: the poses of all bodies, and what the descent remembers from the last step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from .state_arrays import StateArrays

__all__ = ["State"]


@dataclass(eq=False)
class State(StateArrays):
    """The state of a run in the plane: everything that a step changes. Lengths are in the solver's unit (:class:`~.model.Model`).

    Attributes:
        pose: Position, angle [rad] and length of every body's axis, ``wp.vec4``, shape ``[body_count]``.
        turn: Rotation of every outline [rad], for lines relative to their axes, float, shape ``[body_count]``.
        bend: Offset of every charge perpendicular to its body's axis, float, shape ``[charge_count]``.
        displacement: Change of the poses in the last step, ``wp.vec4``, shape ``[body_count]``.
        move: Change of the poses that the forces asked for in the last step, ``wp.vec4``, shape ``[body_count]``.
        length_factor: Correction of the lengths of lines for the pressure of their charges, float: one for every kind of line, then
            one for every block of lines whose preferred lengths are an image.
        target_factor: By how much more is asked for than the densities say, as a share, at the nodes of a coarse mesh, one group after
            the other, float; empty where bodies are too few. See :mod:`~esh.engine.field.target_feedback`.
        steps: Steps taken, shape ``[1]``, int32, on the host.
        unit: Meters per unit of length, shape ``[1]``, on the host.
    """

    pose: wp.array
    turn: wp.array
    bend: wp.array
    displacement: wp.array
    move: wp.array
    length_factor: wp.array
    target_factor: wp.array
    steps: np.ndarray
    unit: np.ndarray

    KINDS: ClassVar[dict[str, type]] = {
        "pose": wp.vec4,
        "turn": float,
        "bend": float,
        "displacement": wp.vec4,
        "move": wp.vec4,
        "length_factor": float,
        "target_factor": float,
    }
