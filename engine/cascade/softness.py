"""How soft charges on a surface are, and the near part of what they do to each other.

Softness is that of the plane, see :mod:`esh.engine.field.blur`: charges and targets are blurred alike, and close pairs have a core.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .kernels_near_charges import NEAR_TERMS

__all__ = ["Following", "Softness", "near_force", "near_terms"]

# Octaves that are taken from -log r to have the near part between charges, and places that its polynomial is fitted to.
FAR_OCTAVES = 40
FITTED = 4001
# Charges are blurred by a share of the variance of their place; the target's force is known for so many shares, each half the one
# before.
SHARES = 4


class Following(NamedTuple):
    """How the blur follows the density of the charges, and the charges.

    Attributes:
        number: Charges that follow every image.
        exponent: Its variance falls with this power of their density.
        lowest: The least that it is, over that of a mean charge where there is one for every square of the length.
        widest: The most that it is, over the same.
        least: The least share of that which a small charge has.
    """

    number: tuple[float, ...]
    exponent: float
    lowest: float
    widest: float
    least: float

    def shares(self, charge: np.ndarray) -> np.ndarray:
        """Share of the variance of their place that charges are blurred by, shape ``[n]``: a small one fills little space."""
        return np.clip(charge, self.least, 1.0)

    def shares_of_groups(self, charge: np.ndarray, group: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """A few shares of the variance, and which of them every group has on average, shapes ``[k]`` and ``[group_count]``."""
        number = np.maximum(np.bincount(group, minlength=count), 1)
        mean = np.bincount(group, np.log2(self.shares(charge)), count) / number
        halvings = np.clip(np.round(-mean).astype(np.int64), 0, SHARES - 1)
        used, which = np.unique(halvings, return_inverse=True)
        return 0.5 ** used.astype(np.float64), which.astype(np.int32)


class Softness(NamedTuple):
    """How soft charges are, in lengths of the cascade.

    Attributes:
        blur: Width of the Gaussian between them, and between them and what attracts them.
        core: Strength of what keeps them apart beside that, see :mod:`esh.engine.field.blur`.
        reach: Distance at which this ends.
        following: What the blur follows; None where it is everywhere the same.
    """

    blur: float
    core: float
    reach: float
    following: Following | None = None


def near_force(squared: np.ndarray, width: float) -> np.ndarray:
    """Distance times force of the near part between two charges: that of -log r, blurred, less all octaves that go to nodes.

    Args:
        squared: Squares of distances, in lengths, shape ``[n]``.
        width: Width of the blur between them, in lengths.
    """
    ratio = squared[:, None] / 4.0 ** (np.arange(FAR_OCTAVES) + 0.5)
    force = 1.0 - (math.log(2.0) * ratio * np.exp(-0.5 * ratio)).sum(axis=1)
    return force - np.exp(-0.5 * squared / width**2) if width > 0.0 else force


@lru_cache(maxsize=16)
def near_terms(cutoff: float, blur: float) -> np.ndarray:
    """Factors of the polynomial of the near part (:class:`.NearPart`), shape ``[NEAR_TERMS]``, the constant one first.

    Args:
        cutoff: Where it ends, in lengths.
        blur: Width of the blur between two charges, in lengths; 0 for points.
    """
    squared = np.linspace(0.0, 1.0, FITTED)
    force = near_force(cutoff**2 * squared, blur)
    fit = np.polynomial.Chebyshev.fit(squared, force, NEAR_TERMS - 1, domain=[0.0, 1.0])
    return fit.convert(kind=np.polynomial.Polynomial).coef
