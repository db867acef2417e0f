"""Which bodies of a new model were in an old one, and where they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp

__all__ = ["CarriedInPlane", "CarriedOver"]


@dataclass(frozen=True, eq=False)
class CarriedOver:
    """Who the bodies of a new model on a surface are after an edit.

    Attributes:
        source: Index of the same body in the old model, -1 for a new one, shape ``[n]``.
        identity: Identity of every body, shape ``[n]``.
        gone: Which bodies of the old model are no more, bool, shape ``[old count]``.
        left: Tiles that these have left.
    """

    source: np.ndarray
    identity: np.ndarray
    gone: np.ndarray
    left: np.ndarray


@dataclass(frozen=True, eq=False)
class CarriedInPlane:
    """Who the bodies of a new model in a rectangle are after an edit, and where; what all of them have is on the device.

    Attributes:
        sources: Index of the same body in the old model, -1 for a new one, ``wp.int32``, shape ``[n]``.
        identity: Identity of every body, ``wp.int32``, shape ``[n]``.
        pose: Positions in the new model's unit, with neither angles nor lengths, ``wp.vec4``, shape ``[n]``.
        new: Rows of bodies that are new, from the smallest on.
        came: Their identities.
        went: Identities of bodies of the old model that are no more.
        changes: Where bodies came, went or were moved, in the new model's unit, each ``wp.vec2``.
    """

    sources: wp.array
    identity: wp.array
    pose: wp.array
    new: np.ndarray
    came: np.ndarray
    went: np.ndarray
    changes: list[wp.array]

    @cached_property
    def source(self) -> np.ndarray:
        """The sources, for whoever asks: few do, and there may be millions."""
        return self.sources.numpy()
