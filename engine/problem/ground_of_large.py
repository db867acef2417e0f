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

# Areas from which on a body is large beside another: nothing changes up to the first ratio, everything from the second on. Up to the
# first, bodies stand in gaps between each other.
LARGE_FROM, LARGE = 3.0, 9.0
# Cells along the longer side of a rectangle in which it is compared how dense small and large ones stand.
CELLS = 32
# And pixels along each that are looked at, about.
PIXELS_OF_CELL = 16
# Forces go in steps of this share: a stroke of a brush does not change how all bodies act on each other.
STEP = 0.2
# Share of its mean density below which a class counts as absent.
ABSENT = 0.02


def most_alone(problem: Problem) -> np.ndarray:
    """Return the largest own factor of every class with which large bodies of others push its own enough, shape ``[classes]``.

    See :meth:`.Balance.class_factors`. It is infinite where no large ones keep off, and 1 at least, which is the paper's.
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
            most = max((1.0 / push - 1.0) * alpha / (1.0 - alpha), 1.0)
            result[small] = most ** (1.0 / max(float(largeness[small, least]), 0.1))
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

    Where a class is absent does not count: an erased spot changes nothing around others.
    """
    if isinstance(problem.domain, Surface):
        points = problem.domain.sample()
        found = [_shares(c.density_on(points) if c.varies_on_surface else np.ones(1)) for c in problem.classes]
    else:
        width, height = problem.rectangle.size
        rows, columns = (max(1, round(CELLS * length / max(width, height))) for length in (height, width))
        found = [_shares(_thinned(c.density_image), (rows, columns)) for c in problem.classes]
    share, present = (np.stack(np.broadcast_arrays(*values)) for values in zip(*found, strict=True))
    met = present @ share.T
    result: np.ndarray = np.divide(share @ share.T, met, out=np.zeros_like(met), where=met > 0.0)
    return result


def _thinned(image: np.ndarray) -> np.ndarray:
    """Every so many pixels of an image, of which cells have enough."""
    rows, columns = (max(1, length // (CELLS * PIXELS_OF_CELL)) for length in image.shape)
    return image[::rows, ::columns]


def _shares(density: np.ndarray, cells: tuple[int, int] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A density over its mean, and which part of it is not next to nothing, at points or in ``cells`` of an image; flat."""
    if density.size == 1:
        return np.ones(1), np.ones(1)
    mean = float(density.mean(dtype=np.float64))
    present = density > ABSENT * mean
    if cells is None:
        return density / max(mean, 1e-300), present.astype(np.float64)
    return in_cells(density, cells).ravel() / mean, in_cells(present, cells).ravel()
