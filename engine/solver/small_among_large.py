"""Small bodies among much larger ones: placed anew around these, which are obstacles to them.

While all move at once, a large body pushes small ones with its charge from its middle, as strongly as its ground asks for in the mean
over the domain. How densely small ones lie right beside it then depends on how many are asked for just there, and on what a natural
border has cut off. So, once large ones have their places, small ones are placed again, with the ground of the large ones cut out of
their densities as that of all obstacles is. Errors of tufts among boulders, before and after that: .013 and .007 with an open border,
.038 and .008 with a natural one, .090 and .006 where their density rises tenfold. Of three sizes in a crescent with a natural border
the smallest have .19 and .01.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.fixed_bodies import FixedBodies
from ..problem.footprints import Footprints
from ..problem.ground_of_large import LARGE
from ..problem.obstacles import Obstacle
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..problem.problem import Problem
from ..problem.size import Size

__all__ = ["SmallAmongLarge", "least_large_area", "small_among_large"]

# Points of the arc around a rounded corner of a large body.
ARC_POINTS = 12
# Small bodies stand in a row along an edge of their density. So many of their spacings are left free in front of large ones, but no
# more than is between two of them; less where an edge turns away before the next neighbor.
MARGIN = 0.25
# At least so many small ones come to each large one. Fewer have few neighbors among themselves, and are as even where they and large
# ones push each other. Measured in units of what forces alone give, distances to the nearest are .86 with 60 among 60, .97 with 909
# among 91, and .98 with 400 among 25, whose coverage error falls from .010 to .004.
FEWEST = 12.0


class SmallAmongLarge(NamedTuple):
    """What is to be placed around large bodies.

    Attributes:
        problem: Small bodies, with the large ones as obstacles.
        rows: Which bodies of the placement they are, in the order of the problem, shape ``[problem.body_count]``.
        placement: All bodies.
    """

    problem: Problem
    rows: np.ndarray
    placement: Placement


def least_large_area(problem: Problem) -> float:
    """Return the mean area [m²] from which on sizes are large; infinity where they are not clearly apart from all others.

    The largest ones are told from all others first. Those that may lie on each other are no obstacles; small lines have places that
    depend on how they lie; and small ones have to be many.
    """
    if not problem.avoid_overlap or problem.balance.rare_emphasis == 0.0 or problem.balance.classes_apart is not None:
        return math.inf
    sizes = sorted((size for c in problem.classes for size in c.sizes), key=lambda size: size.mean_area)
    for smaller, larger in reversed(list(itertools.pairwise(sizes))):
        small = [size for size in sizes if size.mean_area < larger.mean_area]
        many = sum(float(size.count or 0) for size in small)
        few = sum(float(size.count or 0) for size in sizes) - many
        is_apart = larger.area_span[0] >= LARGE * smaller.area_span[1]
        if is_apart and many >= FEWEST * few and all(size.line is None for size in small):
            return larger.mean_area
    return math.inf


def small_among_large(placement: Placement) -> SmallAmongLarge | None:
    """Return the problem of the small bodies of a placement around its large ones, which stay; None where no sizes are clearly apart.

    Args:
        placement: In a rectangle; all its bodies.

    Raises:
        ProblemError: The large bodies leave a class of small ones no place.
    """
    problem = placement.problem
    least = least_large_area(problem)
    if not math.isfinite(least):
        return None
    is_small = [[size.mean_area < least for size in c.sizes] for c in problem.classes]
    kept = [c for c, small in enumerate(is_small) if any(small)]
    first = [np.flatnonzero(small) for small in is_small]
    counts = [size.count or 0 for c in problem.classes for size in c.sizes]
    row_is_small = np.repeat([small for of_class in is_small for small in of_class], counts)
    if not (row_is_small & ~placement.fixed).any():
        return None
    # Their densities have clumps already, and what is cut out now changes no counts.
    classes = [
        replace(
            problem.classes[c],
            asked=None,
            base=None,
            clustering=0.0,
            sizes=tuple(_size_of(placement, c, s) for s in first[c]),
        )
        for c in kept
    ]
    around = Problem(
        problem.rectangle,
        classes,
        problem.balance.of_some(kept, max(len(c.sizes) for c in classes)),
        fixed=_fixed_small(placement, kept, first),
        obstacles=[
            *problem.obstacles,
            *_obstacles(placement, np.flatnonzero(~row_is_small), _margin(placement, row_is_small)),
        ],
        seed=int(np.random.default_rng([problem.seed, 16]).integers(1 << 31)),
        avoid_overlap=True,
        regularity=problem.regularity,
    )
    return SmallAmongLarge(around, np.flatnonzero(row_is_small), placement)


def _size_of(placement: Placement, class_index: int, size_index: int) -> Size:
    """A size with the bodies that a placement has of it, but for fixed ones: as large as they are, and turned alike."""
    size = placement.problem.classes[class_index].sizes[size_index]
    own = (placement.class_index == class_index) & (placement.size_index == size_index) & ~placement.fixed
    changes: dict[str, Any] = {"count": int(own.sum()), "share": None}
    if isinstance(size.area, tuple):
        changes["distribution"] = np.clip(placement.area[own], *size.area)
    if isinstance(size.footprint, Footprints):
        changes["footprint"] = replace(
            size.footprint,
            variant=placement.variant[own],
            scale=placement.scale[own],
            scale_jitter=0.0,
            turn=placement.angle[own],
            may_turn=size.footprint.is_free,
        )
    return replace(size, **changes)


def _fixed_small(placement: Placement, kept: list[int], first: list[np.ndarray]) -> list[FixedBodies]:
    """Fixed bodies among the small ones, as a problem of these alone counts classes and sizes."""
    fixed = placement.problem.fixed
    own = np.array(
        [c in kept and s in first[c] for c, s in zip(fixed.class_index, fixed.size_index, strict=True)], bool
    )
    if not own.any():
        return []
    pairs = zip(fixed.class_index[own].tolist(), fixed.size_index[own].tolist(), strict=True)
    numbers = np.array([(kept.index(c), int(np.searchsorted(first[c], s))) for c, s in pairs])
    return [
        FixedBodies(
            fixed.position[own],
            numbers[:, 0],
            numbers[:, 1],
            fixed.angle[own],
            fixed.length[own],
            fixed.area[own],
            # Both are in the same order.
            placement.id[placement.fixed][own],
            variant=fixed.variant[own],
            scale=fixed.scale[own],
        )
    ]


def _margin(placement: Placement, row_is_small: np.ndarray) -> float:
    """What is left free in front of large bodies [m]: in the mean of the small ones where these are dense."""
    problem, area = placement.problem, placement.area
    free = max(1.0 - float(area[~row_is_small].sum()) / problem.domain.area, 0.1)
    radius = math.sqrt(float(area[~row_is_small].mean()) / math.pi)
    margins, number = [], []
    for c, body_class in enumerate(problem.classes):
        own = area[row_is_small & (placement.class_index == c)]
        if len(own):
            image = body_class.density_image.astype(np.float64)
            # Of the ground, as bodies see it that follow this density.
            ground = free * problem.domain.area * float(image.mean()) ** 2 / float((image**2).mean())
            spacing = math.sqrt(ground / len(own))
            gap = max(spacing - 2.0 * math.sqrt(float(own.mean()) / math.pi), 0.0)
            margins.append(min(MARGIN * spacing * radius / (radius + spacing), gap))
            number.append(len(own))
    return float(np.average(margins, weights=number))


def _obstacles(placement: Placement, rows: np.ndarray, margin: float) -> list[Obstacle]:
    """Bodies as obstacles, with the ground that they keep for themselves and so much around it."""
    footprints = footprints_of_placement(placement)
    outlines = [one.outline(ARC_POINTS) for one in footprints.shapes]
    return [_obstacle(placement, footprints, outlines, body, margin) for body in rows.tolist()]


def _obstacle(
    placement: Placement, footprints: BodyFootprints, outlines: list[np.ndarray], body: int, margin: float
) -> Obstacle:
    room, gap = float(footprints.room[body]), 0.5 * float(footprints.gap[body]) + margin
    x, y = placement.position[body].tolist()
    c, s = math.cos(placement.angle[body]), math.sin(placement.angle[body])
    if footprints.shape[body] == CAPSULE:
        half = 0.5 * room * float(placement.length[body]) * np.array([c, s])
        radius = 0.5 * room * float(placement.width[body])
        normal = 1e-3 * radius * np.array([-s, c]) / max(np.hypot(c, s), 1e-300)
        corners = np.array([half - normal, half + normal, -half + normal, -half - normal])
        return Obstacle(polygon=corners + (x, y), margin=radius + gap)
    if not footprints.is_outline[body]:
        return Obstacle(disc=(x, y, math.sqrt(float(placement.area[body]) / math.pi) * room), margin=gap)
    turned = outlines[footprints.shape[body]] @ np.array([[c, s], [-s, c]])
    return Obstacle(polygon=turned * (float(footprints.factor[body]) * room) + (x, y), margin=gap)
