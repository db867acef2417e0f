"""Directions on a surface that long bodies prefer: down the slope, along a density's edges or curves, or vectors of the meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from ..geometry.nearest_on_segments import nearest_on_segments
from .given_values import FOREIGN_ERRORS, as_reals, numbers_of, show
from .settings import Settings, described, setting
from .surface import PointsOnSurface

__all__ = [
    "SLOPE",
    "AlongCurves",
    "SurfaceDirection",
    "SurfaceVectors",
    "along_segments",
    "direction_at",
    "down_the_slope",
]

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
        return self.at(points, "`direction`")

    def at(self, points: PointsOnSurface, key: str) -> np.ndarray:
        """Return the same; sentences call the direction ``key``."""
        values = points.attribute(self.name, key)
        if values.ndim != 2 or values.shape[1] != 3:
            raise ProblemError(f'{key} must name an attribute of three numbers; "{self.name}" has another shape')
        return values


def _check_curves(value: object, key: str) -> tuple[np.ndarray, ...]:
    """Return the points of curves, shape ``[m, 3]`` each, float64; a single curve may be given by itself."""
    given = value if isinstance(value, list | tuple) and not _are_points(value) else [value]
    curves = []
    for one in given:
        try:
            points = as_reals(one)
        except FOREIGN_ERRORS:
            points = np.empty(0)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ProblemError(
                f"{key} must be two or more points [x, y, z] of a curve, or a list of such; got {show(one)}"
            )
        if not np.isfinite(points).all():
            raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity")
        curves.append(points)
    if not any(np.ptp(points, axis=0).any() for points in curves):
        raise ProblemError(f"{key} must be curves of some length; " + ("all have none" if curves else "got none"))
    return tuple(curves)


def _are_points(value: Sequence) -> bool:
    """Tell whether a sequence is one of points, and not of curves."""
    return len(value) > 0 and isinstance(value[0], list | tuple | np.ndarray) and np.ndim(value[0]) == 1


@described
@dataclass(frozen=True, eq=False)
class AlongCurves(Settings):
    """A direction on a surface: that of the nearest of some curves, such as the stem that leaves lie along.

    It is measured in space, and laid onto the surface. A curve has no front: its points may run either way.

    Raises:
        ProblemError: No curve, one of fewer than two points, or points that are not finite.
    """

    curves: Sequence[np.ndarray] = field(
        metadata=setting(
            "Points of each curve, joined by straight pieces",
            unit="m",
            more="Shape ``[m, 3]`` each; a single one may be given by itself",
            check=_check_curves,
        )
    )

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Directions at points, shape ``[n, 3]``."""
        pieces = [np.stack([curve[:-1], curve[1:]], axis=1) for curve in self.curves]
        return along_segments(np.concatenate(pieces), points.position)


def along_segments(segment: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return where the nearest straight pieces point to.

    Args:
        segment: Both ends of each [m], shape ``[s, 2, 3]``, float64; one at least has a length.
        position: The points [m], shape ``[n, 3]``.

    Returns:
        Vectors of length 1, shape ``[n, 3]``, float64.
    """
    side = segment[:, 1] - segment[:, 0]
    length = np.linalg.norm(side, axis=1)
    there = np.flatnonzero(length > 0.0)
    nearest = there[nearest_on_segments(segment[there], np.asarray(position, np.float64))]
    return side[nearest] / length[nearest][:, None]


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
    given = direction.at(points, key) if isinstance(direction, SurfaceVectors) else direction(points)
    vector = numbers_of(given, key)
    if vector.shape != (count, 3):
        raise ProblemError(f"{key} must return a vector per point, shape [{count}, 3]; got shape {list(vector.shape)}")
    if not np.isfinite(vector).all():
        raise ProblemError(f"{key} must be finite everywhere; it returned NaN or infinity")
    normal = points.normal
    vector = vector - (vector * normal).sum(axis=1, keepdims=True) * normal
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1.0)
