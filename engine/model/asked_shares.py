"""Which share of the bodies of a class is to be in which cell of the domain, on the device."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.part import Part
from ..space.target_deposit import integrate_boxes
from .attraction import vacancy
from .model import Model

__all__ = ["are_asked_alike", "asked_share", "cells_for"]

# Cells per body in which densities are compared; powers of two along either side. Pixels are not divided: they are of one density.
CELLS_PER_BODY = 2
SMALLEST_ORDER, LARGEST_ORDER = 3, 10


def cells_for(count: int, *images: np.ndarray, part: Part | None = None) -> int:
    """How finely the densities of so many bodies, which are these images, are compared: in so many cells along either side.

    These are cells of the domain, or of a ``part``.
    """
    order = math.ceil(0.5 * math.log2(CELLS_PER_BODY * count + 1.0))
    if images:
        shares = (1.0, 1.0) if part is None else part.extent((1.0, 1.0))[::-1]
        pixels = max(length * share for image in images for length, share in zip(image.shape, shares, strict=True))
        order = min(order, math.ceil(math.log2(pixels)))
    return 1 << min(max(order, SMALLEST_ORDER), LARGEST_ORDER)


def asked_share(launcher: Launcher, model: Model, class_index: int, cells: int, part: Part | None) -> wp.array:
    """Share of a class's bodies that are to be placed in every cell, flat, row 0 at the bottom; the sum is 1.

    These are cells of the domain, or of a part, where nobody is fixed.
    """
    of_model = _asked_of.setdefault(model, {})
    key = class_index, cells, launcher.device.alias, part
    if key not in of_model:
        share = integrate_boxes(launcher, model.problem.classes[class_index].density_image, (cells, cells), part)
        left = vacancy(model, class_index, cells)
        if left is not None:
            vacant = share.numpy().astype(np.float64) * left.ravel()
            if vacant.any():
                share = launcher.array((vacant / vacant.sum()).astype(np.float32), float)
        of_model[key] = share
    return of_model[key]


# Of a model that is edited to, the next edit asks again.
_asked_of: WeakKeyDictionary[Model, dict[tuple[int, int, str, Part | None], wp.array]] = WeakKeyDictionary()


def are_asked_alike(one: Model, class_index: int, other: Model, other_index: int) -> bool:
    """Whether two classes of two models are to be placed alike, but for their numbers, and nobody is fixed in either."""
    if one.has_fixed or other.has_fixed:
        return False
    images = one.problem.classes[class_index].density_image, other.problem.classes[other_index].density_image
    return images[0] is images[1] or np.array_equal(*images)
