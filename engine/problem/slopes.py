"""Outlines that lie in slopes, seen from above: what of them is foreshortened.

A slope is how far the ground rises for each meter along x and y. A plane of slope s leans by the angle atan |s|; seen from above, what
lies in it is shorter by the cosine of that along s, and as long as it is across. A body leans from upright by the shortest way.
"""

from __future__ import annotations

import math

import numpy as np

__all__ = [
    "LEVEL",
    "SMALLEST_COSINE",
    "foreshortened",
    "lengthened",
    "level_share",
    "mean_cosine",
    "normal_of_slope",
    "slope_at",
    "slope_of_normal",
    "tilted",
    "tilts",
]

# Ground that rises by less than this is level [m/m].
LEVEL = 1e-4
# Smallest z of a normal: what is steeper leans as if it were just as steep.
SMALLEST_COSINE = 0.02


def foreshortened(vector: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Vectors of leaning planes as they are seen from above.

    Args:
        vector: In the plane, before it leans, shape ``[..., 2]``.
        slope: Of the plane, shape that goes with it.
    """
    square = (slope**2).sum(axis=-1, keepdims=True)
    # 1 - cosine, over the square, which may be 0.
    share = 1.0 / (1.0 + square + np.sqrt(1.0 + square))
    return vector - slope * (share * (vector * slope).sum(axis=-1, keepdims=True))


def lengthened(vector: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """The vectors that are seen so from above: what :func:`foreshortened` undoes; arguments as there."""
    square = (slope**2).sum(axis=-1, keepdims=True)
    # 1 / cosine - 1, over the square.
    share = 1.0 / (1.0 + np.sqrt(1.0 + square))
    return vector + slope * (share * (vector * slope).sum(axis=-1, keepdims=True))


def level_share(slope: np.ndarray) -> np.ndarray:
    """Area of what lies in planes of these slopes, ``[..., 2]``, as it is seen from above, over the area that it has."""
    x, y = np.moveaxis(slope.astype(np.float64), -1, 0)
    return 1.0 / np.sqrt(1.0 + (x * x + y * y))


def slope_of_normal(normal: np.ndarray, align: float = 1.0) -> np.ndarray:
    """Slopes of the planes that bodies stand upright on.

    Args:
        normal: Of the ground, unit vectors that do not point down, shape ``[..., 3]``.
        align: Share of the angle from upright to the normal that bodies lean by.

    Returns:
        Shape ``[..., 2]``, float64.
    """
    if align == 1.0:
        # What angles come to, which take ten times as long.
        down = -np.maximum(normal[..., 2].astype(np.float64), SMALLEST_COSINE)
        return np.stack([normal[..., 0] / down, normal[..., 1] / down], axis=-1)
    normal = normal.astype(np.float64)
    sine = np.hypot(normal[..., 0], normal[..., 1])
    angle = align * np.arctan2(sine, np.maximum(normal[..., 2], 0.0))
    tangent = np.tan(np.minimum(angle, np.arccos(SMALLEST_COSINE)))
    return normal[..., :2] * (-tangent / np.maximum(sine, 1e-12))[..., None]


def normal_of_slope(slope: np.ndarray, align: float) -> np.ndarray:
    """Normals of the ground, shape ``[n, 3]``, float32, where bodies lean in planes of these slopes; see :func:`slope_of_normal`."""
    steep = np.hypot(slope[:, 0], slope[:, 1])
    angle = np.minimum(np.arctan(steep) / align, 0.5 * np.pi)
    level = -slope * (np.sin(angle) / np.maximum(steep, 1e-12))[:, None]
    return np.column_stack([level, np.cos(angle)]).astype(np.float32)


def tilts(most: float | np.ndarray, identity: np.ndarray, seed: int) -> np.ndarray:
    """Draw how far bodies lean over from how they would stand: in all directions alike, and spread over the cone as over a disc.

    Args:
        most: Largest angle [rad], a number or shape ``[n]``.
        identity: Numbers of the bodies, which decide, shape ``[n]``.
        seed: Of the run.

    Returns:
        Angles [rad], and the directions to which bodies lean, as each sees them from its place [rad], shape ``[n, 2]``.
    """
    drawn = np.random.default_rng([seed, 6]).random((int(identity.max(initial=-1)) + 1, 2))[identity]
    return np.stack([most * np.sqrt(drawn[:, 0]), 2.0 * np.pi * drawn[:, 1]], axis=1)


def mean_cosine(most: float) -> float:
    """Mean of the cosines of what :func:`tilts` draws for this largest angle [rad]: how much of areas is seen from above.

    Not for more than a right angle: what is turned over is seen from below.
    """
    if most <= 1e-3:
        return 1.0
    return 2.0 * (math.cos(most) + most * math.sin(most) - 1.0) / most**2


def tilted(slope: np.ndarray, tilt: np.ndarray) -> np.ndarray:
    """Slopes of the planes of bodies that lean over in planes of other slopes.

    Args:
        slope: Of the planes that bodies would stand on, shape ``[n, 2]``.
        tilt: See :func:`tilts`.

    Returns:
        Shape ``[n, 2]``, float64.
    """
    angle, direction = tilt.T
    way = np.stack([np.sin(angle) * np.cos(direction), np.sin(angle) * np.sin(direction)], axis=1)
    cosine = level_share(slope)
    level = -slope * cosine[:, None]
    # The shortest turn from upright to the normal (level, cosine), of the axis (way, cos angle).
    along = (level * way).sum(axis=1)
    height = np.cos(angle)
    axis = way + level * (height - along / (1.0 + cosine))[:, None]
    normal = np.column_stack([axis, cosine * height - along])
    # What is turned over lies in the same plane as what is not.
    return slope_of_normal(np.where(normal[:, 2:] < 0.0, -normal, normal))


def slope_at(image: np.ndarray, position: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Slopes at positions, blended from the pixels around them.

    Args:
        image: Slopes over the domain, row 0 at its largest y, shape ``[rows, columns, 2]``.
        position: In the domain [m], shape ``[n, 2]``.
        size: Of the domain [m].

    Returns:
        Shape ``[n, 2]``, float64.
    """
    rows, columns = image.shape[:2]
    x = np.clip(position[:, 0] / size[0] * columns - 0.5, 0.0, columns - 1.0)
    y = np.clip((1.0 - position[:, 1] / size[1]) * rows - 0.5, 0.0, rows - 1.0)
    left, top = x.astype(np.int64), y.astype(np.int64)
    right, bottom = np.minimum(left + 1, columns - 1), np.minimum(top + 1, rows - 1)
    u, v = (x - left)[:, None], (y - top)[:, None]
    upper = (1.0 - u) * image[top, left] + u * image[top, right]
    lower = (1.0 - u) * image[bottom, left] + u * image[bottom, right]
    return (1.0 - v) * upper + v * lower
