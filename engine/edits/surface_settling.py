"""Bodies on a surface that an edit holds near where they were; see :mod:`.settling`."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..descent.surface_descent import SurfaceDescent
from . import kernels_surface_settling
from .settling import Held, Schedule, most_free, reach, settle

__all__ = ["settle_on_surface"]

# How many may move far for each that came or went, where these are many: more than in the plane, since who comes and goes is spread
# less evenly. Measured on a sphere and a stroke of three times the density that takes a tenth of all from elsewhere: errors are 1.8
# times the later ones, and two thirds of the others stay; with 3 they are 2.2 times, and three quarters stay.
FREE_FOR_EACH = 4.0
# Up to so many bodies are held for longer. Measured with a twentieth of a sphere, a torus and a knotted tube painted to a fifth of the
# density, and counts as they were: with 2 steps errors are 1.26 to 1.58 times the later ones, with these 1.11 to 1.26; with 10,000
# bodies both are 1.2. Four fifths of the others stay.
FEW_BODIES, OF_FEW = 5_000, Schedule(12, 10, 0.203)


def settle_on_surface(descent: SurfaceDescent, source: np.ndarray, left: np.ndarray, steps: int) -> None:
    """Take the steps after an edit; where nobody came or went, there are no others than these ``steps``.

    Args:
        descent: Of a surface, before its first step.
        source: Which of the bodies before the edit stands where that stood, -1 for others, shape ``[body_count]``.
        left: Tiles that bodies have left, shape ``[k]``.
        steps: How many to take behind those in which bodies settle.
    """
    if len(left) or (source < 0).any():
        settle(descent.launcher, descent.step, _HeldOnSurface(descent, source, left), steps)
    else:
        descent.step.play(steps)


class _HeldOnSurface(Held):
    """Those of a descent of a surface before its first step; see :func:`settle_on_surface` for the others."""

    def __init__(self, descent: SurfaceDescent, source: np.ndarray, left: np.ndarray) -> None:
        self._descent = descent
        self.body_count = len(source)
        # Lines are not held at all: they would go on for longer.
        few = len(source) <= FEW_BODIES and not descent.model.kinds
        self.schedule = OF_FEW if few else Schedule.usual(len(source))
        changed = max(len(left), int((source < 0).sum()))
        self.most_free = most_free(self.schedule.free, len(source), changed, FREE_FOR_EACH)
        launcher, charges = descent.launcher, descent.charges
        sources = launcher.array(source.astype(np.int32), wp.int32)
        start = kernels_surface_settling.Start()
        start.position, start.home = wp.clone(charges.points.position), wp.clone(charges.home)
        start.within, start.locally = reach(float(descent.facets.area.sum()), self.body_count)
        start.near = self._near(sources, launcher.array(left.astype(np.int32), wp.int32))
        self._where = [sources, descent.bodies, start, descent.ground]

    def count_moved(self, moved: wp.array) -> None:
        """See :meth:`.Held.count_moved`."""
        descent = self._descent
        inputs = [*self._where, descent.charges]
        descent.launcher.launch(kernels_surface_settling.count_moved, self.body_count, inputs, [moved], per_thread=True)

    def bring_back(self, free_from: wp.array) -> None:
        """See :meth:`.Held.bring_back`."""
        descent = self._descent
        descent.launcher.launch(
            kernels_surface_settling.bring_back,
            self.body_count,
            [*self._where, free_from],
            [descent.charges, descent.poses, descent.motion],
        )

    def _near(self, sources: wp.array, left: wp.array) -> wp.array:
        """Which nodes are near those of bodies that are new, or gone: 1 for these, ``wp.uint8``, shape ``[node_count]``."""
        descent, launcher = self._descent, self._descent.launcher
        cascade = descent.cascade
        marked, near = launcher.zeros(cascade.node_count, wp.int32), launcher.empty(cascade.node_count, wp.uint8)
        inputs = [sources, descent.bodies, descent.charges.home]
        launcher.launch(kernels_surface_settling.mark_new, self.body_count, inputs, [marked])
        launcher.launch(kernels_surface_settling.mark_places, len(left), [left, cascade.home], [marked])
        lists = cascade.neighbors
        launcher.launch(
            kernels_surface_settling.mark_beside, cascade.node_count, [marked, lists.start, lists.entry], [near]
        )
        return near
