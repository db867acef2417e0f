"""Which bodies of a new model were in an old one, and where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

__all__ = ["CarriedInPlane", "CarriedOver"]


@dataclass(frozen=True, eq=False)
class CarriedOver:
    """Who the bodies of a new model are after an edit.

    Attributes:
        source: Index of the same body in the old model, -1 for a new one, shape ``[n]``.
        identity: Identity of every body, shape ``[n]``.
    """

    source: np.ndarray
    identity: np.ndarray


@dataclass(frozen=True, eq=False)
class CarriedInPlane(CarriedOver):
    """And where they are in a rectangle.

    Attributes:
        pose: Positions in the new model's unit, with neither angles nor lengths, on the device, ``wp.vec4``, shape ``[n]``.
        new: Rows of bodies that are new, from the smallest on.
        gone: Indices of bodies in the old model that are no more, from the smallest on.
        changes: Where bodies came, went or were moved, in the new model's unit, on the device, each ``wp.vec2``.
    """

    pose: wp.array
    new: np.ndarray
    gone: np.ndarray
    changes: list[wp.array]
