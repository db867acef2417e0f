"""What attracts the groups: their densities, and what fixed bodies are too many of for them.

Fixed bodies repel, and count as part of what the density asks for. Where they are more than it asks for, the excess is a target of its
own: without it, others would keep away from them far and wide. So the target is max(a density, that of the fixed bodies), of as much
charge as there is.
"""

from __future__ import annotations

import math

import numpy as np

from ..field.field import FieldTarget
from ..problem.image_filters import gaussian_blur
from ..space.density import box_integrals
from ..space.space import Space
from .model import Model

__all__ = [
    "BLUR_OF_FIXED",
    "KEEPS_OFF",
    "LEAST_FREE",
    "MOST_BY_CHANCE",
    "but_for_chance",
    "group_targets",
    "vacancy",
    "vacant_cells",
    "water_level",
]

# Fixed bodies are counted in cells of the size of their group's spacing, blurred by so many of them as densities are: fluctuations
# of bodies that stand at random are no excess. Measured with half of 4,000 bodies fixed: with 1.5 another 9 to 14 stand between them,
# with 2 none to 3, and errors are .002 instead of .006.
BLUR_OF_FIXED = 2.0
FEWEST_CELLS, MOST_CELLS = 4, 512
# Cells that places near a fixed body are looked for in, at most.
MOST_REACH = 16
# What is between so many times as much as is asked for may be so by chance. Measured with half of 4,000 bodies fixed: taken for an
# excess, it is a target of its own that draws others to between the fixed ones, and errors are .02 instead of .002.
LITTLE_LESS, LITTLE_MORE = 0.9, 1.1
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
# Halvings of the interval in which the density's share of the target lies.
BISECTIONS = 60


def group_targets(model: Model) -> list[FieldTarget]:
    """Return what attracts every group: its class's density, and beside it the excess of fixed bodies where there is one."""
    classes = model.problem.classes
    class_index = model.groups.class_index.tolist()
    charge = model.group_charge
    fixed = model.fixed
    result = []
    for g, c in enumerate(class_index):
        image = classes[c].density_image
        own = fixed & (model.body.group == g) if model.has_fixed else fixed
        if not model.has_fixed or not own.any():
            result.append(FieldTarget(image, charge[g], class_index=c))
            continue
        bodies = (model.body.group == g).sum()
        share, excess = _excess(model, image, own, float(charge[g]), int(bodies))
        more = (FieldTarget(excess.astype(np.float32), float(excess.sum())),) if excess.any() else ()
        result.append(FieldTarget(image, share, more, c))
    return result


def vacancy(model: Model, class_index: int, cells: int) -> np.ndarray | None:
    """Share of a class's density that fixed bodies leave to new ones in ``cells`` by ``cells`` cells, row 0 at the bottom.

    None where none of the class is fixed.
    """
    if not model.has_fixed:
        return None
    of_class = model.body.class_index == class_index
    own = model.fixed & of_class
    if not own.any():
        return None
    image = model.problem.classes[class_index].density_image
    total = float(model.body_charge[of_class].sum())
    there, asked = _on_cells(model, image, own, int(of_class.sum()), total)
    share = water_level(asked, there, total, total)
    left = np.clip(1.0 - there / np.maximum(share * asked, 1e-300), 0.0, 1.0)[::-1]
    row, column = ((np.arange(cells) + 0.5) * n / cells for n in left.shape)
    return left[row.astype(int)[:, None], column.astype(int)]


def _excess(model: Model, image: np.ndarray, own: np.ndarray, total: float, bodies: int) -> tuple[float, np.ndarray]:
    """Charge that the density stands for, and the excess of fixed bodies over it per cell, row 0 at the top."""
    there, asked = _on_cells(model, image, own, bodies, total)
    share = water_level(asked, there, total, total)
    excess = np.maximum(there - share * asked, 0.0)
    return total - float(excess.sum()), excess


def water_level(asked: np.ndarray, there: np.ndarray, total: float, most: float) -> float:
    """The factor of ``asked``, at most ``most``, with which max(asked, there) adds up to ``total``."""
    low, high = 0.0, most
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if np.maximum(middle * asked, there).sum() > total:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def but_for_chance(there: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """What is there, or what is asked for where these may differ by chance."""
    return np.where((there > LITTLE_LESS * asked) & (there < LITTLE_MORE * asked), asked, there)


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


def _on_cells(
    model: Model, image: np.ndarray, own: np.ndarray, bodies: int, total: float
) -> tuple[np.ndarray, np.ndarray]:
    """Charge of fixed bodies, and share of the density, in cells about a spacing of the group wide, row 0 at the top; both blurred."""
    domain = model.problem.rectangle
    spacing = math.sqrt(domain.area / bodies)
    rows, columns = (int(np.clip(round(length / spacing), FEWEST_CELLS, MOST_CELLS)) for length in domain.size[::-1])
    table = model.problem.fixed
    position = table.position[own[model.fixed]]
    column = np.minimum((position[:, 0] / domain.size[0] * columns).astype(int), columns - 1)
    row = np.minimum(((1.0 - position[:, 1] / domain.size[1]) * rows).astype(int), rows - 1)
    there = np.bincount(row * columns + column, weights=model.body_charge[own], minlength=rows * columns)
    pad = [min(math.ceil(5.0 * BLUR_OF_FIXED), n) for n in (rows, columns)]

    def blurred(values: np.ndarray) -> np.ndarray:
        wide = gaussian_blur(model.space.padded(values, *pad), BLUR_OF_FIXED)
        inner = wide[pad[0] : pad[0] + rows, pad[1] : pad[1] + columns]
        return inner * (values.sum() / max(float(inner.sum()), 1e-300))

    asked = blurred(box_integrals(image, (rows, columns))[::-1])
    return but_for_chance(blurred(there.reshape(rows, columns)), total * asked), asked
