"""Where the bodies start: importance sampling along a Hilbert curve, even from the first step on and exact in number.

Cells visited along a Hilbert curve carry their share of a group's density; bodies stand at even steps of the running sum.
Neighbours on the curve are neighbours in the plane, so no region gets more than its share, unlike independent draws.
"""

from __future__ import annotations

import numpy as np

from .density import box_integrals, sample_density, settle_on_full_pixels
from .interaction import Groups
from .problem import Problem

__all__ = ["initial_placement"]

# Cells per body, and the finest curve (2^11 cells a side): cells smaller than a spacing are what makes the start even.
CELLS_PER_BODY = 8
LARGEST_ORDER = 11
# A cell that is partly empty is drawn from again this often before its body is put on a pixel that is known to be full.
REDRAWS = 12
# Golden ratio: group after group starts at another fraction of a step, so that groups interleave along the curve.
GOLDEN = 0.6180339887498949


def initial_placement(problem: Problem, groups: Groups) -> np.ndarray:
    """Return positions [m], shape ``[body_count, 2]``, float64, in class, then size order; seeded by ``problem.seed``.

    Every group is spread by itself, so that each starts even.

    Every body stands inside the domain on a pixel whose density is above zero.
    """
    rng = np.random.default_rng(problem.seed)
    size = np.array(problem.domain.size)
    result = np.empty((problem.body_count, 2))
    # Bodies of every group, group after group.
    by_group = np.argsort(groups.body_group, kind="stable")
    count = np.bincount(groups.body_group, minlength=groups.count)
    first = np.concatenate([[0], np.cumsum(count)])
    shift = rng.random()
    for c, body_class in enumerate(problem.classes):
        image = body_class.density_image
        of_class = np.flatnonzero(groups.class_index == c)
        order = int(np.clip(np.ceil(np.log2(np.sqrt(CELLS_PER_BODY * count[of_class].max()) + 1)), 3, LARGEST_ORDER))
        cells = 2**order
        column, row = _hilbert_curve(order)
        running = np.cumsum(box_integrals(image, (cells, cells))[row, column])
        for g in of_class:
            shift = (shift + GOLDEN) % 1.0
            n = int(count[g])
            # Half a step of jitter: enough to hide the curve, little enough to stay even.
            step = (np.arange(n) + (shift + 0.5 * rng.random(n)) % 1.0) / n
            chosen = np.minimum(np.searchsorted(running, step * running[-1], side="right"), cells * cells - 1)
            corner = np.stack([column[chosen], row[chosen]], axis=1)
            position = (corner + rng.random((n, 2))) / cells * size
            bodies = by_group[first[g] : first[g + 1]]
            result[bodies] = _off_empty_pixels(position, corner, cells, image, size, rng)
    return result


def _off_empty_pixels(
    position: np.ndarray, corner: np.ndarray, cells: int, image: np.ndarray, size: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Draw again within the cell where a body fell on zero density, then settle on a full pixel nearby."""
    extent = (float(size[0]), float(size[1]))
    for _ in range(REDRAWS):
        empty = np.flatnonzero(sample_density(image, position, extent) <= 0.0)
        if len(empty) == 0:
            return position
        position[empty] = (corner[empty] + rng.random((len(empty), 2))) / cells * size
    return settle_on_full_pixels(image, position, extent)


def _hilbert_curve(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the cells of a ``2^order`` square in the order in which a Hilbert curve visits them."""
    column = np.zeros(1, dtype=np.int32)
    row = np.zeros(1, dtype=np.int32)
    for level in range(order):
        side = 1 << level
        # Four copies: the first reflected about the diagonal, the last about the other one.
        column, row = (
            np.concatenate([row, column, column + side, 2 * side - 1 - row]),
            np.concatenate([column, row + side, row + side, side - 1 - column]),
        )
    return column, row
