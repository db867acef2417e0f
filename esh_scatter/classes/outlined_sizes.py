"""Sizes whose bodies have the outlines of what is placed there, as large and as turned as it will stand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.footprints import Footprints
from ...engine.problem.scatter_settings import ScatterSettings
from ...engine.problem.size import Size, with_count
from .scatter_class import ScatterClass, standing_of, turns_freely
from .sources import DISC_IN_POLYGON, SizeShape, disc_of_area, variant_footprints, variants_of
from .standing import Unread, draw

__all__ = ["OutlinedSizes", "unread_of_standing"]


class OutlinedSizes:
    """Gives sizes their outlines, one after the other, in the order of a problem: that of its bodies, which number the points.

    Args:
        classes: What is asked.
        shapes: Of their sizes, by class.
        settings: How the scatter is made.
        staying: How many objects of an earlier result stay, by class and size; they are among the counts.
    """

    def __init__(
        self,
        classes: Sequence[ScatterClass],
        shapes: Sequence[Sequence[SizeShape]],
        settings: ScatterSettings,
        staying: Mapping[tuple[int, int], int],
    ) -> None:
        self._classes, self._shapes, self._settings, self._staying = classes, shapes, settings, staying
        # Bodies of the sizes before.
        self._counted = 0

    def size(
        self, where: tuple[int, int], size: Size, leaning: tuple[np.ndarray, np.ndarray] | None, tilt: float
    ) -> Size:
        """Return a size whose bodies have outlines.

        Args:
            where: Number of its class, and its own.
            size: With its whole count.
            leaning: Slopes of the planes that outlines lie in, shape ``[rows, columns, 2]``, and how much ground each of these is;
                None where outlines lie along the ground.
            tilt: How far outlines lean over at most [rad].
        """
        shape = self._shapes[where[0]][where[1]]
        identity = np.arange(self._counted, self._counted + (size.count or 0))
        self._counted += len(identity)
        if shape.line_given or not len(identity):
            return replace(size, footprint=None)
        # A right angle of Blender's is a little larger.
        right_angle = 0.5 * math.pi
        if not shape.outlines_of_variants and not _discs_lean(leaning):
            leaning = None
        if tilt > np.float32(right_angle) and (shape.outlines_of_variants or leaning is not None):
            raise ProblemError(
                f"`tilt` must be at most a right angle where overlap is avoided; got {math.degrees(tilt):.4g}°; outlines of objects "
                "that are turned over are not known"
            )
        tilt = min(tilt, right_angle)
        scatter_class = self._classes[where[0]]
        standing = standing_of(scatter_class, self._settings)
        long = np.full(len(identity), shape.line is not None)
        factor, turn = draw(standing, identity, long, self._settings.seed)
        if not shape.outlines_of_variants:
            return _with_discs(size, factor, leaning, tilt)
        variants = variant_footprints(shape)
        variant = variants_of(identity, len(variants), shape.weights, self._settings.seed)
        if isinstance(shape.area, tuple):
            # What gives each object its area; its jitter comes on top of that.
            area = self._areas(where, size)
            factor = factor * np.sqrt(area / np.array([outline.area for outline in variants])[variant])
        slope = None if leaning is None else leaning[0]
        free = turns_freely(scatter_class, self._settings)
        footprint = Footprints(
            variants, variant=variant, scale=factor, turn=turn, may_turn=free, slope=slope, tilt=tilt
        )
        # Every body takes the ground of its own outline, so that a large one has more room around it, and not that of their mean.
        alike = len(variants) == 1 and bool((factor == 1.0).all())
        if isinstance(shape.area, tuple) or alike:
            return replace(size, footprint=footprint)
        return replace(size, area=None, footprint=footprint, usual_area=size.mean_area)

    def _areas(self, where: tuple[int, int], size: Size) -> np.ndarray:
        """Areas of a size's bodies [m²] as the engine draws them; of those that stay, which come last, nobody asks any."""
        count = size.count or 0
        left = max(count - self._staying.get(where, 0), 0)
        drawn = with_count(size, left).areas([self._settings.seed, 2, *where])
        return np.pad(drawn, (0, count - left), mode="edge") if left else np.full(count, size.mean_area)


def unread_of_standing(
    scatter_class: ScatterClass, shapes: Sequence[SizeShape], leaning: tuple[np.ndarray, np.ndarray] | None
) -> Unread:
    """Return how much of how its objects stand has no influence on where a class's bodies are, where overlap is avoided.

    Discs are the same however they are turned, and where it is mostly flat they are level whatever their objects do.

    Args:
        scatter_class: What is asked.
        shapes: Of its sizes.
        leaning: As :meth:`OutlinedSizes.size` takes it, of objects that lean as the ground does; None where outlines lie along it.
    """
    if any(shape.outlines_of_variants or shape.line is not None for shape in shapes):
        return Unread.NOTHING
    # How much ground there is for discs depends on how they lean.
    covers = leaning is not None and scatter_class.count == "cover"
    return Unread.TURNS if covers or _discs_lean(leaning) else Unread.LEANS


def _discs_lean(leaning: tuple[np.ndarray, np.ndarray] | None) -> bool:
    """Tell whether discs lean with their objects.

    A level disc keeps off more than one that leans, but where it is mostly flat less than a polygon around one that leans.
    """
    if leaning is None:
        return False
    longer = np.sqrt(1.0 + (leaning[0] ** 2).sum(axis=-1))
    return bool(np.average(longer, weights=leaning[1]) >= DISC_IN_POLYGON)


def _with_discs(size: Size, factor: np.ndarray, leaning: tuple[np.ndarray, np.ndarray] | None, tilt: float) -> Size:
    """Return a size whose bodies are discs that somebody asked for, as large as the objects will be, and leaning as these do.

    Their scales are those of the objects, as where outlines are the objects' own: what is pinned is known by its scale.
    """
    slope = None if leaning is None else leaning[0]
    if slope is None and (factor == 1.0).all():
        return replace(size, footprint=None)
    disc = disc_of_area(size.mean_area, leans=slope is not None)
    tilt = 0.0 if slope is None else tilt
    return replace(size, footprint=Footprints(disc, scale=factor, turn=0.0, slope=slope, tilt=tilt))
