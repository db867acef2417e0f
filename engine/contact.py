"""Contact of footprints: counting overlaps, and pushing bodies apart. Discs, and capsules around the axes of lines.

Neighbours are found in a grid of cells per level of size, so that a few large bodies among many small ones cost no more than both
by themselves.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from . import kernels_contact, kernels_update
from .cell_sort import CellSort
from .device import GRAIN_OF_NEIGHBOURS, Launcher
from .line_rules import line_widths
from .problem import Domain, Problem
from .quality import MeasuredBodies, measured_bodies

__all__ = ["Contact", "Neighbourhood", "count_overlaps", "overlap_count"]

# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
# Footprints that touch do not overlap: rounding of float32 positions is not an overlap.
TOUCH_TOLERANCE = 1e-4
# No body's overlaps are counted beyond this: footprints many times larger than the space would have n² of them.
MOST_OVERLAPS_PER_BODY = 200
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


class Neighbourhood:
    """Finds what may touch what.

    Args:
        launcher: Where to run.
        size: Extent of the domain along x and y.
        periodic: Whether it wraps.
        radius: Of every body's disc, or half the thickness of its capsule, shape ``[n]``.
        half_length: Half the longest axis that it may have, shape ``[n]``.
        mass: Of every body, shape ``[n]``.
    """

    def __init__(
        self,
        launcher: Launcher,
        size: tuple[float, float],
        periodic: bool,
        radius: np.ndarray,
        half_length: np.ndarray,
        mass: np.ndarray,
    ) -> None:
        self.launcher = launcher
        device = launcher.device
        n = len(radius)
        reach = radius + half_length
        level = np.clip(np.log2(reach.max() / reach), 0, MOST_LEVELS - 1).astype(np.int32)
        used = np.flatnonzero(np.bincount(level))
        level = np.searchsorted(used, level).astype(np.int32) if len(used) <= used[-1] else level
        most_reach = np.array([reach.max(initial=0.0, where=level == m) for m in range(len(used))])
        # Cells as large as a body, but not many more than bodies.
        cell = np.maximum(2.0 * most_reach, math.sqrt(size[0] * size[1] / (2 * n + 64)))
        counts = np.array([[max(1, int(length / side)) for length in size] for side in cell])
        first = np.concatenate([[0], np.cumsum(counts.prod(axis=1))])
        grid = kernels_contact.ContactGrid()
        grid.level_count = len(used)
        grid.reach = wp.array(most_reach, dtype=float, device=device)
        grid.count_x = wp.array(counts[:, 0], dtype=wp.int32, device=device)
        grid.count_y = wp.array(counts[:, 1], dtype=wp.int32, device=device)
        grid.first_cell = wp.array(first, dtype=wp.int32, device=device)
        grid.domain = wp.vec2(*size)
        grid.periodic = int(periodic)
        self.grid = grid
        footprints = kernels_contact.Footprints()
        footprints.level = wp.array(level, dtype=wp.int32, device=device)
        footprints.radius = wp.array(radius, dtype=float, device=device)
        footprints.mass = wp.array(mass / mass.mean(), dtype=float, device=device)
        self.footprints = footprints
        self.body_count = n
        self._cells = CellSort(launcher, n, int(first[-1]))
        room = n + kernels_contact.LANES
        near = kernels_contact.Sorted()
        near.body = self._cells.order
        near.place = launcher.empty(n, wp.int32)
        near.x, near.y, near.reach = (launcher.zeros(room, float) for _ in range(3))
        near.half_axis = launcher.zeros(room, wp.vec2)
        self.near = near
        self._found = launcher.zeros(n, wp.int32)

    @property
    def cell_start(self) -> wp.array:
        """Place of the first body of every cell in :attr:`near`."""
        return self._cells.cell_start

    def sort(self, pose: wp.array) -> None:
        """Put bodies where they are now into the cells."""
        self._cells.sort(kernels_contact.contact_keys, [pose, self.footprints, self.grid])
        self.launcher.launch(kernels_contact.gather_bodies, self.body_count, [pose, self.footprints], [self.near])

    def overlap_count(self, pose: wp.array, tolerance: float) -> int:
        """Pairs whose footprints overlap by more than ``tolerance`` of their distance; a lower bound beyond 200 a body."""
        self.count_overlaps(pose, tolerance)
        return self.counted_overlaps()

    def count_overlaps(self, pose: wp.array, tolerance: float) -> None:
        """Launch what counts them."""
        self.sort(pose)
        self.launcher.launch(
            kernels_contact.count_overlaps,
            self.body_count,
            [
                pose,
                self.near,
                self.footprints,
                self.cell_start,
                self.grid,
                1.0 - tolerance,
                MOST_OVERLAPS_PER_BODY,
            ],
            [self._found],
            grain=GRAIN_OF_NEIGHBOURS,
        )

    def counted_overlaps(self) -> int:
        """What :meth:`count_overlaps` has counted."""
        return int(self._found.numpy().sum(dtype=np.int64)) // 2


class Contact:
    """Pushes bodies apart whose footprints overlap, while the relaxation runs and at its end.

    Args:
        problem: What is to be placed.
        launcher: Where to run.
        unit: Metres per unit of the solver.
        bodies: As the relaxation's kernels take them.
        images: Densities, as the relaxation's kernels take them.
    """

    def __init__(
        self,
        problem: Problem,
        launcher: Launcher,
        unit: float,
        bodies: kernels_update.Bodies,
        images: kernels_update.Images,
    ) -> None:
        self.launcher = launcher
        self._bodies = bodies
        self._images = images
        domain = problem.domain
        area = problem.body_areas()
        longest = np.concatenate(
            [np.full(s.count or 0, 0.0 if s.line is None else s.line.longest) for c in problem.classes for s in c.sizes]
        )
        self._problem = problem
        self._unit = unit
        radius = self._radii(longest)
        size = (domain.size[0] / unit, domain.size[1] / unit)
        # Lines whose length the forces change may be longer for a while.
        half = 0.5 * kernels_update.LONGEST_LINE * longest
        self._near = Neighbourhood(launcher, size, domain.periodic, radius / unit, half / unit, area)
        n = len(area)
        self._pushed = launcher.empty(n, wp.vec4)
        self._spare = launcher.zeros(n, wp.vec4)

    def _radii(self, length: np.ndarray) -> np.ndarray:
        """Radius of every disc, half the thickness of every capsule [m], for axes of these lengths [m]."""
        width = line_widths(self._problem, length)
        radius = np.where(width > 0.0, 0.5 * width, np.sqrt(self._problem.body_areas() / math.pi))
        return radius if self._problem.avoid_overlap else AXIS_RADIUS * radius

    def push(self, pose: wp.array, bend: wp.array, displacement: wp.array) -> None:
        """Push overlapping bodies apart for a few rounds, as part of the step that ``displacement`` describes."""
        # What a push brings together is found in the next step.
        self._near.sort(pose)
        for _ in range(ROUNDS_PER_STEP):
            self._round(pose, bend, displacement)

    def separate(self, pose: wp.array, bend: wp.array) -> None:
        """Push until nothing overlaps, or no progress is made."""
        # Where lines have no width of their own, it follows from the lengths that they have reached.
        reached = pose.numpy()[:, 3].astype(np.float64) * self._unit
        self._near.footprints.radius.assign((self._radii(reached) / self._unit).astype(np.float32))

        def run_round() -> None:
            self._near.sort(pose)
            self._round(pose, bend, self._spare)

        one_round = self.launcher.record(run_round)
        counting = self.launcher.record(lambda: self._near.count_overlaps(pose, 0.0))
        fewest, since = math.inf, 0
        for _ in range(0, LAST_ROUNDS, ROUNDS_AT_ONCE):
            for _ in range(ROUNDS_AT_ONCE):
                one_round.play()
            counting.play()
            left = self._near.counted_overlaps()
            if left == 0:
                return
            since = 0 if left < max(PROGRESS * fewest, min(fewest, FEW_OVERLAPS)) else since + ROUNDS_AT_ONCE
            fewest = min(fewest, left) if since == 0 else fewest
            if since >= ROUNDS_WITHOUT_PROGRESS:
                return

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
                near.grid.domain,
                near.grid.periodic,
            ],
            [near.near, pose, displacement],
        )


def overlap_count(
    position: np.ndarray,
    area: np.ndarray,
    domain: Domain,
    launcher: Launcher,
    *,
    angle: np.ndarray | None = None,
    length: np.ndarray | None = None,
    width: np.ndarray | None = None,
) -> int:
    """Number of pairs of bodies whose footprints overlap by more than 1e-4 of their distance.

    A lower bound where a body overlaps more than 200 others.

    Args:
        position: Body positions [m], shape ``[n, 2]``.
        area: Footprints of dots [m²], shape ``[n]``: discs.
        domain: The domain.
        launcher: Where to count.
        angle: Directions of the axes [rad], shape ``[n]``; None where all are dots.
        length: Lengths of the axes [m], shape ``[n]``.
        width: Thicknesses of the capsules around them [m], shape ``[n]``; 0 for dots. One that bends counts as straight.
    """
    return count_overlaps(measured_bodies(launcher, domain, position, angle, length), area, length, width)


def count_overlaps(
    bodies: MeasuredBodies, area: np.ndarray, length: np.ndarray | None = None, width: np.ndarray | None = None
) -> int:
    """See :func:`overlap_count`: the same for bodies on a device."""
    radius = np.sqrt(area / math.pi) / bodies.unit
    half = np.zeros(len(area))
    if length is not None and width is not None:
        radius = np.where(width > 0.0, 0.5 * width / bodies.unit, radius)
        half = 0.5 * length / bodies.unit
    near = Neighbourhood(bodies.launcher, bodies.size, bodies.domain.periodic, radius, half, area)
    return near.overlap_count(bodies.pose, TOUCH_TOLERANCE)
