"""How strongly large bodies push small ones that they do not overlap: by as many as would have stood where they stand.

A class follows its density wherever the bodies of others are. Where outlines are kept apart, small bodies that are asked for on the
ground of a large one would stand in a closed row around it, nearer to each other than anywhere else. So a class is no more even by
itself than leaves large bodies of others the force of as many small ones as they take the ground of. The densities of these others,
which attract small ones as strongly, ask for those elsewhere. Around obstacles it is the same: they are known before anything is
placed, and are cut out of densities. And small sizes of one class are more even by themselves, where large ones would else push them
by more and leave a moat around themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .balance import TIMES_AS_LARGE
from .body_kind import disc_radius
from .packing import in_cells
from .prepared_class import PreparedClass
from .problem import Problem
from .size import Size
from .surface import Surface

__all__ = ["LARGE", "LEAST_RATIO", "Bodies", "Together", "ground_radius", "most_alone", "spread_among_large"]

# Areas from which on bodies are large beside others: nothing changes up to the first ratio, everything from the second on. Bodies that
# are more alike stand in gaps between each other.
LARGE_FROM, LARGE = 3.0, 9.0
# Cells along the longer side of a rectangle in which it is compared how dense small and large ones stand, and points of a surface.
CELLS, POINTS = 32, 1 << 14
# Forces go in steps of this share: a stroke of a brush does not change how all bodies act on each other.
STEP = 0.1
# Small ones push each other so many times as strongly as that makes it: measured, their coverage errors are least then, with one class
# or several, few large ones or many. They stand in rows along the rims of large ones, of which the first is where these begin.
IN_ROWS = 1.2
# Groups whose mean areas differ by less are not told apart.
LEAST_RATIO = 2.0
# What is left of an own factor of 1 at least where small ones are so dense that large ones push them too little even with that.
LEAST_ALONE = 0.05


@dataclass(frozen=True, eq=False)
class Bodies:
    """Groups of bodies of about one size and one class.

    Attributes:
        class_index: Class of every group, shape ``[groups]``.
        number: How many bodies each has, shape ``[groups]``.
        area: Their mean areas [m²], shape ``[groups]``.
        radius: Radii of the ground that they keep for themselves [m], shape ``[groups]``.
    """

    class_index: np.ndarray
    number: np.ndarray
    area: np.ndarray
    radius: np.ndarray

    @classmethod
    def of_sizes(cls, problem: Problem) -> Bodies:
        """Return the sizes of a problem as groups."""
        rows = [
            (c, s.count or 0, s.mean_area, ground_radius(one, s))
            for c, one in enumerate(problem.classes)
            for s in one.sizes
        ]
        class_index, number, area, radius = np.array(rows, np.float64).T
        return cls(class_index.astype(int), number, area, radius)

    @property
    def alike(self) -> bool:
        """Whether none is large beside another."""
        return bool(self.area.max() < LARGE_FROM * self.area.min())


class Together:
    """How dense classes are where others are, looked at once, if at all.

    Args:
        problem: Whose classes they are.
        densities: Images of their densities; None for those of the problem.
    """

    def __init__(self, problem: Problem, densities: Sequence[np.ndarray] | None = None) -> None:
        self.problem, self._densities = problem, densities

    @cached_property
    def density(self) -> np.ndarray:
        """See :func:`_densities_where_two_are`."""
        return _densities_where_two_are(self.problem, self._densities)


class GroundOfLarge:
    """What large bodies of a problem leave no ground for.

    Args:
        together: Of the problem.
        bodies: Groups of its bodies.
    """

    def __init__(self, together: Together, bodies: Bodies) -> None:
        problem = together.problem
        self.bodies = bodies
        self._apart = problem.balance.classes_apart
        self._ground = problem.domain.area
        self._density = together.density
        # Share of the ground that each covers, were it all over the domain.
        self._cover = bodies.number * bodies.area / self._ground
        self._is_of_class = np.eye(len(problem.classes))[bodies.class_index]

    def pairs(self, small: np.ndarray, large: np.ndarray) -> Pairs:
        """Return what small bodies miss beside large ones.

        Args:
            small: Groups of small bodies, indices.
            large: Groups of bodies that may be large beside these, indices.
        """
        at, ground = self.bodies, math.pi * np.add.outer(self.bodies.radius[small], self.bodies.radius[large]) ** 2
        mean_area = float(self._cover[small].sum()) * self._ground / max(float(at.number[small].sum()), 1.0)
        ratio = np.maximum(at.area[large] / max(mean_area, 1e-300), 1e-300)
        largeness = np.clip(np.log(ratio / LARGE_FROM) / math.log(LARGE / LARGE_FROM), 0.0, 1.0)
        of_small, of_large = at.class_index[small], at.class_index[large]
        largeness = np.broadcast_to(largeness, ground.shape)
        if self._apart is not None:
            largeness = largeness * self._apart[np.ix_(of_small, of_large)]
        # Densities where both are, of every class.
        local = self._density[np.ix_(of_small, of_large)]
        of_all = np.einsum("slc,c->sl", local, self._cover[small] @ self._is_of_class[small])
        weight = at.number[large] * ground * largeness * of_all * self._cover[small][:, None]
        times = ground / np.maximum(at.area[large], 1e-300)
        return Pairs(local * times[:, :, None], self._cover[:, None] * self._is_of_class, weight, largeness, mean_area)


@dataclass(frozen=True, eq=False)
class Pairs:
    """What groups of small bodies miss where large ones are, for all pairs of such groups.

    Attributes:
        density: How dense every class would be on the ground of a large body, over its mean, times this ground over the area of the
            body, shape ``[small, large, classes]``.
        cover: Share of the domain that every group covers, in the column of its class, shape ``[groups, classes]``.
        weight: How much each pair counts: by how many small bodies find no ground there, shape ``[small, large]``.
        largeness: 0 where large ones are not much larger, 1 where they are, shape ``[small, large]``.
        mean_area: Of the small ones [m²].
    """

    density: np.ndarray
    cover: np.ndarray
    weight: np.ndarray
    largeness: np.ndarray
    mean_area: float

    def mean(self, values: np.ndarray) -> float:
        """Return the mean over pairs of values that broadcast to ``[small, large]``."""
        return float((np.broadcast_to(values, self.weight.shape) * self.weight).sum() / self.weight.sum())

    def missed(self, factors: np.ndarray, groups: np.ndarray) -> float:
        """Return the force on small bodies of who would be where a large body is, over that of its charge with a factor of 1.

        Args:
            factors: Between small bodies and groups, shape ``[small, their number]``.
            groups: Those that are missed, indices.
        """
        return self.mean(np.einsum("slc,sc->sl", self.density, factors @ self.cover[groups]))


def most_alone(together: Together) -> np.ndarray:
    """Return the largest own factor of every class with which large bodies of others push its own enough, shape ``[classes]``.

    See :meth:`.Balance.class_factors`. It is infinite where no large ones keep off. Of several large sizes each has a say by how many
    small bodies it leaves no ground for.

    Args:
        together: Of the problem whose classes they are.
    """
    problem = together.problem
    alpha, result = problem.balance.class_separation, np.full(len(problem.classes), math.inf)
    if not problem.avoid_overlap or len(problem.classes) < 2 or alpha in {0.0, 1.0}:
        return result
    bodies = Bodies.of_sizes(problem)
    if bodies.alike:
        return result
    ground = GroundOfLarge(together, bodies)
    for of_class in range(len(problem.classes)):
        own = bodies.class_index == of_class
        pairs = ground.pairs(np.flatnonzero(own), np.flatnonzero(~own))
        if not pairs.weight.sum() > 0.0:
            continue
        of_own, of_others = (pairs.missed(np.ones((own.sum(), one.sum())), np.flatnonzero(one)) for one in (own, ~own))
        push = in_steps(IN_ROWS * max(1.0 - of_others, LEAST_ALONE) / of_own)
        result[of_class] = max((push - 1.0) * alpha / (1.0 - alpha), LEAST_ALONE) / pairs.mean(pairs.largeness) ** 3
    return result


def in_steps(factor: float) -> float:
    """Round a factor, above 0, so that a stroke of a brush does not change it."""
    return math.exp(STEP * round(math.log(factor) / STEP))


def spread_among_large(together: Together, bodies: Bodies, matrix: np.ndarray, between: np.ndarray) -> np.ndarray:
    """Return factors with which large bodies push small ones by no more than as many as they leave no ground for.

    A large body counts for all of its charge, and that is what would be on a far larger ground: sizes of one class would leave moats
    around it, and crowd on what is left. What all smaller ones do to each other is raised until the force is that of those who miss
    there. What is added is positive semidefinite.

    Args:
        together: Of the problem whose bodies they are.
        bodies: Their groups.
        matrix: Interaction factors of the groups, shape ``[groups, groups]``.
        between: Those of their classes alone.
    """
    problem = together.problem
    power = min(problem.balance.rare_emphasis, 1.0)
    if not problem.avoid_overlap or bodies.alike or power == 0.0:
        return matrix
    ground = GroundOfLarge(together, bodies)
    larger = np.maximum(np.maximum.outer(bodies.area, bodies.area), 1e-300)
    added = between * np.minimum.outer(bodies.area, bodies.area) / larger
    order = np.argsort(bodies.area, kind="stable")
    for last in range(len(order) - 1, 0, -1):
        small, large = order[:last], order[last:]
        if bodies.area[small[-1]] * LEAST_RATIO > bodies.area[large[0]]:
            continue
        pairs = ground.pairs(small, large)
        if not pairs.weight.sum() > 0.0:
            continue
        push, among = pairs.mean(matrix[np.ix_(small, large)]), np.ix_(small, small)
        of_large = pairs.missed(matrix[np.ix_(small, large)], large)
        own, of_added = pairs.missed(matrix[among], small), pairs.missed(added[among], small)
        largest = pairs.mean(bodies.area[large]) / (TIMES_AS_LARGE * pairs.mean_area)
        times = min(IN_ROWS * (push - of_large) / own, largest)
        if times <= 1.0:
            continue
        times = in_steps(times) ** power
        raised = np.zeros(len(order), bool)
        raised[small] = True
        share = pairs.mean(pairs.largeness) * (times - 1.0) * own / of_added
        matrix = matrix + share * added * np.outer(raised, raised)
    return matrix


def ground_radius(body_class: PreparedClass, size: Size, area: float | None = None) -> float:
    """Return the radius of the ground that a body keeps for itself [m]: of an area [m²], or else of the mean area of its size."""
    radius = float(disc_radius(size.mean_area if area is None else area))
    return radius * size.room * body_class.room + 0.5 * (size.gap + body_class.gap)


def _densities_where_two_are(problem: Problem, densities: Sequence[np.ndarray] | None) -> np.ndarray:
    """Return how dense each class is asked to be where bodies of two are, over its mean, shape ``[classes, classes, classes]``.

    The first two are those that meet. It is the mean over those of the first that are there: an erased spot changes nothing around
    others.
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
    result = np.zeros((len(share), len(share), len(share)))
    for first, density in enumerate(share):
        both = density * share
        total = both.sum(axis=1, keepdims=True)
        np.divide(both @ share.T, total, out=result[first], where=total > 0.0)
    return result
