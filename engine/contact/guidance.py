"""Guidance: forces that keep bodies even while their outlines are parted.

Long bodies gather in sheaves, or where their turns let them, and leave gaps beside these. The forces that place bodies act between
neighbors, so they would take the sheaves apart; these here see charges and densities that are blurred over a spacing.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher, Recording
from ..model.model import Model
from ..motion import kernels_descent
from ..motion.forces import FieldSettings, Forces
from ..problem.packing import elongation_of
from . import kernels_guidance, kernels_outlines

__all__ = ["Guidance", "needs_guidance"]

# Width of the blur between two charges over their spacing. Measured on 300 planks at 70 %, six seeds: .7 and 1.4 leave errors that
# are a third larger.
BLUR_OVER_SPACING = 1.0
# How far bodies are sent at once, in mean spacings of charges.
FARTHEST = 1.0
# Bodies are long from this length over their width on.
LONG = 2.0
# Long bodies are guided from the first cover on, all that are not round from the second, up to the third; if such bodies are this
# share of all. Measured at 80 %, three seeds: coverage errors grow by .042 to .058 with triangles that nothing guides, and by .011 to
# .019 with some that are guided; with polygons of 3 to 14 corners by .007 to .024 and by -.003 to .004, in 1.5 times the time.
CROWDED_LONG, CROWDED, OVERFULL = 0.4, 0.6, 1.0
LEAST_SHARE = 0.1


def needs_guidance(model: Model) -> bool:
    """Whether parting outlines would make bodies much less even than they were."""
    footprints = model.footprints
    length = np.zeros(model.body_count)
    area = footprints.areas(length, length, apart=True)
    whole = float(area.sum())
    covered = whole / model.problem.domain.area
    # Lines, which come last, keep their places by themselves.
    elongation = np.array([elongation_of(outline) for outline in footprints.shapes] + [1.0])
    is_round = np.array([len(outline.corners) == 1 for outline in footprints.shapes] + [True])
    guided = ~is_round if covered > CROWDED else elongation > LONG
    of_guided = float(area[guided[footprints.shape]].sum())
    return of_guided > LEAST_SHARE * whole and CROWDED_LONG < covered < OVERFULL


class Guidance:
    """Says where bodies whose outlines are parted are to go.

    Args:
        model: What was placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        bend: As the state has it.
    """

    def __init__(self, model: Model, launcher: Launcher, bodies: kernels_descent.Bodies, bend: wp.array) -> None:
        self._launcher, self._bodies, self._bend = launcher, bodies, bend
        self._forces = Forces(model, launcher, FieldSettings(smooth=BLUR_OVER_SPACING))
        self._space = model.space.for_kernels()
        self._pose = launcher.zeros(model.body_count, wp.vec4)
        self._charges = kernels_descent.Charges()
        self._charges.position = launcher.zeros(model.charge_count, wp.vec2)
        self._charges.field = launcher.zeros(model.charge_count, wp.vec2)
        self._steps = kernels_descent.Steps()
        self._steps.length, self._steps.mesh = self._forces.step_lengths(launcher), self._forces.field.mesh
        # Nothing here asks how far a step may go.
        self._steps.limit = launcher.zeros(1, float)
        self._recording: Recording | None = None

    def lead(self, crowd_pose: wp.array, outlines: kernels_outlines.Outlines, home: wp.array) -> None:
        """Write where bodies are to go into ``home``.

        The arrays, those of a :class:`.plane_separation.PlaneSeparation`, are always the same.
        """
        if self._recording is None:
            self._recording = self._launcher.record(lambda: self._launch(crowd_pose, outlines, home))
        self._recording.play()

    def _launch(self, crowd_pose: wp.array, outlines: kernels_outlines.Outlines, home: wp.array) -> None:
        launcher, count = self._launcher, len(self._pose)
        launcher.launch(kernels_guidance.take_poses, count, [crowd_pose, outlines, self._space], [self._pose])
        launcher.launch(
            kernels_descent.place_charges,
            count,
            [self._pose, self._bodies, self._bend, self._space],
            [self._charges.position],
        )
        self._forces.evaluate(self._charges.position, self._charges.field)
        launcher.launch(
            kernels_guidance.find_homes,
            count,
            [crowd_pose, outlines, self._charges, self._bodies, self._steps, FARTHEST, self._space],
            [home],
        )

    def close(self) -> None:
        """Let go of what was recorded."""
        if self._recording is not None:
            self._launcher.release(self._recording)
            self._recording = None
