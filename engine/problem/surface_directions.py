"""Directions on a surface that long bodies prefer: down the slope, along the edges of a density, or vectors of the meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from . import validation
from .settings import Settings, described, setting
from .surface import PointsOnSurface

__all__ = ["SLOPE", "SurfaceDirection", "SurfaceVectors", "direction_at", "down_the_slope"]

# The word for it.
SLOPE = "slope"

# Gets points and returns a vector for each, shape [n, 3], whose length, up to 1, weighs it.
SurfaceDirection = Callable[[PointsOnSurface], np.ndarray]


@described
@dataclass(frozen=True)
class SurfaceVectors(Settings):
    """A direction on a surface: vectors that are an attribute of its meshes, by vertex or by triangle."""

    name: str = field(metadata=setting("Name of the attribute", text=True))

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Vectors at points, shape ``[n, 3]``."""
        values = points.attribute(self.name, "`direction`")
        if values.ndim != 2 or values.shape[1] != 3:
            raise ProblemError(f'`direction` must name an attribute of three numbers; "{self.name}" has another shape')
        return values


def down_the_slope(points: PointsOnSurface) -> np.ndarray:
    """Where water runs, shape ``[n, 3]``: steep slopes weigh more, and what is level has no direction."""
    down = np.zeros((len(points.triangle), 3))
    down[:, 2] = -1.0
    return down


def direction_at(direction: SurfaceDirection, points: PointsOnSurface, key: str) -> np.ndarray:
    """Directions at points, in the planes that touch the surface and no longer than 1, shape ``[n, 3]``, float64.

    Raises:
        ProblemError: It returns something else than a finite vector for each.
    """
    count = len(points.triangle)
    vector = validation.numbers_of(direction(points), key)
    if vector.shape != (count, 3):
        raise ProblemError(f"{key} must return a vector per point, shape [{count}, 3]; got shape {list(vector.shape)}")
    if not np.isfinite(vector).all():
        raise ProblemError(f"{key} must be finite everywhere; it returned NaN or infinity")
    normal = points.normal
    vector = vector - (vector * normal).sum(axis=1, keepdims=True) * normal
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1.0)
