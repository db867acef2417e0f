"""How strongly large bodies push small ones that they do not overlap: by as many as would have stood where they stand.

A class follows its density wherever the bodies of others are. Where outlines are kept apart, small bodies that are asked for on the
ground of a large one would stand in a closed row around it, nearer to each other than anywhere else. So a class is no more even by
itself than leaves large bodies of others the force of as many small ones as they take the ground of. The densities of these others,
which attract small ones as strongly, ask for those elsewhere. Around obstacles it is the same: they are known before anything is
placed, and are cut out of densities.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .body_kind import disc_radius
from .packing import in_cells
from .prepared_class import PreparedClass
from .problem import Problem
from .size import Size
from .surface import Surface

__all__ = ["LARGE", "ground_radius", "most_alone"]

# Areas from which on bodies are large beside others: nothing changes up to the first ratio, everything from the second on. Bodies that
# are more alike stand in gaps between each other.
LARGE_FROM, LARGE = 3.0, 9.0
# Cells along the longer side of a rectangle in which it is compared how dense small and large ones stand, and points of a surface.
CELLS, POINTS = 32, 1 << 14
# Forces go in steps of this share: a stroke of a brush does not change how all bodies act on each other.
STEP = 0.2
# What is left of an own factor of 1 at least where small ones are so dense that large ones push them too little even with that.
LEAST_ALONE = 0.05


def most_alone(problem: Problem, densities: Sequence[np.ndarray] | None = None) -> np.ndarray:
    """Return the largest own factor of every class with which large bodies of others push its own enough, shape ``[classes]``.

    See :meth:`.Balance.class_factors`. It is infinite where no large ones keep off. Of several large sizes each has a say by how many
    small bodies it leaves no ground for.

    Args:
        problem: Whose bodies they are.
        densities: Images of the classes' densities; None for those of the problem.
    """
    alpha, result = problem.balance.class_separation, np.full(len(problem.classes), math.inf)
    if not problem.avoid_overlap or len(problem.classes) < 2 or alpha in {0.0, 1.0}:
        return result
    of = np.array([c for c, one in enumerate(problem.classes) for _ in one.sizes])
    number, area, radius = np.array(
        [(s.count or 0, s.mean_area, ground_radius(one, s)) for one in problem.classes for s in one.sizes], np.float64
    ).T
    if area.max() < LARGE_FROM * area.min():
        return result
    apart = problem.balance.classes_apart
    together = _density_where_others_are(problem, densities)
    for small in range(len(problem.classes)):
        own = of == small
        bodies = max(float(number[own].sum()), 1.0)
        mean_area, mean_radius = (float((number[own] * values[own]).sum()) / bodies for values in (area, radius))
        ratio = np.maximum(area / max(mean_area, 1e-300), 1e-300)
        largeness = np.clip(np.log(ratio / LARGE_FROM) / math.log(LARGE / LARGE_FROM), 0.0, 1.0)
        largeness[own] = 0.0
        if apart is not None:
            largeness *= apart[small][of]
        # How many small ones each large one leaves no ground for; and how strongly it pushes then, over how strongly these do each
        # other.
        displaced = bodies / problem.domain.area * together[small][of] * math.pi * (mean_radius + radius) ** 2
        push = displaced * mean_area / np.maximum(area, 1e-300)
        weight = number * displaced * largeness
        if not weight.sum() > 0.0:
            continue
        push, large = float(np.average(push, weights=weight)), float(np.average(largeness, weights=weight))
        push = math.exp(STEP * round(math.log(push) / STEP))
        result[small] = max((1.0 / push - 1.0) * alpha / (1.0 - alpha), LEAST_ALONE) / large**3
    return result


def ground_radius(body_class: PreparedClass, size: Size) -> float:
    """Return the radius of the ground that a body of a size keeps for itself [m]."""
    return float(disc_radius(size.mean_area)) * size.room * body_class.room + 0.5 * (size.gap + body_class.gap)


def _density_where_others_are(problem: Problem, densities: Sequence[np.ndarray] | None) -> np.ndarray:
    """Return how dense each class is asked to be where the bodies of each other are, over its mean, shape ``[classes, classes]``.

    It is the mean over those of its bodies that are there: an erased spot changes nothing around others.
    """
    if isinstance(problem.domain, Surface):
        points = problem.domain.sample(POINTS)
        found = [c.density_on(points) if c.varies_on_surface else np.ones(1) for c in problem.classes]
    else:
        width, height = problem.rectangle.size
        cells = max(1, round(CELLS * height / max(width, height))), max(1, round(CELLS * width / max(width, height)))
        images = [c.density_image for c in problem.classes] if densities is None else densities
        known = {id(one): np.ones(1) if one.size == 1 else in_cells(one, cells).ravel() for one in images}
        found = [known[id(one)] for one in images]
    share = np.stack(np.broadcast_arrays(*[one / max(float(one.mean()), 1e-300) for one in found]))
    together = share @ share.T
    result: np.ndarray = np.divide(share**2 @ share.T, together, out=np.zeros_like(together), where=together > 0.0)
    return result
