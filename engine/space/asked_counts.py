"""How many bodies are asked for where."""

from __future__ import annotations

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..problem.problem import Problem
from .density import box_integrals
from .part import Part, part_of

__all__ = ["share_in_use", "typical_spacing"]

# Cells along the longer side on which the typical spacing and the space that bodies may use are measured.
CELLS = 256


class _Asked(NamedTuple):
    """What whoever solves a problem asks of it several times."""

    spacing: float
    share_in_use: float


_known: WeakKeyDictionary[Problem, _Asked] = WeakKeyDictionary()


def typical_spacing(problem: Problem) -> float:
    """Spacing [m] of charges at the number density that the average body sees."""
    return _asked(problem).spacing


def share_in_use(problem: Problem) -> float:
    """Share of the domain in which any body is asked for."""
    return _asked(problem).share_in_use


def _asked(problem: Problem) -> _Asked:
    if problem not in _known:
        part = part_of(c.density_image for c in problem.classes)
        number = _counts_in_cells(problem, part)
        used = 1.0 if part is None else part.share
        cell_area = problem.domain.area * used / number.size
        spacing = math.sqrt(cell_area * number.sum() / (number**2).sum())
        spacing *= math.sqrt(problem.body_count / problem.charge_count)
        _known[problem] = _Asked(spacing, float(np.mean(number > 0.0)) * used)
    return _known[problem]


def _counts_in_cells(problem: Problem, part: Part | None) -> np.ndarray:
    """Asked number of bodies in every cell of a coarse grid over the domain, or a part, shape ``[rows, columns]``, float64."""
    size = problem.rectangle.size if part is None else part.extent(problem.rectangle.size)
    rows, columns = (max(1, round(CELLS * length / max(size))) for length in size[::-1])
    share = {id(c.density_image): c.density_image for c in problem.classes}
    share = {key: box_integrals(image, (rows, columns), part) for key, image in share.items()}
    return np.sum([c.body_count * share[id(c.density_image)] for c in problem.classes], axis=0)
