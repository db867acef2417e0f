"""How the kernel K = -log r is split into a smooth far part and a near part of finite reach.

A charge is spread by a density psi that vanishes beyond the cut-off; the far part is K * psi. By Gauss's law in the plane the near
part's force between two unit charges is N / r, where N is the share of psi that lies farther out than r: exactly zero beyond the
cut-off. Psi is the Kaiser-Bessel window, whose transform falls faster than that of any other of its reach, short of the prolate
functions themselves (Kaiser and Schafer, 1980): a Gaussian of the same accuracy would need nearly twice as many neighbors.

With v = 1 - (r / cut-off)², N = w I1(beta w) / I1(beta) where w² = v: a polynomial of v, but for rounding.
"""

from __future__ import annotations

import math

import numpy as np

__all__ = ["BETA", "height_of_transform", "outside_share", "smoothed_potential", "split_variance"]

# The larger, the faster psi's transform falls where it has become small, and the wider it is before.
BETA = 6.0
# Of this degree N is wrong by 1e-4.
DEGREE = 5
# Of a Bessel function's series: the rest is below float64's rounding.
TERMS = 40


def outside_share() -> np.ndarray:
    """Coefficients of N, lowest first, shape ``[DEGREE + 1]``: a polynomial of v that is 0 at 0 and 1 at 1."""
    v = np.linspace(0.0, 1.0, 1001)
    exact = _window(v)
    # v (1 + (v - 1) q): q is fitted where Chebyshev's nodes would lie closest.
    weight = 1.0 / np.sqrt(v * (1.0 - v) + 1e-3)
    basis = (v * (v - 1.0))[:, None] * v[:, None] ** np.arange(DEGREE - 1)
    q = np.linalg.lstsq(basis * weight[:, None], (exact - v) * weight, rcond=None)[0]
    return np.polynomial.polynomial.polyadd([0.0, 1.0], np.polynomial.polynomial.polymul([0.0, -1.0, 1.0], q))


def smoothed_potential() -> np.ndarray:
    """Coefficients of S, lowest first, where K * psi is -log(cut-off) + S(v) / 2 within the cut-off."""
    # (1 - N) / (1 - v), integrated: what -log r and the near part's potential leave.
    rest = np.polynomial.polynomial.polysub([1.0], outside_share())
    quotient = np.polynomial.polynomial.polydiv(rest, [1.0, -1.0])[0]
    return np.polynomial.polynomial.polyint(quotient)


def split_variance(cutoff: float) -> float:
    """Variance of psi along an axis."""
    first, second = _bessel(BETA, 1), _bessel(BETA, 2)
    return cutoff**2 * second / (BETA * first)


def height_of_transform() -> float:
    """I1(beta) / beta, by which psi's transform is divided to be 1 at wave number 0."""
    return _bessel(BETA, 1) / BETA


def _bessel(x: float, order: int) -> float:
    """The modified Bessel function I of the order, by its series."""
    return sum((0.5 * x) ** (2 * k + order) / (math.factorial(k) * math.factorial(k + order)) for k in range(TERMS))


def _window(v: np.ndarray) -> np.ndarray:
    """N itself: sqrt(v) I1(beta sqrt(v)) as a series of powers of v."""
    quarter = 0.25 * BETA**2
    series = [quarter**k / (math.factorial(k) * math.factorial(k + 1)) for k in range(TERMS)]
    return v * np.polynomial.polynomial.polyval(v, series) / sum(series)
