"""A few points spread evenly over a density, wherever that is: a centroidal Voronoi tessellation (Lloyd, 1982).

A descent spreads many points more evenly. A few that lie far from each other on a narrow density, such as the rim of a hole, take
steps as long as they are apart, and end anywhere; of some more, one or another does.
"""

from __future__ import annotations

import numpy as np

from ..space.density import move_into_support
from ..space.hilbert_curve import along_hilbert_curve

__all__ = ["few_points", "with_strays_back"]

# Rounds in which points go to the centroids of what is nearest to them.
ROUNDS = 8
# Cells that are told apart, at most: finer ones are taken together. And for each point, at least: coarser ones are split.
MOST_CELLS, CELLS_FOR_EACH = 2048, 6
# Cells between a point and a density from which on it is a stray.
STRAY = 2


def few_points(density: np.ndarray, count: int, size: tuple[float, float], seed: int) -> np.ndarray:
    """Return points [m] where a density is above 0, each with as much of it around it as others, shape ``[count, 2]``.

    Args:
        density: Over a rectangle, shape ``[rows, columns]``, row 0 at the bottom; the same everywhere where all of it is 0.
        count: How many points.
        size: Extent of that rectangle along x and y [m].
        seed: Decides what is random.
    """
    if not density.any():
        density = np.ones((1, 1))
    mass, block = _in_blocks(np.asarray(density, np.float64), CELLS_FOR_EACH * count)
    cell = np.array(size) / density.shape[::-1]
    row, column = np.nonzero(mass)
    weight = mass[row, column]
    center = (np.stack([column, row], axis=1) + 0.5) * block * cell
    point = _along_curve(row, column, weight, count, np.random.default_rng([seed, 15]))
    point = (point + 0.5) * block * cell
    for _ in range(ROUNDS):
        nearest = np.argmin((point**2).sum(axis=1) - 2.0 * center @ point.T, axis=1)
        total = np.bincount(nearest, weight, count)
        for axis in (0, 1):
            moment = np.bincount(nearest, weight * center[:, axis], count)
            # Who has nothing stays.
            point[:, axis] = np.where(total > 0.0, moment / np.maximum(total, 1e-300), point[:, axis])
    return move_into_support(density[::-1], point, size)


def with_strays_back(density: np.ndarray, point: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return points [m] of which those far from where a density is above 0 are where it has most room between the others.

    Args:
        density: Over a rectangle, shape ``[rows, columns]``, row 0 at the bottom; above 0 somewhere.
        point: The points, shape ``[count, 2]``.
        size: Extent of that rectangle along x and y [m].
    """
    cell = np.array(size) / density.shape[::-1]
    way = np.abs(move_into_support(density[::-1], point, size) - point)
    stray = np.flatnonzero((way > STRAY * cell).any(axis=1))
    if not len(stray):
        return point
    mass, block = _in_blocks(np.asarray(density, np.float64), 1)
    row, column = np.nonzero(mass)
    center = (np.stack([column, row], axis=1) + 0.5) * block * cell
    result, there = point.copy(), np.delete(point, stray, axis=0)
    # Spacings are as the root of what each point stands for.
    room = np.full(len(center), np.inf)
    for one in there:
        np.minimum(room, ((center - one) ** 2).sum(axis=1), out=room)
    for k in stray.tolist():
        chosen = np.argmax(room * mass[row, column])
        result[k] = center[chosen]
        np.minimum(room, ((center - result[k]) ** 2).sum(axis=1), out=room)
    return move_into_support(density[::-1], result, size)


def _in_blocks(density: np.ndarray, least: int) -> tuple[np.ndarray, float]:
    """Sums over square blocks of cells of which neither too many are above 0 nor too few, and how many cells long a block is."""
    block, mass = 1, density
    while np.count_nonzero(mass) > MOST_CELLS:
        block *= 2
        padded = np.pad(density, [(0, -length % block) for length in density.shape])
        mass = padded.reshape(padded.shape[0] // block, block, padded.shape[1] // block, block).sum(axis=(1, 3))
    parts = 1
    while np.count_nonzero(mass) < least:
        parts *= 2
        mass = np.repeat(np.repeat(mass, 2, axis=0), 2, axis=1)
    return mass, block / parts


def _along_curve(
    row: np.ndarray, column: np.ndarray, weight: np.ndarray, count: int, random: np.random.Generator
) -> np.ndarray:
    """Places between cells (their numbers along x and y), as much of a density apart from each other along Hilbert's curve."""
    order = np.argsort(along_hilbert_curve(column, row), kind="stable")
    reached = np.cumsum(weight[order])
    asked = (np.arange(count) + random.random()) / count * reached[-1]
    chosen = order[np.minimum(np.searchsorted(reached, asked, side="right"), len(order) - 1)]
    # Several of one cell are not at one place.
    return np.stack([column, row], axis=1)[chosen] + 0.5 * (random.random((count, 2)) - 0.5)
