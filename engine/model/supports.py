"""Where bodies may be: where their density is above zero, and clear of obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from ..problem.body_footprints import BodyFootprints
from ..problem.clearance import clearance
from ..problem.domain import Domain
from ..problem.obstacles import Obstacle
from ..problem.of_bodies import of_bodies
from ..problem.problem import Problem
from ..problem.surface import Surface

__all__ = ["Supports", "parted_from_obstacles", "supports_of"]

# Bodies of a size whose footprints differ keep off obstacles by one of so many distances, the next larger one.
LEVELS = 4
# Width of a pixel over what bodies need beside convex obstacles, and pixels along an axis for that, at most.
PIXEL_OF_NEEDED = 0.5
MOST_PIXELS = 2048
# Farther than by rounding.
SAFELY = 1.0 + 1e-4


class Supports(NamedTuple):
    """Images that are above zero where bodies may be.

    Attributes:
        images: The distinct ones, each of shape ``[height, width]``.
        of_body: Which one holds for every body, shape ``[n]``, int32.
    """

    images: list[np.ndarray]
    of_body: np.ndarray


def supports_of(
    problem: Problem, class_index: np.ndarray, size_index: np.ndarray, area: np.ndarray, footprints: BodyFootprints
) -> Supports:
    """Return where the bodies of a problem may be.

    Args:
        problem: The problem.
        class_index: Class of every body, shape ``[n]``.
        size_index: Its size.
        area: Ground that it takes [m²].
        footprints: Its outline.

    Raises:
        ProblemError: Obstacles leave bodies of a size no place.
    """
    # On a surface tiles and balls say where bodies may be.
    if not problem.obstacles or isinstance(problem.domain, Surface):
        return Supports([c.density_image for c in problem.classes], class_index)
    images: list[np.ndarray] = []
    of_body = np.zeros(len(class_index), np.int32)
    radius = _radii(problem, class_index, size_index, area, footprints)
    # Outlines are parted from what is convex; the image is to say only where none of them could be, however they are turned.
    nearest = np.where(parted_from_obstacles(problem, footprints), _inner_radii(footprints), radius)
    kinds: list[tuple[np.ndarray, list[Obstacle]]] = [(radius, []), (nearest, [])]
    for obstacle in problem.obstacles:
        kinds[int(obstacle.outline is not None)][1].append(obstacle)
    known: dict[tuple[int, tuple[int, int]], np.ndarray] = {}

    def free_around(kind: int, shape: tuple[int, int]) -> np.ndarray | None:
        """How far every pixel is from the obstacles of a kind [m]; None where there are none."""
        reach, obstacles = kinds[kind]
        if not obstacles:
            return None
        if (kind, shape) not in known:
            # Classes whose images are alike ask once: as far as any of them wants to know.
            pixel = np.array(problem.rectangle.size) / shape[::-1]
            most = (float(reach.max()) + 0.5 * float(np.hypot(*pixel))) * SAFELY + float(pixel.max())
            known[kind, shape] = clearance(obstacles, problem.rectangle, shape, most)
        return known[kind, shape]

    for c, body_class in enumerate(problem.classes):
        own = class_index == c
        image = _fine_enough(body_class.density_image, problem.rectangle, nearest[own], bool(kinds[1][1]))
        shape = (image.shape[0], image.shape[1])
        # A pixel belongs to the support with its corners.
        corner = 0.5 * float(np.hypot(*(np.array(problem.rectangle.size) / shape[::-1])))
        free = [free_around(kind, shape) for kind in range(len(kinds))]
        for s, size in enumerate(body_class.sizes):
            bodies = np.flatnonzero(own & (size_index == s))
            low, high = float(radius[bodies].min()), float(radius[bodies].max())
            steps = LEVELS if high > low else 1
            level = np.ceil((radius[bodies] - low) / max(high - low, 1e-300) * steps).astype(int).clip(1, steps)
            for number in np.unique(level).tolist():
                of_level = bodies[level == number]
                needed = [float(reach[of_level].max()) for reach, _ in kinds]
                support = _left_of(image, free, [(away + corner) * SAFELY for away in needed])
                if not support.any():
                    raise ProblemError(
                        f'`obstacles` must leave room for size "{size.name}" of class "{body_class.name}", which keeps '
                        f"{max(needed):.3g} m away from them; gaps are to be wider than {2.0 * (max(needed) + corner):.3g} m",
                        Refusal(Reason.OBSTACLES_TOO_NEAR, max(needed), 0, body_class.called(size)),
                    )
                of_body[of_level] = len(images)
                images.append(support)
    return Supports(images, of_body)


def _radii(
    problem: Problem, class_index: np.ndarray, size_index: np.ndarray, area: np.ndarray, footprints: BodyFootprints
) -> np.ndarray:
    """How far footprints reach from the charges of every body [m]; 0 where footprints may overlap what they like.

    Outlines reach as far as their farthest points, however they come to be turned; those of lines, which lie along the axis, as far as
    they are beside it and beyond its ends.
    """
    if not problem.avoid_overlap:
        return np.zeros(len(area))
    radius = np.zeros(len(area))
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            own = (class_index == c) & (size_index == s)
            radius[own] = size.kind.reach_across(area[own])
            along = own & footprints.is_outline
            if size.kind.has_axis and along.any():
                beyond = _beyond_axis(footprints, np.flatnonzero(along), 0.5 * size.kind.mean_length)
                radius[along] = np.maximum(radius[along], beyond)
    dots = footprints.is_outline & ~_has_axis(problem)
    return np.where(dots, footprints.circumradius, radius)


def _fine_enough(image: np.ndarray, domain: Domain, needed: np.ndarray, convex: bool) -> np.ndarray:
    """An image with pixels smaller than what bodies need beside convex obstacles [m], so that gaps between these are not lost."""
    least = float(needed.min(initial=np.inf, where=needed > 0.0))
    for axis, (count, length) in enumerate(zip(image.shape, domain.size[::-1], strict=True)) if convex else ():
        times = min(math.ceil(length / count / least / PIXEL_OF_NEEDED), MOST_PIXELS // count)
        image = np.repeat(image, max(times, 1), axis=axis)
    return image


def _left_of(image: np.ndarray, free: Sequence[np.ndarray | None], needed: Sequence[float]) -> np.ndarray:
    """What of an image is as far from obstacles of all kinds as is needed [m]; shape as the image's."""
    for clear, away in zip(free, needed, strict=True):
        if clear is not None:
            image = np.where(clear >= away, image, np.float32(0.0))
    return image


def parted_from_obstacles(problem: Problem, footprints: BodyFootprints) -> np.ndarray:
    """Which bodies are parted from convex obstacles by their outlines, shape ``[n]``, bool.

    Not lines, nor discs, which keep off by their radius; nor those whose room is smaller than they are.
    """
    if not problem.avoid_overlap:
        return np.zeros(len(footprints.shape), bool)
    is_round = np.array([outline.inner_radius == outline.circumradius for outline in footprints.shapes] + [True])
    return footprints.is_outline & ~is_round[footprints.shape] & ~_has_axis(problem) & (footprints.room >= 1.0)


def _inner_radii(footprints: BodyFootprints) -> np.ndarray:
    """Radius of the largest disc about every body's position within its outline [m], shape ``[n]``."""
    inner = np.array([outline.inner_radius for outline in footprints.shapes] + [0.0])
    return inner[footprints.shape] * footprints.factor


def _has_axis(problem: Problem) -> np.ndarray:
    """Which bodies are lines, shape ``[n]``, bool."""
    sizes = [size for c in problem.classes for size in c.sizes]
    return of_bodies([size.kind.has_axis for size in sizes], [size.count or 0 for size in sizes], np.bool_)


def _beyond_axis(footprints: BodyFootprints, bodies: np.ndarray, half: float) -> np.ndarray:
    """How far outlines of bodies reach from an axis along x of this half length [m], shape ``[len(bodies)]``."""
    result = np.zeros(len(bodies))
    shape, factor = footprints.shape[bodies], footprints.factor[bodies]
    for number in np.unique(shape).tolist():
        own, outline = shape == number, footprints.shapes[number]
        x, y = np.abs(outline.corners.T)[:, :, None] * factor[own]
        result[own] = np.hypot(np.maximum(x - half, 0.0), y).max(axis=0) + outline.rounding * factor[own]
    return result
