"""Where bodies on a surface are, and what the descent remembers of the way there."""

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
    """The state of a run on a surface. Lengths in the solver's unit (:class:`~.model.Model`).

    Attributes:
        facet: Facet that every body is on (:mod:`~esh.engine.surface.facets`), int32, shape ``[body_count]``.
        weight: Weights of the facet's second and third corner, ``wp.vec2``.
        displacement: What the last step changed of the positions, ``wp.vec3``.
        move: What the forces asked for in the last step, ``wp.vec3``.
        axis: Half the axis of every body along the surface, ``wp.vec3``; 0 for a dot.
        bend: How far every charge stands beside its body's axis, float, shape ``[charge_count]``.
        heading: How every outline is turned [rad], float: from the direction along the surface that is nearest to x (to y where it
            looks along x), of a line from its axis.
        turned: What the last step changed of a line's angle and length, ``wp.vec2``; of a dot on a crumb the second number is how far
            it has come.
        turn: What the forces asked to change of them, ``wp.vec2``.
        length_factor: What makes up for the pressure of the charges in the length of every kind of line, float.
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
