"""The direction of a descent step: memoryless BFGS, from sums over all bodies."""

from __future__ import annotations

import math

import warp as wp

from ..device.launcher import Launcher, Until
from . import kernels_direction
from .line_rules import LineRules
from .surface_line_rules import SurfaceLineRules

__all__ = ["ANY_STRETCH", "Direction"]

# Stands for no bound on the length of a step, relative to the moves that the forces ask for.
ANY_STRETCH = 1e30


class Direction:
    """The direction of a descent, in the plane or on a surface.

    Args:
        launcher: Runs the kernels.
        body_count: Number of bodies.
        rules: Rules for the lines among them.
        most_stretch: Largest length of a step, relative to the moves that the forces ask for.

    Attributes:
        sums: The sums that bodies add to, see :mod:`.kernels_direction`.
        factors: What :func:`.kernels_direction.decide_direction` writes, shape ``[4]``.
    """

    def __init__(
        self,
        launcher: Launcher,
        body_count: int,
        rules: LineRules | SurfaceLineRules,
        most_stretch: float = ANY_STRETCH,
    ) -> None:
        self._launcher, self._body_count, self._rules = launcher, body_count, rules
        self._most_stretch = most_stretch
        on_gpu = launcher.device.is_cuda
        slots = kernels_direction.SLOTS_ON_GPU if on_gpu else kernels_direction.SLOTS_ON_CPU
        count = kernels_direction.LENGTHS + rules.kind_count
        # No two threads write to one cache line.
        room = count if on_gpu else count + kernels_direction.SUMS_APART
        self.sums = launcher.zeros((launcher.thread_count, room, slots), wp.int64)
        self._totals = launcher.zeros(count, wp.int64)
        self._arrived = launcher.zeros(1, wp.int32)
        self.factors = launcher.zeros(4, float)

    def decide(self, length_factor: wp.array) -> None:
        """Launch the kernel that computes the direction, after all bodies have added to the sums; it also adapts ``length_factor``."""
        slots = self.sums.shape[2]
        at_once = min(kernels_direction.SLOTS_AT_ONCE, slots)
        elements = len(self._totals) * slots // at_once
        rules = self._rules
        self._launcher.launch(
            kernels_direction.decide_direction,
            elements,
            [elements, at_once, rules.kind_count, self._most_stretch, rules.line_count, rules.pressed],
            [self.sums, self._totals, self._arrived, self.factors, length_factor],
            # One thread of the CPU does all.
            grain=elements,
        )

    def residual(self) -> float:
        """RMS of the moves that the forces asked for in the last step, over the local spacing; NaN where one is no finite number."""
        squares = float(self.factors.numpy()[3])
        return math.sqrt(max(squares, 0.0) / self._body_count) if math.isfinite(squares) else math.nan

    def settled(self, tolerance: float) -> Until:
        """When steps are to end: once the residual may be below a tolerance, or is no number.

        Rounding must not hide that, so the limit is a little higher; whoever stops there looks at the residual itself.
        """
        return Until(self.factors, 3, tolerance**2 * self._body_count * (1.0 + 1e-5))
