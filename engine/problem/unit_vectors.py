"""Vectors of length 1."""

from __future__ import annotations

import numpy as np

__all__ = ["unit_vectors"]


def unit_vectors(vector: np.ndarray) -> np.ndarray:
    """Return vectors ``[..., d]`` at length 1; those of length 0 stay."""
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-300)
