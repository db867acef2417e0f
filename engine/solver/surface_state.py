"""Where bodies on a surface are, and what the descent remembers of the way there."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import ClassVar

import numpy as np
import warp as wp

__all__ = ["SurfaceState"]


@dataclass(eq=False)
class SurfaceState:
    """The state of a run on a surface. Lengths in the solver's unit (:class:`~.model.Model`).

    Attributes:
        facet: Facet that every body is on (:mod:`~esh.engine.surface.facets`), int32, shape ``[body_count]``.
        weight: Weights of the facet's second and third corner, ``wp.vec2``.
        displacement: What the last step changed of the positions, ``wp.vec3``.
        move: What the forces asked for in the last step, ``wp.vec3``.
        axis: Half the axis of every body along the surface, ``wp.vec3``; 0 for a dot.
        turned: What the last step changed of angle and length, ``wp.vec2``.
        turn: What the forces asked to change of them, ``wp.vec2``.
        length_factor: What makes up for the pressure of the charges in the length of every kind of line, float.
        steps: Steps taken, shape ``[1]``, int32, on the host.
    """

    facet: wp.array
    weight: wp.array
    displacement: wp.array
    move: wp.array
    axis: wp.array
    turned: wp.array
    turn: wp.array
    length_factor: wp.array
    steps: np.ndarray

    KINDS: ClassVar[dict[str, type]] = {
        "facet": wp.int32,
        "weight": wp.vec2,
        "displacement": wp.vec3,
        "move": wp.vec3,
        "axis": wp.vec3,
        "turned": wp.vec2,
        "turn": wp.vec2,
        "length_factor": float,
    }

    def copy(self) -> SurfaceState:
        """A state of its own with the same values, on the same device."""
        copies = {name: wp.clone(array) for name, array in self._arrays().items()}
        return SurfaceState(**copies, steps=self.steps.copy())

    def assign(self, other: SurfaceState) -> None:
        """Take over the values of another state, of the same shapes; it may be on another device."""
        for name, array in self._arrays().items():
            given = getattr(other, name)
            if given.shape != array.shape:
                raise ValueError(f"`{name}` must have shape {array.shape}; got {given.shape}")
            wp.copy(array, given)
        self.steps[:] = other.steps

    def save(self, path: str | Path) -> None:
        """Write the state as `.npz`."""
        np.savez(path, steps=self.steps, **{name: array.numpy() for name, array in self._arrays().items()})

    @classmethod
    def load(cls, path: str | Path) -> SurfaceState:
        """Read what :meth:`save` has written, onto the CPU."""
        with np.load(path) as stored:
            arrays = {name: wp.array(stored[name], dtype=kind, device="cpu") for name, kind in cls.KINDS.items()}
            return cls(**arrays, steps=stored["steps"].astype(np.int32))

    def _arrays(self) -> dict[str, wp.array]:
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "steps"}
