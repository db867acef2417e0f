"""Where new bodies start beside fixed ones of their class: between bodies that do not move there is no way out."""

from __future__ import annotations

import numpy as np

from ..space.space import Space
from .attraction import vacancy
from .model import Model

__all__ = ["KEEPS_OFF", "LEAST_FREE", "MOST_BY_CHANCE", "vacant_cells"]

# New bodies do not start nearer than so many spacings to fixed ones, the middles between three neighbors in a lattice included.
KEEPS_OFF = 0.65
# A density counts as no less than so large a share of its mean there.
SPARSEST = 0.25
# Those that would have started there start beside, in the smallest of some blocks of cells of which so large a share is free: there
# fixed ones end, or are sparse. Where they are that dense all over, in what little there is.
BLOCKS = (8, 16, 32)
LEAST_FREE = 0.06
# Unless what is left of the vacancy is so small a share of it: that is what fixed ones lack by chance.
MOST_BY_CHANCE = 0.1
# Cells that places near a fixed body are looked for in, at most.
MOST_REACH = 16


def vacant_cells(model: Model, class_index: int, asked: np.ndarray) -> np.ndarray | None:
    """Share of a class's density in cells that new bodies start in, where fixed ones leave them room; None where none of it is fixed.

    Args:
        model: The model.
        class_index: Its class.
        asked: Share of the class's bodies that is asked for in every cell, shape ``[cells, cells]``, row 0 at the bottom; as many
            as a power of two.
    """
    cells = len(asked)
    left = vacancy(model, class_index, cells)
    if left is None:
        return None
    vacant = asked * left
    if not vacant.any():
        vacant = asked
    free = vacant * _free_of_fixed(model, class_index, asked)
    sizes = [size for size in BLOCKS if size <= cells] or [cells]
    result, rest = np.zeros_like(vacant), vacant
    for size, least in [*((size, LEAST_FREE) for size in sizes), (sizes[0], 0.0)]:
        if least == 0.0 and rest.sum() < MOST_BY_CHANCE * vacant.sum():
            return result

        def in_blocks(values: np.ndarray, size: int = size) -> np.ndarray:
            return values.reshape(cells // size, size, cells // size, size).sum(axis=(1, 3))

        wanted, found = in_blocks(rest), in_blocks(free)
        enough = found > least * in_blocks(vacant)
        factor, done = (
            values.repeat(size, axis=0).repeat(size, axis=1)
            for values in (np.where(enough, wanted / np.maximum(found, 1e-300), 0.0), enough)
        )
        result += free * factor
        rest = np.where(done, 0.0, rest)
    # Where nothing at all is free they have to start between fixed ones.
    return result + rest


def _free_of_fixed(model: Model, class_index: int, asked: np.ndarray) -> np.ndarray:
    """In which cells no fixed body of a class stands nearer to the middle than others should, shape ``[rows, columns]``, bool.

    Args:
        model: The model.
        class_index: Its class.
        asked: Share of the class's bodies that is asked for in every cell, shape ``[rows, columns]``, row 0 at the bottom.
    """
    of_class = model.body.class_index == class_index
    table, size = model.problem.fixed, model.problem.rectangle.size
    place = table.position[of_class[model.fixed]]
    rows, columns = asked.shape
    cell = np.array([size[0] / columns, size[1] / rows])
    at = np.minimum((place / cell).astype(np.int64), [columns - 1, rows - 1])
    # Where next to nothing is asked for they keep others off no farther than that.
    share = np.maximum(asked[at[:, 1], at[:, 0]], SPARSEST * asked.mean())
    number = int(of_class.sum()) * share
    radius = KEEPS_OFF * np.sqrt(cell.prod() / np.maximum(number, 1e-300))
    result, around = np.ones((rows, columns), bool), Space.of(model.problem.rectangle)
    # Bodies that reach as many cells far are gone through at once.
    reach = np.minimum(np.ceil(radius / cell.min()), MOST_REACH).astype(np.int64)
    for most in np.unique(reach).tolist():
        own = reach == most
        for down in range(-most, most + 1):
            for along in range(-most, most + 1):
                middle = (at[own] + [along + 0.5, down + 0.5]) * cell
                near = np.linalg.norm(middle - place[own], axis=1) < radius[own]
                index = np.floor(around.wrapped(middle[near]) / cell).astype(np.int64)
                index = index[((index >= 0) & (index < [columns, rows])).all(axis=1)]
                result[index[:, 1], index[:, 0]] = False
    return result
