"""The state of a run on a surface: where all bodies are, and what the descent remembers from the last step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from ..model.state_arrays import StateArrays
from . import kernels_on_surface

__all__ = ["SurfaceState"]


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

    def poses(self) -> kernels_on_surface.Poses:
        """Where the bodies are, as kernels take it."""
        poses = kernels_on_surface.Poses()
        poses.facet, poses.weight, poses.axis = self.facet, self.weight, self.axis
        poses.bend = self.bend
        return poses

    def motion(self, change: wp.array, turn_change: wp.array) -> kernels_on_surface.Motion:
        """What is remembered, as kernels take it, beside arrays for what the moves and turns changed by."""
        motion = kernels_on_surface.Motion()
        motion.displacement, motion.move, motion.change = self.displacement, self.move, change
        motion.turned, motion.turn, motion.turn_change = self.turned, self.turn, turn_change
        return motion
