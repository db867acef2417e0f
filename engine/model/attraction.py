"""What attracts the groups: their densities, and what fixed bodies are too many of for them.

Fixed bodies repel, and count as part of what the density asks for. Where they are more than it asks for, the excess is a target of its
own: without it, others would keep away from them far and wide. So the target is max(a density, that of the fixed bodies), of as much
charge as there is.
"""

from __future__ import annotations

import math

import numpy as np

from ..field.field_targets import FieldTarget
from ..problem.image_filters import gaussian_blur
from ..space.density import box_integrals
from .model import Model

__all__ = ["BLUR_OF_FIXED", "but_for_chance", "group_targets", "vacancy", "water_level"]

# Fixed bodies are counted in cells of the size of their group's spacing, blurred by so many of them as densities are: fluctuations
# of bodies that stand at random are no excess. Measured with half of 4,000 bodies fixed: with 1.5 another 9 to 14 stand between them,
# with 2 none to 3, and errors are .002 instead of .006.
BLUR_OF_FIXED = 2.0
FEWEST_CELLS, MOST_CELLS = 4, 512
# What is between so many times as much as is asked for may be so by chance. Measured with half of 4,000 bodies fixed: taken for an
# excess, it is a target of its own that draws others to between the fixed ones, and errors are .02 instead of .002.
LITTLE_LESS, LITTLE_MORE = 0.9, 1.1
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
    """Share of a class's density that fixed bodies leave to new ones, shape ``[cells, cells]``, row 0 at the bottom.

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
    """The factor of ``asked``, at most ``most``, with which max(asked, there), of one shape, adds up to ``total``."""
    low, high = 0.0, most
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if np.maximum(middle * asked, there).sum() > total:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def but_for_chance(there: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """What is there, or what is asked for where these may differ by chance; all of one shape."""
    return np.where((there > LITTLE_LESS * asked) & (there < LITTLE_MORE * asked), asked, there)


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
