"""Contact of footprints on a surface: pushing bodies apart along it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher, Recording
from ..problem.body_kind import radius_of
from ..space.cell_sort import CellSort
from . import kernels_descent, kernels_on_surface, kernels_surface_contact
from .body_flags import BodyFlags
from .contact import AXIS_RADIUS, DAMPING, ROUNDS_PER_STEP, SLACK
from .model import Model

__all__ = ["SurfaceContact"]

# Rounds of pushing at the end, where a run of so many without progress is the last.
LAST_ROUNDS = 2000
ROUNDS_WITHOUT_PROGRESS = 200
# Where footprints cannot fit, ever fewer of them part: progress is to have at most this share of the overlaps left that there were, or
# fewer than before once only so many are left.
PROGRESS = 0.97
FEW_OVERLAPS = 100
# Rounds between two looks at the number of overlaps that are left.
ROUNDS_AT_ONCE = 10
# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
SLOTS_PER_BODY = 2


class SurfaceContact:
    """Pushes bodies on a surface apart whose footprints overlap, while the relaxation runs and at its end.

    Args:
        model: What is to be placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        ground: The surface, as the descent's kernels take it.
        poses: Where the bodies are, as the descent's kernels take it.
        motion: What is remembered of their way there, as the descent's kernels take it.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        bodies: kernels_descent.Bodies,
        ground: kernels_on_surface.Ground,
        poses: kernels_on_surface.Poses,
        motion: kernels_on_surface.Motion,
    ) -> None:
        self._model, self._launcher, self._bodies, self._ground = model, launcher, bodies, ground
        self._poses, self._motion = poses, motion
        device, n = launcher.device, model.body_count
        longest = model.body.longest
        half = 0.5 * kernels_descent.LONGEST_LINE * longest / model.unit
        radius = self._radii(longest) / model.unit
        reach = radius + half
        level = np.clip(np.log2(reach.max() / reach), 0, MOST_LEVELS - 1).astype(np.int32)
        level = np.unique(level, return_inverse=True)[1].ravel().astype(np.int32)
        level_reach = np.array([reach[level == m].max() for m in range(int(level.max()) + 1)])
        mass = np.where(model.body.flags & BodyFlags.PINNED, np.inf, model.body.area)
        footprints = kernels_surface_contact.Footprints()
        footprints.level_count = len(level_reach)
        footprints.level = wp.array(level, dtype=wp.int32, device=device)
        footprints.radius = wp.array(radius, dtype=float, device=device)
        footprints.reach = wp.array(reach, dtype=float, device=device)
        footprints.mass = wp.array(mass / mass[np.isfinite(mass)].mean(), dtype=float, device=device)
        footprints.level_reach = wp.array(level_reach, dtype=float, device=device)
        footprints.inverse_cell = wp.array(0.5 / level_reach, dtype=float, device=device)
        self._footprints = footprints
        slots = 1 << max(4, (SLOTS_PER_BODY * n - 1).bit_length())
        self._sort = CellSort(launcher, n, slots)
        self._position = launcher.empty(n, wp.vec3)
        self._slots = kernels_surface_contact.Slots()
        self._slots.order, self._slots.start, self._slots.mask = self._sort.order, self._sort.cell_start, slots - 1
        self._slots.sorted_at = launcher.empty(n, wp.vec3)
        self._pushes = kernels_surface_contact.Pushes()
        self._pushes.shift, self._pushes.turn = launcher.zeros(n, wp.vec3), launcher.zeros(n, float)
        self._pushes.count, self._pushes.overlaps = launcher.zeros(n, wp.int32), launcher.zeros(n, wp.int32)

    def _radii(self, length: np.ndarray) -> np.ndarray:
        """Radius of every disc, half the thickness of every capsule [m], for axes of these lengths [m]."""
        width = self._model.widths(length)
        radius = radius_of(width, self._model.body.area)
        footprints = self._model.footprints
        apart = radius * footprints.room + 0.5 * footprints.gap
        return apart if self._model.problem.avoid_overlap else AXIS_RADIUS * radius

    def push(self) -> None:
        """Push overlapping bodies apart for a few rounds, as part of the step that the motion describes."""
        self._find()
        for _ in range(ROUNDS_PER_STEP):
            self._round()

    def separate(self, go_on: Callable[[], bool] | None = None) -> bool:
        """Push until nothing overlaps, no progress is made or ``go_on`` says so; returns whether nothing overlaps."""
        reached = 2.0 * np.linalg.norm(self._poses.axis.numpy().astype(np.float64), axis=1) * self._model.unit
        self._footprints.radius.assign((self._radii(reached) / self._model.unit).astype(np.float32))

        def run_round() -> None:
            self._find()
            self._round()

        one_round = self._launcher.record(run_round)
        try:
            return self._push_until_parted(one_round, go_on)
        finally:
            self._launcher.release(one_round)

    def _push_until_parted(self, one_round: Recording, go_on: Callable[[], bool] | None) -> bool:
        fewest, since = math.inf, 0
        for _ in range(0, LAST_ROUNDS, ROUNDS_AT_ONCE):
            one_round.play(ROUNDS_AT_ONCE)
            # As they were before the last push.
            left = int(self._pushes.overlaps.numpy().sum(dtype=np.int64)) // 2
            if left == 0:
                return True
            if go_on is not None and not go_on():
                return False
            since = 0 if left < max(PROGRESS * fewest, min(fewest, FEW_OVERLAPS)) else since + ROUNDS_AT_ONCE
            fewest = min(fewest, left) if since == 0 else fewest
            if since >= ROUNDS_WITHOUT_PROGRESS:
                return False
        return False

    def _find(self) -> None:
        """Sort bodies into cells where they are now."""
        self._sort.sort(
            kernels_surface_contact.contact_slots,
            [self._poses, self._footprints, self._ground, self._slots.mask, self._position],
        )
        self._launcher.launch(
            kernels_surface_contact.keep_positions, self._model.body_count, [self._position], [self._slots.sorted_at]
        )

    def _round(self) -> None:
        n, ground = self._model.body_count, self._ground
        self._launcher.launch(
            kernels_surface_contact.push_apart,
            n,
            [self._poses, self._position, self._slots, self._footprints, ground, SLACK, DAMPING],
            [self._pushes],
            grain=GRAIN_OF_NEIGHBORS,
        )
        self._launcher.launch(
            kernels_surface_contact.accept_push,
            n,
            [self._pushes, self._bodies, ground],
            [self._poses, self._position, self._motion],
        )
