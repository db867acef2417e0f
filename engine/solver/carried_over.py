"""Which bodies of a new model were in an old one, and where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["CarriedOver"]


@dataclass(frozen=True, eq=False)
class CarriedOver:
    """Where the bodies of a new model are after an edit.

    Attributes:
        position: [m], shape ``[n, 2]``, float64.
        source: Index of the same body in the old model, -1 for a new one, shape ``[n]``.
        identity: Identity of every body, shape ``[n]``, int64.
        removed: Positions of bodies that were taken out [m], shape ``[m, 2]``.
        moved: Where bodies that stayed were and are, of those that are elsewhere now [m], shape ``[k, 2]``.
    """

    position: np.ndarray
    source: np.ndarray
    identity: np.ndarray
    removed: np.ndarray
    moved: np.ndarray

    @property
    def changes(self) -> np.ndarray:
        """Where bodies came, went or were moved [m], shape ``[c, 2]``."""
        return np.concatenate([self.position[self.new], self.removed, self.moved])

    @property
    def new(self) -> np.ndarray:
        """Whether a body is new, shape ``[n]``."""
        return self.source < 0
