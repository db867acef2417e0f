"""How much ground a mesh takes: area, and long axis, of its outline seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.convex_polygon import convex_hull
from .top_view import TopView
from .triangle_mesh import TriangleMesh

__all__ = ["Outline", "outline_from_above"]

# Rays along the longer side of the bounding rectangle: outlines are right to better than 1 %.
RESOLUTION = 512
# Directions that are tried for the narrowest rectangle around an outline.
DIRECTIONS = 720
# An outline longer than this many widths makes line bodies.
LONGEST_DOT = 2.5
# An object's origin is near the middle of its outline where the outline reaches at most so many times as far from it.
NEAR_MIDDLE = 1.15
# What takes less of the ground than this share of the square of its length stands upright: rounding has turned it a little.
UPRIGHT = 1e-5
# Sides of the polygon around a disc.
SIDES_OF_DISC = 16


@dataclass(frozen=True)
class Outline:
    """An outline seen from above.

    Attributes:
        area: What lies below some face [m²]; what overlaps counts once, holes do not count.
        length: Longer side of the smallest rectangle around it [m].
        width: Shorter side [m].
        angle: Direction of the longer side [rad], counter-clockwise from x.
        center: Middle of that rectangle, from the object's origin [m].
        corners: Corners of its convex hull, from the object's origin [m], counter-clockwise, shape ``[k, 2]``.
        lowest: Height of its lowest point above the object's origin [m].
        is_around: Whether no face looks up, as of a card with grass on it: the outline is the smallest disc about the middle then.
    """

    area: float
    length: float
    width: float
    angle: float
    center: tuple[float, float]
    corners: tuple[tuple[float, float], ...] = ()
    lowest: float = 0.0
    is_around: bool = False

    @property
    def is_long(self) -> bool:
        """Whether such bodies are lines unless somebody says otherwise."""
        return self.length > LONGEST_DOT * self.width

    @property
    def foot(self) -> tuple[float, float]:
        """What is where the body is, from the object's origin [m]: the origin itself where it is near the middle, or else the center.

        Bodies turn about where they are, and forces leave them ground around it. About an origin near their edge or beside them they
        would sweep over ground that is others'.
        """
        if not self.corners:
            return (0.0, 0.0)
        from_origin, from_center = (
            np.hypot(*(np.array(self.corners) - middle).T).max() for middle in ((0.0, 0.0), self.center)
        )
        return (0.0, 0.0) if from_origin <= NEAR_MIDDLE * from_center else self.center

    def scaled(self, factor: float) -> Outline:
        """Return the outline of an object that is larger by a factor."""
        x, y = self.center
        corners = tuple((factor * a, factor * b) for a, b in self.corners)
        return Outline(
            factor**2 * self.area,
            factor * self.length,
            factor * self.width,
            self.angle,
            (factor * x, factor * y),
            corners,
            factor * self.lowest,
            self.is_around,
        )


def outline_from_above(mesh: TriangleMesh) -> Outline:
    """Measure the outline of a mesh: where all its faces stand upright, that of a disc around it; an area of 0 where it is a line."""
    view = TopView(mesh)
    size = view.high[:2] - view.low[:2]
    if not size.min() > UPRIGHT * size.max():
        return _disc_around(mesh)
    columns, rows = np.maximum(np.ceil(size / size.max() * RESOLUTION).astype(int), 16)
    step = size / [columns, rows]
    first = view.low[:2] + 0.5 * step
    hit = (view.cast_grid(first, step, (int(rows), int(columns)))[0] >= 0).reshape(rows, columns)
    x, y = (start + np.arange(count) * width for start, count, width in zip(first, (columns, rows), step, strict=True))
    area = float(hit.mean() * size.prod())
    if area <= UPRIGHT * size.max() ** 2:
        return _disc_around(mesh)
    # The outermost cells of every row hold all corners of the convex hull.
    filled = np.flatnonzero(hit.any(axis=1))
    left = hit[filled].argmax(axis=1)
    right = columns - 1 - hit[filled, ::-1].argmax(axis=1)
    points = np.concatenate([np.stack([x[left], y[filled]], axis=1), np.stack([x[right], y[filled]], axis=1)])
    angle = np.arange(DIRECTIONS) * (np.pi / DIRECTIONS)
    along = points @ np.stack([np.cos(angle), np.sin(angle)])
    across = points @ np.stack([-np.sin(angle), np.cos(angle)])
    # Cells reach half a step beyond their middles.
    half = 0.5 * float(step.mean())
    extent = np.stack([np.ptp(along, axis=0), np.ptp(across, axis=0)]) + 2.0 * half
    best = int(np.argmin(np.where(extent[0] >= extent[1], extent.prod(axis=0), np.inf)))
    axis = np.array([np.cos(angle[best]), np.sin(angle[best])])
    middle = 0.5 * np.array(
        [along[:, best].min() + along[:, best].max(), across[:, best].min() + across[:, best].max()]
    )
    center = middle[0] * axis + middle[1] * np.array([-axis[1], axis[0]])
    used = mesh.position[np.unique(mesh.triangle)]
    return Outline(
        area,
        float(extent[0, best]),
        float(extent[1, best]),
        float(angle[best]),
        (float(center[0]), float(center[1])),
        tuple(map(tuple, convex_hull(used[:, :2]).tolist())),
        float(used[:, 2].min()),
    )


def _disc_around(mesh: TriangleMesh) -> Outline:
    """The outline of a disc about the middle of a mesh, as wide as that is."""
    position = mesh.position[np.unique(mesh.triangle)]
    middle = 0.5 * (position[:, :2].min(axis=0) + position[:, :2].max(axis=0)) if len(position) else np.zeros(2)
    radius = float(np.hypot(*(position[:, :2] - middle).T).max(initial=0.0))
    angle = np.arange(SIDES_OF_DISC) * (2.0 * np.pi / SIDES_OF_DISC)
    corners = middle + radius / np.cos(np.pi / SIDES_OF_DISC) * np.column_stack([np.cos(angle), np.sin(angle)])
    return Outline(
        np.pi * radius**2,
        2.0 * radius,
        2.0 * radius,
        0.0,
        (float(middle[0]), float(middle[1])),
        tuple(map(tuple, corners.tolist())),
        float(position[:, 2].min(initial=0.0)) if len(position) else 0.0,
        is_around=True,
    )
