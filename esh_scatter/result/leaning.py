"""Which objects of a result lean into each other: their outlines on the ground keep apart, and they meet above it or below.

Compared are convex hulls. Only objects with outlines of their own are: of others somebody said how much ground they take. Nothing here
touches Blender.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...engine.geometry.unit_vectors import unit_vectors
from ...engine.problem.placement import Placement
from ...engine.problem.slopes import LEVEL
from ...engine.quality.solids import TOLERANCE, Solids, depths, meeting, meeting_pairs
from ...engine.surface.instances import rotate
from .result_points import ResultPoints

__all__ = ["Leaning", "SizeHulls", "StandingObjects", "count_leaning", "with_leaning"]

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


class StandingObjects(NamedTuple):
    """Objects as they stand, and the ground below them.

    Attributes:
        position: Where their origins are [m], shape ``[n, 3]``.
        rotation: Unit quaternions (w, x, y, z), shape ``[n, 4]``.
        scale: Shape ``[n]``.
        source: Which object each is a copy of, shape ``[n]``.
        ground: Where their points are on the ground [m], shape ``[n, 3]``.
        normal: Where the ground looks to there, shape ``[n, 3]``.
        laid: Whether outlines lie along the ground, and are not those from above, shape ``[n]``, bool.
        middle: What of an object at scale 1 is on its point, from its origin [m], shape ``[n, 2]``.
        size_number: Which of all sizes each is of, shape ``[n]``.
        class_index: And which class, shape ``[n]``.
    """

    position: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    source: np.ndarray
    ground: np.ndarray
    normal: np.ndarray
    laid: np.ndarray
    middle: np.ndarray
    size_number: np.ndarray
    class_index: np.ndarray


class Leaning(NamedTuple):
    """Which objects lean into each other; see the attributes of :class:`~esh.Report` that are called ``leaning…``."""

    pairs: int
    deepest: float
    pair: tuple[int, int] | None
    bodies: tuple[int, ...]

    def as_reported(self) -> dict[str, Any]:
        """Return it by the names that reports have for it."""
        return {
            "leaning": self.pairs,
            "deepest_leaning": self.deepest,
            "leaning_pair": self.pair,
            "leaning_bodies": self.bodies,
        }


def with_leaning(
    placement: Placement, points: ResultPoints, size_number: np.ndarray, hulls: Sequence[SizeHulls | None]
) -> Placement:
    """Return a placement whose report, if it has one, also says which objects lean into each other.

    Args:
        placement: Where the bodies are.
        points: Where their objects are.
        size_number: Which of all sizes every body is of, shape ``[n]``.
        hulls: Of all sizes; None for those that are not looked at.
    """
    report = placement.report
    if report is None or not placement.problem.avoid_overlap or all(one is None for one in hulls):
        return placement
    instances, ground = points.instances, points.ground
    objects = StandingObjects(
        instances.position,
        instances.rotation,
        instances.scale,
        instances.source,
        points.surface.position,
        ground.normal,
        ground.laid,
        ground.middle,
        size_number,
        placement.class_index,
    )
    told = bool(report.overlaps or report.fixed_overlaps)
    found = count_leaning(objects, hulls, placement.problem.balance.classes_apart, told=told)
    return placement if found is None else replace(placement, report=replace(report, **found.as_reported()))


def count_leaning(
    objects: StandingObjects,
    hulls: Sequence[SizeHulls | None],
    apart: np.ndarray | None,
    *,
    told: bool,
    factor: float = 1.0,
    ask: Callable[[], None] | None = None,
) -> Leaning | None:
    """Return which objects lean into each other; None where nothing leans.

    Where nothing leans, or all stand straight on a plane, outlines tell all, and this takes no time.

    Args:
        objects: The objects.
        hulls: Of all sizes; None for those that are not looked at.
        apart: Which classes keep apart, shape ``[classes, classes]``, bool; None where all do.
        told: Whether pairs whose outlines overlap on the ground are counted elsewhere.
        factor: How much larger objects are shown than they were placed. What is larger may meet however it stands.
        ask: Called now and then; what it raises ends the count.
    """
    shape, shapes = _shapes(objects, hulls)
    own = np.flatnonzero(shape >= 0)
    if not len(own) or factor <= 0.0:
        return None
    objects = StandingObjects(*(values[own] for values in objects))
    leans = np.ones(len(own), bool) if factor > 1.0 else _leaning(objects)
    if not leans.any():
        return None
    solids, flat = _solids(objects, shape[own], shapes, factor)
    first, second = meeting_pairs(solids, leans, apart, objects.class_index, ask)
    if told:
        on_ground = _overlap_on_ground(flat, objects, first, second)
        first, second = first[~on_ground], second[~on_ground]
    depth = depths(solids, first, second)
    order = np.argsort(-depth, kind="stable")
    pairs = own[np.stack([first, second], axis=1)[order]]
    bodies = list(dict.fromkeys(pairs[:MOST_NAMED].ravel().tolist()))[:MOST_NAMED]
    pair = (int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None
    return Leaning(len(pairs), float(depth.max(initial=0.0)), pair, tuple(bodies))


def _leaning(objects: StandingObjects) -> np.ndarray:
    """Tell which of some objects may meet others though outlines keep apart, shape ``[m]``: those that outlines do not tell all of.

    Seen from above that is what does not stand upright. On a whole surface outlines lie along it, so what stands upright on a slope is
    among them.
    """
    rotation, normal = objects.rotation.astype(np.float64), objects.normal.astype(np.float64)
    up = rotate(rotation, np.broadcast_to([0.0, 0.0, 1.0], normal.shape))
    leans = np.hypot(up[:, 0], up[:, 1]) > LEVEL
    if objects.laid.any():
        leans |= np.hypot(normal[:, 0], normal[:, 1]) > LEVEL
    if not leans.any():
        return leans
    place = objects.ground @ normal[0]
    on_plane = np.ptp(place) <= LEVEL * np.ptp(objects.ground, axis=0).max()
    alike = max(np.ptp(up, axis=0).max(), np.ptp(normal, axis=0).max()) <= LEVEL
    straight = np.abs(up[0] - normal[0]).max() <= LEVEL
    return np.zeros_like(leans) if on_plane and alike and straight else leans


class _Shape(NamedTuple):
    """An object as it may be met: corners of its hull [m], shape ``[k, 3]``, and of its outline about what is on the point."""

    corners: np.ndarray
    flat: np.ndarray


def _shapes(objects: StandingObjects, hulls: Sequence[SizeHulls | None]) -> tuple[np.ndarray, list[_Shape]]:
    """Return which shape every object has, -1 for those that are not looked at, shape ``[n]``; and the shapes."""
    shape = np.full(len(objects.source), -1, np.int64)
    found: list[_Shape] = []
    for number, size in enumerate(hulls):
        if size is None:
            continue
        for which, hull in zip(size.objects, size.corners, strict=True):
            of_this = np.flatnonzero((objects.size_number == number) & (objects.source == which))
            if len(of_this):
                shape[of_this] = len(found)
                middle = objects.middle[of_this[0]].astype(np.float64)
                level = min(size.room, 1.0) * (hull[:, :2] - middle)
                flat = np.column_stack([level, np.zeros(len(hull))])
                found.append(_Shape(np.column_stack([level + middle, hull[:, 2]]), flat))
    return shape, found


def _solids(
    objects: StandingObjects, shape: np.ndarray, shapes: Sequence[_Shape], factor: float
) -> tuple[Solids, Solids]:
    """Return objects as they stand, and their outlines as they lie in planes of their own on the ground: these as they were placed."""
    rotation, scale = objects.rotation.astype(np.float64), objects.scale.astype(np.float64)
    axes = [rotate(rotation, np.broadcast_to(axis, (len(shape), 3))) for axis in np.eye(3)]
    standing = scale[:, None, None] * np.stack(axes, axis=2)
    position, ground = objects.position.astype(np.float64), objects.ground.astype(np.float64)
    solids = Solids([one.corners for one in shapes], shape, position, factor * standing)
    return solids, Solids([one.flat for one in shapes], shape, ground, standing)


def _overlap_on_ground(flat: Solids, objects: StandingObjects, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Tell of pairs whether their outlines overlap on the ground, which the report says already; shape ``[m]``.

    They are looked at from above, on a whole surface from where both look to.
    """
    body = np.concatenate([first, second])
    view = np.broadcast_to([0.0, 0.0, 1.0], (len(first), 3))
    if objects.laid.any():
        normal = objects.normal.astype(np.float64)
        view = unit_vectors(normal[first] + normal[second])
    view = np.concatenate([view, view])
    axes, position = flat.axes[body], flat.position[body]
    axes = axes - view[:, :, None] * np.einsum("ni,nij->nj", view, axes)[:, None, :]
    position = position - view * np.einsum("ni,ni->n", view, position)[:, None]
    seen = Solids(flat.shapes, flat.shape[body], position, axes).smaller(TOLERANCE)
    return meeting(seen, np.arange(len(first)), np.arange(len(first), len(body)))
