"""The outline of every body of a problem, as flat tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np

from .body_kind import disc_radius
from .footprint import Footprint
from .footprints import Footprints
from .of_bodies import is_same, of_all, of_bodies, one_by_one
from .packing import CELLS, in_cells
from .problem import Problem
from .settings import settle
from .size import with_count
from .slopes import level_share, mean_cosine, slope_at, tilted, tilts

__all__ = ["CAPSULE", "DISC", "BodyFootprints", "footprints_of"]

# Stands for the shape of a line without outlines of its own: a capsule, as long and as wide as the line comes to be.
CAPSULE = -1
# The first of all shapes, that of bodies without an outline of their own, is a disc of radius 1.
DISC = 0
# Means over its cells say what slopes leave of areas.
GRID = (CELLS, CELLS)


@dataclass(frozen=True, eq=False)
class BodyFootprints:
    """Outlines of all bodies in class, then size order; every array has shape ``[n]``.

    Attributes:
        shapes: The different outlines that there are.
        shape: Which of them a body has, int32; :data:`CAPSULE` where it is a capsule around the axis of a line.
        factor: How many times as large as that it is, float64.
        turn: How it is turned at first, or always [rad], float64; of a line, from the direction of its axis.
        free: Whether the solver may turn it: not where its turn is given, nor lines, which turn with their axes.
        is_outline: Whether it was given an outline; what was not is a disc of its area, or a capsule.
        variant: Which of the variants of its size it has, int32; 0 where there are none.
        room: Factor on the outline for keeping apart, float64.
        gap: Distance from others' outlines that is kept [m], float64.
        slopes: The different images of slopes that outlines lie in, each of shape ``[rows, columns, 2]``, not ``[n]``.
        slope: Which of them a body's outline lies in, int32; -1 where it is horizontal.
        most_tilt: How far its outline leans over at most, beside that [rad], float64.
        seen: Area of an outline as it is seen from above over the area that it has, in the mean where its class may be, float64.
    """

    shapes: tuple[Footprint, ...]
    shape: np.ndarray
    factor: np.ndarray
    turn: np.ndarray
    free: np.ndarray
    is_outline: np.ndarray
    variant: np.ndarray
    room: np.ndarray
    gap: np.ndarray
    slopes: tuple[np.ndarray, ...] = ()
    slope: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    most_tilt: np.ndarray = field(default_factory=lambda: np.zeros(0))
    seen: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.slope):
            n = len(self.shape)
            settle(self, slope=of_all(np.int32(-1), n), most_tilt=of_all(0.0, n), seen=of_all(1.0, n))

    @property
    def has_outlines(self) -> bool:
        """Whether any body was given an outline."""
        # The first shape is the disc of all others.
        return len(self.shapes) > 1

    def tilts(self, identity: np.ndarray, seed: int) -> np.ndarray | None:
        """How far every outline leans over beside the ground, see :func:`.slopes.tilts`; None where none does.

        Args:
            identity: Numbers of the bodies, see :meth:`.problem.Problem.body_ids`.
            seed: Of the problem.
        """
        if is_same(self.most_tilt) and self.most_tilt[0] == 0.0:
            return None
        return tilts(self.most_tilt, identity, seed) if self.most_tilt.any() else None

    def slopes_at(
        self, position: np.ndarray, size: tuple[float, float], tilt: np.ndarray | None = None
    ) -> np.ndarray | None:
        """Slope of the plane that every outline lies in, shape ``[n, 2]``; None where all are horizontal.

        Args:
            position: Of the bodies [m].
            size: Of the domain [m].
            tilt: What :meth:`tilts` returned.
        """
        if not self.slopes and tilt is None:
            return None
        result = np.zeros((len(position), 2))
        for number, image in enumerate(self.slopes):
            own = self.slope == number
            result[own] = slope_at(image, position[own], size)
        if tilt is not None:
            leaning = tilt[:, 0] != 0.0
            result[leaning] = tilted(result[leaning], tilt[leaning])
        return result

    @property
    def scale(self) -> np.ndarray:
        """Factor on the outline that a body was given, shape ``[n]``, float64, to read only; 1 where it was given none."""
        if not self.has_outlines:
            return of_all(1.0, len(self.factor))
        return np.where(self.is_outline, self.factor, 1.0)

    def with_outlines(self, variant: np.ndarray, scale: np.ndarray) -> BodyFootprints:
        """The same, but for the variants and the scales of bodies that were given outlines."""
        shape = np.where(self.is_outline, self.shape - self.variant + variant, self.shape).astype(np.int32)
        factor = np.where(self.is_outline, scale, self.factor)
        return replace(self, shape=shape, factor=factor, variant=variant)

    @property
    def circumradius(self) -> np.ndarray:
        """Radius around every outline, as large as it is [m], shape ``[n]``; 0 where there is none."""
        circle = np.array([outline.circumradius for outline in self.shapes] + [0.0])
        return circle[self.shape] * self.factor

    def areas(self, length: np.ndarray, width: np.ndarray, *, apart: bool) -> np.ndarray:
        """Area of every outline [m²] as it is seen from above, about, shape ``[n]``, float64.

        Args:
            length: Length of every line's axis [m].
            width: Thickness of every line [m].
            apart: Whether the ground counts that it keeps for itself, or only what it covers.
        """
        area = np.array([outline.area for outline in self.shapes] + [0.0])
        edge = np.array([_perimeter(outline) for outline in self.shapes] + [0.0])
        factor = self.factor * (self.room if apart else 1.0)
        around = 0.5 * self.gap if apart else np.zeros(len(factor))
        outlined = area[self.shape] * factor**2 + edge[self.shape] * factor * around + math.pi * around**2
        room = self.room if apart else 1.0
        radius = 0.5 * width * room + around
        return np.where(self.shape == CAPSULE, 2.0 * length * room * radius + math.pi * radius**2, outlined * self.seen)


def _perimeter(outline: Footprint) -> float:
    edges = np.roll(outline.corners, -1, axis=0) - outline.corners
    return float(np.hypot(*edges.T).sum()) + 2.0 * math.pi * outline.rounding


# Of a million bodies they take a tenth of a solver's memory; kept as long as somebody has them.
_made: WeakKeyDictionary[Problem, ReferenceType[BodyFootprints]] = WeakKeyDictionary()


def footprints_of(problem: Problem) -> BodyFootprints:
    """Return the outlines of all bodies of ``problem``: the same ones whenever it is asked."""
    made = _made[problem]() if problem in _made else None
    if made is None:
        made = _footprints(problem)
        _made[problem] = ref(made)
    return made


def _footprints(problem: Problem) -> BodyFootprints:
    sizes = [(c, s, size) for c, k in enumerate(problem.classes) for s, size in enumerate(k.sizes)]
    counts = [size.count or 0 for _, _, size in sizes]
    n = sum(counts)
    if all(size.footprint is None for _, _, size in sizes):
        return _discs_and_capsules(problem, counts)
    shapes: list[Footprint] = [Footprint.disc(1.0)]
    first, variant = np.zeros(n, np.int32), np.zeros(n, np.int32)
    factor, room, gap = np.ones(n), np.ones(n), np.zeros(n)
    turn = np.zeros(n)
    free, is_outline = np.zeros(n, bool), np.zeros(n, bool)
    slopes: list[np.ndarray] = []
    share_seen: list[np.ndarray] = []
    slope, most_tilt, seen = np.full(n, -1, np.int32), np.zeros(n), np.ones(n)
    area = problem.body_areas()
    begin = 0
    for (c, s, size), count in zip(sizes, counts, strict=True):
        own = slice(begin, begin + count)
        begin += count
        given = size.footprint
        body_class = problem.classes[c]
        room[own], gap[own] = size.room * body_class.room, size.gap + body_class.gap
        if given is None:
            if size.kind.has_axis:
                first[own] = CAPSULE
            else:
                factor[own] = disc_radius(area[own])
            continue
        assert isinstance(given, Footprints)
        fixed = (problem.fixed.class_index == c) & (problem.fixed.size_index == s)
        drawn = with_count(size, count - int(fixed.sum())).footprints([problem.seed, 5, c, s])
        variant[own] = np.concatenate([drawn.variant, problem.fixed.variant[fixed]])
        turn[own] = np.concatenate(
            [drawn.turn, 0.0 * problem.fixed.angle[fixed] if size.kind.has_axis else problem.fixed.angle[fixed]]
        )
        outline_area = np.array([outline.area for outline in given.outlines])[variant[own]][count - int(fixed.sum()) :]
        # One whose scale is not said has its area, where that is the outline's.
        by_area = np.ones(len(outline_area))
        if size.area is None or isinstance(size.area, tuple):
            by_area = np.sqrt(problem.fixed.area[fixed] / outline_area)
        scale = problem.fixed.scale[fixed]
        factor[own] = np.concatenate([drawn.scale, np.where(np.isnan(scale), by_area, scale)])
        first[own] = len(shapes)
        shapes.extend(given.outlines)
        free[own] = given.is_free and problem.classes[c].look_at is None and not size.kind.has_axis
        is_outline[own] = True
        if given.slope is not None:
            known = [k for k, image in enumerate(slopes) if image is given.slope]
            which = slope[own] = known[0] if known else len(slopes)
            slopes += [] if known else [given.slope]
            share_seen += [] if known else [in_cells(level_share(given.slope), GRID)]
            # Mean of what slopes leave of areas as they are seen from above, where a density is.
            seen[own] = np.average(share_seen[which], weights=in_cells(body_class.density_image, GRID))
        most_tilt[own] = given.tilt
        seen[own] *= mean_cosine(given.tilt)
    return BodyFootprints(
        tuple(shapes),
        first + variant,
        factor,
        turn,
        free,
        is_outline,
        variant,
        room,
        gap,
        tuple(slopes),
        slope,
        most_tilt,
        seen,
    )


def _discs_and_capsules(problem: Problem, counts: list[int]) -> BodyFootprints:
    """Outlines where none is given."""
    n = sum(counts)
    sizes = [(c, size) for c in problem.classes for size in c.sizes]
    factor = one_by_one(disc_radius, problem.shared_areas())
    has_axis = [size.kind.has_axis for _, size in sizes]
    if any(has_axis):
        factor = np.where(np.repeat(has_axis, counts), 1.0, factor)
    no, nothing, once = of_all(False, n), of_all(np.int32(0), n), of_all(1.0, n)
    return BodyFootprints(
        (Footprint.disc(1.0),),
        of_bodies([CAPSULE if axis else DISC for axis in has_axis], counts, np.int32),
        factor,
        of_all(0.0, n),
        no,
        no,
        nothing,
        of_bodies([size.room * c.room for c, size in sizes], counts, np.float64),
        of_bodies([size.gap + c.gap for c, size in sizes], counts, np.float64),
        (),
        of_all(np.int32(-1), n),
        of_all(0.0, n),
        once,
    )
