"""Noise: patches of a given size, spread over space without order."""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_layers
from .launching import launch_on_cpu

__all__ = ["noise_at"]

# Standard deviation of one octave, measured over 10⁷ points.
DEVIATION = 0.2701
# How steep the logistic function is that comes nearest to the normal distribution (S. R. Bowling et al., 2009).
LOGISTIC = 1.702


def noise_at(position: np.ndarray, scale: float, detail: int, seed: int) -> np.ndarray:
    """Return noise whose values are about equally frequent between 0 and 1, shape ``[n]``, float32.

    Args:
        position: Points in the world [m], shape ``[n, 3]``, float64.
        scale: Distance between patches [m].
        detail: Octaves, each of half the scale and half the height of the one before.
        seed: Another seed, another noise.
    """
    height = np.empty(len(position), np.float32)
    inputs = [np.ascontiguousarray(position, np.float64), 1.0 / scale, detail, wp.uint32(seed % 2**32)]
    launch_on_cpu(kernels_layers.sum_octaves, len(height), inputs, [height])
    return 1.0 / (1.0 + np.exp(-LOGISTIC / DEVIATION * height))
