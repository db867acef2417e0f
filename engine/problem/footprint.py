"""What bodies take of the ground: convex outlines, and which of them every body of a size has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from . import validation
from .settings import Settings, described, setting
from .validation import FOREIGN_ERRORS, show

__all__ = ["MOST_CORNERS", "DrawnFootprints", "Footprint", "Footprints", "checked_footprints", "convex_hull"]

MOST_CORNERS = 16
# Edges shorter than this share of a polygon's extent are cut off: their directions would be those of rounding errors.
SHORTEST_EDGE = 1e-5
# Polygons narrower than this share of their extent have no inside that float32 could tell.
NARROWEST = 1e-4
# Points of the arc around a corner, where a rounded outline is measured as a polygon.
ARC = 64
# Directions whose farthest points say which others cannot be corners of a hull.
DIRECTIONS = 16
# Turns of a long body about its axis: its frame lies along it, or the other way round.
ALONG_THE_AXIS = 1e-6
# Largest rise of the ground over a meter.
STEEPEST = 100.0
# Beyond this an angle [rad] has no digits left that say where it points.
LARGEST_ANGLE = 1e9


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
    return _kept(corners)


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
        width = _narrowest(hull) if len(hull) > 2 else 0.0
        if width < NARROWEST * extent:
            if not rounding > 0.0:
                raise ProblemError(
                    "`points` of a polygon must not lie on one line without a `rounding`: such a footprint has no inside"
                )
            # What stands out of the segment is covered by a little more rounding.
            ends = hull[np.array(_farthest(hull))]
            return cls(ends, rounding + width)
        return cls(_enclosing(hull), rounding)

    @property
    def area(self) -> float:
        """Area [m²]."""
        x, y = self.corners.T
        core = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        return core + float(self._edges.sum()) * self.rounding + math.pi * self.rounding**2

    @property
    def width(self) -> float:
        """Smallest distance between two parallel lines that hold the outline [m]."""
        return 2.0 * self.rounding + (_narrowest(self.corners) if len(self.corners) > 2 else 0.0)

    @property
    def circumradius(self) -> float:
        """Distance of the farthest point from the origin [m]."""
        return float(np.hypot(*self.corners.T).max()) + self.rounding

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


@dataclass(frozen=True, eq=False)
class DrawnFootprints:
    """What was drawn for the bodies of a size.

    Attributes:
        variant: Which of the variants it is, shape ``[n]``, int32.
        scale: Factor on the variant's outline, shape ``[n]``, float64.
        turn: Turn that it starts with, or has [rad], shape ``[n]``, float64.
    """

    variant: np.ndarray
    scale: np.ndarray
    turn: np.ndarray


def _check_variants(value: object, key: str) -> tuple[Footprint, ...]:
    variants = validation.as_tuple((value,) if isinstance(value, Footprint) else value, Footprint, key)
    if not variants:
        raise ProblemError(f"{key} must hold at least one Footprint; got none")
    return variants


def _check_weights(value: object, key: str) -> tuple[float, ...]:
    accepted = "a number of 0 or more for each variant"
    weights = _numbers(value, key, accepted)
    if not (weights >= 0.0).all() or not weights.sum() > 0.0:
        raise ProblemError(f"{key} must be {accepted}, and one above 0; got {show(value)}")
    return tuple(weights.tolist())


def _check_variant(value: object, key: str) -> np.ndarray:
    index = _numbers(value, key, "the number of a variant for each body")
    if not ((index >= 0) & (index < 2**31) & (index == np.floor(index))).all():
        raise ProblemError(f"{key} must hold whole numbers of 0 or more; got {show(value)}")
    return _kept(index.astype(np.int32))


def _check_scale(value: object, key: str) -> float | np.ndarray:
    if validation.is_real(value):
        return validation.check_positive(value, key)
    scale = _kept(_numbers(value, key, "a factor above 0, or one for each body"))
    if not (scale > 0.0).all():
        raise ProblemError(f"{key} must be above 0 everywhere; got {scale.min():g}")
    return scale


def _check_jitter(value: object, key: str) -> float:
    jitter = validation.check_at_least_zero(value, key)
    if not jitter < 1.0:
        raise ProblemError(f"{key} must be below 1; got {jitter:g}")
    return jitter


def _check_turn(value: object, key: str) -> str | float | np.ndarray:
    accepted = '"free", "random", an angle in radians, or one for each body'
    if isinstance(value, str):
        if value not in ("free", "random"):
            raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
        return value
    if validation.is_real(value):
        number = validation.as_float(value)
        if number is None or not abs(number) <= LARGEST_ANGLE:
            raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
        return number
    angles = _numbers(value, key, accepted)
    if not (np.abs(angles) <= LARGEST_ANGLE).all():
        raise ProblemError(f"{key} must be at most {LARGEST_ANGLE:g} radians; got {np.abs(angles).max():g}")
    return _kept(angles)


def _check_slope(value: object, key: str) -> np.ndarray:
    accepted = f"an image of slopes, shape [rows, columns, 2], of at most {STEEPEST:g} meters per meter"
    try:
        slope = None if isinstance(value, (str, bytes)) else np.array(value)
    except FOREIGN_ERRORS:
        slope = None
    if slope is None or slope.ndim != 3 or slope.shape[2] != 2 or not slope.size or slope.dtype.kind not in "uif":
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    slope = slope.astype(np.float32)
    if not (np.abs(slope) <= STEEPEST).all():
        raise ProblemError(f"{key} must be {accepted}; it holds {float(np.abs(slope).max()):g}")
    return _kept(slope)


@described
@dataclass(frozen=True, eq=False)
class Footprints(Settings):
    """The outlines of a size's bodies: which each of them has, how large it is and how it is turned.

    Raises:
        ProblemError: A value outside these ranges.
    """

    variants: Footprint | Sequence[Footprint] = field(
        metadata=setting("The outlines that there are, one or several", check=_check_variants)
    )
    weights: Sequence[float] | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "How often each variant is drawn",
            more="A number of 0 or more for each; None: all as often",
            check=_check_weights,
        ),
    )
    variant: np.ndarray | Sequence[int] | None = field(
        default=None,
        metadata=setting("The variant of every body", more="Shape ``[count]``; None draws them", check=_check_variant),
    )
    scale: float | np.ndarray | Sequence[float] | None = field(
        default=None,
        metadata=setting(
            "Factor on every body's outline",
            more="A number or shape ``[count]``; None: 1, and for a size whose area is a range what gives the body its area",
            check=_check_scale,
        ),
    )
    scale_jitter: float = field(
        default=0.0,
        metadata=setting(
            "Outlines are scaled by a random factor within 1 ± this, below 1",
            unit="share",
            low=0.0,
            check=_check_jitter,
        ),
    )
    turn: str | float | np.ndarray | Sequence[float] = field(
        default="free",
        metadata=setting(
            "How bodies are turned",
            unit="rad",
            more='``"free"``: the solver may turn bodies so that they fit; ``"random"``: drawn before solving; an angle; or one for '
            'every body, shape ``[count]``. Of a line the frame lies along the axis: ``"free"`` and 0 leave it so, ``"random"`` turns '
            "half of the bodies round, and an array holds 0 or pi",
            check=_check_turn,
        ),
    )
    room: float = field(
        default=1.0, metadata=setting("Factor on the outlines for keeping apart", check=validation.check_positive)
    )
    gap: float = field(
        default=0.0,
        metadata=setting(
            "Distance that outlines keep from each other, instead of ``room``",
            unit="m",
            low=0.0,
            check=validation.check_at_least_zero,
        ),
    )
    slope: np.ndarray | None = field(
        default=None,
        metadata=setting(
            "How far the ground rises for each meter along x and y, where bodies lean with it",
            more="Their outlines lie in planes of this slope, and are foreshortened in the domain. An image stretched over it, "
            "shape ``[rows, columns, 2]``, row 0 at the largest y; None: they are horizontal. Discs and the round of other outlines "
            "stay as large as they are",
            check=_check_slope,
        ),
    )
    tilt: float = field(
        default=0.0,
        metadata=setting(
            "Largest random lean of a body, in any direction, beside that of the ground. Its outline lies in the plane that leans so",
            unit="rad",
            low=0.0,
            high=math.pi,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        number = len(self.outlines)
        if self.weights is not None and len(self.weights) != number:
            raise ProblemError(
                f"{self._key('weights')} must be a number of 0 or more for each of the {number} variants; got {show(self.weights)}"
            )
        if self.variant is not None and np.max(self.variant) >= number:
            raise ProblemError(
                f"{self._key('variant')} must hold whole numbers from 0 to {number - 1}; got {show(self.variant)}"
            )
        if self.room != 1.0 and self.gap != 0.0:
            raise ProblemError(f"{self._key('room')} cannot be combined with a `gap`; got {self.room:g}")
        self._check_lengths()

    def _key(self, name: str) -> str:
        return f"`{name}` of footprints"

    def _check_lengths(self) -> None:
        lengths = {
            name: len(value)
            for name, value in (("variant", self.variant), ("scale", self.scale), ("turn", self.turn))
            if isinstance(value, np.ndarray)
        }
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"`{name}` has {length}" for name, length in lengths.items())
            raise ProblemError(f"arrays of footprints must all have one entry per body; {told}")

    @property
    def outlines(self) -> tuple[Footprint, ...]:
        """The variants."""
        return self.variants  # type: ignore[return-value]

    @property
    def body_count(self) -> int | None:
        """Number of bodies that arrays are given for; None where there is no array."""
        for value in (self.variant, self.scale, self.turn):
            if isinstance(value, np.ndarray):
                return len(value)
        return None

    @property
    def mean_area(self) -> float:
        """Mean area of the outlines that bodies get [m²]."""
        area = np.array([outline.area for outline in self.outlines])
        square = np.array(1.0 if self.scale is None else self.scale, dtype=np.float64) ** 2
        square = square * (1.0 + self.scale_jitter**2 / 3.0)
        if self.variant is not None:
            return float(np.mean(area[np.asarray(self.variant)] * square))
        weights = np.ones(len(area)) if self.weights is None else np.array(self.weights)
        return float(area @ weights / weights.sum()) * float(np.mean(square))

    @property
    def area_span(self) -> tuple[float, float]:
        """Smallest and largest area that a body's outline may have [m²]."""
        area = np.array([outline.area for outline in self.outlines])
        if self.variant is not None:
            area = area[np.asarray(self.variant)]
        elif self.weights is not None:
            area = area[np.array(self.weights) > 0.0]
        scale = np.array(1.0 if self.scale is None else self.scale, dtype=np.float64)
        low, high = 1.0 - self.scale_jitter, 1.0 + self.scale_jitter
        if self.variant is not None and scale.ndim:
            area = area * scale**2
            return float(area.min() * low**2), float(area.max() * high**2)
        return float(area.min() * (scale.min() * low) ** 2), float(area.max() * (scale.max() * high) ** 2)

    def draw(self, count: int, seed: Sequence[int], area: np.ndarray | None, long: bool) -> DrawnFootprints:
        """Draw what is not given for every body.

        Args:
            count: Number of bodies.
            seed: Of the stream that is drawn from.
            area: Areas that the outlines are to have [m²], shape ``[count]``; None leaves them as large as they are.
            long: Whether the bodies are lines.
        """
        # Three numbers for each body, in their order: a longer list of bodies leaves the earlier ones as they are.
        random = np.random.default_rng(seed).random((count, 3))
        number = len(self.outlines)
        if self.variant is not None:
            # Given for fixed bodies, too, where counts include them; those come last.
            variant = np.asarray(self.variant)[:count]
        elif self.weights is None:
            variant = np.minimum((random[:, 0] * number).astype(np.int32), number - 1)
        else:
            steps = np.cumsum(np.array(self.weights)) / sum(self.weights)
            last = int(np.flatnonzero(np.array(self.weights) > 0.0)[-1])
            variant = np.minimum(np.searchsorted(steps, random[:, 0], side="right"), last).astype(np.int32)
        scale = 1.0 + self.scale_jitter * (2.0 * random[:, 1] - 1.0)
        if self.scale is not None:
            scale = scale * (self.scale[:count] if isinstance(self.scale, np.ndarray) else np.float64(self.scale))  # type: ignore[arg-type]
        elif area is not None:
            scale = scale * np.sqrt(area / np.array([outline.area for outline in self.outlines])[variant])
        if isinstance(self.turn, str):
            turn = 2.0 * math.pi * random[:, 2]
            if long:
                turn = np.where((random[:, 2] < 0.5) | (self.turn == "free"), 0.0, math.pi)
        else:
            turn = np.array(np.asarray(self.turn, dtype=np.float64)[..., :count] if np.ndim(self.turn) else self.turn)
            turn = np.broadcast_to(turn, count).astype(np.float64)
        return DrawnFootprints(variant, scale, turn)


def checked_footprints(value: object, where: str, count: int | None, long: bool) -> Footprints:
    """Return what a size was given as footprints.

    Args:
        value: A Footprint, several, or Footprints.
        where: What messages call the size.
        count: Number of its bodies, None where it has a share instead.
        long: Whether they are lines.
    """
    if isinstance(value, Footprints):
        footprints = value
    elif isinstance(value, Footprint) or (isinstance(value, Sequence) and not isinstance(value, str)):
        footprints = Footprints(value)
    else:
        raise ProblemError(
            f"`footprint` {where} must be a Footprint, a list of them, Footprints, or None; got {show(value)}"
        )
    given = footprints.body_count
    if given is not None and count is not None and given != count:
        raise ProblemError(f"arrays of the `footprint` {where} must have one entry per body, {count}; got {given}")
    if given is not None and count is None:
        raise ProblemError(
            f"arrays of the `footprint` {where} need a `count` of the size; it has a share of the class instead"
        )
    if long and not isinstance(footprints.turn, str):
        angle = np.asarray(footprints.turn, dtype=np.float64)
        if not (np.abs(np.sin(angle)) <= ALONG_THE_AXIS).all():
            raise ProblemError(
                f'`turn` of the `footprint` {where} must be "free", "random", 0 or pi, because its bodies are lines; '
                f"got {show(footprints.turn)}"
            )
    return footprints


def _kept(values: np.ndarray) -> np.ndarray:
    values.flags.writeable = False
    return values


def _numbers(value: object, key: str, accepted: str) -> np.ndarray:
    """Return a new list of finite numbers, float64."""
    try:
        values = None if isinstance(value, (str, bytes)) else np.array(value)
    except FOREIGN_ERRORS:
        values = None
    if values is None or values.ndim != 1 or not values.size or values.dtype.kind not in "uif":
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    values = values.astype(np.float64)
    if not np.isfinite(values).all():
        raise ProblemError(f"{key} must be finite; it holds NaN or infinity")
    return values


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


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Corners of the convex hull of points ``[n, 2]``, counter-clockwise; none of them on the line between its neighbors."""
    points = np.unique(_outer(points), axis=0)
    if len(points) < 3:
        return points

    def chain(ordered: np.ndarray) -> list[np.ndarray]:
        hull: list[np.ndarray] = []
        for point in ordered:
            while len(hull) > 1 and _cross(hull[-1] - hull[-2], point - hull[-2]) <= 0.0:
                hull.pop()
            hull.append(point)
        return hull[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _outer(points: np.ndarray) -> np.ndarray:
    """Points without those well inside the polygon of the farthest ones in some directions, which are no corners of the hull."""
    if len(points) <= 4 * DIRECTIONS:
        return points
    angle = np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
    normal = np.stack([np.cos(angle), np.sin(angle)])
    corner = points[np.argmax(points @ normal, axis=0)]
    edge = np.roll(corner, -1, axis=0) - corner
    reach = np.ptp(points, axis=0).max()
    inside = np.ones(len(points), bool)
    for start, way in zip(corner, edge, strict=True):
        if way.any():
            left = way[0] * (points[:, 1] - start[1]) - way[1] * (points[:, 0] - start[0])
            inside &= left > 1e-9 * reach * math.hypot(*way)
    return points[~inside]


def _narrowest(hull: np.ndarray) -> float:
    """Smallest width of a convex polygon: across one of its edges."""
    edge = np.roll(hull, -1, axis=0) - hull
    normal = np.stack([edge[:, 1], -edge[:, 0]]) / np.hypot(*edge.T)
    return float(np.ptp(hull @ normal, axis=0).min())


def _farthest(points: np.ndarray) -> tuple[int, int]:
    """The two points that are farthest apart."""
    distance = np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0))
    first, second = np.unravel_index(int(np.argmax(distance)), distance.shape)
    return int(first), int(second)


def _enclosing(hull: np.ndarray) -> np.ndarray:
    """A convex polygon of at most 16 corners around a convex polygon, whose edges are some of its edges, made longer."""
    corners = hull
    shortest = SHORTEST_EDGE * float(np.ptp(hull, axis=0).max())
    while len(corners) > 3:
        start, end = corners, np.roll(corners, -1, axis=0)
        edge = end - start
        before, after = np.roll(edge, 1, axis=0), np.roll(edge, -1, axis=0)
        # Where the two edges beside every edge meet, and how much ground that adds; only where they do meet outside.
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        meets = turn > 1e-12 * np.hypot(*before.T) * np.hypot(*after.T)
        along = (edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]) / np.where(meets, turn, 1.0)
        corner = start + along[:, None] * before
        beyond = np.abs((corner[:, 0] - start[:, 0]) * edge[:, 1] - (corner[:, 1] - start[:, 1]) * edge[:, 0])
        added = np.where(meets, 0.5 * beyond, np.inf)
        short = np.flatnonzero((np.hypot(*edge.T) < shortest) & meets)
        if len(short):
            gone = int(short[np.argmin(added[short])])
        elif len(corners) > MOST_CORNERS:
            gone = int(np.argmin(added))
        else:
            break
        kept = corners.copy()
        kept[gone] = corner[gone]
        corners = np.delete(kept, (gone + 1) % len(corners), axis=0)
    return corners
