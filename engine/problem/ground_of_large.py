"""How strongly large bodies push small ones that they do not overlap: by as many as would have stood where they stand.

A class follows its density wherever the bodies of others are. Where outlines are kept apart, small bodies that are asked for on the
ground of a large one would stand in a closed row around it, nearer to each other than anywhere else. So a large body counts, for small
ones, as the number of them that it leaves no ground for; the density of its own class, which attracts them as strongly, asks for those
elsewhere. Around obstacles it is the same, which are known before anything is placed, and are cut out of densities.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .body_kind import disc_radius
from .packing import in_cells
from .prepared_class import PreparedClass
from .problem import Problem
from .surface import Surface

__all__ = ["keep_off_large"]

# Areas from which on a body is large beside another: nothing changes up to the first ratio, everything from the second on. Up to the
# first, bodies stand in gaps between each other.
LARGE_FROM, LARGE = 3.0, 9.0
# Cells along the longer side of a rectangle in which it is compared how dense small and large ones stand.
CELLS = 32
# Strengths go in steps of this share: a stroke of a brush does not change how all bodies act on each other.
STEP = 0.1
# How much more strongly a group acts on itself at least than its bonds to smaller ones ask for, so that no eigenvalue is negative.
MARGIN = 1.05


def keep_off_large(
    matrix: np.ndarray, problem: Problem, number: np.ndarray, charge: np.ndarray, of: Sequence[tuple[int, int]]
) -> np.ndarray:
    """Return factors with which large bodies push small ones away from no more ground than they take.

    They push at least as strongly as with ``matrix``. It stays positive semidefinite: where it has to, what is larger acts more
    strongly on itself.

    Args:
        matrix: Interaction factors of groups, shape ``[n, n]``.
        problem: Whose bodies they are.
        number: Bodies of every group, shape ``[n]``.
        charge: Their footprints added up [m²], shape ``[n]``.
        of: Class and size of every group.
    """
    strength = min(problem.balance.rare_emphasis, 1.0)
    given = [problem.classes[c].sizes[s].mean_area for c, s in of]
    area = np.where(number > 0.0, charge / np.maximum(number, 1e-300), given)
    if not problem.avoid_overlap or strength == 0.0 or area.max() < LARGE_FROM * area.min():
        return matrix
    class_index = np.array([c for c, _ in of])
    radius = disc_radius(area)
    for g, (c, s) in enumerate(of):
        of_class, size = problem.classes[c], problem.classes[c].sizes[s]
        radius[g] = radius[g] * size.room * of_class.room + 0.5 * (size.gap + of_class.gap)
    apart = problem.balance.classes_apart
    together = density_where_others_are(problem)
    order = np.argsort(area, kind="stable")
    result = matrix.copy()
    for place, large in enumerate(order.tolist()):
        before = order[:place]
        for small in before.tolist():
            if apart is not None and not apart[class_index[small], class_index[large]]:
                continue
            per_area = number[small] / problem.domain.area * together[class_index[small], class_index[large]]
            displaced = per_area * math.pi * (radius[small] + radius[large]) ** 2
            wanted = min(_in_steps(displaced * area[small] / area[large]), 1.0) * result[small, small]
            more = strength * _largeness(area[large] / area[small]) * max(wanted - result[small, large], 0.0)
            result[small, large] = result[large, small] = result[small, large] + more
        if place and not np.array_equal(result[large, before], matrix[large, before]):
            bonds = result[before, large]
            least = float(bonds @ np.linalg.lstsq(result[np.ix_(before, before)], bonds, rcond=None)[0])
            result[large, large] = max(result[large, large], MARGIN * least)
    return result


def density_where_others_are(problem: Problem) -> np.ndarray:
    """Return how dense each class is asked to be where the bodies of each other are, over its mean, shape ``[classes, classes]``."""
    if isinstance(problem.domain, Surface):
        points = problem.domain.sample()
        shares = [c.density_on(points) if c.varies_on_surface else np.ones(1) for c in problem.classes]
    else:
        shares = [_in_cells_of(c, problem.rectangle.size) for c in problem.classes]
    relative = np.stack(np.broadcast_arrays(*[share / max(float(share.mean()), 1e-300) for share in shares]))
    result: np.ndarray = relative @ relative.T / relative.shape[1]
    return result


def _in_cells_of(body_class: PreparedClass, size: Sequence[float]) -> np.ndarray:
    image = body_class.density_image
    if image.size == 1:
        return np.ones(1)
    shape = [max(1, round(CELLS * length / max(size))) for length in size]
    return in_cells(image, (shape[1], shape[0])).ravel()


def _in_steps(value: float) -> float:
    return math.exp(STEP * round(math.log(max(value, 1e-12)) / STEP))


def _largeness(ratio: float) -> float:
    """How much of it acts between bodies whose areas have this ratio."""
    share = math.log(max(ratio, 1.0) / LARGE_FROM) / math.log(LARGE / LARGE_FROM)
    return min(max(share, 0.0), 1.0)
