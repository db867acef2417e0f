"""Objects on a surface: where each stands in space, how it is turned, and how large it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Instances", "body_rotations", "rotate"]


@dataclass(frozen=True, eq=False)
class Instances:
    """Transforms of all objects that a scatter places, in the placement's order, as an exporter needs them.

    Attributes:
        position: Origin of each object in the world [m], shape ``[n, 3]``, float32.
        rotation: Unit quaternions (w, x, y, z), applied after the source object's own rotation, shape ``[n, 4]``, float32.
        scale: Uniform scale factor, shape ``[n]``, float32.
        source: Index of the object that each is a copy of, see :class:`~esh.ScatterResult`, shape ``[n]``, int32.
    """

    position: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    source: np.ndarray


def body_rotations(
    normal: np.ndarray, align: float, turn: np.ndarray, tilt: tuple[np.ndarray, np.ndarray] | None = None
) -> np.ndarray:
    """Return quaternions (w, x, y, z) that lean bodies from upright towards a normal and turn them about their own axis.

    Args:
        normal: Unit vectors, shape ``[n, 3]``.
        align: 0 leaves bodies upright, 1 sets them along the normal; in between, that share of the angle.
        turn: Turn about the body's own axis [rad], shape ``[n]``.
        tilt: How far every body leans over, seen from its place [rad], and in which direction [rad]; shape ``[n]`` each.

    Returns:
        Shape ``[n, 4]``, of the arguments' type.
    """
    # The rotation from z to the normal is about (-ny, nx, 0); straight down, about any horizontal axis: y.
    sine = np.hypot(normal[:, 0], normal[:, 1])
    half = 0.5 * align * np.arctan2(sine, normal[:, 2])
    along = np.sin(half) / np.maximum(sine, 1e-12)
    w, x, y = np.cos(half), -normal[:, 1] * along, normal[:, 0] * along
    y = np.where((sine < 1e-12) & (normal[:, 2] < 0.0), np.sin(half), y)
    c, s = np.cos(0.5 * turn), np.sin(0.5 * turn)
    if tilt is None:
        # The product with (c, 0, 0, s): first the turn, then the lean.
        return np.stack([w * c, x * c + y * s, y * c - x * s, w * s], axis=1)
    angle, direction = tilt
    tilt_w, tilt_sine = np.cos(0.5 * angle), np.sin(0.5 * angle)
    # About the horizontal axis that stands at right angles to the direction of the tilt.
    p, q = -np.sin(direction) * tilt_sine, np.cos(direction) * tilt_sine
    leaning = (w * tilt_w - x * p - y * q, w * p + x * tilt_w, w * q + y * tilt_w, x * q - y * p)
    a, b, d, e = leaning
    return np.stack([a * c - e * s, b * c + d * s, d * c - b * s, e * c + a * s], axis=1)


def rotate(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Turn vectors ``[n, 3]`` by unit quaternions (w, x, y, z) ``[n, 4]``; returns shape ``[n, 3]``."""
    axis = quaternion[:, 1:]
    across = 2.0 * np.cross(axis, vector)
    return vector + quaternion[:, :1] * across + np.cross(axis, across)
