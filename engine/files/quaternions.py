"""Rotations as files hold them: quaternions (x, y, z, w)."""

from __future__ import annotations

import numpy as np

__all__ = ["multiply_xyzw", "rotate_by_xyzw"]


def rotate_by_xyzw(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Turn vectors ``[n, 3]`` by unit quaternions (x, y, z, w), shape ``[4]`` or ``[n, 4]``."""
    axis = np.broadcast_to(quaternion[..., :3], vector.shape)
    across = 2.0 * np.cross(axis, vector)
    return vector + quaternion[..., 3:] * across + np.cross(axis, across)


def multiply_xyzw(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the products of quaternions (x, y, z, w), shapes ``[n, 4]`` or ``[1, 4]``: turned by the second, then by the first."""
    a, b = first[:, :3], second[:, :3]
    real = first[:, 3:] * second[:, 3:] - (a * b).sum(axis=1, keepdims=True)
    return np.hstack([first[:, 3:] * b + second[:, 3:] * a + np.cross(a, b), real])
