"""How strongly large bodies push small ones that they do not overlap: by as many as would have stood where they stand.

A class follows its density wherever the bodies of others are. Where outlines are kept apart, small bodies that are asked for on the
ground of a large one would stand in a closed row around it, nearer to each other than anywhere else. So a class is no more even by
itself than leaves large bodies of others the force of as many small ones as they take the ground of. The densities of these others,
which attract small ones as strongly, ask for those elsewhere. Around obstacles it is the same: they are known before anything is
placed, and are cut out of densities.
"""

from __future__ import annotations

import math

import numpy as np

from .body_kind import disc_radius
from .packing import in_cells
from .problem import Problem
from .surface import Surface

__all__ = ["most_alone"]

# Areas from which on a body is large beside another: nothing changes up to the first ratio, everything from the second on. Bodies that
# are more alike stand in gaps between each other.
LARGE_FROM, LARGE = 3.0, 9.0
# Cells along the longer side of a rectangle in which it is compared how dense small and large ones stand.
CELLS = 32
# And pixels along each that are looked at, about.
PIXELS_OF_CELL = 16
# The same of a surface: points.
POINTS = 4096
# Forces go in steps of this share: a stroke of a brush does not change how all bodies act on each other.
STEP = 0.2
# What is left of an own factor of 1 at least where small ones are so dense that large ones push them too little even with that.
LEAST_ALONE = 0.05


def most_alone(problem: Problem) -> np.ndarray:
    """Return the largest own factor of every class with which large bodies of others push its own enough, shape ``[classes]``.

    See :meth:`.Balance.class_factors`. It is infinite where no large ones keep off.
    """
    alpha, result = problem.balance.class_separation, np.full(len(problem.classes), math.inf)
    if not problem.avoid_overlap or len(problem.classes) < 2 or alpha in {0.0, 1.0}:
        return result
    number = np.array([c.body_count for c in problem.classes], np.float64)
    charge = np.array([sum((s.count or 0) * s.mean_area for s in c.sizes) for c in problem.classes])
    area = charge / np.maximum(number, 1.0)
    if area.max() < LARGE_FROM * area.min():
        return result
    ratio = np.maximum(area / np.maximum(area[:, None], 1e-300), 1e-300)
    largeness = np.clip(np.log(ratio / LARGE_FROM) / math.log(LARGE / LARGE_FROM), 0.0, 1.0)
    if problem.balance.classes_apart is not None:
        largeness = largeness * problem.balance.classes_apart
    # How many small ones each large one leaves no ground for; and how strongly it pushes then, over how strongly they push each other.
    radius = _radii(problem)
    per_area = number[:, None] / problem.domain.area * _density_where_others_are(problem)
    displaced = per_area * math.pi * (radius[:, None] + radius) ** 2
    wanted = displaced * area[:, None] / np.maximum(area, 1e-300)
    for small in range(len(number)):
        large = np.flatnonzero((largeness[small] > 0.0) & (wanted[small] > 0.0))
        if len(large):
            least = large[np.argmin(wanted[small, large])]
            push = math.exp(STEP * round(math.log(wanted[small, least]) / STEP))
            most = max((1.0 / push - 1.0) * alpha / (1.0 - alpha), LEAST_ALONE)
            result[small] = most / float(largeness[small, least]) ** 3
    return result


def _radii(problem: Problem) -> np.ndarray:
    """Mean radius [m] of the ground that bodies of each class keep for themselves, shape ``[classes]``."""
    return np.array(
        [
            sum(
                (s.count or 0) * (float(disc_radius(s.mean_area)) * s.room * c.room + 0.5 * (s.gap + c.gap))
                for s in c.sizes
            )
            / max(c.body_count, 1)
            for c in problem.classes
        ]
    )


def _density_where_others_are(problem: Problem) -> np.ndarray:
    """Return how dense each class is asked to be where the bodies of each other are, over its mean, shape ``[classes, classes]``.

    It is the mean over those of its bodies that are there: an erased spot changes nothing around others.
    """
    if isinstance(problem.domain, Surface):
        points = problem.domain.sample(POINTS)
        found = [c.density_on(points) if c.varies_on_surface else np.ones(1) for c in problem.classes]
    else:
        width, height = problem.rectangle.size
        cells = max(1, round(CELLS * height / max(width, height))), max(1, round(CELLS * width / max(width, height)))
        images = [c.density_image for c in problem.classes]
        found = [np.ones(1) if one.size == 1 else in_cells(_thinned(one), cells).ravel() for one in images]
    share = np.stack(np.broadcast_arrays(*[one / max(float(one.mean()), 1e-300) for one in found]))
    together = share @ share.T
    result: np.ndarray = np.divide(share**2 @ share.T, together, out=np.zeros_like(together), where=together > 0.0)
    return result


def _thinned(image: np.ndarray) -> np.ndarray:
    """Every so many pixels of an image, of which cells have enough."""
    rows, columns = (max(1, length // (CELLS * PIXELS_OF_CELL)) for length in image.shape)
    return image[::rows, ::columns]
