"""Where bodies may be: where their density is above zero, and clear of obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import ProblemError
from ..problem.body_footprints import BodyFootprints
from ..problem.obstacles import clearance
from ..problem.problem import Problem
from ..problem.surface import Surface

__all__ = ["Supports", "supports_of"]

# Bodies of a size whose footprints differ keep off obstacles by one of so many distances, the next larger one.
LEVELS = 4
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
    largest = [float(radius[class_index == c].max(initial=0.0)) for c in range(len(problem.classes))]
    shapes = [(c.density_image.shape[0], c.density_image.shape[1]) for c in problem.classes]
    free_space: dict[tuple[int, int], np.ndarray] = {}
    for c, body_class in enumerate(problem.classes):
        image = body_class.density_image
        shape = shapes[c]
        pixel = np.array(problem.rectangle.size) / shape[::-1]
        # A pixel belongs to the support with its corners.
        corner = 0.5 * float(np.hypot(*pixel))
        own = class_index == c
        # Classes whose images are alike ask once: as far as any of them wants to know, which changes nothing nearer than that.
        if shape not in free_space:
            most = max(reach for reach, other in zip(largest, shapes, strict=True) if other == shape)
            free_space[shape] = clearance(
                problem.obstacles, problem.rectangle, shape, (most + corner) * SAFELY + float(pixel.max())
            )
        free = free_space[shape]
        for s, size in enumerate(body_class.sizes):
            bodies = np.flatnonzero(own & (size_index == s))
            low, high = float(radius[bodies].min()), float(radius[bodies].max())
            steps = LEVELS if high > low else 1
            level = np.ceil((radius[bodies] - low) / max(high - low, 1e-300) * steps).astype(int).clip(1, steps)
            for number in np.unique(level).tolist():
                needed = low + (high - low) * number / steps
                support = np.where(free >= (needed + corner) * SAFELY, image, np.float32(0.0))
                if not support.any():
                    raise ProblemError(
                        f'`obstacles` must leave room for size "{size.name}" of class "{body_class.name}", which keeps '
                        f"{needed:.3g} m away from them"
                    )
                of_body[bodies[level == number]] = len(images)
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
    circle = np.array([outline.circumradius for outline in footprints.shapes] + [0.0])[footprints.shape]
    has_axis = np.array([size.kind.has_axis for c in problem.classes for size in c.sizes])
    first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in problem.classes])])
    dots = footprints.is_outline & ~has_axis[first[class_index] + size_index]
    return np.where(dots, circle * footprints.factor, radius)


def _beyond_axis(footprints: BodyFootprints, bodies: np.ndarray, half: float) -> np.ndarray:
    """How far outlines of bodies reach from an axis along x of this half length [m], shape ``[len(bodies)]``."""
    result = np.zeros(len(bodies))
    shape, factor = footprints.shape[bodies], footprints.factor[bodies]
    for number in np.unique(shape).tolist():
        own, outline = shape == number, footprints.shapes[number]
        x, y = np.abs(outline.corners.T)[:, :, None] * factor[own]
        result[own] = np.hypot(np.maximum(x - half, 0.0), y).max(axis=0) + outline.rounding * factor[own]
    return result
