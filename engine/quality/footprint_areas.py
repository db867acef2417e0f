"""Areas of footprints as bodies have them in the end, of which reports say how much ground they cover."""

from __future__ import annotations

import numpy as np

from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.of_bodies import one_by_one
from ..problem.placement import Placement

__all__ = ["footprint_areas"]


def footprint_areas(placement: Placement, footprints: BodyFootprints, area: np.ndarray) -> np.ndarray:
    """Return the area of every footprint as it is seen from above [m²], without the room around it, shape ``[body_count]``.

    Outlines, and lines with a width of their own, may have other areas than their bodies were given.

    Args:
        placement: What was placed.
        footprints: Those of its bodies.
        area: :attr:`Placement.area`.
    """
    # Of what leans with the ground.
    seen: np.ndarray = one_by_one(np.multiply, area, footprints.seen)
    outlined = footprints.is_outline | _is_capsule(placement, footprints)
    if not outlined.any():
        return seen
    return np.where(outlined, footprints.areas(placement.length, placement.width, apart=False), seen)


def _is_capsule(placement: Placement, footprints: BodyFootprints) -> np.ndarray:
    """Which bodies are lines whose width was given, without outlines."""
    sizes = [size for body_class in placement.problem.classes for size in body_class.sizes]
    given = [size.line is not None and size.line.width is not None for size in sizes]
    if not any(given):
        return np.zeros(len(footprints.shape), bool)
    return np.repeat(given, [size.count or 0 for size in sizes]) & (footprints.shape == CAPSULE)
