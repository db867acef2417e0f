"""Contact of footprints: pushing bodies apart."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBOURS, Launcher
from ..space import kernels_images
from ..space.neighbourhood import Neighbourhood
from . import kernels_contact, kernels_descent
from .body_flags import BodyFlags
from .model import Model

__all__ = ["Contact"]

# Rounds of pushing after every step of the relaxation, and at its end, where a run of so many without progress is the last.
ROUNDS_PER_STEP = 4
LAST_ROUNDS = 2000
ROUNDS_WITHOUT_PROGRESS = 200
# Where footprints cannot fit, ever fewer of them part: progress is to have at most this share of the overlaps left that there were, or
# fewer than before once only so many are left.
PROGRESS = 0.97
FEW_OVERLAPS = 100
# Share of a push that is made at once, and how much farther than touching bodies are pushed, as a share of their radii.
DAMPING = 0.9
SLACK = 1e-3
# Lines that may overlap still do not cross: footprints thinned to this share keep apart.
AXIS_RADIUS = 0.25
# Bodies that the CPU looks after with one reading of a kernel's many arguments.
BODIES_AT_ONCE = 32
# Rounds between two looks at the number of overlaps that are left.
ROUNDS_AT_ONCE = 10


class Contact:
    """Pushes bodies apart whose footprints overlap, while the relaxation runs and at its end.

    Args:
        model: What is to be placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        images: Densities, as the descent's kernels take them.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        bodies: kernels_descent.Bodies,
        images: kernels_images.Images,
    ) -> None:
        self.launcher = launcher
        self._bodies = bodies
        self._images = images
        self._model = model
        longest, area = model.body.longest, model.body.area
        # Lines whose length the forces change may be longer for a while.
        half = 0.5 * kernels_descent.LONGEST_LINE * longest
        mass = np.where(model.body.flags & BodyFlags.PINNED, np.inf, area)
        self._near = Neighbourhood(
            launcher,
            model.size,
            model.problem.domain.periodic,
            self._radii(longest) / model.unit,
            half / model.unit,
            mass,
        )
        n = model.body_count
        self._pushed = launcher.empty(n, wp.vec4)
        self._spare = launcher.zeros(n, wp.vec4)

    def _radii(self, length: np.ndarray) -> np.ndarray:
        """Radius of every disc, half the thickness of every capsule [m], for axes of these lengths [m]."""
        width = self._model.widths(length)
        radius = np.where(width > 0.0, 0.5 * width, np.sqrt(self._model.body.area / math.pi))
        return radius if self._model.problem.avoid_overlap else AXIS_RADIUS * radius

    def push(self, pose: wp.array, bend: wp.array, displacement: wp.array) -> None:
        """Push overlapping bodies apart for a few rounds, as part of the step that ``displacement`` describes."""
        # What a push brings together is found in the next step.
        self._near.sort(pose)
        for _ in range(ROUNDS_PER_STEP):
            self._round(pose, bend, displacement)

    def separate(self, pose: wp.array, bend: wp.array) -> None:
        """Push until nothing overlaps, or no progress is made."""
        # Where lines have no width of their own, it follows from the lengths that they have reached.
        reached = pose.numpy()[:, 3].astype(np.float64) * self._model.unit
        self._near.footprints.radius.assign((self._radii(reached) / self._model.unit).astype(np.float32))

        def run_round() -> None:
            self._near.sort(pose)
            self._round(pose, bend, self._spare)

        # Bodies that do not move stay on each other.
        most = self._pinned_overlaps(pose, reached)
        one_round = self.launcher.record(run_round)
        counting = self.launcher.record(lambda: self._near.count_overlaps(pose, 0.0))
        fewest, since = math.inf, 0
        for _ in range(0, LAST_ROUNDS, ROUNDS_AT_ONCE):
            for _ in range(ROUNDS_AT_ONCE):
                one_round.play()
            counting.play()
            left = self._near.counted_overlaps() - most
            if left <= 0:
                return
            since = 0 if left < max(PROGRESS * fewest, min(fewest, FEW_OVERLAPS)) else since + ROUNDS_AT_ONCE
            fewest = min(fewest, left) if since == 0 else fewest
            if since >= ROUNDS_WITHOUT_PROGRESS:
                return

    def _pinned_overlaps(self, pose: wp.array, length: np.ndarray) -> int:
        """Overlaps among bodies that do not move; axes of lengths [m]."""
        model = self._model
        pinned = np.flatnonzero(model.body.flags & BodyFlags.PINNED)
        if not len(pinned):
            return 0
        near = Neighbourhood(
            self.launcher,
            model.size,
            model.problem.domain.periodic,
            self._radii(length)[pinned] / model.unit,
            0.5 * length[pinned] / model.unit,
            model.body.area[pinned],
        )
        alone = wp.array(pose.numpy()[pinned], dtype=wp.vec4, device=self.launcher.device)
        return near.overlap_count(alone, 0.0)

    def _round(self, pose: wp.array, bend: wp.array, displacement: wp.array) -> None:
        near = self._near
        at_once = 1 if self.launcher.device.is_cuda else BODIES_AT_ONCE
        self.launcher.launch(
            kernels_contact.push_apart,
            -(-near.body_count // at_once),
            [
                pose,
                near.near,
                near.footprints,
                near.cell_start,
                near.grid,
                SLACK,
                DAMPING,
                near.body_count,
                at_once,
            ],
            [self._pushed],
            grain=max(1, GRAIN_OF_NEIGHBOURS // at_once),
        )
        self.launcher.launch(
            kernels_contact.accept_push,
            near.body_count,
            [
                self._pushed,
                near.footprints,
                self._bodies,
                bend,
                self._images,
                near.grid.space,
            ],
            [near.near, pose, displacement],
        )
