"""Obstacles on a surface, laid onto it as outlines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ProblemError
from ..geometry.nearest_on_triangles import corner_weights, nearest_on_triangles
from ..geometry.unit_vectors import tangent_frame, turned, unit_vectors
from .footprint import Footprint
from .obstacles import Obstacle
from .outlines_on_surface import OutlinesOnSurface
from .surface import Surface

__all__ = ["outlines_of_obstacles"]

# What the settings of an obstacle may hold.
Given = np.ndarray | Sequence[float] | Sequence[Sequence[float]] | None

# Normals that look away from a face by more than this cosine say nothing of the plane that a tangent lies in.
STEEPEST = 0.2


def outlines_of_obstacles(surface: Surface, obstacles: Sequence[Obstacle]) -> OutlinesOnSurface:
    """Return those of some obstacles that are outlines on a surface, where they lie on it."""
    lying = [obstacle for obstacle in obstacles if obstacle.position is not None]
    count = np.array([len(np.asarray(one.position)) for one in lying], np.int64)
    own = [np.arange(end - number, end) for end, number in zip(np.cumsum(count), count, strict=True)]
    shapes: list[Footprint] = []
    # Of every outline: its core, the obstacle, and the spot.
    parts: list[np.ndarray] = [np.empty((3, 0), np.int64)]
    for number, obstacle in enumerate(lying):
        for core in obstacle.cores:
            parts.append(
                np.stack([np.full_like(own[number], len(shapes)), np.full_like(own[number], number), own[number]])
            )
            shapes.append(core)
    shape, of_obstacle, spot = np.concatenate(parts, axis=1)
    scale = np.concatenate([np.empty(0), *(np.asarray(one.scale) for one in lying)])
    triangle, weight = _places(surface, lying)
    points = surface.points(triangle, weight)
    given = _of_spots(lying, [one.position for one in lying])
    face, normal = points.normal, points.smooth_normal
    flat = _laid_onto(
        _of_spots(lying, [one.tangent for one in lying]), _of_spots(lying, [one.normal for one in lying]), face
    )
    # A tangent that stands upright says nothing.
    told = np.linalg.norm(flat, axis=1) > 1e-6
    along = turned(np.where(told[:, None], unit_vectors(flat), tangent_frame(face)[0]), face, normal)
    return OutlinesOnSurface(
        tuple(shapes),
        shape.astype(np.int32),
        scale[spot],
        np.array([one.margin for one in lying] + [0.0])[of_obstacle],
        surface.points(triangle[spot], weight[spot]),
        points.position[spot],
        normal[spot],
        along[spot],
        np.linalg.norm(given - points.position, axis=1)[spot],
        spot,
    )


def _of_spots(obstacles: Sequence[Obstacle], values: Sequence[Given]) -> np.ndarray:
    """Vectors of all the spots of obstacles, one after the other, shape ``[spots, 3]``; NaN where an obstacle has none."""
    given = [
        np.full(np.asarray(one.position).shape, np.nan) if value is None else np.asarray(value, np.float64)
        for one, value in zip(obstacles, values, strict=True)
    ]
    return np.concatenate([np.empty((0, 3)), *given])


def _laid_onto(tangent: np.ndarray, normal: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Tangents laid onto the planes of faces along the normals that came with them, as those of bodies are laid into theirs."""
    steep = ~(np.einsum("nd,nd->n", normal, face) > STEEPEST)
    along = np.where(steep[:, None], face, normal)
    height = np.einsum("nd,nd->n", tangent, face) / np.einsum("nd,nd->n", along, face)
    return tangent - height[:, None] * along


def _places(surface: Surface, obstacles: Sequence[Obstacle]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of a surface that the spots of obstacles are on, and the weights of their corners."""
    position = _of_spots(obstacles, [one.position for one in obstacles])
    triangle, weight = np.empty(len(position), np.int64), np.empty((len(position), 3))
    told = np.repeat(
        np.array([one.triangle is not None for one in obstacles], bool),
        np.array([len(np.asarray(one.position)) for one in obstacles], np.int64),
    )
    looks = np.nan_to_num(_of_spots(obstacles, [one.normal for one in obstacles]))
    free = np.flatnonzero(~told)
    if len(free):
        corner = surface.position[surface.triangle]
        triangle[free], weight[free] = nearest_on_triangles(corner, position[free], looks[free])
    first = 0
    for obstacle in obstacles:
        own = slice(first, first + len(np.asarray(obstacle.position)))
        first = own.stop
        if obstacle.triangle is not None:
            triangle[own], weight[own] = _told_places(surface, obstacle)
    return triangle, weight


def _told_places(surface: Surface, obstacle: Obstacle) -> tuple[np.ndarray, np.ndarray]:
    """The same for an obstacle that says on which triangles it is."""
    position = np.asarray(obstacle.position)
    mesh, triangle = np.asarray(obstacle.mesh), np.asarray(obstacle.triangle)
    wrong = surface.wrong_triangle(mesh, triangle)
    if wrong is not None:
        raise ProblemError(f"`obstacle.{wrong[0]}` {wrong[2]}")
    third = np.full((len(position), 3), 1.0 / 3.0)
    own = surface.locate(mesh, triangle, third).triangle
    weight = np.maximum(corner_weights(surface.position[surface.triangle[own]], position), 0.0)
    return own, weight / weight.sum(axis=1, keepdims=True)
