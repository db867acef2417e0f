"""Obstacles: where no body may be."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..errors import ProblemError
from ..geometry.convex_pieces import convex_pieces
from ..geometry.convex_polygon import convex_hull, enclosing_polygon
from . import validation
from .footprint import MOST_CORNERS, Footprint
from .given_values import FOREIGN_ERRORS, as_float, as_reals, show
from .settings import Settings, described, setting, settle

__all__ = ["Obstacle"]

# From this value on an obstacle's image is one.
THRESHOLD = 0.5
# A polygon is convex where it lacks no larger share of its hull.
NOT_CONVEX = 1e-6
# How thick a polygon without an inside is taken for where its margin is kept, as a share of that.
THINNEST = 1e-3
# Sine of the angle between a tangent and a normal at least: below this it does not say where along the surface an outline points.
SMALLEST_SINE = 1e-6


def _check_polygon(value: object, key: str) -> np.ndarray:
    """Return the corners, float64, shape ``[n, 2]``; raise ProblemError unless there are three or more."""
    try:
        corners = as_reals(value)
    except FOREIGN_ERRORS:
        corners = np.empty(0)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
        raise ProblemError(f"{key} must be three or more corners, each x and y in meters; got {show(value)}")
    _check_near(float(np.abs(corners).max()), key)
    return corners


def _check_disc(value: object, key: str) -> tuple[float, ...]:
    return _center_and_radius(value, key, "x, y")


def _check_ball(value: object, key: str) -> tuple[float, ...]:
    return _center_and_radius(value, key, "x, y, z")


def _check_places(value: object, key: str) -> np.ndarray:
    """Return one place or several, float64, shape ``[m, 3]``."""
    vectors = _vectors(value, key, "x, y and z in meters, or a list of such places")
    _check_near(float(np.abs(vectors).max()), key)
    return vectors


def _check_directions(value: object, key: str) -> np.ndarray:
    """Return one direction or several, of length 1, float64, shape ``[m, 3]``."""
    vectors = _vectors(value, key, "x, y and z of a direction, or a list of such")
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (length > 0.0).all():
        raise ProblemError(f"{key} must point somewhere; got {show(value)}")
    return vectors / length


def _vectors(value: object, key: str, accepted: str) -> np.ndarray:
    try:
        vectors = np.atleast_2d(as_reals(value))
    except FOREIGN_ERRORS:
        vectors = np.empty(0)
    if vectors.ndim != 2 or vectors.shape[1:] != (3,) or not len(vectors) or not np.isfinite(vectors).all():
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    return vectors


def _check_scale(value: object, key: str) -> np.ndarray:
    try:
        factors = np.atleast_1d(as_reals(value))
    except FOREIGN_ERRORS:
        factors = np.empty(0)
    if factors.ndim != 1 or not len(factors) or not ((factors > 0.0) & np.isfinite(factors)).all():
        raise ProblemError(f"{key} must be a number above 0, or a list of such; got {show(value)}")
    return factors


def _check_whole(value: object, key: str) -> np.ndarray:
    try:
        given = np.atleast_1d(np.asarray(value))
    except FOREIGN_ERRORS:
        given = np.empty(0)
    if given.ndim != 1 or not len(given) or given.dtype.kind not in "ui" or given.min() < -1:
        raise ProblemError(f"{key} must be a whole number of 0 or more, or a list of such; got {show(value)}")
    return given.astype(np.int64)


def _center_and_radius(value: object, key: str, center: str) -> tuple[float, ...]:
    """Return the coordinates of a center, named as messages name them, and a radius above 0."""
    listed = isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1)
    entries = [as_float(entry) for entry in value] if listed else []  # type: ignore[attr-defined]
    numbers = tuple(entry for entry in entries if entry is not None and math.isfinite(entry))
    if not len(entries) == len(numbers) == center.count(",") + 2 or not numbers[-1] > 0.0:
        raise ProblemError(f"{key} must be {center} and a radius above 0, in meters; got {show(value)}")
    _check_near(max(map(abs, numbers)), key)
    if numbers[-1] < validation.SMALLEST_LENGTH:
        raise ProblemError(
            f"{key} must have a radius of at least {validation.SMALLEST_LENGTH:g} m; got {numbers[-1]:g}"
        )
    return numbers


def _check_near(largest: float, key: str) -> None:
    """Raise ProblemError for what lies beyond everything that could be placed."""
    if largest > validation.LARGEST_LENGTH:
        raise ProblemError(f"{key} must lie within {validation.LARGEST_LENGTH:g} meters; got {largest:g}")


def _check_image(value: object, key: str) -> np.ndarray:
    try:
        image = np.asarray(value)
    except FOREIGN_ERRORS:
        image = np.empty(0)
    if image.ndim != 2 or not image.size or image.dtype.kind not in "buif":
        raise ProblemError(f"{key} must be an image of shape [height, width]; got {show(value)}")
    if not np.isfinite(image).all():
        raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity")
    return image.astype(np.float32) >= THRESHOLD


@described
@dataclass(frozen=True, eq=False)
class Obstacle(Settings):
    """Something that bodies keep off: one of a polygon, a disc and an image; of a surface a ball, or an outline that lies on it.

    Raises:
        ProblemError: None or several of the four, or a value that is none.
    """

    polygon: np.ndarray | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "Corners, in either order",
            unit="m",
            more="Shape ``[3 or more, 2]``; where its edges cross, what is inside an odd number of times",
            check=_check_polygon,
        ),
    )
    disc: Sequence[float] | None = field(
        default=None, metadata=setting("Center along x and y, and radius", unit="m", check=_check_disc)
    )
    image: np.ndarray | None = field(
        default=None,
        metadata=setting(
            "An image that is stretched over the domain: an obstacle from half on",
            more="Shape ``[height, width]``, row 0 at the top, of 0..1 or of true and false",
            check=_check_image,
        ),
    )
    margin: float = field(
        default=0.0,
        metadata=setting(
            "How far bodies keep off its edge: their centers, and their whole footprints where overlap is avoided",
            unit="m",
            low=0.0,
            high=validation.LARGEST_LENGTH,
        ),
    )
    ball: Sequence[float] | None = field(
        default=None,
        metadata=setting(
            "Center along x, y and z, and radius; what of a surface lies within it is an obstacle",
            unit="m",
            check=_check_ball,
        ),
    )
    position: np.ndarray | Sequence[float] | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "On a surface, where the origin of the polygon or the disc lies, which lies along the surface there",
            unit="m",
            more="x, y and z, or several such places, shape ``[m, 3]``: the same outline in each. Those that are not on the surface "
            "come to where that is nearest",
            check=_check_places,
        ),
    )
    normal: np.ndarray | Sequence[float] | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "Where the surface looks to there: it says which side of a thin wall is meant",
            more="Shape ``[3]`` or ``[m, 3]``; None: the nearest one",
            check=_check_directions,
        ),
    )
    tangent: np.ndarray | Sequence[float] | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "Where the x axis of the polygon or the disc points there, along the surface",
            more="Shape ``[3]`` or ``[m, 3]``; None: to where bodies of angle 0 point",
            check=_check_directions,
        ),
    )
    scale: float | Sequence[float] | np.ndarray = field(
        default=1.0,
        metadata=setting(
            "Factor on the polygon or the disc there; the margin stays as it is",
            more="One number, or one for every place",
            check=_check_scale,
        ),
    )
    mesh: int | Sequence[int] | np.ndarray = field(
        default=0,
        metadata=setting("Which mesh of the surface `triangle` is of", check=_check_whole),
    )
    triangle: int | Sequence[int] | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Triangle of this mesh that a place is on, where it is known: it says exactly where that is",
            more="One, or one for every place; None: the nearest one",
            check=_check_whole,
        ),
    )

    def __post_init__(self) -> None:
        given = [name for name in ("polygon", "disc", "image", "ball") if getattr(self, name) is not None]
        if len(given) != 1:
            got = " and ".join(f"`{name}`" for name in given) or "none of them"
            raise ProblemError(f"an obstacle must have one of `polygon`, `disc`, `image` and `ball`; got {got}")
        super().__post_init__()
        self._check_lying()

    def _check_lying(self) -> None:
        """Bring what is said of places on a surface to one value for each."""
        lying = {name: getattr(self, name) for name in ("normal", "tangent", "triangle")}
        if self.position is None:
            said = [name for name, value in lying.items() if value is not None]
            if said:
                raise ProblemError(f"{self._key(said[0])} must come with `position`; got no position")
            settle(self, scale=float(np.asarray(self.scale)[0]), mesh=int(np.asarray(self.mesh)[0]))
            if self.scale != 1.0:
                raise ProblemError(f"{self._key('scale')} must come with `position`; got no position")
            return
        if self.polygon is None and self.disc is None:
            raise ProblemError(f"{self._key('position')} must come with a `polygon` or a `disc`; got neither")
        m = len(np.asarray(self.position))
        for name, value in {**lying, "scale": self.scale, "mesh": self.mesh}.items():
            if value is None:
                continue
            values = np.asarray(value)
            if len(values) not in (1, m):
                raise ProblemError(
                    f"{self._key(name)} must be one, or one for each of {m} places; got {len(values)} of them"
                )
            settle(self, **{name: np.broadcast_to(values, (m, *values.shape[1:]))})
        if self.normal is not None and self.tangent is not None:
            across = np.linalg.norm(np.cross(np.asarray(self.normal), np.asarray(self.tangent)), axis=1)
            if not (across > SMALLEST_SINE).all():
                worst = int(np.argmin(across))
                raise ProblemError(
                    f"{self._key('tangent')} must point along the surface, not along `obstacle.normal`; got "
                    f"{show(np.asarray(self.tangent)[worst].tolist())} for place {worst}"
                )

    def _key(self, name: str) -> str:
        return f"`obstacle.{name}`"

    @cached_property
    def outline(self) -> Footprint | None:
        """The ground that bodies keep off, with the margin, as an outline about the origin; None where it is not known to be convex.

        Of a polygon with more corners than a footprint may have it is one around it, which is a little larger.
        """
        if self.disc is not None:
            x, y, radius = self.disc
            return Footprint(np.array([[x, y]]), radius + self.margin)
        return self._polygon_outline(self.margin)

    def _polygon_outline(self, margin: float) -> Footprint | None:
        """The polygon, and so much around it, where it is known to be convex."""
        if self.polygon is None:
            return None
        corners = np.asarray(self.polygon)
        area = _area(corners)
        try:
            if len(corners) <= MOST_CORNERS:
                return Footprint(corners if area > 0.0 else corners[::-1], margin)
        except ProblemError:
            # Some of the corners may lie on edges.
            pass
        hull = convex_hull(corners)
        if len(hull) < 3 or _area(hull) - abs(area) > NOT_CONVEX * _area(hull):
            return None
        try:
            return Footprint(enclosing_polygon(hull, MOST_CORNERS), margin)
        except ProblemError:
            # Too thin, or too large, for an outline.
            return None

    @cached_property
    def pieces(self) -> tuple[Footprint, ...]:
        """That ground in convex pieces, of many-cornered polygons trapezoids; none of images, balls, and what has no inside."""
        return self._pieces(self.outline, self.margin)

    @cached_property
    def cores(self) -> tuple[Footprint, ...]:
        """The same without the margin; of polygons that are convex, with however many corners, one outline."""
        if self.disc is not None:
            return (Footprint(np.array([self.disc[:2]]), self.disc[2]),)
        outline = self._polygon_outline(0.0)
        if outline is not None:
            return (outline,)
        pieces = self._pieces(None, 0.0)
        if not pieces and self.polygon is not None and self.margin > 0.0:
            # What has no inside keeps its margin off all the same.
            return (Footprint.polygon(self.polygon, THINNEST * self.margin),)
        return pieces

    def _pieces(self, outline: Footprint | None, margin: float) -> tuple[Footprint, ...]:
        if outline is not None and (self.polygon is None or len(self.polygon) <= MOST_CORNERS):
            return (outline,)
        found = []
        for corners in () if self.polygon is None else convex_pieces(np.asarray(self.polygon), MOST_CORNERS):
            # Those without an inside take no ground.
            with contextlib.suppress(ProblemError):
                found.append(Footprint.polygon(corners, margin))
        return tuple(found)


def _area(corners: np.ndarray) -> float:
    """Area of a polygon, above 0 where its corners are counter-clockwise."""
    x, y = (corners - corners[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
