"""The problem of a window: its bodies as a problem of their own, in what densities, obstacles and images are there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..errors import ProblemError
from ..model.model import Model
from ..problem.balance import Balance
from ..problem.domain import Domain
from ..problem.footprints import DrawnFootprints, Footprints
from ..problem.interaction import Groups
from ..problem.line import Line
from ..problem.obstacles import Obstacle
from ..problem.prepared_class import PreparedClass, cut_out
from ..problem.problem import Problem
from ..problem.size import Size, with_count
from .bodies import PartBodies
from .density_windows import Axis, sample_source
from .layout import Box
from .plan import Plan, uncut

__all__ = ["MARGIN", "between_pixels", "density_of_class", "model_of", "pixels_of"]

# Pixels of a window's densities over the typical spacing.
PIXELS_PER_SPACING = 4.0
# Bodies nearer to a cut than this are pinned; in spacings of the window. Lines are pinned farther from it by half of their length.
MARGIN = 5.0


@lru_cache(maxsize=8)
def density_of_class(plan: Plan, class_index: int, box: Box) -> np.ndarray:
    """Density of a class in a part of the domain, less obstacles, shape ``[height, width]``, float32; 0 all over where nothing is."""
    image = _density(plan, class_index, box)
    obstacles = _obstacles_near(plan, box, image.shape)
    if not obstacles or not image.any():
        return image
    size = plan.problem.classes[class_index].sizes[0]
    prepared = PreparedClass("class", (with_count(size, _bodies_at(plan, box)),), image)
    try:
        return cut_out(prepared, Domain(box.size), obstacles).density_image
    except ProblemError:  # they leave nothing
        return np.zeros((1, 1), np.float32)


def model_of(
    plan: Plan,
    box: Box,
    bodies: PartBodies,
    flags: np.ndarray,
    seed: int,
    vacancy: Mapping[int, np.ndarray] | None = None,
    images: Mapping[int, np.ndarray] | None = None,
) -> Model:
    """The model of some bodies in a box; in order of their numbers they are in class, then size order.

    Where ``vacancy`` says of a class's density how much is left in the cells of the coarse grid, only that is followed. Densities of
    ``images`` are taken as they are, in a box whose border is open and where obstacles are in these densities only.
    """
    tiles, identity = plan.groups, bodies.identity
    drawn = tiles.outlines(identity) if tiles.outlined else None
    group = tiles.group_of(identity)
    present, own = np.unique(group, return_inverse=True)
    area = tiles.areas(identity)
    classes: list[PreparedClass] = []
    of_plan: list[int] = []
    for c, body_class in enumerate(plan.problem.classes):
        sizes = []
        for s, size in enumerate(body_class.sizes):
            of_size = np.isin(group, np.flatnonzero((tiles.class_index == c) & (tiles.size_index == s)))
            if of_size.any():
                outlines = None if drawn is None or size.footprint is None else drawn.chosen(of_size)
                sizes.append(_size_in(plan, box, (c, s), size, area[of_size], outlines))
        if sizes:
            of_plan.append(c)
            # With the room and the gap that it keeps.
            uncut_class = uncut(body_class)
            image = _density(plan, c, box) if images is None else images[c]
            if vacancy is not None and c in vacancy:
                image = _left_of(plan, box, image, vacancy[c])
            classes.append(replace(uncut_class, sizes=tuple(sizes), density_image=image, asked=None, base=None))
    obstacles = _obstacles_near(plan, box, classes[0].density_image.shape) if images is None else []
    domain = _domain_in(plan, box, classes, obstacles) if images is None else Domain(box.size)
    class_index = np.unique(tiles.class_index[present], return_inverse=True)[1].ravel()
    groups = Groups(own.ravel().astype(np.int32), class_index, tiles.matrix[np.ix_(present, present)])
    # Group factors are those of the whole problem; sizes are weighed nowhere else.
    balance = Balance(size_emphasis=1.0)
    kept = plan.problem.balance.classes_apart
    if kept is not None:
        # Only contact asks for it.
        balance = replace(balance, class_separation=0.0, non_overlap=kept[np.ix_(of_plan, of_plan)].astype(float))

    apart = plan.problem.avoid_overlap and images is None
    # Where obstacles leave a size no room in this window with its footprints, their centers keep off them, or nothing does.
    ways = [(apart, obstacles), (False, obstacles), (False, [])] if obstacles else [(apart, obstacles)]
    for keep_apart, kept_off in ways:
        try:
            problem = Problem(
                replace(domain, inset=domain.inset and keep_apart),
                classes,
                balance,
                seed=seed,
                avoid_overlap=keep_apart,
                regularity=plan.problem.regularity,
                obstacles=kept_off,
            )
            return _with_turns(Model(problem, flags, groups=groups), bodies)
        except ProblemError:
            if (keep_apart, kept_off) == ways[-1]:
                raise
    raise AssertionError


def _domain_in(plan: Plan, box: Box, classes: list[PreparedClass], obstacles: list[Obstacle]) -> Domain:
    """The domain that a box is: one that has cuts only has no border, unless densities have natural ones within it."""
    whole = plan.problem.rectangle
    at_edge = not all(box.cut)
    ends = bool(obstacles) or any((c.density_image <= 0.0).any() for c in classes)
    bordered = at_edge or (whole.natural and ends)
    return Domain(box.size, whole.boundary if bordered else "open", inset=whole.inset and at_edge)


def _left_of(plan: Plan, box: Box, image: np.ndarray, vacancy: np.ndarray) -> np.ndarray:
    """What of a density is left in a box, by the cells of the coarse grid, row 0 at the bottom."""
    rows, columns = image.shape if image.size > 1 else pixels_of(plan, box)
    share = between_pixels(vacancy[::-1, :, None], box, plan.problem.rectangle.size, (rows, columns))[..., 0]
    left = (image * share).astype(np.float32)
    return left if left.any() else image


def _size_in(
    plan: Plan, box: Box, place: tuple[int, int], size: Size, area: np.ndarray, drawn: DrawnFootprints | None
) -> Size:
    """A size as it is in a box: as many bodies as have these areas [m²] and outlines, and its line's images cut."""
    line = None if size.line is None else _line_in(plan, box, place, size.line, size)
    outlines = None if drawn is None else _outlines_in(plan, box, size, drawn)
    span = size.area if isinstance(size.area, tuple) else None
    if isinstance(size.area, float) and not (area == size.area).all():
        # Fixed bodies may have other areas than their size says.
        span = (size.area, size.area)
    if span is not None:
        low, high = min(span[0], float(area.min())), max(span[1], float(area.max()))
        return replace(
            size, count=len(area), share=None, area=(low, high), distribution=area, line=line, footprint=outlines
        )
    # Arrays of outlines that are given for all bodies do not fit so few: both change at once.
    return replace(size, count=len(area), share=None, line=line, footprint=outlines)


def _outlines_in(plan: Plan, box: Box, size: Size, drawn: DrawnFootprints) -> Footprints:
    """Footprints of a size whose bodies have these outlines, with how the ground leans in a box."""
    given = size.footprint
    assert isinstance(given, Footprints)
    slope = given.slope
    if slope is not None:
        slope = _part_of(slope, box, tuple(max(2, math.ceil(2.0 * side / plan.fine)) for side in box.size[::-1]))
    return replace(
        given,
        weights=None,
        variant=drawn.variant,
        scale=drawn.scale,
        scale_jitter=0.0,
        turn=drawn.turn,
        may_turn=given.is_free,
        slope=slope,
    )


def _with_turns(model: Model, bodies: PartBodies) -> Model:
    """A model whose outlines are turned as bodies are, and whose bodies have the numbers from which all that is random follows."""
    if model.footprints.has_outlines:
        turn = np.where(model.footprints.is_outline, bodies.turn, model.footprints.turn)
        model.footprints = replace(model.footprints, turn=turn)
        model.body = replace(model.body, identities=(bodies.identity % 2**31).astype(np.int32))
    return model


def _part_of(image: np.ndarray, box: Box, least: tuple[int, ...]) -> np.ndarray:
    """The part of an image over the domain that lies in a box: its own pixels where there are many, ``least`` of them where not."""
    down, across = box.down, box.across
    wraps = box.period is not None
    row = _pixels_under(down, image.shape[0], least[0], wraps)
    column = _pixels_under(across, image.shape[1], least[1], wraps)
    return image[row[:, None], column]


def _line_in(plan: Plan, box: Box, place: tuple[int, int], line: Line, size: Size) -> Line:
    length, direction, width = line.length, line.direction, line.width
    if width is None and not isinstance(size.area, tuple):
        # That of capsules of this area, the same in all windows; see :meth:`~.model.Model.widths`.
        area = np.array([float(size.area or 0.0)])
        width = float(line.thickness(area, float(np.mean(line.length)))[0])
    shape = tuple(max(2, math.ceil(2.0 * side / plan.fine)) for side in box.size[::-1])
    if isinstance(length, np.ndarray):
        length = _part_of(length, box, shape)
    if place in plan.directions:
        doubled = between_pixels(plan.directions[place], box, plan.problem.rectangle.size, (shape[0], shape[1]))
        weight = np.hypot(doubled[..., 0], doubled[..., 1])
        angle = 0.5 * np.arctan2(doubled[..., 1], doubled[..., 0])
        vectors = np.minimum(weight, 1.0)[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        direction = vectors.astype(np.float32) if vectors.any() else "none"
    return replace(line, length=length, direction=direction, width=width)


def between_pixels(image: np.ndarray, box: Box, size: tuple[float, float], shape: tuple[int, int]) -> np.ndarray:
    """An image over the domain at the middles of pixels of a box, linearly; shape ``[*shape, channels]``."""
    places = []
    for axis, (pixels, count) in enumerate(zip(image.shape[:2], shape, strict=True)):
        low, high = (box.low[1], box.high[1]) if axis == 0 else (box.low[0], box.high[0])
        middle = (low + (np.arange(count) + 0.5) * (high - low) / count) / size[1 - axis]
        middle = 1.0 - middle[::-1] if axis == 0 else middle
        at = middle * pixels - 0.5
        if box.period is None:
            at = np.clip(at, 0.0, pixels - 1.0)
        first = np.floor(at).astype(np.int64)
        after = np.minimum(first + 1, pixels - 1) if box.period is None else (first + 1) % pixels
        places.append((first % pixels, after, at - first))
    (top, bottom, v), (left, right, u) = places
    u, v = u[None, :, None], v[:, None, None]
    upper = (1.0 - u) * image[top[:, None], left] + u * image[top[:, None], right]
    lower = (1.0 - u) * image[bottom[:, None], left] + u * image[bottom[:, None], right]
    return (1.0 - v) * upper + v * lower


def _obstacles_near(plan: Plan, box: Box, shape: tuple[int, ...]) -> list[Obstacle]:
    """Obstacles that reach into a box or its neighborhood, as seen from its corner."""
    reach = max(MARGIN * plan.fine, 2.0 * math.sqrt(float(plan.groups.mean_area.max())))
    result = []
    # A domain that wraps has each of them again beyond its edges.
    around = (-1, 0, 1) if plan.layout.periodic else (0,)
    ways = [np.array([right, up]) * plan.layout.size for up in around for right in around]
    for obstacle in plan.problem.obstacles:
        most = reach + obstacle.margin
        if obstacle.image is not None:
            image = obstacle.image.astype(np.float32)
            part = _part_of(image, box, shape)
            if part.any():
                result.append(Obstacle(image=part, margin=obstacle.margin))
            continue
        corners = np.array([obstacle.disc[:2]]) if obstacle.disc is not None else np.asarray(obstacle.polygon)
        radius = obstacle.disc[2] if obstacle.disc is not None else 0.0
        for way in ways:
            here = corners + way
            low, high = here.min(axis=0) - radius, here.max(axis=0) + radius
            if (low > np.array(box.high) + most).any() or (high < np.array(box.low) - most).any():
                continue
            here = here - box.low
            if obstacle.disc is not None:
                disc = (float(here[0, 0]), float(here[0, 1]), radius)
                result.append(Obstacle(disc=disc, margin=obstacle.margin))
            else:
                result.append(Obstacle(polygon=here, margin=obstacle.margin))
    return result


def _pixels_under(axis: Axis, pixels: int, least: int, wraps: bool) -> np.ndarray:
    """Pixels of an image under the middles of so many steps, or more, of a part of an axis; beyond its ends those at them."""
    begin, end, units = axis.begin, axis.end, axis.units
    count = max(least, math.ceil((end - begin) * pixels / units))
    middle = begin + (np.arange(count) + 0.5) * (end - begin) / count
    under = np.floor(middle * pixels / units).astype(np.int64)
    # What is below the end of an axis by less than a rounding is at that end.
    return under % pixels if wraps and end > units else np.clip(under, 0, pixels - 1)


@lru_cache(maxsize=8)
def _density(plan: Plan, class_index: int, box: Box) -> np.ndarray:
    """Density of a class in a box; a single pixel where it is everywhere the same, and no obstacle asks for finer ones."""
    source = plan.sources[class_index]
    if not plan.problem.obstacles and source.shape == (1, 1):
        return np.array(source.read(0, 1, 0, 1), np.float32)
    image = sample_source(source, box.down, box.across, pixels_of(plan, box))
    if not plan.problem.obstacles and float(image.min()) == float(image.max()):
        return np.ascontiguousarray(image[:1, :1])
    return image


def pixels_of(plan: Plan, box: Box) -> tuple[int, int]:
    """Rows and columns of pixels that a box's densities need."""
    across, up = (max(1, math.ceil(PIXELS_PER_SPACING * side / plan.fine)) for side in box.size)
    return up, across


def _bodies_at(plan: Plan, box: Box) -> int:
    """About how many bodies there would be in a box at the typical spacing."""
    return max(1, round(box.size[0] * box.size[1] / plan.fine**2))
