"""How many footprints of a placement overlap."""

from __future__ import annotations

import math

import numpy as np

from ..device.launcher import Launcher
from ..problem.problem import Domain
from ..space.neighbourhood import Neighbourhood
from .measured_bodies import MeasuredBodies, measured_bodies

__all__ = ["count_overlaps", "overlap_count"]

# Footprints that touch do not overlap: rounding of float32 positions is not an overlap.
TOUCH_TOLERANCE = 1e-4


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
