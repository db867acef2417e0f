"""Bodies on a device, as they are measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..problem.domain import Domain
from ..space.space import Space
from . import kernels_measured_bodies

__all__ = ["MeasuredBodies", "measured_bodies"]


@dataclass(frozen=True, eq=False)
class MeasuredBodies:
    """Bodies on a device, lengths in units of their mean spacing.

    Attributes:
        launcher: Where they are.
        domain: The domain.
        unit: Meters per unit.
        pose: Position, angle [rad] and length of every body, ``wp.vec4``, shape ``[n]``.
        position: Positions [m], in meters and not in units, ``wp.vec2d``, shape ``[n]``.
    """

    launcher: Launcher
    domain: Domain
    unit: float
    pose: wp.array
    position: wp.array

    @property
    def count(self) -> int:
        """Number of bodies."""
        return len(self.pose)

    @property
    def space(self) -> Space:
        """Where they are, in that unit."""
        return Space.of(self.domain, self.unit)


def measured_bodies(
    launcher: Launcher,
    domain: Domain,
    position: np.ndarray,
    angle: np.ndarray | None = None,
    length: np.ndarray | None = None,
) -> MeasuredBodies:
    """Put bodies on a device: positions [m], shape ``[n, 2]``; angles [rad] and lengths [m], shape ``[n]``, None for dots."""
    n = len(position)
    unit = math.sqrt(domain.area / max(n, 1))
    place = launcher.array(position, wp.vec2d)
    if angle is None or length is None:
        at = launcher.empty(n, wp.vec4)
        launcher.launch(kernels_measured_bodies.place_bodies, n, [place, 1.0 / unit], [at])
        return MeasuredBodies(launcher, domain, unit, at, place)
    pose = np.zeros((n, 4), dtype=np.float32)
    np.multiply(position, 1.0 / unit, out=pose[:, :2], casting="same_kind")
    pose[:, 2] = angle
    pose[:, 3] = length / unit
    return MeasuredBodies(launcher, domain, unit, launcher.array(pose, wp.vec4), place)
