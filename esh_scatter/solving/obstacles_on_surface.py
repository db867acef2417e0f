"""What obstacles are on a whole surface, walls and undersides too, where nothing is seen from above; asks nothing of Blender.

What other scatters have placed lies there with its outlines, on the side that it stands on. Of everything else every point covers the
point of the surface that is nearest to it, if it is near: a path that lies a little above or below the ground, a picture on a wall.
And what lies inside a closed mesh is covered. The edge of what is covered is a row of discs, which bodies are parted from.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...engine.problem.obstacles import Obstacle
from ...engine.surface.near_surface import COVERS_STEP, NearSurface, PlacesNear, is_inside, samples_of
from ...engine.surface.whole_surface import WholeSurface
from ..classes.sources import SizeShape
from ..classes.survey import Survey
from .obstacles import Stood, StoredObstacle

__all__ = ["OnSurface", "obstacles_on"]

# How far from a surface a shape may be, as a share of its width: the middle one of its three extents.
NEAR = 0.25
# Steps between the points of a shape: over the radius of the smallest body and over its width; and points at most.
STEP_OF_BODY = 0.5
STEPS_OF_SHAPE = 8.0
MOST_SAMPLES = 200_000
# Of discs that are nearer to each other than so many steps some are enough.
BETWEEN_DISCS = 0.7
# How far the edge of a row of discs may wave, over the radius of the smallest body.
WAVES = 0.05
# Discs that have only covered ground around them, so many steps wide, meet nobody.
STEPS_OF_RIM = 2.0


class OnSurface(NamedTuple):
    """Obstacles on a whole surface.

    Attributes:
        free: Which of the surface's points they leave free, shape ``[n]``, bool.
        obstacles: What bodies are parted from.
    """

    free: np.ndarray
    obstacles: list[Obstacle]


def obstacles_on(
    obstacles: Sequence[StoredObstacle], chart: WholeSurface, shapes: Sequence[SizeShape], survey: Survey
) -> OnSurface:
    """Return what obstacles are on a whole surface.

    Args:
        obstacles: What was read.
        chart: The target.
        shapes: Of what is to be placed.
        survey: Knows outlines.
    """
    near = chart.near
    points = chart.points
    free = np.ones(len(points.position), bool)
    found: list[Obstacle] = []
    smallest = _smallest_radius(shapes)
    for obstacle in obstacles:
        if obstacle.place is not None:
            if math.isnan(obstacle.place[2]):
                away = np.hypot(*(points.position[:, :2] - obstacle.place[:2]).T)
                free &= away > obstacle.reach
            else:
                found.append(Obstacle(ball=(*obstacle.place, obstacle.reach)))
            continue
        for stood in obstacle.stood:
            found += _standing(stood, obstacle.reach, near, survey)
        for solid in obstacle.solids:
            found += _covering(solid, obstacle.reach, near, chart, smallest, free)
    return OnSurface(free, found)


def _smallest_radius(shapes: Sequence[SizeShape]) -> float:
    """Radius of a disc as large as the smallest body [m]."""
    area = [shape.area[0] if isinstance(shape.area, tuple) else shape.area for shape in shapes]
    area += [outline.area for shape in shapes for outline in shape.outlines if outline is not None]
    return math.sqrt(min(area) / math.pi)


def _standing(stood: Stood, margin: float, near: NearSurface, survey: Survey) -> list[Obstacle]:
    """Outlines of what another scatter has placed on the surface, or so near to it that they reach it."""
    lying, found = stood.lying, []
    for own, corners in stood.outlines(survey):
        for middle in np.unique(lying.middle[own], axis=0):
            some = own[(lying.middle[own] == middle).all(axis=1)]
            seen = corners - middle
            within = np.hypot(*seen.T).max() * lying.scale[some] + margin
            places = near.towards(lying.position[some], lying.normal[some], within)
            if len(places.row):
                there = some[places.row]
                found.append(
                    Obstacle(
                        polygon=seen,
                        margin=margin,
                        position=places.position,
                        normal=lying.normal[there],
                        tangent=lying.along[there],
                        scale=lying.scale[there],
                        triangle=near.surface.source[places.triangle],
                    )
                )
    return found


def _covering(
    solid: np.ndarray, reach: float, near: NearSurface, chart: WholeSurface, smallest: float, free: np.ndarray
) -> list[Obstacle]:
    """Take from ``free`` what a shape ``[t, 3, 3]`` covers, and return the edge of that as discs."""
    surface, points = chart.surface, chart.points
    width = _width_of(solid)
    farthest = max(reach, NEAR * width)
    low, high = solid.min(axis=1) - farthest, solid.max(axis=1) + farthest
    own = solid[((high >= surface.low) & (low <= surface.high)).all(axis=1)]
    covered = is_inside(solid, points.position).astype(np.uint8)
    if not len(own):
        free &= covered == 0
        return []
    step = min(STEP_OF_BODY * smallest, width / STEPS_OF_SHAPE if width > 0.0 else math.inf)
    area = 0.5 * np.linalg.norm(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]), axis=1).sum()
    # The edge of a row of wide discs is hardly less straight where they are farther apart.
    step = max(step, math.sqrt(area / MOST_SAMPLES), min(reach, math.sqrt(8.0 * WAVES * smallest * reach)))
    samples = samples_of(own, step)
    places = near.nearest(samples, np.full(len(samples), farthest))
    radius = max(reach, COVERS_STEP * step)
    row, triangle = chart.on_surface
    position, normal = points.position[row], surface.normal[triangle]
    taken = covered[row]
    near.covered_by(places, radius, position, normal, taken)
    covered[row] = taken
    free &= covered == 0
    # Of some discs those that see something free.
    places = _thinned(places, BETWEEN_DISCS * step)
    left = np.flatnonzero(taken == 0)
    rim = np.zeros(len(places.row), np.uint8)
    uncovered = PlacesNear(left, triangle[left], position[left])
    sees = radius + STEPS_OF_RIM * max(step, chart.step)
    near.covered_by(uncovered, sees, places.position, surface.normal[places.triangle], rim)
    edge = np.flatnonzero(rim)
    if not len(edge):
        return []
    on = surface.source[places.triangle[edge]]
    return [Obstacle(disc=(0.0, 0.0, radius), position=places.position[edge], triangle=on)]


def _thinned(places: PlacesNear, size: float) -> PlacesNear:
    """One of the places in each cell of this size [m], on every side: the outermost, so that corners are covered."""
    if not len(places.row):
        return places
    outward = np.argsort(-np.linalg.norm(places.position - places.position.mean(axis=0), axis=1), kind="stable")
    cell = np.floor((places.position - places.position.min(axis=0)) / size).astype(np.int64)
    key = np.column_stack([cell, places.triangle])[outward]
    _, first = np.unique(key, axis=0, return_index=True)
    return PlacesNear(*(values[np.sort(outward[first])] for values in places))


def _width_of(solid: np.ndarray) -> float:
    """The middle one of the extents of a shape along its own axes [m]."""
    place = solid.reshape(-1, 3) - solid.mean(axis=(0, 1))
    _, axes = np.linalg.eigh(place.T @ place)
    return float(np.sort(np.ptp(place @ axes, axis=0))[1])
