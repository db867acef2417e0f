"""The state of a run, in the plane or on a surface: where all bodies are, and what the descent remembers from the last step."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self
from zipfile import BadZipFile

import numpy as np
import warp as wp

from ..errors import ProblemError

__all__ = ["State", "StateArrays", "SurfaceState"]


class StateArrays:
    """Base of a dataclass whose fields are arrays of Warp, of the ``KINDS`` that it says, and three on the host.

    Attributes:
        steps: Steps taken, shape ``[1]``, int32.
        unit: Meters per unit of length, shape ``[1]``.
        identity: Identity of every body, shape ``[body_count]``, int32; None where they are those that the problem gives.
    """

    KINDS: ClassVar[dict[str, type]] = {}
    steps: np.ndarray
    unit: np.ndarray
    identity: np.ndarray | None

    def copy(self) -> Self:
        """A state of its own with the same values, on the same device."""
        copies: dict[str, Any] = {name: wp.clone(array) for name, array in self._arrays().items()}
        identity = None if self.identity is None else self.identity.copy()
        return type(self)(**copies | {"steps": self.steps.copy(), "unit": self.unit.copy(), "identity": identity})

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
                raise ProblemError(
                    f"`{name}` must have shape {array.shape}; got {given.shape}: this is the state of another problem"
                )

    def save(self, path: str | Path) -> None:
        """Write the state as `.npz`, which is added to the name where it lacks."""
        arrays = {name: array.numpy() for name, array in self._arrays().items()}
        known = {} if self.identity is None else {"identity": self.identity}
        np.savez(path, steps=self.steps, unit=self.unit, **arrays, **known)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what :meth:`save` has written, onto the CPU.

        Raises:
            ProblemError: A file that holds something else.
            OSError: No such file.
        """
        try:
            with np.load(path) as stored:
                arrays: dict[str, Any] = {
                    name: wp.array(stored[name], dtype=kind, device="cpu") for name, kind in cls.KINDS.items()
                }
                identity = stored["identity"].astype(np.int32) if "identity" in stored else None
                on_host = {"steps": stored["steps"].astype(np.int32), "unit": stored["unit"], "identity": identity}
                return cls(**arrays | on_host)
        except (ValueError, KeyError, TypeError, RuntimeError, EOFError, BadZipFile) as error:
            raise ProblemError(f"{path} holds no {cls.__name__} that this version has saved") from error

    def _arrays(self) -> dict[str, wp.array]:
        return {name: getattr(self, name) for name in self.KINDS}


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
        identity: :attr:`Placement.id` of every body, shape ``[body_count]``, int32, on the host; None where they are those that the
            problem gives.
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
    identity: np.ndarray | None = None

    KINDS: ClassVar[dict[str, type]] = {
        "pose": wp.vec4,
        "turn": float,
        "bend": float,
        "displacement": wp.vec4,
        "move": wp.vec4,
        "length_factor": float,
        "target_factor": float,
    }


@dataclass(eq=False)
class SurfaceState(StateArrays):
    """The state of a run on a surface: everything that a step changes. Lengths are in the solver's unit (:class:`~.model.Model`).

    Arrays have shape ``[body_count]`` unless another one is given.

    Attributes:
        facet: Index of the facet that every body is on (:mod:`~esh.engine.surface.facets`), int32.
        weight: Barycentric weights of that facet's second and third corner, ``wp.vec2``.
        displacement: Change of the positions in the last step, ``wp.vec3``.
        move: Change of the positions that the forces asked for in the last step, ``wp.vec3``.
        axis: Half the axis of every body, a vector along the surface, ``wp.vec3``; 0 for a dot.
        bend: Offset of every charge perpendicular to its body's axis, float, shape ``[charge_count]``.
        heading: Rotation of every outline [rad], float. For a line it is measured from its axis; for other bodies from the direction
            along the surface that is nearest to x, or to y where the surface looks along x.
        turned: Change of a line's angle and length in the last step, ``wp.vec2``. Of a dot on a crumb (a part of the surface for a few
            bodies only), the second number is how far it has come.
        turn: Change of a line's angle and length that the forces asked for, ``wp.vec2``.
        length_factor: Correction of the lengths of lines for the pressure of their charges, float, one for every kind of line.
        steps: Steps taken, shape ``[1]``, int32, on the host.
        unit: Meters per unit of length, shape ``[1]``, on the host.
        identity: :attr:`Placement.id` of every body, shape ``[body_count]``, int32, on the host; None where they are those that the
            problem gives.
    """

    facet: wp.array
    weight: wp.array
    displacement: wp.array
    move: wp.array
    axis: wp.array
    bend: wp.array
    heading: wp.array
    turned: wp.array
    turn: wp.array
    length_factor: wp.array
    steps: np.ndarray
    unit: np.ndarray
    identity: np.ndarray | None = None

    KINDS: ClassVar[dict[str, type]] = {
        "facet": wp.int32,
        "weight": wp.vec2,
        "displacement": wp.vec3,
        "move": wp.vec3,
        "axis": wp.vec3,
        "bend": float,
        "heading": float,
        "turned": wp.vec2,
        "turn": wp.vec2,
        "length_factor": float,
    }
