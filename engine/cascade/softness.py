"""How soft charges on a surface are, and the near field between two of them.

As in the plane, charges and target are blurred alike by Gaussians, and close pairs of charges have a repulsive core: see
:mod:`esh.engine.field.blur`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .kernels_near_charges import NEAR_TERMS

__all__ = ["Following", "Softness", "near_force", "near_terms"]

# The near field between charges is -log r less this many octaves of the far field. Its polynomial is fitted at so many points.
FAR_OCTAVES = 40
FITTED = 4001
# Small charges are blurred by a share of the variance of their place. The target's force on them is found for this many shares: 1,
# 1/2, 1/4 and so on.
SHARES = 4


class Following(NamedTuple):
    """How the variance of the blur depends on the local number density of charges, and on the charge.

    The usual variance is that of a mean charge where there is one charge for every square of the length.

    Attributes:
        number: Number of charges that follow every image.
        exponent: The variance is proportional to the number density to the power of -exponent.
        lowest: Smallest variance of a place, over the usual one.
        widest: Largest variance of a place, over the usual one.
        least: Smallest share of the variance of its place that a charge has.
    """

    number: tuple[float, ...]
    exponent: float
    lowest: float
    widest: float
    least: float

    def shares(self, charge: np.ndarray) -> np.ndarray:
        """Share of the variance of its place that every charge is blurred by, shape ``[n]``: small charges fill little space."""
        return np.clip(charge, self.least, 1.0)

    def shares_of_groups(self, charge: np.ndarray, group: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return a few shares of the variance, shape ``[k]``, and which of them fits every group's mean, shape ``[group_count]``."""
        number = np.maximum(np.bincount(group, minlength=count), 1)
        mean = np.bincount(group, np.log2(self.shares(charge)), count) / number
        halvings = np.clip(np.round(-mean).astype(np.int64), 0, SHARES - 1)
        used, which = np.unique(halvings, return_inverse=True)
        return 0.5 ** used.astype(np.float64), which.astype(np.int32)


class Softness(NamedTuple):
    """How soft charges are; lengths are those of the cascade.

    Attributes:
        blur: Standard deviation of the Gaussian between two charges, and between a charge and the target.
        core: Strength of the repulsive core, see :mod:`esh.engine.field.blur`.
        reach: Distance at which the core ends.
        following: How the blur varies; None if it is everywhere the same.
    """

    blur: float
    core: float
    reach: float
    following: Following | None = None


def near_force(squared: np.ndarray, width: float) -> np.ndarray:
    """Distance times force of the near field between two unit charges: that of -log r, blurred, less all octaves of the far field.

    Args:
        squared: Squared distances, in squared lengths, shape ``[n]``.
        width: Standard deviation of the blur between the two, in lengths; 0 for points.
    """
    ratio = squared[:, None] / 4.0 ** (np.arange(FAR_OCTAVES) + 0.5)
    force = 1.0 - (math.log(2.0) * ratio * np.exp(-0.5 * ratio)).sum(axis=1)
    return force - np.exp(-0.5 * squared / width**2) if width > 0.0 else force


@lru_cache(maxsize=16)
def near_terms(cutoff: float, blur: float) -> np.ndarray:
    """Coefficients of a polynomial that approximates :func:`near_force`, shape ``[NEAR_TERMS]``, the constant one first.

    Its variable is the squared distance over that of the cut-off: see :class:`.NearPart`.

    Args:
        cutoff: Distance at which the near field ends, in lengths.
        blur: Standard deviation of the blur between two charges, in lengths; 0 for points.
    """
    squared = np.linspace(0.0, 1.0, FITTED)
    force = near_force(cutoff**2 * squared, blur)
    fit = np.polynomial.Chebyshev.fit(squared, force, NEAR_TERMS - 1, domain=[0.0, 1.0])
    return fit.convert(kind=np.polynomial.Polynomial).coef
