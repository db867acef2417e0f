"""Which objects of a result lean into each other: their outlines on the ground keep apart, and they meet above it or below.

Compared are convex hulls. Only objects with outlines of their own are: of others somebody said how much ground they take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...engine.geometry.unit_vectors import unit_vectors
from ...engine.problem.placement import Placement
from ...engine.problem.slopes import LEVEL
from ...engine.quality.solids import TOLERANCE, Solids, depths, meeting, meeting_pairs
from ...engine.surface.instances import rotate
from .result_points import ResultPoints

__all__ = ["SizeHulls", "with_leaning"]

# Bodies that are named.
MOST_NAMED = 10_000


@dataclass(frozen=True, eq=False)
class SizeHulls:
    """What a size's objects are in space.

    Attributes:
        objects: The objects, by their numbers among those of the scatter.
        corners: Of the convex hull of each, from its origin [m], shape ``[k, 3]``.
        room: Factor on outlines while they are kept apart: below 1 they may overlap as far as it lets them, which does not count.
    """

    objects: tuple[int, ...]
    corners: tuple[np.ndarray, ...]
    room: float = 1.0


def with_leaning(
    placement: Placement, points: ResultPoints, size_number: np.ndarray, hulls: Sequence[SizeHulls | None]
) -> Placement:
    """Return a placement whose report, if it has one, also says which objects lean into each other; touches nothing of Blender.

    Where nothing leans, or all stand straight on a plane, outlines tell all, and this takes no time.

    Args:
        placement: Where the bodies are.
        points: Where their objects are.
        size_number: Which of all sizes every body is of, shape ``[n]``.
        hulls: Of all sizes; None for those that are not looked at.
    """
    report = placement.report
    looked_at = np.array([one is not None for one in hulls], bool)
    if report is None or not placement.problem.avoid_overlap or not looked_at.any():
        return placement
    own = np.flatnonzero(looked_at[size_number])
    leans = _leaning(points, own)
    if not leans.any():
        return placement
    solids, flat = _solids(points, own, size_number[own], hulls)
    apart = placement.problem.balance.classes_apart
    first, second = meeting_pairs(solids, leans, apart, placement.class_index[own])
    if report.overlaps or report.fixed_overlaps:
        told = _overlap_on_ground(flat, points, own, first, second)
        first, second = first[~told], second[~told]
    depth = depths(solids, first, second)
    order = np.argsort(-depth, kind="stable")
    pairs = own[np.stack([first, second], axis=1)[order]]
    bodies = list(dict.fromkeys(pairs[:MOST_NAMED].ravel().tolist()))[:MOST_NAMED]
    found = replace(
        report,
        leaning=len(pairs),
        deepest_leaning=float(depth.max(initial=0.0)),
        leaning_pair=(int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None,
        leaning_bodies=tuple(bodies),
    )
    return replace(placement, report=found)


def _leaning(points: ResultPoints, own: np.ndarray) -> np.ndarray:
    """Tell which of some objects may meet others though outlines keep apart, shape ``[m]``: those that outlines do not tell all of.

    Seen from above that is what does not stand upright. On a whole surface outlines lie along it, so what stands upright on a slope is
    among them.
    """
    on_surface = bool(points.ground.laid.any())
    rotation = points.instances.rotation[own].astype(np.float64)
    up = rotate(rotation, np.broadcast_to([0.0, 0.0, 1.0], (len(own), 3)))
    normal = points.ground.normal[own].astype(np.float64)
    leans = np.hypot(up[:, 0], up[:, 1]) > LEVEL
    if on_surface:
        leans |= np.hypot(normal[:, 0], normal[:, 1]) > LEVEL
    if not leans.any():
        return leans
    place = points.surface.position[own] @ normal[0]
    on_plane = np.ptp(place) <= LEVEL * np.ptp(points.surface.position[own], axis=0).max()
    alike = max(np.ptp(up, axis=0).max(), np.ptp(normal, axis=0).max()) <= LEVEL
    straight = np.abs(up[0] - normal[0]).max() <= LEVEL
    return np.zeros_like(leans) if on_plane and alike and straight else leans


def _solids(
    points: ResultPoints, own: np.ndarray, size_number: np.ndarray, hulls: Sequence[SizeHulls | None]
) -> tuple[Solids, Solids]:
    """Return some objects as they stand, and their outlines as they lie in planes of their own on the ground."""
    shape = np.zeros(len(own), np.int64)
    corners: list[np.ndarray] = []
    flat: list[np.ndarray] = []
    source = points.instances.source[own]
    for number, size in enumerate(hulls):
        if size is None:
            continue
        for which, hull in zip(size.objects, size.corners, strict=True):
            of_this = np.flatnonzero((size_number == number) & (source == which))
            if len(of_this):
                shape[of_this] = len(corners)
                middle = points.ground.middle[own[of_this[0]]].astype(np.float64)
                level = min(size.room, 1.0) * (hull[:, :2] - middle)
                corners.append(np.column_stack([level + middle, hull[:, 2]]))
                flat.append(np.column_stack([level, np.zeros(len(hull))]))
    rotation, scale = (getattr(points.instances, name)[own].astype(np.float64) for name in ("rotation", "scale"))
    axes = [rotate(rotation, np.broadcast_to(axis, (len(own), 3))) for axis in np.eye(3)]
    standing = scale[:, None, None] * np.stack(axes, axis=2)
    position = points.instances.position[own].astype(np.float64)
    ground = points.surface.position[own].astype(np.float64)
    return Solids(corners, shape, position, standing), Solids(flat, shape, ground, standing)


def _overlap_on_ground(
    flat: Solids, points: ResultPoints, own: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Tell of pairs whether their outlines overlap on the ground, which the report says already; shape ``[m]``.

    They are looked at from above, on a whole surface from where both look to.
    """
    body = np.concatenate([first, second])
    view = np.broadcast_to([0.0, 0.0, 1.0], (len(first), 3))
    if points.ground.laid.any():
        normal = points.ground.normal[own].astype(np.float64)
        view = unit_vectors(normal[first] + normal[second])
    view = np.concatenate([view, view])
    axes, position = flat.axes[body], flat.position[body]
    axes = axes - view[:, :, None] * np.einsum("ni,nij->nj", view, axes)[:, None, :]
    position = position - view * np.einsum("ni,ni->n", view, position)[:, None]
    seen = Solids(flat.shapes, flat.shape[body], position, axes).smaller(TOLERANCE)
    return meeting(seen, np.arange(len(first)), np.arange(len(first), len(body)))
