"""Densities that follow from the shape of the ground: slope, altitude, the direction it faces; and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...engine.problem.settings import described, setting
from ...engine.problem.validation import LARGEST_ANGLE
from .density_source import DensityReader, DensitySource

__all__ = ["AltitudeDensity", "FacingDensity", "NoiseDensity", "SlopeDensity", "within"]

# Ground that slopes less than this faces no direction worth the name [rad]; from flat ground on, it does so more and more.
FLAT = math.radians(3.0)


def within(value: np.ndarray, low: float, high: float, falloff: float) -> np.ndarray:
    """Return 1 where a value is between two others, and less beside them: 0 from ``falloff`` away on; float32."""
    beside = np.maximum(np.maximum(low - value, value - high), 0.0)
    if falloff > 0.0:
        return np.maximum(1.0 - beside / falloff, 0.0).astype(np.float32)
    return (beside == 0.0).astype(np.float32)


@described
@dataclass(frozen=True)
class SlopeDensity(DensitySource):
    """How steep the ground is: 1 between two slopes, 0 elsewhere."""

    low: float = field(
        default=0.0,
        metadata=setting("Smallest slope. 0 is level", label="From", unit="rad", low=0.0, high=0.5 * math.pi),
    )
    high: float = field(
        default=math.radians(30.0),
        metadata=setting("Largest slope. 90° is a wall", label="To", unit="rad", low=0.0, high=0.5 * math.pi),
    )
    falloff: float = field(
        default=math.radians(10.0),
        metadata=setting("How far beyond these slopes the density fades out", unit="rad", low=0.0, high=0.5 * math.pi),
    )

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 where the slope is between both ends."""
        slope = np.arccos(np.clip(reader.normal[:, 2], -1.0, 1.0))
        return within(slope, self.low, self.high, self.falloff)


@described
@dataclass(frozen=True)
class AltitudeDensity(DensitySource):
    """How high the ground is in the world: 1 between two heights, 0 elsewhere."""

    low: float = field(
        default=0.0,
        metadata=setting("Smallest height above the world's origin", label="From", unit="m", soft_low=-100.0),
    )
    high: float = field(
        default=10.0,
        metadata=setting("Largest height above the world's origin", label="To", unit="m", soft_low=-100.0),
    )
    falloff: float = field(
        default=1.0,
        metadata=setting("How far beyond these heights the density fades out", unit="m", low=0.0, soft_high=100.0),
    )

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 where the height is between both ends."""
        return within(reader.points.position[:, 2], self.low, self.high, self.falloff)


@described
@dataclass(frozen=True)
class FacingDensity(DensitySource):
    """Which way the ground slopes down: 1 around a direction, 0 elsewhere and where it is level."""

    direction: float = field(
        default=0.0,
        metadata=setting(
            "Direction in which the ground slopes down, seen from above. 0° is along x, 90° along y",
            unit="rad",
            low=-LARGEST_ANGLE,
            high=LARGEST_ANGLE,
            soft_low=-math.pi,
            soft_high=math.pi,
        ),
    )
    width: float = field(
        default=math.radians(90.0),
        metadata=setting(
            "Range of directions that count, half of it to either side",
            unit="rad",
            low=0.0,
            high=2.0 * math.pi,
        ),
    )
    falloff: float = field(
        default=math.radians(45.0),
        metadata=setting("How far beyond these directions the density fades out", unit="rad", low=0.0, high=math.pi),
    )

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 where the ground faces the direction."""
        normal = reader.normal
        away = np.arctan2(normal[:, 1], normal[:, 0]) - self.direction
        away = np.abs(np.mod(away + math.pi, 2.0 * math.pi) - math.pi)
        slope = np.arccos(np.clip(normal[:, 2], -1.0, 1.0))
        return within(away, 0.0, 0.5 * self.width, self.falloff) * np.minimum(slope / FLAT, 1.0).astype(np.float32)


@described
@dataclass(frozen=True)
class NoiseDensity(DensitySource):
    """Patches without order, for clusters and clearings. The same seed makes the same patches in all classes."""

    scale: float = field(
        default=10.0,
        metadata=setting("Size of the patches", unit="m", low=1e-4, soft_low=0.1, soft_high=1000.0),
    )
    detail: int = field(
        default=3,
        metadata=setting(
            "How ragged the patches are: 1 is smooth, and each further level adds detail of half the size",
            low=1,
            high=12,
        ),
    )
    cover: float = field(
        default=0.5, metadata=setting("Share of the ground that lies in patches", unit="share", low=0.0, high=1.0)
    )
    softness: float = field(
        default=0.5,
        metadata=setting(
            "How soft the edges of the patches are: 0 is sharp, 1 fades gradually from none to many",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )
    seed: int = field(
        default=0, metadata=setting("Each number gives different patches", low=0, high=2**31 - 1, soft_high=1000)
    )

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 within patches."""
        # Warp is not imported before something is computed.
        from ...engine.surface.noise import noise_at

        level = noise_at(reader.points.position, self.scale, self.detail, self.seed)
        # At 0 and at 1 there is nothing, and everything, whatever the softness.
        above = level - (1.0 + 0.5 * self.softness - (1.0 + self.softness) * self.cover)
        if self.softness > 0.0:
            return np.clip(above / self.softness + 0.5, 0.0, 1.0).astype(np.float32)
        return (above >= 0.0).astype(np.float32)
