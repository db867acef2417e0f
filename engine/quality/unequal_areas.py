"""What is to be said where some bodies are very much larger than most: small ones gather between them, and figures say less."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..problem.problem import Problem

__all__ = ["notes_on_areas"]

# Ratio of areas below which none of this shows.
LEAST_RATIO = 16.0
# Small bodies gather where at least so many come to each large one that they share gaps, and they are asked to fill less than a share
# of the ground. Measured with 60 large squares: else their nearest neighbors are about as far as those of random points.
GATHERING = ((2.0, 0.1), (1.0, 0.005))
# Coverage errors above which somebody asks why; and how many times more bodies there are than equal ones that would be as coarse.
UNEVEN, MOST_OF_FEW = 0.15, 4.0


def notes_on_areas(problem: Problem, area: np.ndarray, class_index: np.ndarray, errors: Sequence[float]) -> list[str]:
    """Say what comes of areas that differ by very much, and what helps.

    Large bodies repel small ones with all of their charge. So the energy is least where the small ones fill the gaps between them as
    densely as the density asks of all together: they crowd on a share of the ground that is their share of the charge. Classes that
    are kept even each by itself (`class_separation`) do not see each other.

    Args:
        problem: What was asked.
        area: Footprints of the bodies [m²], shape ``[n]``.
        class_index: Their classes, shape ``[n]``.
        errors: Coverage errors of the classes.
    """
    if not len(area) or not area.min() * LEAST_RATIO < area.max():
        return []
    number, charge = _by_size(area, class_index, len(problem.classes))
    factors = problem.balance.class_factors([c.body_count for c in problem.classes])
    found = _gathering(number, charge, factors)
    if found is not None:
        small, share = found
        parted = bool((small * (number.sum(axis=0) - small) == 0.0).all())
        helps = "" if parted else "make them a class of their own, and "
        return [
            f"{small.sum():,.0f} of {len(area):,} bodies are so small that all of them are {100.0 * share:.2g}% of the footprints: "
            f"they gather in the gaps between the large ones; to spread them, {helps}lower `class_separation` to 0"
        ]
    classes = len(problem.classes)
    count, total, squares = (np.bincount(class_index, w, classes) for w in (None, area, np.square(area)))
    # Equal bodies that are as coarse as these: the square of all charge over the sum of its squares.
    if (np.greater(errors, UNEVEN) & (total**2 * MOST_OF_FEW < count * squares)).any():
        return [
            "some bodies are so much larger than most that the space around them counts as uneven: coverage errors look no "
            "farther than the usual spacing"
        ]
    return []


def _by_size(area: np.ndarray, class_index: np.ndarray, classes: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and charges of bodies, by how often their areas can be doubled up to the largest, and by class."""
    doublings = np.floor(np.log2(area.max() / np.maximum(area, np.finfo(float).tiny))).astype(np.int64)
    row = doublings * classes + class_index
    shape = (int(doublings.max()) + 1, classes)
    number, charge = (np.bincount(row, weights, shape[0] * classes).reshape(shape) for weights in (None, area))
    return number.astype(np.float64), charge


def _gathering(number: np.ndarray, charge: np.ndarray, factors: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return how many small bodies of every class gather, and their share of all areas; None where none do.

    Args:
        number: Bodies by size, from the largest, and class.
        charge: Their charges.
        factors: How classes see each other.
    """
    every = charge.sum(axis=0)
    for larger in range(1, len(number)):
        small, own = number[larger:].sum(axis=0), charge[larger:].sum(axis=0)
        seen = own @ factors @ every
        filled = own @ factors @ own / seen if seen > 0.0 else 1.0
        to_each = small.sum() / number[:larger].sum()
        if any(to_each >= least and filled < share for least, share in GATHERING):
            return small, float(own.sum() / every.sum())
    return None
