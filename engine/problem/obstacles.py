"""Obstacles: where no body may be, and what they leave of densities.

All of it happens on pixels a fraction of the bodies' spacing wide. What attracts bodies ends smoothly within a pixel of an obstacle's
edge, and so holds as much as is asked beside it. Where bodies may be ends before that pixel: no body ever stands on an obstacle.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from weakref import WeakKeyDictionary

import numpy as np

from ..errors import ProblemError
from . import validation
from .convex_polygon import convex_hull, enclosing_polygon
from .domain import Domain
from .footprint import MOST_CORNERS, Footprint
from .settings import Settings, described, setting, settle
from .validation import show

__all__ = ["Obstacle", "clearance", "distance_to", "mask_shape"]

# Pixels over the mean spacing of bodies, and along the longer side of the domain at least and at most.
PIXELS_PER_SPACING = 5.0
FEWEST_PIXELS = 384
MOST_PIXELS = 4096
# Rows of an image that are looked at together.
ROWS = 32
# Images of distances that are kept of an obstacle: one problem asks for two, and other counts may ask for other numbers of pixels.
MOST_KNOWN = 3
# From this value on an obstacle's image is one.
THRESHOLD = 0.5
# A polygon is convex where it lacks no larger share of its hull.
NOT_CONVEX = 1e-6
# Corners this close, as a share of a polygon's extent, are one, and what bends by less is straight.
SAME_CORNER = 1e-9
# How thick a polygon without an inside is taken for where its margin is kept, as a share of that.
THINNEST = 1e-3
# Sine of the angle between a tangent and a normal at least: below this it does not say where along the surface an outline points.
SMALLEST_SINE = 1e-6
# Edges times pixels of a polygon that are looked at together.
MOST_AT_ONCE = 1 << 18
# Edges of a polygon that is looked at for crossings.
MOST_EDGES_THAT_CROSS = 1000


def _check_polygon(value: object, key: str) -> np.ndarray:
    """Return the corners, float64, shape ``[n, 2]``; raise ProblemError unless there are three or more."""
    try:
        corners = validation.as_reals(value)
    except validation.FOREIGN_ERRORS:
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
        vectors = np.atleast_2d(validation.as_reals(value))
    except validation.FOREIGN_ERRORS:
        vectors = np.empty(0)
    if vectors.ndim != 2 or vectors.shape[1:] != (3,) or not len(vectors) or not np.isfinite(vectors).all():
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    return vectors


def _check_scale(value: object, key: str) -> np.ndarray:
    try:
        factors = np.atleast_1d(validation.as_reals(value))
    except validation.FOREIGN_ERRORS:
        factors = np.empty(0)
    if factors.ndim != 1 or not len(factors) or not ((factors > 0.0) & np.isfinite(factors)).all():
        raise ProblemError(f"{key} must be a number above 0, or a list of such; got {show(value)}")
    return factors


def _check_whole(value: object, key: str) -> np.ndarray:
    try:
        given = np.atleast_1d(np.asarray(value))
    except validation.FOREIGN_ERRORS:
        given = np.empty(0)
    if given.ndim != 1 or not len(given) or given.dtype.kind not in "ui" or given.min() < -1:
        raise ProblemError(f"{key} must be a whole number of 0 or more, or a list of such; got {show(value)}")
    return given.astype(np.int64)


def _center_and_radius(value: object, key: str, center: str) -> tuple[float, ...]:
    """Return the coordinates of a center, named as messages name them, and a radius above 0."""
    listed = isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1)
    entries = [validation.as_float(entry) for entry in value] if listed else []  # type: ignore[attr-defined]
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
    except validation.FOREIGN_ERRORS:
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
        for corners in () if self.polygon is None else _convex_pieces(np.asarray(self.polygon)):
            # Those without an inside take no ground.
            with contextlib.suppress(ProblemError):
                found.append(Footprint.polygon(corners, margin))
        return tuple(found)


def mask_shape(obstacles: Sequence[Obstacle], domain: Domain, shape: tuple[int, int], count: int) -> tuple[int, int]:
    """Pixels for a density of ``shape`` that obstacles are cut out of: each of its own is divided into whole ones.

    Args:
        obstacles: The obstacles.
        domain: Where.
        shape: Height and width of the density's image.
        count: Bodies that are to follow it.
    """
    longer = max(domain.size)
    wanted = PIXELS_PER_SPACING * longer / math.sqrt(domain.area / max(count, 1))
    pixel = longer / min(max(wanted, FEWEST_PIXELS), MOST_PIXELS)
    result = []
    for axis, (pixels, length) in enumerate(zip(shape, domain.size[::-1], strict=True)):
        of_images = [obstacle.image.shape[axis] for obstacle in obstacles if obstacle.image is not None]
        fine = max([math.ceil(length / pixel), *(min(n, MOST_PIXELS) for n in of_images)])
        result.append(pixels * math.ceil(fine / pixels))
    return result[0], result[1]


def _convex_pieces(corners: np.ndarray) -> Iterator[np.ndarray]:
    """Cut a polygon, whose edges may cross, into convex pieces of at most ``MOST_CORNERS`` corners each."""
    close = SAME_CORNER * float(np.ptp(corners, axis=0).max())
    growing: list[tuple[list[np.ndarray], list[np.ndarray]]] = []
    for slab in _slabs(corners):
        for left, right in growing:
            # What ends where this one begins may go on in it.
            met = max(np.abs(left[-1] - slab[0]).max(), np.abs(right[-1] - slab[1]).max()) <= close
            if met and _goes_on(left, right, slab, close):
                break
        else:
            growing.append(([slab[0], slab[3]], [slab[1], slab[2]]))
    for left, right in growing:
        yield np.array([*right, *reversed(left)])


def _goes_on(left: list[np.ndarray], right: list[np.ndarray], slab: np.ndarray, close: float) -> bool:
    """Whether a convex piece stays one when a trapezoid is set on it; if so it is. Its sides are given from bottom to top."""
    bends = [_bend(side, end) for side, end in ((left, slab[3]), (right, slab[2]))]
    # To the right on the left side, and to the left on the right one.
    if bends[0] > close or bends[1] < -close:
        return False
    straight = [abs(bend) <= close for bend in bends]
    if len(left) + len(right) + 2 - sum(straight) > MOST_CORNERS:
        return False
    for side, end, on_line in zip((left, right), (slab[3], slab[2]), straight, strict=True):
        if on_line:
            side.pop()
        side.append(end)
    return True


def _bend(side: list[np.ndarray], end: np.ndarray) -> float:
    """How far a side of a piece, from bottom to top, bends to the left where it goes on to ``end`` [m]."""
    last, onwards = side[-1] - side[-2], end - side[-2]
    return float(last[0] * onwards[1] - last[1] * onwards[0]) / max(float(np.hypot(*onwards)), 1e-300)


def _slabs(corners: np.ndarray) -> Iterator[np.ndarray]:
    """Cut a polygon, whose edges may cross, into trapezoids between horizontal lines: corners of shape ``[4, 2]``."""
    start, end = corners, np.roll(corners, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    lines = np.unique(np.concatenate([corners[:, 1], _heights_of_crossings(start, end - start)]))
    slope = (end[:, 0] - start[:, 0]) / np.where(high > low, end[:, 1] - start[:, 1], 1.0)
    for below, above in pairwise(lines.tolist()):
        middle = 0.5 * (below + above)
        own = np.flatnonzero((low <= middle) & (middle < high))
        own = own[np.argsort(start[own, 0] + slope[own] * (middle - start[own, 1]), kind="stable")]
        at = np.array([start[own, 0] + slope[own] * (y - start[own, 1]) for y in (below, above)]).T
        # What is inside an odd number of times lies between the first and the second edge, the third and the fourth, and so on.
        for left, right in zip(at[::2], at[1::2], strict=False):
            yield np.array([[left[0], below], [right[0], below], [right[1], above], [left[1], above]])


def _heights_of_crossings(start: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Where edges cross, along y; of more edges than these nobody asks."""
    if len(edge) > MOST_EDGES_THAT_CROSS:
        return np.empty(0)
    between = start[None] - start[:, None]
    cross = edge[:, None, 0] * edge[None, :, 1] - edge[:, None, 1] * edge[None, :, 0]
    parted = np.where(cross == 0.0, np.nan, cross)
    along = (between[..., 0] * edge[None, :, 1] - between[..., 1] * edge[None, :, 0]) / parted
    other = (between[..., 0] * edge[:, None, 1] - between[..., 1] * edge[:, None, 0]) / parted
    met = (along > 0.0) & (along < 1.0) & (other > 0.0) & (other < 1.0)
    one = np.nonzero(met)[0]
    return start[one, 1] + along[met] * edge[one, 1]


def _area(corners: np.ndarray) -> float:
    """Area of a polygon, above 0 where its corners are counter-clockwise."""
    x, y = (corners - corners[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def clearance(obstacles: Sequence[Obstacle], domain: Domain, shape: tuple[int, int], reach: float) -> np.ndarray:
    """How far every pixel's center is from the nearest obstacle with its margin [m].

    Args:
        obstacles: The obstacles.
        domain: Where; obstacles in a periodic one go on at the other side.
        shape: Rows and columns of pixels over the domain, row 0 at the top.
        reach: Nobody asks for more than this [m].

    Returns:
        Shape ``shape``, float32: below 0 within an obstacle or its margin, and at most ``reach``.
    """
    result = np.full(shape, reach, np.float32)
    for obstacle in obstacles:
        if obstacle.image is not None:
            np.minimum(
                result,
                _from_image(obstacle, domain, shape, reach + obstacle.margin) - np.float32(obstacle.margin),
                out=result,
            )
            continue
        for shift in _shifts(domain):
            _cut_shape(result, obstacle, shift, domain, reach)
    return result


def distance_to(
    mask: np.ndarray, pixel: tuple[float, float], reach: float, periodic: bool, *, squares: bool = False
) -> np.ndarray:
    """Distance of every pixel's center from that of the nearest one in ``mask``, exact up to ``reach``, which is the most.

    Args:
        mask: Shape ``[height, width]``, bool.
        pixel: Width and height of a pixel.
        reach: Largest distance of interest.
        periodic: Whether the image wraps.
        squares: Whether it is the distance from the nearest pixel as a whole, which is 0 in it.
    """
    half = 0.5 if squares else 0.0
    rows, columns = (min(math.ceil(reach / side), n) for side, n in zip(pixel[::-1], mask.shape, strict=True))
    large = np.float32(np.float32(2.0 * reach + 1.0) ** 2)
    # First up and down, then across: the square of the distance is a sum.
    padded = np.pad(mask, ((rows, rows), (0, 0)), mode="wrap") if periodic else mask
    steps = _steps_to(padded, rows + 1)
    if periodic:
        steps = steps[rows : rows + mask.shape[0]]
    up = np.maximum(np.arange(rows + 1) - half, 0.0) * pixel[1]
    squared = np.append((up**2).astype(np.float32), large)[steps]
    across = (np.maximum(np.arange(columns + 1) - half, 0.0) * pixel[0]) ** 2
    # A few rows at a time, which stay in the processor's cache.
    for first in range(0, len(squared), ROWS):
        nearest = squared[first : first + ROWS]
        known = (nearest < large).any(axis=0)
        if not known.any():
            continue
        beside = ((0, 0), (columns, columns))
        wide = np.pad(nearest, beside, mode="wrap") if periodic else np.pad(nearest, beside, constant_values=large)
        for begin, end in _runs(np.pad(known, columns, mode="wrap" if periodic else "constant"), columns):
            for step in range(-columns, columns + 1):
                there = wide[:, columns + begin + step : columns + end + step]
                np.minimum(nearest[:, begin:end], there + np.float32(across[abs(step)]), out=nearest[:, begin:end])
    return np.minimum(np.sqrt(squared, out=squared), np.float32(reach), out=squared)


def _runs(known: np.ndarray, columns: int) -> list[tuple[int, int]]:
    """First and last columns, and the one behind these, of all that are no farther than so many from a known one.

    ``known`` has as many more on either side, which are those of copies, or unknown.
    """
    at = np.flatnonzero(known) - columns
    begin, end = np.maximum(at - columns, 0), np.minimum(at + columns + 1, len(known) - 2 * columns)
    parted = np.flatnonzero(begin[1:] > end[:-1])
    first, last = begin[np.concatenate([[0], parted + 1])], end[np.concatenate([parted, [len(at) - 1]])]
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _steps_to(mask: np.ndarray, most: int) -> np.ndarray:
    """How many rows away the nearest pixel in ``mask`` of the same column is, and ``most`` where that is more, or there is none."""
    steps = np.where(mask, np.int16(0), np.int16(most))
    # Down, and up again: a row at a time, which is fifteen times as fast as what NumPy accumulates.
    for rows in (steps, steps[::-1]):
        for before, row in pairwise(rows):
            np.minimum(row, before + np.int16(1), out=row)
    return steps


def _shifts(domain: Domain) -> Iterator[tuple[float, float]]:
    copies = (-1, 0, 1) if domain.periodic else (0,)
    for row in copies:
        for column in copies:
            yield column * domain.size[0], row * domain.size[1]


def _window(
    low: np.ndarray, high: np.ndarray, domain: Domain, shape: tuple[int, int]
) -> tuple[slice, slice, np.ndarray, np.ndarray]:
    """Pixels that a box comes upon: rows and columns, x of the columns' centers and y of the rows'."""
    height, width = shape
    pixel_x, pixel_y = domain.size[0] / width, domain.size[1] / height
    left, right = np.clip([math.floor(low[0] / pixel_x), math.ceil(high[0] / pixel_x)], 0, width)
    bottom, top = np.clip([math.floor(low[1] / pixel_y), math.ceil(high[1] / pixel_y)], 0, height)
    rows, columns = slice(height - top, height - bottom), slice(left, right)
    x = (np.arange(left, right) + 0.5) * pixel_x
    y = domain.size[1] - (np.arange(height - top, height - bottom) + 0.5) * pixel_y
    return rows, columns, x.astype(np.float64), y.astype(np.float64)


def _cut_shape(
    result: np.ndarray, obstacle: Obstacle, shift: tuple[float, float], domain: Domain, reach: float
) -> None:
    """Bring the distance from a polygon or a disc, moved by ``shift``, into ``result``."""
    shape = (result.shape[0], result.shape[1])
    most = reach + obstacle.margin
    if obstacle.disc is not None:
        x, y, radius = obstacle.disc
        center = np.array([x, y]) + shift
        rows, columns, xs, ys = _window(center - radius - most, center + radius + most, domain, shape)
        away = np.hypot(xs - center[0], (ys - center[1])[:, None]) - radius - obstacle.margin
        np.minimum(result[rows, columns], away, out=result[rows, columns], casting="same_kind")
        return
    corners = np.asarray(obstacle.polygon) + shift
    rows, columns, xs, ys = _window(corners.min(0) - most, corners.max(0) + most, domain, shape)
    if not (len(xs) and len(ys)):
        return
    near = _all_edges if len(corners) * len(ys) * len(xs) <= MOST_AT_ONCE else _edge_by_edge
    away, inside = near(corners, xs, ys, most)
    np.sqrt(away, out=away)
    np.negative(away, out=away, where=inside)
    away -= obstacle.margin
    np.minimum(result[rows, columns], away, out=result[rows, columns], casting="same_kind")


def _all_edges(corners: np.ndarray, xs: np.ndarray, ys: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Squared distance of pixels from the nearest edge of a polygon, ``most`` squared at most, and whether they are inside.

    Args:
        corners: Of the polygon, shape ``[k, 2]``.
        xs: Of the columns' centers, shape ``[w]``.
        ys: Of the rows' centers, falling, shape ``[h]``.
        most: Distance beyond which nobody asks.

    Returns:
        Both of shape ``[h, w]``.
    """
    start, end = corners[:, :, None, None], np.roll(corners, -1, axis=0)[:, :, None, None]
    edge = end - start
    dx, dy = xs - start[:, 0], ys[:, None] - start[:, 1]
    along = np.clip((dx * edge[:, 0] + dy * edge[:, 1]) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
    squared = ((dx - along * edge[:, 0]) ** 2 + (dy - along * edge[:, 1]) ** 2).min(axis=0)
    rises = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    crossed = (ys[:, None] >= low) & (ys[:, None] < high)
    left = xs < start[:, 0] + dy * edge[:, 0] / rises
    return np.minimum(squared, most**2), np.logical_xor.reduce(crossed & left, axis=0)


def _edge_by_edge(corners: np.ndarray, xs: np.ndarray, ys: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """The same where there are many pixels: of each edge only those near it are looked at."""
    inside = np.zeros((len(ys), len(xs)), bool)
    away = np.full(inside.shape, most**2)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        # The pixels near this edge.
        low, high = np.minimum(a, b) - most, np.maximum(a, b) + most
        i = slice(*np.searchsorted(xs, [low[0], high[0]]))
        j = slice(*(len(ys) - np.searchsorted(ys[::-1], [high[1], low[1]])))
        edge = b - a
        dx, dy = xs[i] - a[0], (ys[j] - a[1])[:, None]
        along = np.clip((dx * edge[0] + dy * edge[1]) / max(float(edge @ edge), 1e-300), 0.0, 1.0)
        squared = (dx - along * edge[0]) ** 2 + (dy - along * edge[1]) ** 2
        np.minimum(away[j, i], squared, out=away[j, i])
        crossed = np.flatnonzero((ys >= min(a[1], b[1])) & (ys < max(a[1], b[1])))
        if len(crossed):
            crossing = a[0] + (ys[crossed] - a[1]) * edge[0] / edge[1]
            inside[crossed] ^= xs < crossing[:, None]
    return away, inside


# How far pixels are from images of obstacles, and up to which reach that is known, by domain and number of pixels: a problem asks more
# than once, and another one after an edit asks the same.
_distances: WeakKeyDictionary[Obstacle, dict[Hashable, tuple[float, np.ndarray]]] = WeakKeyDictionary()


def _from_image(obstacle: Obstacle, domain: Domain, shape: tuple[int, int], reach: float) -> np.ndarray:
    """Distance of every pixel's center from the edge of an image's obstacles, below 0 within them; right up to ``reach`` at least.

    It is kept as long as the obstacle is, and so nobody may write it.
    """
    assert obstacle.image is not None
    pixel = (domain.size[0] / shape[1], domain.size[1] / shape[0])
    reach += max(pixel)
    known = _distances.setdefault(obstacle, {})
    key = domain.size, domain.periodic, shape
    if key not in known or known[key][0] < reach:
        mask = np.ascontiguousarray(_any_of(_any_of(obstacle.image, shape[0]).T, shape[1]).T)
        away = distance_to(mask, pixel, reach, domain.periodic, squares=True)
        # Within them nobody asks how far: half a pixel on their edge, more than that elsewhere.
        away[mask] = np.float32(-min(pixel))
        known.pop(key, None)
        known[key] = reach, away
        if len(known) > MOST_KNOWN:
            known.pop(next(iter(known)))
    return known[key][1]


def _any_of(image: np.ndarray, rows: int) -> np.ndarray:
    """An image of so many rows, bool: where any part of a row is set."""
    own = len(image)
    if rows == own:
        return image
    if rows % own == 0:
        return np.repeat(image, rows // own, axis=0)
    begin = np.arange(rows) * own // rows
    end = -(-(np.arange(rows) + 1) * own // rows)
    before = np.zeros((own + 1, *image.shape[1:]), np.int32)
    np.cumsum(image, axis=0, out=before[1:])
    return before[end] > before[begin]
