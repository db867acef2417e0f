"""What a body takes of the ground: a convex outline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from ..geometry.convex_polygon import SHORTEST_EDGE, convex_hull, enclosing_polygon, farthest_points, width_of
from . import validation
from .given_values import FOREIGN_ERRORS, show
from .settings import Settings, described, setting

__all__ = ["MOST_CORNERS", "Footprint"]

# A footprint has at most so many corners.
MOST_CORNERS = 16
# Polygons narrower than this share of their extent have no inside that float32 could tell.
NARROWEST = 1e-4
# Points of the arc around a corner, where a rounded outline is measured as a polygon.
ARC = 64


def _check_corners(value: object, key: str) -> np.ndarray:
    corners = _points(value, key)
    if len(corners) > MOST_CORNERS:
        raise ProblemError(f"{key} must be at most {MOST_CORNERS}; got {len(corners)}")
    if len(corners) > 1:
        edge = np.roll(corners, -1, axis=0) - corners
        following = np.roll(edge, -1, axis=0)
        turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
        if not (np.hypot(*edge.T) > 0.0).all() or (len(corners) > 2 and not (turn > 0.0).all()):
            raise ProblemError(f"{key} must be those of a convex polygon, counter-clockwise")
        # Once round, and no more.
        angle = np.unwrap(np.arctan2(edge[:, 1], edge[:, 0]))
        if len(corners) > 2 and angle[-1] - angle[0] > 2.0 * math.pi:
            raise ProblemError(f"{key} must be those of a convex polygon, counter-clockwise")
    corners.flags.writeable = False
    return corners


@described
@dataclass(frozen=True, eq=False)
class Footprint(Settings):
    """A convex outline: all points within ``rounding`` of a convex core, which is a point, a segment or a polygon.

    Its origin is where the body's position is, and what it turns about.

    Raises:
        ProblemError: Corners that are none, not convex or not counter-clockwise, or an outline without an inside.
    """

    corners: np.ndarray = field(
        metadata=setting(
            "Corners of the core in the body's frame, counter-clockwise",
            unit="m",
            more="Shape ``[k, 2]``, k from 1 to 16",
            check=_check_corners,
        )
    )
    rounding: float = field(
        default=0.0,
        metadata=setting(
            "Radius by which the outline lies around the core", unit="m", low=0.0, check=validation.check_at_least_zero
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.corners) < 3 and not self.rounding > 0.0:
            raise ProblemError(
                f"`rounding` of a footprint of {len(self.corners)} corners must be above 0; got {self.rounding:g}"
            )
        if not (self.width >= validation.SMALLEST_LENGTH and self.circumradius <= validation.LARGEST_LENGTH):
            raise ProblemError(
                f"a footprint must be between {validation.SMALLEST_LENGTH:g} and {validation.LARGEST_LENGTH:g} meters wide; "
                f"got one of {self.width:.3g} by {2.0 * self.circumradius:.3g}"
            )

    def _key(self, name: str) -> str:
        return f"`{name}` of a footprint"

    @classmethod
    def disc(cls, radius: float) -> Footprint:
        """A disc of this radius [m]."""
        return cls(np.zeros((1, 2)), validation.check_length(radius, "`radius` of a disc"))

    @classmethod
    def capsule(cls, length: float, width: float) -> Footprint:
        """A capsule along x: ``length`` [m] from end to end, its round ends included, and ``width`` [m], at most as much."""
        length = validation.check_length(length, "`length` of a capsule")
        width = validation.check_length(width, "`width` of a capsule")
        if width > length:
            raise ProblemError(
                f"`width` of a capsule must be at most its length, {length:g}, from end to end; got {width:g}"
            )
        if width == length:
            return cls.disc(0.5 * width)
        half = 0.5 * (length - width)
        return cls(np.array([[-half, 0.0], [half, 0.0]]), 0.5 * width)

    @classmethod
    def rectangle(cls, length: float, width: float, rounding: float = 0.0) -> Footprint:
        """A rectangle of ``length`` [m] along x and ``width`` [m] along y about the origin, and ``rounding`` [m] around it."""
        half = 0.5 * validation.check_length(length, "`length` of a rectangle")
        across = 0.5 * validation.check_length(width, "`width` of a rectangle")
        return cls.polygon([[-half, -across], [half, -across], [half, across], [-half, across]], rounding)

    @classmethod
    def polygon(cls, points: np.ndarray | Sequence[Sequence[float]], rounding: float = 0.0) -> Footprint:
        """The convex hull of points, and ``rounding`` around it.

        Args:
            points: In the body's frame [m], in any order, shape ``[k, 2]``. A hull of more than 16 corners becomes a polygon of 16
                around it, so that nothing of it is cut off.
            rounding: [m], 0 or more. With it, points on a line make a capsule and a single one a disc.
        """
        given = _points(points, "`points` of a polygon")
        rounding = validation.check_at_least_zero(rounding, "`rounding` of a polygon")
        extent = float(np.ptp(given, axis=0).max())
        if extent <= SHORTEST_EDGE * rounding or extent == 0.0:
            if rounding > 0.0:
                return cls(given.mean(axis=0, keepdims=True), rounding)
            raise ProblemError(f"`points` of a polygon must not all be the same; got {show(given[0].tolist())} only")
        hull = convex_hull(given)
        width = width_of(hull) if len(hull) > 2 else 0.0
        if width < NARROWEST * extent:
            if not rounding > 0.0:
                raise ProblemError(
                    "`points` of a polygon must not lie on one line without a `rounding`: such a footprint has no inside"
                )
            # What stands out of the segment is covered by a little more rounding.
            ends = hull[np.array(farthest_points(hull))]
            return cls(ends, rounding + width)
        return cls(enclosing_polygon(hull, MOST_CORNERS), rounding)

    @property
    def area(self) -> float:
        """Area [m²]."""
        x, y = self.corners.T
        core = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        return core + float(self._edges.sum()) * self.rounding + math.pi * self.rounding**2

    @property
    def width(self) -> float:
        """Smallest distance between two parallel lines that hold the outline [m]."""
        return 2.0 * self.rounding + (width_of(self.corners) if len(self.corners) > 2 else 0.0)

    @property
    def circumradius(self) -> float:
        """Distance of the farthest point from the origin [m]."""
        return float(np.hypot(*self.corners.T).max()) + self.rounding

    @property
    def inner_radius(self) -> float:
        """Radius of the largest disc about the origin that lies within the outline [m]; 0 where the origin lies outside."""
        edge = np.roll(self.corners, -1, axis=0) - self.corners
        square = np.maximum((edge**2).sum(axis=1), 1e-300)
        along = np.clip(-(self.corners * edge).sum(axis=1) / square, 0.0, 1.0)
        away = float(np.hypot(*(self.corners + along[:, None] * edge).T).min())
        left_of = edge[:, 1] * self.corners[:, 0] - edge[:, 0] * self.corners[:, 1]
        inside = len(self.corners) > 2 and bool((left_of >= 0.0).all())
        return max(self.rounding + (away if inside else -away), 0.0)

    @property
    def moment(self) -> float:
        """Integral of the squared distance from the origin over the inside [m⁴]."""
        x, y = self.outline(ARC).T
        next_x, next_y = np.roll(x, -1), np.roll(y, -1)
        cross = x * next_y - next_x * y
        squares = x * x + x * next_x + next_x**2 + y * y + y * next_y + next_y**2
        return float((cross * squares).sum()) / 12.0

    @property
    def middle(self) -> np.ndarray:
        """Middle of the core [m], shape ``[2]``: of a polygon its center of mass."""
        if len(self.corners) < 3:
            return self.corners.mean(axis=0)
        corners = self.corners - self.corners[0]
        following = np.roll(corners, -1, axis=0)
        cross = corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]
        return self.corners[0] + ((corners + following) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())

    def with_room(self, room: float) -> Footprint:
        """The outline so many times as large about its middle, wherever its origin is: above 1 it holds the outline itself."""
        if room == 1.0:
            return self
        return Footprint(self.middle + room * (self.corners - self.middle), self.rounding * room)

    def same_as(self, other: Footprint) -> bool:
        """Whether another footprint is the same outline."""
        same = self.corners.shape == other.corners.shape and self.rounding == other.rounding
        return self is other or (same and bool((self.corners == other.corners).all()))

    def scaled(self, factor: float) -> Footprint:
        """The same outline, so many times as large."""
        factor = validation.check_positive(factor, "`factor` of a footprint")
        return Footprint(self.corners * factor, self.rounding * factor)

    def outline(self, points_of_a_corner: int = 16) -> np.ndarray:
        """The outline as a polygon, counter-clockwise [m], shape ``[m, 2]``; arcs become so many points each, on the arc."""
        if not self.rounding > 0.0:
            return self.corners.copy()
        count = len(self.corners)
        if count == 1:
            angle = np.arange(2 * points_of_a_corner) * (math.pi / points_of_a_corner)
            return self.corners + self.rounding * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        edge = np.roll(self.corners, -1, axis=0) - self.corners
        # An edge's normal lies to its right: outside.
        normal = np.arctan2(-edge[:, 0], edge[:, 1])
        before = np.roll(normal, 1)
        sweep = np.mod(normal - before, 2.0 * math.pi)
        share = np.linspace(0.0, 1.0, max(2, points_of_a_corner))
        angle = before[:, None] + sweep[:, None] * share
        arc = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return (self.corners[:, None] + self.rounding * arc).reshape(-1, 2)

    @property
    def _edges(self) -> np.ndarray:
        return np.hypot(*(np.roll(self.corners, -1, axis=0) - self.corners).T)


def _points(value: object, key: str) -> np.ndarray:
    """Return new points, float64, shape ``[k, 2]``."""
    accepted = "points [x, y] in meters, at least one"
    try:
        points = None if isinstance(value, (str, bytes)) else np.array(value)
    except FOREIGN_ERRORS:
        points = None
    if points is None or points.ndim != 2 or points.shape[1] != 2 or not points.size or points.dtype.kind not in "uif":
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    points = points.astype(np.float64)
    if not (np.abs(points) <= validation.LARGEST_LENGTH).all():
        raise ProblemError(f"{key} must be finite, and within {validation.LARGEST_LENGTH:g} meters of the origin")
    return points
