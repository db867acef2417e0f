"""The forces on a model's charges, and how far they move these."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..field.blur import BlurSettings
from ..field.field import Field
from ..field.field_targets import FieldTarget, counts_of
from ..field.mirrored_field import COPIES, MirroredField
from ..field.target_feedback import feedback_widths
from ..model.attraction import group_targets
from ..model.body_flags import BodyFlags
from ..model.model import Model
from ..model.occupied_part import occupied_part
from ..problem.of_bodies import distinct
from ..space.asked_counts import typical_spacing
from . import kernels_descent

__all__ = ["SMALLEST_DENSITY", "FieldSettings", "Forces"]

# Curvature and spacing are taken where the density is at least this share of its mean, so that steps stay finite. Measured on a
# density that falls to a thousandth: 2e-4 and 2e-2 change coverage errors by 0.2 %.
SMALLEST_DENSITY = 2e-3
# Width of the blur, over the spacing, in crowds of long bodies. Blurred charges let these slip through each other, and contact cannot
# disentangle them again: of 24 crowds of sticks and discs, 7 kept overlaps with the usual blur, 3 with half of it, none with
# this one, where charges are nearly points.
BLUR_OF_TANGLING = 0.03


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldSettings:
    """How the field that forces come from differs from the usual one.

    Attributes:
        targets: What attracts every group; None for the densities of the problem.
        fewest_nodes: Of the mesh that shows details of the targets; None for as many as it takes to show all.
        whole_charge: Charges before fading (see ``engine/tiles/fading.py``), shape ``[charge_count]``; None if none faded.
        smooth: Width of a blur between two charges over their spacing, with nothing that keeps close pairs apart; None for the blur
            that places bodies. See :class:`~esh.engine.field.blur.BlurSettings`.
        corrected: Whether targets can be corrected by how dense bodies stand even where some are pinned.
    """

    targets: list[FieldTarget] | None = None
    fewest_nodes: int | None = None
    whole_charge: np.ndarray | None = None
    smooth: float | None = None
    corrected: bool = False


class Forces:
    """The forces on the charges of a model, in the plane.

    Args:
        model: The compiled problem.
        launcher: Runs the kernels.
        settings: How the field differs from the usual one.

    Attributes:
        field: The field; that of a mirrored domain is one of twice its extent, unless all bodies are far from its edges.
        images_of_each: How many times each body is in that field.
        target_factor: See :attr:`.State.target_factor`.
    """

    def __init__(self, model: Model, launcher: Launcher, settings: FieldSettings) -> None:
        problem = model.problem
        blur_over_spacing = settings.smooth
        if blur_over_spacing is None and model.may_tangle:
            blur_over_spacing = BLUR_OF_TANGLING
        described: dict[str, Any] = {
            "space": model.space,
            "interaction": model.interaction,
            "targets": group_targets(model) if settings.targets is None else settings.targets,
            "spacing": typical_spacing(problem) / model.unit,
            "charge": model.charge.charge,
            "charge_group": model.charge_group,
            "fewest_nodes": settings.fewest_nodes,
            "family": model.groups.class_index,
            "blur_settings": BlurSettings(
                problem.regularity, over_spacing=blur_over_spacing, smooth=settings.smooth is not None
            ),
            "whole_charge": settings.whole_charge,
        }
        parts = [part for target in described["targets"] for part in (target, *target.more)]
        attracting = [image for part in parts for image in (part.image, part.whole) if image is not None]
        part = occupied_part(problem, attracting)
        self.images_of_each = 1
        if part is None and problem.rectangle.mirrored:
            self.images_of_each = COPIES
            mirrored = MirroredField(launcher, **described)
            self.evaluate, self.correct_targets, self.field = (
                mirrored.evaluate,
                mirrored.correct_targets,
                mirrored.field,
            )
        else:
            self.field = Field(launcher, **described, part=part)
            self.evaluate, self.correct_targets = self.field.evaluate, self.field.correct_targets
        self._prepare_feedback(model, settings.corrected)
        feedback = self.field.feedback
        self.target_factor: wp.array = launcher.zeros(0, float) if feedback is None else feedback.factor

    def _prepare_feedback(self, model: Model, corrected: bool) -> None:
        """Make ready for targets that are corrected, unless bodies are pinned: others are not to make up for how those stand."""
        if not corrected and (distinct(model.body.flags) & BodyFlags.PINNED).any():
            return
        layout = self.field.layout
        counts = counts_of(model.body.group, self.field.group_count)
        width = feedback_widths(counts, model.size if layout.whole is layout.space else layout.space.size)
        if width.any():
            self.field.prepare_feedback(width)

    def step_lengths(self, launcher: Launcher, share: wp.array | None = None) -> wp.array:
        """Return the inverse of the energy's curvature at every node of the field's mesh, flat, one group after the other.

        Args:
            launcher: Where to run.
            share: How much of the forces counts there, shaped alike; None where they count wholly.
        """
        field, layout = self.field, self.field.layout
        group_count = len(field.mean_attraction)
        # A group that nothing attracts keeps a finite step.
        least = np.maximum(SMALLEST_DENSITY * field.mean_attraction, 1e-30)
        result = launcher.empty(group_count * layout.node_count, float)
        launcher.launch(
            kernels_descent.find_step_lengths,
            group_count * layout.node_count,
            [
                field.attraction,
                layout.node_count,
                1.0 / layout.node_area,
                launcher.array(least, float),
                wp.empty(0, dtype=float, device=launcher.device) if share is None else share,
            ],
            [result],
        )
        return result
