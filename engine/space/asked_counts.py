"""How many bodies are asked for where."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np

from ..problem.problem import Problem
from .density import box_integrals
from .part import Part, part_of

__all__ = ["typical_spacing"]

# Cells along the longer side on which the typical spacing is measured.
CELLS = 256


_known: WeakKeyDictionary[Problem, float] = WeakKeyDictionary()


def typical_spacing(problem: Problem) -> float:
    """Spacing [m] of charges at the number density that the average body sees."""
    # Whoever solves a problem asks for it several times.
    if problem not in _known:
        part = part_of(c.density_image for c in problem.classes)
        number = _counts_in_cells(problem, part)
        used = 1.0 if part is None else part.share
        cell_area = problem.domain.area * used / number.size
        spacing = math.sqrt(cell_area * number.sum() / (number**2).sum())
        _known[problem] = spacing * math.sqrt(problem.body_count / problem.charge_count)
    return _known[problem]


def _counts_in_cells(problem: Problem, part: Part | None) -> np.ndarray:
    """Asked number of bodies in every cell of a coarse grid over the domain, or a part, shape ``[rows, columns]``, float64."""
    size = problem.rectangle.size if part is None else part.extent(problem.rectangle.size)
    rows, columns = (max(1, round(CELLS * length / max(size))) for length in size[::-1])
    share = {id(c.density_image): c.density_image for c in problem.classes}
    share = {key: box_integrals(image, (rows, columns), part) for key, image in share.items()}
    return np.sum([c.body_count * share[id(c.density_image)] for c in problem.classes], axis=0)
