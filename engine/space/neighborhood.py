"""What may touch what: discs, and capsules around the axes of lines.

Neighbors are found in a grid of cells per level of size, so that a few large bodies among many small ones cost no more than both
by themselves.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from . import kernels_neighborhood
from .cell_sort import CellSort
from .kernels_meeting import Meeting
from .space import Space

__all__ = ["Neighborhood"]

# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12


class Neighborhood:
    """Finds what may touch what.

    Args:
        launcher: Where to run.
        space: Where they are.
        radius: Of every body's disc, or half the thickness of its capsule, shape ``[n]``.
        half_length: Half the longest axis that it may have, shape ``[n]``.
        mass: Of every body, shape ``[n]``; infinite for one that others cannot push.
        meeting: Which of them keep apart.

    Attributes:
        footprints: Level, radius and mass of every body, on the device.
        for_kernels: What kernels find neighbors by.
    """

    def __init__(
        self,
        launcher: Launcher,
        space: Space,
        radius: np.ndarray,
        half_length: np.ndarray,
        mass: np.ndarray,
        meeting: Meeting,
    ) -> None:
        self.launcher = launcher
        n = len(radius)
        reach = radius + half_length
        level = np.clip(np.log2(reach.max() / reach), 0, MOST_LEVELS - 1).astype(np.int32)
        used = np.flatnonzero(np.bincount(level))
        level = np.searchsorted(used, level).astype(np.int32) if len(used) <= used[-1] else level
        most_reach = np.array([reach.max(initial=0.0, where=level == m) for m in range(len(used))])
        # Cells as large as a body, but not many more than bodies.
        cell = np.maximum(2.0 * most_reach, math.sqrt(space.area / (2 * n + 64)))
        counts = np.array([[max(1, int(length / side)) for length in space.size] for side in cell])
        first = np.concatenate([[0], np.cumsum(counts.prod(axis=1))])
        grid = kernels_neighborhood.ContactGrid()
        grid.level_count = len(used)
        grid.reach = launcher.array(most_reach, float)
        grid.count_x = launcher.array(counts[:, 0], wp.int32)
        grid.count_y = launcher.array(counts[:, 1], wp.int32)
        grid.first_cell = launcher.array(first, wp.int32)
        grid.space = space.for_kernels()
        footprints = kernels_neighborhood.Footprints()
        footprints.level = launcher.own_array(level, wp.int32)
        footprints.radius = launcher.own_array(radius, float)
        footprints.mass = launcher.array(mass / mass[np.isfinite(mass)].mean(), float)
        footprints.meeting = meeting
        self.footprints = footprints
        self.body_count = n
        self._cells = CellSort(launcher, n, int(first[-1]), spread=True)
        room = n + kernels_neighborhood.LANES
        near = kernels_neighborhood.Sorted()
        near.body = self._cells.order
        near.rank = launcher.empty(n, wp.int32)
        near.x, near.y, near.reach = (launcher.zeros(room, float) for _ in range(3))
        near.half_axis = launcher.zeros(room, wp.vec2)
        neighbors = kernels_neighborhood.Neighbors()
        neighbors.bodies, neighbors.footprints = near, footprints
        neighbors.cell_start, neighbors.grid = self._cells.cell_start, grid
        self.for_kernels = neighbors

    def sort(self, pose: wp.array) -> None:
        """Put bodies where they are now into the cells."""
        self._cells.sort(kernels_neighborhood.contact_keys, [pose, self.for_kernels])
        self.launcher.launch(kernels_neighborhood.gather_bodies, self.body_count, [pose], [self.for_kernels])
