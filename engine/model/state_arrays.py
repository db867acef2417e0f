"""What the states of all spaces have in common: their arrays are copied, handed over, saved and read."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import warp as wp

from ..errors import ProblemError

__all__ = ["StateArrays"]


class StateArrays:
    """Base of a dataclass whose fields are arrays of Warp, of the ``KINDS`` that it says, and two on the host.

    Attributes:
        steps: Steps taken, shape ``[1]``, int32.
        unit: Meters per unit of length, shape ``[1]``.
    """

    KINDS: ClassVar[dict[str, type]] = {}
    steps: np.ndarray
    unit: np.ndarray

    def copy(self) -> Self:
        """A state of its own with the same values, on the same device."""
        copies: dict[str, Any] = {name: wp.clone(array) for name, array in self._arrays().items()}
        return type(self)(**copies | {"steps": self.steps.copy(), "unit": self.unit.copy()})

    def assign(self, other: Self) -> None:
        """Take over the values of another state, of the same shapes and unit; it may be on another device."""
        self.check(other)
        for name, array in self._arrays().items():
            wp.copy(array, getattr(other, name))
        self.steps[:] = other.steps

    def check(self, other: Self) -> None:
        """Raise ProblemError where the arrays of another state have other shapes."""
        for name, array in self._arrays().items():
            given = getattr(other, name)
            if given.shape != array.shape:
                raise ProblemError(f"`{name}` must have shape {array.shape}; got {given.shape}")

    def save(self, path: str | Path) -> None:
        """Write the state as `.npz`."""
        np.savez(
            path, steps=self.steps, unit=self.unit, **{name: array.numpy() for name, array in self._arrays().items()}
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what :meth:`save` has written, onto the CPU."""
        with np.load(path) as stored:
            arrays: dict[str, Any] = {
                name: wp.array(stored[name], dtype=kind, device="cpu") for name, kind in cls.KINDS.items()
            }
            return cls(**arrays | {"steps": stored["steps"].astype(np.int32), "unit": stored["unit"]})

    def _arrays(self) -> dict[str, wp.array]:
        return {name: getattr(self, name) for name in self.KINDS}
