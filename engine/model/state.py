"""Where the bodies are, and what the descent remembers of the way there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from .state_arrays import StateArrays

__all__ = ["State"]


@dataclass(eq=False)
class State(StateArrays):
    """The state of a run: everything that a step reads and changes. Lengths in the solver's unit (:class:`~.model.Model`).

    Attributes:
        pose: Position, angle [rad] and length of every body's axis, ``wp.vec4``, shape ``[body_count]``.
        turn: How every outline is turned, of lines from their axes [rad], float, shape ``[body_count]``.
        bend: How far every charge stands beside its body's axis, float, shape ``[charge_count]``.
        displacement: What the last step changed of the poses, ``wp.vec4``, shape ``[body_count]``.
        move: What the forces asked for in the last step, ``wp.vec4``, shape ``[body_count]``.
        length_factor: What makes up for the pressure of the charges in the length of every kind of line, float.
        steps: Steps taken, shape ``[1]``, int32, on the host.
        unit: Meters per unit of length, shape ``[1]``, on the host.
    """

    pose: wp.array
    turn: wp.array
    bend: wp.array
    displacement: wp.array
    move: wp.array
    length_factor: wp.array
    steps: np.ndarray
    unit: np.ndarray

    KINDS: ClassVar[dict[str, type]] = {
        "pose": wp.vec4,
        "turn": float,
        "bend": float,
        "displacement": wp.vec4,
        "move": wp.vec4,
        "length_factor": float,
    }
