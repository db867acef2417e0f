"""Contact in the plane: pushes footprints apart, as discs and capsules, in every step of the descent."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..model.body_flags import BodyFlags
from ..model.model import Model
from ..motion import kernels_descent, kernels_lines
from ..problem.body_kind import disc_radius, radius_of
from ..space import kernels_images
from ..space.neighborhood import Neighborhood
from . import kernels_contact
from .guidance import Guidance, needs_guidance
from .plane_separation import PlaneSeparation

__all__ = ["DAMPING", "ROUNDS_PER_STEP", "SLACK", "Contact", "contact_radii", "keeps_apart"]

# Rounds of pushing after every step of the relaxation.
ROUNDS_PER_STEP = 4
# Share of a push that is made at once, and how much farther than touching bodies are pushed, as a share of their radii.
DAMPING = 0.9
SLACK = 1e-3
# Where lines may overlap, their axes still should not cross: footprints thinned to this share of their radius are kept apart.
AXIS_RADIUS = 0.25
# Contact of axes is left out where the thinned footprints cover the ground this many times: nearly every body then touches every other
# one, and nothing can part them.
MOST_LAYERS = 30.0
# It is also left out where each line would cross so many others if they were strewn at random: a body then has more neighbors than
# contact can resolve. Measured on 2,000 lines along a density's contours: contact leaves an eighth of their crossings at 50, a third
# at 100, and takes ten times as long as all else there.
MOST_CROSSINGS = 100.0
# Number of bodies that one element of a kernel handles on the CPU, so that the kernel's many arguments are read less often.
BODIES_AT_ONCE = 32


def keeps_apart(model: Model) -> bool:
    """Whether anything is to be kept apart: all footprints, or of lines that may overlap what lies along their axes."""
    if model.problem.avoid_overlap or not model.kinds:
        return model.problem.avoid_overlap
    longest, ground = model.body.longest, model.problem.domain.area
    radius = AXIS_RADIUS * radius_of(model.widths(longest), model.body.area)
    layers = float((2.0 * longest * radius + np.pi * radius**2).sum()) / ground
    # What Buffon's needles cross.
    crossings = 2.0 / np.pi * float(longest.sum()) ** 2 / (np.count_nonzero(longest) * ground)
    return layers < MOST_LAYERS and crossings < MOST_CROSSINGS


def contact_radii(model: Model, length: np.ndarray) -> np.ndarray:
    """Radius of every disc, half the thickness of every capsule [m], as they are pushed apart with axes of these lengths [m]."""
    width = model.widths(length)
    if not model.problem.avoid_overlap:
        return AXIS_RADIUS * radius_of(width, model.body.area)
    footprints = model.footprints
    # While bodies find their places an outline is a disc of its area.
    area = footprints.areas(length, width, apart=True)
    half = 0.5 * width * footprints.room + 0.5 * footprints.gap
    return np.where(width > 0.0, half, disc_radius(area))


class Contact:
    """Pushes bodies apart whose footprints overlap, while the relaxation runs and at its end.

    Args:
        model: What is to be placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        images: Densities, as the descent's kernels take them.

    Attributes:
        discs: Whether all bodies are pushed as discs, which have no axis, by what the CPU has for these.
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
        half = 0.5 * kernels_lines.LONGEST_LINE * longest
        mass = np.where(model.body.flags & BodyFlags.PINNED, np.inf, area)
        self._near = Neighborhood(
            launcher,
            model.space,
            contact_radii(model, longest) / model.unit,
            half / model.unit,
            mass,
            model.meeting(launcher),
        )
        n = model.body_count
        self._pushed = launcher.empty(n, wp.vec4)
        self.discs = model.space.has_straight_ways and not (launcher.device.is_cuda or model.kinds)

    def push(self, pose: wp.array, bend: wp.array, displacement: wp.array) -> None:
        """Push overlapping bodies apart for a few rounds, as part of the step that ``displacement`` describes."""
        # What a push brings together is found in the next step.
        self._near.sort(pose)
        for _ in range(ROUNDS_PER_STEP):
            self._round(pose, bend, displacement)

    def separate(
        self,
        pose: wp.array,
        turn: wp.array,
        bend: wp.array,
        go_on: Callable[[], bool] | None = None,
        *,
        again: bool = False,
        guided: bool = False,
        room: tuple[Sequence[float], Sequence[float]] | None = None,
    ) -> bool:
        """Part all outlines, where the space can hold them; returns whether none overlap any more.

        Args:
            pose: As the state has it.
            turn: As the state has it.
            bend: As the state has it.
            go_on: Called now and then; returning False ends it.
            again: Whether they were parted before, and have moved little since.
            guided: Whether forces may keep them even meanwhile, where that takes some; they follow the densities of the problem.
            room: Lower left and upper right corner [m] of where bodies may be put that stay wedged between pinned ones; None: of
                all the domain.
        """
        parting = PlaneSeparation(self._model, self.launcher, self._bodies, self._images, pose, turn, bend, room)
        if not guided or not needs_guidance(self._model) or parting.crowding.is_too_crowded:
            return parting.run(go_on, again=again)
        guidance = Guidance(self._model, self.launcher, self._bodies, bend)
        try:
            return parting.run(go_on, again=again, guidance=guidance)
        finally:
            guidance.close()

    def _round(self, pose: wp.array, bend: wp.array, displacement: wp.array) -> None:
        near = self._near
        at_once = 1 if self.launcher.device.is_cuda else BODIES_AT_ONCE
        self.launcher.launch(
            kernels_contact.push_apart,
            -(-near.body_count // at_once),
            [pose, near.for_kernels, SLACK, DAMPING, near.body_count, at_once, int(self.discs)],
            [self._pushed],
            grain=max(1, GRAIN_OF_NEIGHBORS // at_once),
        )
        self.launcher.launch(
            kernels_contact.accept_push,
            near.body_count,
            [self._pushed, self._bodies, bend, self._images],
            [near.for_kernels, pose, displacement],
        )
