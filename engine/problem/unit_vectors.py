"""Vectors of length 1."""

from __future__ import annotations

import numpy as np

__all__ = ["tangent_frame", "unit_vectors"]


def unit_vectors(vector: np.ndarray) -> np.ndarray:
    """Return vectors ``[..., d]`` at length 1; those of length 0 stay."""
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-300)


def tangent_frame(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions along the surface, nearest to x (to y where it looks along x) and a quarter turn on, shape ``[n, 3]`` each."""
    along_x = np.abs(normal[:, :1]) > 0.9
    wanted = np.where(along_x, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = wanted - (wanted * normal).sum(axis=1, keepdims=True) * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)
