"""Where the bodies are, and what the descent remembers of the way there."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import warp as wp

__all__ = ["State"]


@dataclass(eq=False)
class State:
    """The state of a run: everything that a step reads and changes. Lengths in the solver's unit (:class:`~.model.Model`).

    Attributes:
        pose: Position, angle [rad] and length of every body's axis, ``wp.vec4``, shape ``[body_count]``.
        turn: How every outline is turned, of lines from their axes [rad], float, shape ``[body_count]``.
        bend: How far every charge stands beside its body's axis, float, shape ``[charge_count]``.
        displacement: What the last step changed of the poses, ``wp.vec4``, shape ``[body_count]``.
        move: What the forces asked for in the last step, ``wp.vec4``, shape ``[body_count]``.
        length_factor: What makes up for the pressure of the charges in the length of every kind of line, float.
        steps: Steps taken, shape ``[1]``, int32, on the host.
    """

    pose: wp.array
    turn: wp.array
    bend: wp.array
    displacement: wp.array
    move: wp.array
    length_factor: wp.array
    steps: np.ndarray

    def copy(self) -> State:
        """A state of its own with the same values, on the same device."""
        copies = {name: wp.clone(array) for name, array in self._arrays().items()}
        return State(**copies, steps=self.steps.copy())

    def assign(self, other: State) -> None:
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
    def load(cls, path: str | Path) -> State:
        """Read what :meth:`save` has written, onto the CPU."""
        kinds = {"pose": wp.vec4, "displacement": wp.vec4, "move": wp.vec4}
        with np.load(path) as stored:
            arrays = {
                name: wp.array(stored[name], dtype=kinds.get(name, float), device="cpu")
                for name in (field.name for field in fields(cls))
                if name != "steps"
            }
            return cls(**arrays, steps=stored["steps"].astype(np.int32))

    def _arrays(self) -> dict[str, wp.array]:
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "steps"}
