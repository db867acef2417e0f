"""Which outlines of a placement on a surface lie in obstacles: measured on what was placed, not taken from contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..device.launcher import Launcher
from ..geometry.outline_distances import distance_from_outline
from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from .bodies_on_surface import BodiesOnSurface, bodies_at, bodies_on_surface
from .out_of_place import OutOfPlace
from .overlaps import TOLERANCE, overlaps_on_sheets

__all__ = ["out_of_place_on_surface"]


def out_of_place_on_surface(placement: Placement, launcher: Launcher, *, fixed: bool = False) -> OutOfPlace:
    """Return what of a placement on a surface lies in obstacles, where footprints are to keep apart.

    Where they may overlap only the middles of bodies keep off obstacles, which they do whatever happens.

    Args:
        placement: The placement.
        launcher: Where to run.
        fixed: Whether to look at its fixed bodies, or at all others.
    """
    problem, own = placement.problem, np.flatnonzero(placement.fixed == fixed)
    if not len(own) or not problem.avoid_overlap or not problem.obstacles:
        return OutOfPlace()
    footprints = footprints_of_placement(placement)
    bodies = bodies_on_surface(placement, launcher)
    inside = np.zeros(len(placement.position), bool)
    deepest = _in_outlines(placement, footprints, bodies, own, inside, launcher)
    deepest = max(deepest, _in_balls(placement, footprints, own, inside))
    return OutOfPlace(int(inside.sum()), deepest)


def _in_outlines(
    placement: Placement,
    footprints: BodyFootprints,
    bodies: BodiesOnSurface,
    own: np.ndarray,
    inside: np.ndarray,
    launcher: Launcher,
) -> float:
    """Mark the bodies that lie in outlines; return how deep the deepest does [m]."""
    outlines = placement.problem.outlines_on_surface
    m = len(outlines)
    if not m:
        return 0.0

    def behind(values: np.ndarray, others: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(values)[own], others])

    zero, one = np.zeros(m), np.ones(m)
    together = replace(
        footprints,
        shapes=(*footprints.shapes, *outlines.shapes),
        shape=behind(footprints.shape, len(footprints.shapes) + outlines.shape),
        factor=behind(footprints.factor, outlines.scale),
        slope=behind(footprints.slope, np.full(m, -1, np.int32)),
        room=behind(footprints.room, one),
    )
    surface = bodies.points.surface
    points = surface.points(
        behind(bodies.points.triangle, outlines.points.triangle),
        behind(bodies.points.barycentric, outlines.points.barycentric),
    )
    assert placement.normal is not None and placement.tangent is not None
    # Outlines lie along the smooth surface; what is told of bodies lies along their triangles.
    everything = bodies_at(
        points,
        behind(placement.position, outlines.position),
        behind(placement.normal, outlines.normal),
        behind(placement.tangent, outlines.along),
        launcher,
    )
    bends = placement.bends
    if bends is not None:
        bends = behind(bends, np.full((m, *bends.shape[1:]), np.nan))
    found = overlaps_on_sheets(
        everything,
        together,
        behind(placement.length, zero),
        behind(placement.width, zero),
        launcher,
        fixed=np.concatenate([np.zeros(len(own), bool), np.ones(m, bool)]),
        bends=bends,
        apart=np.array([[False, True], [True, False]]),
        class_index=np.concatenate([np.zeros(len(own), np.int32), np.ones(m, np.int32)]),
        margin=np.concatenate([np.zeros(len(own)), outlines.margin]),
    )
    inside[own[[body for body in found.bodies if body < len(own)]]] = True
    return found.deepest


def _in_balls(placement: Placement, footprints: BodyFootprints, own: np.ndarray, inside: np.ndarray) -> float:
    """Mark the bodies whose outlines, flat in the planes of their triangles, lie in balls; return how deep the deepest does [m]."""
    assert placement.normal is not None and placement.tangent is not None
    deepest = 0.0
    beside = np.cross(placement.normal, placement.tangent)
    half = 0.5 * (placement.length + placement.width)
    for obstacle in placement.problem.obstacles:
        if obstacle.ball is None:
            continue
        radius = obstacle.ball[3] + obstacle.margin
        way = np.array(obstacle.ball[:3]) - placement.position
        reach = np.array([shape.circumradius for shape in footprints.shapes] + [0.0])[footprints.shape]
        reach = np.where(footprints.shape == CAPSULE, half, reach * footprints.factor)
        near = own[np.linalg.norm(way[own], axis=1) < radius + reach[own]]
        for body in near.tolist():
            height = float(way[body] @ placement.normal[body])
            if abs(height) >= radius:
                continue
            place = np.array([[way[body] @ placement.tangent[body], way[body] @ beside[body]]])
            corners, rounding, width = _core(placement, footprints, body)
            cut = (radius**2 - height**2) ** 0.5
            depth = cut + rounding - float(distance_from_outline(place, corners)[0])
            if depth > TOLERANCE * min(width, 2.0 * cut):
                inside[body] = True
                deepest = max(deepest, depth)
    return deepest


def _core(placement: Placement, footprints: BodyFootprints, body: int) -> tuple[np.ndarray, float, float]:
    """Corners of a body's outline along its own axes, what lies around these, and its smallest width [m]."""
    smaller = min(float(footprints.room[body]), 1.0)
    if footprints.shape[body] == CAPSULE:
        length, width = (float(value[body]) * smaller for value in (placement.length, placement.width))
        return np.array([[-0.5 * length, 0.0], [0.5 * length, 0.0]]), 0.5 * width, width
    outline = footprints.shapes[int(footprints.shape[body])].with_room(smaller)
    factor = float(footprints.factor[body])
    return outline.corners * factor, outline.rounding * factor, outline.width * factor
