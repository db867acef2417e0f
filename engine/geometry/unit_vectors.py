"""Vectors of length 1, and vectors along a surface."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["spread_directions", "tangent_frame", "turned", "unit_vectors"]


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


def turned(vector: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return vectors at right angles to normals, turned the shortest way to where the normals are others, shape ``[n, 3]``."""
    turn = np.einsum("nd,nd->n", new, vector) / np.maximum(1.0 + np.einsum("nd,nd->n", old, new), 0.05)
    return vector - turn[:, None] * (old + new)


def spread_directions(count: int) -> np.ndarray:
    """Directions that are spread over all alike, from those along z to those against it, shape ``[count, 3]``: a golden spiral."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    level = np.sqrt(1.0 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
