"""Contact of footprints on a surface: pushing bodies apart along it."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..model.body_flags import BodyFlags
from ..model.model import Model
from ..motion import kernels_descent, kernels_lines, kernels_lying, kernels_on_surface
from ..space.cell_sort import CellSort
from ..space.kernels_meeting import Meeting
from ..space.size_levels import coarse_cells, levels_of
from . import kernels_surface_contact
from .contact import DAMPING, ROUNDS_PER_STEP, SLACK, contact_radii

__all__ = ["SLOTS_PER_BODY", "SurfaceContact"]

SLOTS_PER_BODY = 2
# Others that are listed as near, of every body; where there are more, it looks for them in every round.
MOST_NEARBY = 12
# Cells over how far bodies of their level reach. Of many small cells most are empty, in large ones many lie that are not near.
# Measured on 100,000 discs that cover 27 % or 75 %: finding all takes 107 and 110 ms with 2, 46 and 53 with 4, 26 and 50 with 6.
CELL = 4.0
# More others around a body than this are looked at by several threads, else all wait for the one: so many on a GPU and on a CPU.
MANY_AROUND = 128
LANES_ON_GPU, LANES_ON_CPU = 64, 8


class SurfaceContact:
    """Pushes bodies on a surface apart whose footprints overlap, while the relaxation runs; or that are nearer than some distance.

    Args:
        model: What is to be placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        ground: The surface, as the descent's kernels take it.
        poses: Where the bodies are, as the descent's kernels take it.
        motion: What is remembered of their way there, as the descent's kernels take it.
        radius: Half the distance that bodies are to keep from others of their radius, in units, shape ``[body_count]``; None to keep
            their footprints apart.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        bodies: kernels_descent.Bodies,
        ground: kernels_on_surface.Ground,
        poses: kernels_on_surface.Poses,
        motion: kernels_on_surface.Motion,
        radius: np.ndarray | None = None,
    ) -> None:
        self._model, self._launcher, self._bodies = model, launcher, bodies
        self._ground, self._poses, self._motion = ground, poses, motion
        self._position = launcher.empty(model.body_count, wp.vec3)
        n, longest = model.body_count, model.body.longest
        half = 0.5 * kernels_lines.LONGEST_LINE * longest / model.unit
        meeting = model.meeting(launcher) if radius is None else Meeting()
        if radius is None:
            radius = contact_radii(model, longest) / model.unit
        reach = radius + half
        level, level_reach = levels_of(reach, coarse=True)
        slots = 1 << max(4, (SLOTS_PER_BODY * n - 1).bit_length())
        self._sort = CellSort(launcher, n, slots)
        self._coarse_sort = CellSort(launcher, n, slots) if len(level_reach) > 1 else None
        sorted_at = launcher.empty(n, wp.vec3)
        neighbors = kernels_surface_contact.SurfaceNeighbors()
        neighbors.poses, neighbors.facets = poses, ground.facets
        neighbors.footprints = self._footprints_of(radius, reach, level, level_reach, meeting)
        neighbors.slots = _slots_of(self._sort, slots - 1, sorted_at)
        neighbors.coarse = _slots_of(self._coarse_sort or self._sort, slots - 1, sorted_at)
        self._neighbors = neighbors
        self._nearby = kernels_surface_contact.Nearby()
        self._nearby.room = MOST_NEARBY
        self._nearby.count, self._nearby.body = launcher.empty(n, wp.int32), launcher.empty(n * MOST_NEARBY, wp.int32)
        self._nearby.listed_at, self._nearby.listed_axis = (launcher.empty(n, wp.vec3) for _ in range(2))
        # Nobody has been listed.
        self._nearby.listed_at.fill_(wp.vec3(np.inf))
        self._nearby.stale = launcher.zeros(1, wp.int32)
        self._lanes = self._lanes_of(reach, level, level_reach)
        self._unlisted = kernels_surface_contact.Nearby()
        self._unlisted.room = 0
        self._pushes = kernels_surface_contact.Pushes()
        self._pushes.shift, self._pushes.turn = launcher.zeros(n, wp.vec3), launcher.zeros(n, float)
        self._pushes.count, self._pushes.overlaps = launcher.zeros(n, wp.int32), launcher.zeros(n, wp.int32)

    def _footprints_of(
        self, radius: np.ndarray, reach: np.ndarray, level: np.ndarray, level_reach: np.ndarray, meeting: Meeting
    ) -> kernels_surface_contact.Footprints:
        """Footprints of bodies with these radii, reaches and levels, shape ``[body_count]``, as kernels take them."""
        device, body = self._launcher.device, self._model.body
        mass = np.where(body.flags & BodyFlags.PINNED, np.inf, body.area)
        widest = np.array([radius[level == m].max() for m in range(len(level_reach))])
        footprints = kernels_surface_contact.Footprints()
        footprints.level_count = len(level_reach)
        footprints.level = wp.array(level, dtype=wp.int32, device=device)
        footprints.radius = wp.array(radius, dtype=float, device=device)
        footprints.reach = wp.array(reach, dtype=float, device=device)
        footprints.mass = wp.array(mass / mass[np.isfinite(mass)].mean(), dtype=float, device=device)
        footprints.level_reach = wp.array(level_reach, dtype=float, device=device)
        footprints.level_radius = wp.array(widest, dtype=float, device=device)
        footprints.inverse_cell = wp.array(1.0 / (CELL * level_reach), dtype=float, device=device)
        footprints.inverse_coarse_cell = wp.array(1.0 / coarse_cells(level_reach), dtype=float, device=device)
        footprints.meeting = meeting
        return footprints

    def _lanes_of(self, reach: np.ndarray, level: np.ndarray, level_reach: np.ndarray) -> kernels_surface_contact.Lanes:
        """The bodies around which many others lie, if they are strewn evenly."""
        launcher = self._launcher
        ground = self._model.problem.domain.area / self._model.unit**2
        per_area = np.bincount(level) / ground
        around = np.pi * (reach[:, None] + level_reach) ** 2 @ per_area
        body = np.flatnonzero(around > MANY_AROUND)
        number = np.full(len(reach), -1, np.int32)
        number[body] = np.arange(len(body))
        lanes = kernels_surface_contact.Lanes()
        lanes.each = LANES_ON_GPU if launcher.device.is_cuda else LANES_ON_CPU
        lanes.body, lanes.number = launcher.array(body.astype(np.int32), wp.int32), launcher.array(number, wp.int32)
        lanes.found = launcher.empty(lanes.each * len(body), kernels_surface_contact.Total)
        return lanes

    def push(self) -> None:
        """Push overlapping bodies apart for a few rounds, as part of the step that the motion describes."""
        self._find()
        for _ in range(ROUNDS_PER_STEP):
            self._round()

    def overlap_count(self) -> int:
        """How many overlaps every body had in the last round, all together."""
        return int(self._pushes.overlaps.numpy().sum())

    def _find(self) -> None:
        """Sort bodies into cells where they are now."""
        position, neighbors, nearby, n = self._position, self._neighbors, self._nearby, self._model.body_count
        self._sort.sort(kernels_surface_contact.contact_slots, [neighbors, position])
        if self._coarse_sort is not None:
            self._coarse_sort.sort(kernels_surface_contact.coarse_slots, [position, neighbors])
        self._launcher.launch(kernels_surface_contact.find_stray, n, [position, neighbors], [nearby])
        self._launcher.launch(kernels_surface_contact.begin_list, n, [position, neighbors], [nearby])
        self._launcher.launch(kernels_surface_contact.end_list, 1, [], [nearby])

    def _round(self) -> None:
        n, seen = self._model.body_count, [self._position, self._neighbors, SLACK]
        if self._lanes.body.size:
            self._launcher.launch(
                kernels_surface_contact.push_in_lanes,
                self._lanes.each * self._lanes.body.size,
                [*seen, self._unlisted],
                [self._lanes],
                grain=1,
            )
        self._launcher.launch(
            kernels_surface_contact.push_apart,
            n,
            [*seen, DAMPING, self._lanes],
            [self._nearby, self._pushes],
            grain=GRAIN_OF_NEIGHBORS,
        )
        self._launcher.launch(
            kernels_surface_contact.accept_push,
            n,
            [self._pushes, self._bodies, self._ground],
            [self._poses, self._position, self._motion],
        )


def _slots_of(sort: CellSort, mask: int, sorted_at: wp.array) -> kernels_lying.Slots:
    """Bodies in the order in which they were sorted, as kernels take it; ``sorted_at`` is where they were."""
    slots = kernels_lying.Slots()
    slots.order, slots.start, slots.sorted_at, slots.mask = sort.order, sort.cell_start, sorted_at, mask
    return slots
