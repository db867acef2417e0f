"""What a problem as a whole must not ask for: bodies that cannot lie in its domain, weights that no float holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from . import validation
from .body_kind import disc_radius
from .domain import Domain
from .footprints import Footprints
from .given_values import show
from .line import Line
from .obstacles import Obstacle
from .prepared_class import PreparedClass
from .size import Size
from .surface_directions import SLOPE

if TYPE_CHECKING:
    from .problem import Problem

__all__ = ["check_feasible", "check_known_in_rectangles", "check_known_on_surfaces"]


def check_feasible(problem: Problem) -> None:
    """Raise ProblemError for what each part of a problem may say, and all of them together may not."""
    _check_balance(problem)
    _check_lines(problem)
    _check_areas(problem)
    _check_emphasis(problem)
    _check_extents(problem)
    _check_fixed(problem)
    _check_inset(problem)


def check_known_on_surfaces(classes: Sequence[PreparedClass], obstacles: Sequence[Obstacle]) -> None:
    """Raise ProblemError for what there is in rectangles only."""
    for obstacle in obstacles:
        if obstacle.ball is None and obstacle.position is None:
            raise ProblemError(
                "`obstacles` on a surface must be balls, or polygons and discs with a `position`; an image must lie in a rectangle"
            )
    for c in classes:
        if c.clustering > 0.0:
            raise ProblemError(
                f'`clustering` of class "{c.name}" must be 0 on a surface; got {c.clustering:g}',
                Refusal(Reason.CLUMPS_ON_SURFACE, c.clustering, 0, (c.name, "")),
            )
        for size in c.sizes:
            if size.line is not None:
                _check_line_on_surface(size.line, f'size "{size.name}" of class "{c.name}"')
            if isinstance(size.footprint, Footprints) and size.footprint.tilt > 0.0:
                raise ProblemError(
                    f'`tilt` of the `footprint` of size "{size.name}" of class "{c.name}" must be 0 on a surface, along which '
                    f"outlines lie; got {size.footprint.tilt:g}"
                )
            if isinstance(size.footprint, Footprints) and size.footprint.slope is not None:
                raise ProblemError(
                    f'`slope` of the `footprint` of size "{size.name}" of class "{c.name}" must be None on a surface, along which '
                    "outlines lie"
                )


def check_known_in_rectangles(classes: Sequence[PreparedClass], obstacles: Sequence[Obstacle]) -> None:
    """Raise ProblemError for what there is on surfaces only."""
    if any(obstacle.ball is not None for obstacle in obstacles):
        raise ProblemError("`obstacles` in a rectangle must be polygons, discs or images; a ball needs a Surface")
    if any(obstacle.position is not None for obstacle in obstacles):
        raise ProblemError("`obstacles` in a rectangle must lie where their corners are; a `position` needs a Surface")
    for c in classes:
        for size in c.sizes:
            direction = None if size.line is None else size.line.direction
            if callable(direction) or (isinstance(direction, str) and direction == SLOPE):
                raise ProblemError(
                    f'`line.direction` of size "{size.name}" of class "{c.name}" must be another in a rectangle; {show(direction)} '
                    "needs a Surface"
                )


def _check_line_on_surface(line: Line, where: str) -> None:
    if isinstance(line.length, np.ndarray):
        raise ProblemError(f"`line.length` of {where} must be one number on a surface; got an image")
    if not (isinstance(line.direction, str) or callable(line.direction)):
        raise ProblemError(
            f'`line.direction` of {where} must be "density", "none", "slope" or a function of points on a surface; got '
            f"{show(line.direction)}"
        )


def _check_balance(problem: Problem) -> None:
    matrix = problem.balance.non_overlap
    if matrix is not None and len(matrix) != len(problem.classes):
        raise ProblemError(
            f"`balance.non_overlap` must have one row per class, {len(problem.classes)}; got {len(matrix)} rows"
        )
    emphasis = problem.balance.size_emphasis
    if isinstance(emphasis, tuple):
        for c in problem.classes:
            if any(isinstance(size.area, tuple) for size in c.sizes):
                raise ProblemError(
                    f'`balance.size_emphasis` must be one number, because areas of class "{c.name}" are a range; got a list'
                )
            ranks = len({size.ranked_area for size in c.sizes})
            if ranks - 1 > len(emphasis):
                raise ProblemError(
                    f'`balance.size_emphasis` must have a value for each of the {ranks - 1} larger sizes of class "{c.name}"; '
                    f"got {len(emphasis)}"
                )
        # Sizes of equal areas are ranked alike, and may differ by chance only: so more values than ranks are no mistake.
        most = max(len(c.sizes) for c in problem.classes) - 1
        if len(emphasis) > most:
            raise ProblemError(
                f"`balance.size_emphasis` must have no more values than a class has larger sizes, {most} at most; got {len(emphasis)}"
            )


def _check_lines(problem: Problem) -> None:
    most = max(problem.domain.size)
    for c in problem.classes:
        for size in c.sizes:
            if size.line is not None and size.line.longest > most:
                raise ProblemError(
                    f'`line.length` of size "{size.name}" of class "{c.name}" must not be longer than the domain, {most:g} m; '
                    f"got {size.line.longest:g}",
                    Refusal(Reason.LINE_TOO_LONG, size.kind.extent(size.area_span[1]), most, c.called(size)),
                )
            if size.line is not None and size.line.shortest < validation.SHORTEST_LINE * most:
                raise ProblemError(
                    f'`line.length` of size "{size.name}" of class "{c.name}" must not be shorter than '
                    f"{validation.SHORTEST_LINE:g} of the domain, {most:g} m; got {size.line.shortest:g}",
                    Refusal(Reason.LINE_TOO_SHORT, size.line.shortest, most, c.called(size)),
                )


def _check_areas(problem: Problem) -> None:
    sizes = [(c, size) for c in problem.classes for size in c.sizes]
    small = min(sizes, key=lambda pair: pair[1].area_span[0])
    large = max(sizes, key=lambda pair: pair[1].area_span[1])
    low, high = small[1].area_span[0], large[1].area_span[1]
    if high > validation.MOST_AREA_RATIO * low:
        raise ProblemError(
            f'`area` of size "{large[1].name}" of class "{large[0].name}" must not be more than '
            f'{validation.MOST_AREA_RATIO:g} times that of size "{small[1].name}" of class "{small[0].name}"; got {high:g} and '
            f"{low:g} m²",
            Refusal(Reason.AREAS_TOO_DIFFERENT, high, low, large[0].called(large[1]), small[0].called(small[1])),
        )
    # Counts may be larger than any float.
    covered = sum(
        float(min(size.count or 0, 10**18)) * (_ground_with_room(size, c) / problem.domain.area) for c, size in sizes
    )
    if problem.avoid_overlap and covered > validation.MOST_COVERED:
        raise ProblemError(
            f"`avoid_overlap` cannot keep footprints apart that add up to {covered:.3g} times the domain; lower the counts or "
            "the areas, or let them overlap",
            Refusal(Reason.TOO_MUCH_GROUND, covered, validation.MOST_COVERED),
        )


def _ground_with_room(size: Size, body_class: PreparedClass) -> float:
    """Mean ground that a body covers or keeps free [m²], about."""
    ground, room, gap = size.mean_ground, size.room * body_class.room, size.gap + body_class.gap
    radius = float(disc_radius(ground))
    return ground if room == 1.0 and gap == 0.0 else math.pi * (radius * room + 0.5 * gap) ** 2


def _check_emphasis(problem: Problem) -> None:
    emphasis = problem.balance.size_emphasis
    for c in problem.classes:
        ranks = len({size.ranked_area for size in c.sizes})
        if not isinstance(emphasis, float):
            powers = math.log(max((1.0, *emphasis[: ranks - 1])))
        elif any(size.is_range for size in c.sizes):
            areas = [area for size in c.sizes for area in (size.area_span if size.is_range else (size.mean_area,))]
            powers = 2.0 * math.log2(emphasis) * math.log(max(areas) / min(areas))
        else:
            powers = (ranks - 1) * math.log(emphasis)
        if powers > math.log(validation.MOST_EMPHASIS):
            raise ProblemError(
                f'`balance.size_emphasis` must not give the largest bodies of class "{c.name}" more than '
                f"{validation.MOST_EMPHASIS:g} times the weight of its smallest; {show(emphasis)} gives them "
                f"1e{powers / math.log(10.0):.0f} times as much",
                Refusal(
                    Reason.TOO_MUCH_EMPHASIS,
                    powers / math.log(10.0),
                    math.log10(validation.MOST_EMPHASIS),
                    (c.name, ""),
                ),
            )


def _most_extent(problem: Problem) -> tuple[float, int, str]:
    """Return a side of the domain [m], how many times as long a body may be, and what sentences call that side."""
    if isinstance(problem.domain, Domain) and problem.domain.periodic:
        return min(problem.domain.size), validation.MOST_PERIODS, "shorter side of the periodic domain"
    return max(problem.domain.size), validation.MOST_EXTENT, "longer side of the domain"


def _check_fixed(problem: Problem) -> None:
    """Hold fixed bodies to what those of a size are held to: areas beside all others', and lengths beside the domain."""
    fixed = problem.fixed
    if not len(fixed.id):
        return
    # Areas of outlines may follow from scales, which are to be named then.
    _check_fixed_lengths(problem, outlined=True)
    spans = [size.area_span for c in problem.classes for size in c.sizes]
    low, high = min(span[0] for span in spans), max(span[1] for span in spans)
    smallest, largest = float(fixed.area.min()), float(fixed.area.max())
    if max(high, largest) > validation.MOST_AREA_RATIO * min(low, smallest):
        got = largest if largest > validation.MOST_AREA_RATIO * low else smallest
        raise ProblemError(
            f"`fixed.area` must not be more than {validation.MOST_AREA_RATIO:g} times another body's, or so much less; got {got:g} "
            f"beside {low:g} m²",
            Refusal(Reason.FIXED_AREA, got, low),
        )
    _check_fixed_lengths(problem, outlined=False)


def _check_fixed_lengths(problem: Problem, *, outlined: bool) -> None:
    """Hold fixed bodies of sizes that have outlines, or of all others, to lengths beside the domain."""
    fixed = problem.fixed
    side, most, which = _most_extent(problem)
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            if (size.footprint is not None) != outlined:
                continue
            own = (fixed.class_index == c) & (fixed.size_index == s)
            narrowest, longest = _span_of_fixed(size, fixed.area[own], fixed.variant[own], fixed.scale[own])
            if longest > most * side or narrowest < validation.SMALLEST_LENGTH:
                raise ProblemError(
                    f'`fixed.area` and `fixed.scale` of size "{size.name}" of class "{body_class.name}" must make bodies no longer '
                    f"than {most:,} times the {which}, {side:g} m, and at least {validation.SMALLEST_LENGTH:g} m wide; got "
                    f"{longest:.3g} by {narrowest:.3g} m",
                    Refusal(Reason.FIXED_LENGTH, longest, side, body_class.called(size)),
                )


def _span_of_fixed(size: Size, area: np.ndarray, variant: np.ndarray, scale: np.ndarray) -> tuple[float, float]:
    """How wide the narrowest outline of fixed bodies of a size is, and how long the longest one [m]; see :class:`.FixedTable`."""
    if not isinstance(size.footprint, Footprints) or not len(area):
        return math.inf, max((float(size.kind.extent(float(one))) for one in area), default=0.0)
    outlines = size.footprint.outlines
    areas, widths, reaches = np.array([(o.area, o.width, o.circumradius) for o in outlines])[variant].T
    factor = np.where(np.isnan(scale), np.sqrt(area / areas), scale)
    return float((factor * widths).min()), 2.0 * float((factor * reaches).max())


def _check_extents(problem: Problem) -> None:
    side, most, which = _most_extent(problem)
    for c in problem.classes:
        for size in c.sizes:
            key, extent = "line" if size.kind.has_axis else "area", size.kind.extent(size.area_span[1])
            if size.footprint is not None:
                key, extent = "footprint", max(extent, size.longest_reach * 2.0)
            extent = extent * size.room * c.room + size.gap + c.gap
            if extent > most * side:
                raise ProblemError(
                    f'`{key}` of size "{size.name}" of class "{c.name}" must not make bodies longer than {most:,} times the '
                    f"{which}, {side:g} m; they are {extent:g} m long",
                    Refusal(Reason.BODY_TOO_LONG, extent, side, c.called(size)),
                )


def _check_inset(problem: Problem) -> None:
    """Walls take contact, which can do nothing about bodies that are wider than the walls are apart."""
    if not isinstance(problem.domain, Domain) or not problem.domain.inset:
        return
    if not problem.avoid_overlap:
        raise ProblemError(
            "`domain.inset` must be false without `avoid_overlap`: it is contact that keeps footprints inside"
        )
    most = min(problem.domain.size)
    for c in problem.classes:
        for size in c.sizes:
            widest = size.widest * size.room * c.room + size.gap + c.gap
            if widest > most * (1.0 + 1e-9):
                raise ProblemError(
                    f'bodies of size "{size.name}" of class "{c.name}" must not be wider than the domain that they are to lie in, '
                    f"{most:g} m; got {widest:.4g}"
                )
