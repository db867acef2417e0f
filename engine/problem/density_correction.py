"""Gray-value correction: denser dots where discs cannot tile the plane, so that dark areas come out dark.

It is section 3 of the paper (Schmaltz, Gwosdek and Weickert 2012).
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import ProblemError

__all__ = ["correct_density", "tone_map"]

# Covered share of touching discs in a honeycomb: up to here they cover what they add up to.
LARGEST_WITHOUT_OVERLAP = math.pi / (2.0 * math.sqrt(3.0))
# Bisection halves an interval of pi / 6 until neighboring floats remain.
BISECTIONS = 64


def tone_map(gray: np.ndarray) -> np.ndarray:
    """The paper's T(x), equations 4 to 6.

    Args:
        gray: Gray values x, 0 (black) to 1 (white), any shape.

    Returns:
        T(x), float64: x itself above 1 - pi / (2 sqrt 3), down to 1 - 2 pi / (3 sqrt 3) < 0 for black; to 1e-9 or better.
    """
    gray = np.asarray(gray, dtype=np.float64)
    dark = gray < 1.0 - LARGEST_WITHOUT_OVERLAP
    result = gray.copy()
    # Images have few different values; each is looked for once.
    wanted, place = np.unique(np.maximum(gray[dark], 0.0), return_inverse=True)
    low, high = np.zeros(wanted.shape), np.full(wanted.shape, math.pi / 6.0)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        too_bright = _uncovered_share(middle) > wanted
        low, high = np.where(too_bright, low, middle), np.where(too_bright, middle, high)
    c = np.cos(math.pi / 6.0 - 0.5 * (low + high))
    result[dark] = (1.0 - LARGEST_WITHOUT_OVERLAP / c**2)[place]
    return result


def correct_density(density: np.ndarray, key: str = "`density`") -> np.ndarray:
    """Return the density of dots whose union covers what ``density`` asks for.

    Args:
        density: Covered share of the ground, 0..1, any shape.
        key: How sentences name it.

    Returns:
        1 - T(1 - density), float64: the same up to 0.907, up to 1.209 for 1.

    Raises:
        ProblemError: A share below 0 or above 1.
    """
    density = np.asarray(density, dtype=np.float64)
    if density.size and not 0.0 <= density.min() <= density.max() <= 1.0:
        raise ProblemError(
            f"{key} must be a covered share between 0 and 1; got {float(density.min()):g} to {float(density.max()):g}"
        )
    return 1.0 - tone_map(1.0 - density)


def _uncovered_share(opening: np.ndarray) -> np.ndarray:
    """Share of the plane that discs in a honeycomb leave free: 1 minus the left side of equation 5.

    Written in ``opening`` = pi/6 - arccos c, in which nothing cancels where the discs cover nearly all: 0 is c = sqrt(3)/2, full
    cover, and pi/6 is c = 1, discs that touch.
    """
    c = np.cos(math.pi / 6.0 - opening)
    free = 2.0 * math.sqrt(3.0) * np.sin(opening) ** 2 - 3.0 * (2.0 * opening - np.sin(2.0 * opening))
    return free / (2.0 * math.sqrt(3.0) * c**2)
