"""Rotations as files hold them, quaternions (x, y, z, w), and as bodies have them, (w, x, y, z)."""

from __future__ import annotations

import numpy as np

__all__ = ["multiply_xyzw", "rotate_by_xyzw", "wxyz_of_axes"]


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


def wxyz_of_axes(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the rotations that turn the axes x and z to these, unit vectors at right angles, shape ``[n, 3]``.

    Returns:
        Unit quaternions (w, x, y, z), shape ``[n, 4]``.
    """
    y = np.cross(z, x)
    (a, b, c), (d, e, f), (g, h, i) = x.T, y.T, z.T
    # Each row is the quaternion times four of its components; of these the largest is far from 0.
    rows = np.array(
        [
            [1.0 + a + e + i, f - h, g - c, b - d],
            [f - h, 1.0 + a - e - i, d + b, g + c],
            [g - c, d + b, 1.0 - a + e - i, h + f],
            [b - d, g + c, h + f, 1.0 - a - e + i],
        ]
    )
    each = np.arange(len(x))
    best = rows[np.argmax(rows[range(4), range(4)], axis=0), :, each]
    return best / np.linalg.norm(best, axis=1, keepdims=True)
