"""Random numbers that belong to whole numbers, whichever others are asked for with them."""

from __future__ import annotations

import numpy as np

__all__ = ["random_shares"]


def random_shares(number: np.ndarray, seed: list[int]) -> np.ndarray:
    """A random number of 0 to 1 for each whole number, shape ``[n]``, whichever others are asked for with it."""
    key = np.random.SeedSequence(seed).generate_state(1, np.uint64)[0]
    # The finaliser of splitmix64 (Steele, Lea and Flood, 2014).
    with np.errstate(over="ignore"):
        z = number.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + key
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return (z >> np.uint64(11)).astype(np.float64) * 2.0**-53
