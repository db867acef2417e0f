"""The rules that values of a problem must keep, one function per kind of value.

Each takes the name that the value has for whoever wrote it (a field of :mod:`.problem`, a key of a recipe), so that every front
end names the value in its own words and none repeats the rules.
The paper, whose symbols are named, is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import itertools
import math
import numbers
from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from .given_values import FOREIGN_ERRORS, as_float, as_reals, is_real, perhaps_meant, show

Boundary = Literal["open", "mirror", "natural", "periodic"]
BOUNDARIES: tuple[Boundary, ...] = ("open", "mirror", "natural", "periodic")
DISTRIBUTIONS: tuple[str, ...] = ("linear", "uniform")

# Beyond these, squares and ratios of lengths leave the range of float32.
SMALLEST_LENGTH = 1e-9
LARGEST_LENGTH = 1e12
MOST_ELONGATED = 10_000
# A periodic mesh is as fine as neighbors across the shorter side need, and holds so many nodes along the longer one.
MOST_ELONGATED_PERIODIC = 3_000
# What combinations of values may do. Charges are added in units of 2^-32 of the mean one; forces and their sums are float32.
MOST_AREA_RATIO = 1e8
MOST_EMPHASIS = 1e15
MOST_MIDDLE_CHARGE = 1e6
# Of a body over the shorter side of a periodic domain, whose bodies meet their own images, and over the longer side of an open one.
MOST_PERIODS = 16
MOST_EXTENT = 10_000_000
# Of a line over the longer side of its domain.
SHORTEST_LINE = 1e-7
# Angles beyond this have lost their fraction of a turn in float32.
LARGEST_ANGLE = 1e4
# Bodies are numbered by signed 32-bit integers.
MOST_BODIES = 2**31 - 1
# Factors on footprints for keeping apart.
SMALLEST_ROOM, LARGEST_ROOM = 0.01, 100.0
# The footprints of bodies that push each other apart, over the domain: a hundred times what could ever fit.
MOST_COVERED = 100.0
# Charges of one line body: the stretch and turn of a body are sums over them.
MOST_CHARGES_ON_A_LINE = 64
# Shares written with few digits (0.111, 0.222, 0.667) are meant to add up.
SHARE_TOLERANCE = 2e-3


def out_of_range(*sides: float) -> Refusal:
    """Return what to refuse a domain or a surface with whose sides are too long or too short [m]."""
    if max(sides) > LARGEST_LENGTH:
        return Refusal(Reason.DOMAIN_OUT_OF_RANGE, max(sides), LARGEST_LENGTH)
    return Refusal(Reason.DOMAIN_OUT_OF_RANGE, min(sides), SMALLEST_LENGTH)


def check_domain_size(value: object, key: str = "`domain.size`") -> tuple[float, float]:
    """Return the two lengths [m]; raise ProblemError unless both are usable and less than 10,000 times each other."""
    entries = (
        tuple(value) if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0) else ()
    )
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two lengths in meters, x and y; got {show(value)}")
    width, height = (_positive(entry, key, " in meters") for entry in entries)
    if not all(SMALLEST_LENGTH <= length <= LARGEST_LENGTH for length in (width, height)):
        raise ProblemError(
            f"{key} must lie between {SMALLEST_LENGTH:g} and {LARGEST_LENGTH:g} meters; got {show(value)}",
            out_of_range(width, height),
        )
    if max(width, height) > MOST_ELONGATED * min(width, height):
        raise ProblemError(
            f"{key} must not be more than {MOST_ELONGATED:,} times longer than wide; got {show(value)}",
            Refusal(Reason.DOMAIN_TOO_NARROW, max(width, height), min(width, height)),
        )
    return width, height


def check_boundary(value: object, key: str = "`domain.boundary`") -> Boundary:
    """Return the boundary; raise ProblemError unless it is one of ``BOUNDARIES``."""
    if not isinstance(value, str) or value not in BOUNDARIES:
        raise ProblemError(f"{key} must be {_either(BOUNDARIES)}; got {show(value)}{perhaps_meant(value, BOUNDARIES)}")
    return BOUNDARIES[BOUNDARIES.index(value)]


def check_period(size: tuple[float, float], boundary: Boundary, key: str = "`domain.size`") -> None:
    """Raise ProblemError where a domain that goes on beyond its edges is longer than its mesh can be."""
    if boundary in ("periodic", "mirror") and max(size) > MOST_ELONGATED_PERIODIC * min(size):
        raise ProblemError(
            f'{key} must not be more than {MOST_ELONGATED_PERIODIC:,} times longer than wide where the boundary is "{boundary}"; got '
            f"{show(size)}"
        )


def check_class_separation(value: object, key: str = "`balance.class_separation`") -> float:
    """Return the paper's alpha; raise ProblemError unless it is within 0..1."""
    number = as_float(value)
    if number is None or not 0.0 <= number <= 1.0:
        raise ProblemError(
            f"{key} must be a number between 0 (each class by itself) and 1 (only the union); got {show(value)}"
        )
    return number


def check_size_emphasis(value: object, key: str = "`balance.size_emphasis`") -> float | tuple[float, ...]:
    """Return the paper's C, or its list C_1, C_2, ...; raise ProblemError unless all are 1 or more and none falls."""
    listed = value.tolist() if isinstance(value, np.ndarray) and value.ndim == 1 else value
    if isinstance(listed, (list, tuple)):
        factors = tuple(_emphasis(entry, key, value) for entry in listed)
        if not factors:
            raise ProblemError(f"{key} must be a number or a list of at least one; got an empty list")
        for before, after in itertools.pairwise(factors):
            if after < before:
                # Of [[before, after], [after, after]], what the two larger sizes would see of each other.
                middle, half = 0.5 * (before + after), 0.5 * (before - after)
                smallest = middle - math.hypot(half, before)
                raise ProblemError(
                    f"{key} must not fall from one size to the next larger one; lower {before:g} to {after:g} or less, because "
                    f"with {after:g} after it the interaction matrix has the eigenvalue {smallest:.3g}"
                )
        return factors
    return _emphasis(value, key, value)


def _emphasis(entry: object, key: str, shown: object) -> float:
    number = as_float(entry)
    if number is None or not 1.0 <= number < math.inf:
        raise ProblemError(f"{key} must be a number of 1 or more, and finite, or a list of such; got {show(shown)}")
    return number


def check_non_overlap(value: object, key: str = "`balance.non_overlap`") -> np.ndarray | None:
    """Return the matrix, float64; raise ProblemError unless it is square, symmetric, within 0..1 and 1 on its diagonal."""
    if value is None:
        return None
    try:
        matrix = as_reals(value)
    except FOREIGN_ERRORS:
        matrix = np.empty(0)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise ProblemError(f"{key} must be a square matrix of numbers, one row per class; got {show(value)}")
    if not (np.isfinite(matrix).all() and (matrix >= 0.0).all() and (matrix <= 1.0).all()):
        raise ProblemError(
            f"{key} must hold numbers between 0 (the two ignore each other) and 1 (they make room); got {show(value)}"
        )
    uneven = np.argwhere(matrix != matrix.T)
    if len(uneven):
        i, j = uneven[0]
        raise ProblemError(
            f"{key} must be symmetric; row {i + 1}, column {j + 1} is {matrix[i, j]:g}, the other way round {matrix[j, i]:g}"
        )
    if not (np.diag(matrix) == 1.0).all():
        raise ProblemError(
            f"{key} must be 1 on its diagonal: every class makes room for itself; got {show(np.diag(matrix).tolist())}"
        )
    return matrix


def check_class_matrix(matrix: np.ndarray, class_separation: float, key: str) -> None:
    """Raise ProblemError unless (1 - class_separation) identity + class_separation matrix has no negative eigenvalue."""
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    eigenvalue = 1.0 - class_separation + class_separation * smallest
    if eigenvalue < -1e-9:
        most = math.floor(1e3 / (1.0 - smallest)) / 1e3
        raise ProblemError(
            f"{key} cannot be combined with `class_separation` {class_separation:g}, because their interaction matrix would have the "
            f"eigenvalue {eigenvalue:.3g}, which is below 0; lower `class_separation` to {most:g} or less",
            Refusal(Reason.MIXED_TOO_MUCH, class_separation, most),
        )


def check_name(value: object, key: str) -> str:
    """Return the name; raise ProblemError unless it can be shown on one line and written to any file."""
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be text, and not empty; got {show(value)}")
    # Line breaks would tear reports apart, and lone surrogates cannot be written as UTF-8.
    if not value.isprintable():
        raise ProblemError(f"{key} must be text on one line, without control characters; got {show(value)}")
    return str(value)


def check_area(value: object, key: str) -> float:
    """Return the footprint [m²]; raise ProblemError unless it is above 0 and no larger than any domain."""
    area = _positive(value, key, " in m²")
    if not SMALLEST_LENGTH**2 <= area <= LARGEST_LENGTH**2:
        raise ProblemError(
            f"{key} must be a number in m² between {SMALLEST_LENGTH**2:g} and {LARGEST_LENGTH**2:g}; got {show(value)}"
        )
    return area


def check_area_or_range(value: object, key: str) -> float | tuple[float, float]:
    """Return one footprint [m²], or the smallest and largest of a range of them."""
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1):
        if len(value) != 2:
            raise ProblemError(f"{key} must be one area in m², or a range of two, smallest first; got {show(value)}")
        low, high = (check_area(entry, key) for entry in value)
        if low > high:
            raise ProblemError(f"{key} must be a range with its smallest area first; got {show(value)}")
        return low, high
    return check_area(value, key)


def check_distribution(value: object, key: str) -> str | np.ndarray:
    """Return how areas spread over a range: a word of ``DISTRIBUTIONS``, or one area per body, float64."""
    if isinstance(value, str) and value in DISTRIBUTIONS:
        return value
    try:
        areas = None if isinstance(value, (str, bytes)) else as_reals(value)
    except FOREIGN_ERRORS:
        areas = None
    if areas is None or areas.ndim != 1 or not len(areas) or not np.isfinite(areas).all():
        raise ProblemError(f"{key} must be {_either(DISTRIBUTIONS)}, or a list of one area per body; got {show(value)}")
    return areas


def check_share(value: object, key: str) -> float:
    """Return a share of a class's charge; raise ProblemError unless it is above 0 and at most 1."""
    number = as_float(value)
    if number is None or not 0.0 < number <= 1.0:
        raise ProblemError(f"{key} must be a number above 0 and at most 1; got {show(value)}")
    return number


def check_class_count(value: object, key: str) -> int | str | None:
    """Return the count of a whole class: a whole number of at least 1, ``"cover"``, or None."""
    if value is None or (isinstance(value, str) and value == "cover"):
        return value
    if isinstance(value, str):
        raise ProblemError(f'{key} must be a whole number of at least 1, or "cover"; got {show(value)}')
    return check_count(value, key)


def check_switch(value: object, key: str) -> bool:
    """Return a truth value; numbers and texts are none."""
    if not isinstance(value, (bool, np.bool_)):
        raise ProblemError(f"{key} must be true or false; got {show(value)}")
    return bool(value)


def check_fraction(value: object, key: str) -> float:
    """Return a number within 0..1."""
    number = as_float(value)
    if number is None or not 0.0 <= number <= 1.0:
        raise ProblemError(f"{key} must be a number between 0 and 1; got {show(value)}")
    return number


def check_at_least_zero(value: object, key: str) -> float:
    """Return a finite number of 0 or more."""
    number = as_float(value)
    if number is None or not 0.0 <= number < math.inf:
        raise ProblemError(f"{key} must be a number of 0 or more, and finite; got {show(value)}")
    return number


def check_length(value: object, key: str) -> float:
    """Return a length [m] above 0."""
    length = _positive(value, key, " in meters")
    if not SMALLEST_LENGTH <= length <= LARGEST_LENGTH:
        raise ProblemError(
            f"{key} must lie between {SMALLEST_LENGTH:g} and {LARGEST_LENGTH:g} meters; got {show(value)}"
        )
    return length


def check_line_length(value: object, key: str) -> float | np.ndarray:
    """Return a preferred length [m], or an image of them, float32, shape ``[height, width]``."""
    if is_real(value):
        return check_length(value, key)
    image = _image(value, key, "a length in meters, or an image of them", (2,))
    smallest, largest = float(image.min()), float(image.max())
    if smallest <= 0.0:
        raise ProblemError(f"{key} must be above 0 everywhere; its smallest value is {smallest:g}")
    if smallest < 0.999 * SMALLEST_LENGTH or largest > LARGEST_LENGTH:
        raise ProblemError(
            f"{key} must lie between {SMALLEST_LENGTH:g} and {LARGEST_LENGTH:g} meters everywhere; got {smallest:g} to {largest:g}"
        )
    return image


def check_direction(value: object, key: str) -> str | float | np.ndarray:
    """Return a preferred direction: ``"density"``, ``"none"``, an angle [rad], an image of angles or of vectors, float32."""
    accepted = '"density", "none", an angle in radians, or an image of angles or of vectors'
    if isinstance(value, str):
        if value not in ("density", "none"):
            raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
        return value
    number = as_float(value)
    if number is not None:
        if not math.isfinite(number):
            raise ProblemError(f"{key} must be finite; got {show(value)}")
        if abs(number) > LARGEST_ANGLE:
            raise ProblemError(
                f"{key} must be an angle between {-LARGEST_ANGLE:g} and {LARGEST_ANGLE:g} radians; got {show(value)}"
            )
        return number
    image = _image(value, key, accepted, (2, 3))
    if image.ndim == 2 and not np.abs(image).max() <= LARGEST_ANGLE:
        raise ProblemError(
            f"{key} must hold angles between {-LARGEST_ANGLE:g} and {LARGEST_ANGLE:g} radians everywhere"
        )
    if image.ndim == 3 and image.shape[2] != 2:
        raise ProblemError(
            f"{key} must have shape [height, width] or [height, width, 2]; got shape {list(image.shape)}"
        )
    if image.ndim == 3 and not image.any():
        raise ProblemError(f"{key} must have a direction somewhere; all its vectors are 0")
    return image


def check_middle_charge(value: object, key: str) -> float:
    """Return the charge of a line's middle over that of its ends; raise ProblemError unless float32 holds both."""
    number = _positive(value, key, "")
    if not 1.0 / MOST_MIDDLE_CHARGE <= number <= MOST_MIDDLE_CHARGE:
        raise ProblemError(
            f"{key} must lie between {1.0 / MOST_MIDDLE_CHARGE:g} and {MOST_MIDDLE_CHARGE:g}; got {show(value)}"
        )
    return number


def check_scales(value: object, key: str) -> tuple[float, float]:
    """Return two standard deviations above 0."""
    entries = _entries(value)
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two standard deviations in pixels; got {show(value)}")
    inner, outer = (check_positive(entry, key) for entry in entries)
    return inner, outer


def _entries(value: object) -> tuple[object, ...]:
    """What a list holds; nothing where the value is none. An array of no dimensions cannot be gone through."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return ()
    return tuple(value) if isinstance(value, (list, tuple, np.ndarray)) else ()


def check_weights(value: object, key: str) -> tuple[float, float]:
    """Return two weights of 0 or more whose sum is at most 1."""
    entries = _entries(value)
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two weights, of the forces and of what is preferred; got {show(value)}")
    forces, preferred = (check_fraction(entry, key) for entry in entries)
    if forces + preferred > 1.0 + 1e-9:
        raise ProblemError(f"{key} must not add up to more than 1, or lines overshoot; got {show(value)}")
    return forces, preferred


def check_charges(value: object, key: str) -> int:
    """Return the number of charges on a line, at least 2."""
    if is_real(value) and 2 <= value <= MOST_CHARGES_ON_A_LINE and value == int(value):  # type: ignore[operator, call-overload]
        return int(value)  # type: ignore[call-overload]
    raise ProblemError(f"{key} must be a whole number from 2 to {MOST_CHARGES_ON_A_LINE}; got {show(value)}")


def check_positive(value: object, key: str) -> float:
    """Return a finite number above 0."""
    return _positive(value, key, "")


def _image(value: object, key: str, accepted: str, dimensions: tuple[int, ...]) -> np.ndarray:
    try:
        image = None if isinstance(value, (str, bytes, bool)) or value is None else np.asarray(value)
    except FOREIGN_ERRORS:
        image = None
    if image is None or image.dtype.kind not in "uif" or image.ndim not in dimensions or not image.size:
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    with np.errstate(over="ignore"):
        image = image.astype(np.float32)
    if not np.isfinite(image).all():
        raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity, or values beyond float32")
    return image


def check_count(value: object, key: str) -> int:
    """Return the count; raise ProblemError unless it is a whole number of at least 1 (120.0 is, ``True`` is not)."""
    if is_real(value) and value >= 1 and value < math.inf and value == int(value):  # type: ignore[operator, call-overload]
        return int(value)  # type: ignore[call-overload]
    raise ProblemError(f"{key} must be a whole number of at least 1; got {show(value)}")


def check_size_count(value: object, key: str) -> int:
    """Return the count of a size: 0 is one where bodies of it are fixed, which only the whole problem tells."""
    return 0 if is_real(value) and value == 0 else check_count(value, key)


def check_seed(value: object, key: str = "`seed`") -> int:
    """Return the seed; raise ProblemError unless it is a whole number that fits 63 bits."""
    if isinstance(value, numbers.Integral) and is_real(value) and 0 <= int(value) < 2**63:
        return int(value)
    raise ProblemError(f"{key} must be a whole number of at least 0 and below 2**63; got {show(value)}")


def check_density(value: object, key: str, *, empty: bool = False) -> np.ndarray:
    """Return a new float32 array of shape ``[height, width]``; raise ProblemError if it means no density.

    It may be 0 everywhere where it is but a part of one (``empty``).
    """
    if isinstance(value, (str, bytes, bool, np.bool_)) or value is None:
        raise ProblemError(f"{key} must be an image (an array of numbers) or a number; got {show(value)}")
    try:
        # What is masked, as readers of maps mask where there are no data, has nobody.
        given = np.asarray(value.filled(0) if isinstance(value, np.ma.MaskedArray) else value)
    except FOREIGN_ERRORS:
        raise ProblemError(f"{key} must be an image (an array of numbers) or a number; got {show(value)}") from None
    if given.dtype.kind not in "buif":
        raise ProblemError(f"{key} must be an image (an array of numbers) or a number; got {show(value)}")
    if given.ndim == 0:
        given = given.reshape(1, 1)
    if given.ndim != 2 or given.size == 0:
        raise ProblemError(f"{key} must have shape [height, width], neither of them 0; got shape {list(given.shape)}")
    if not np.isfinite(given).all():
        raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity")
    smallest, largest = given.min(), given.max()
    if smallest < 0:
        raise ProblemError(f"{key} must be 0 or more everywhere; its smallest value is {smallest:g}")
    if largest <= 0:
        if empty:
            return np.zeros(given.shape, np.float32)
        raise ProblemError(f"{key} must be above 0 somewhere; it is 0 everywhere")
    # Only ratios matter: values that float32, or a sum of them, cannot hold are brought into its range.
    if not 1e-20 < float(largest) < 1e20:
        given = given.astype(np.longdouble) / largest.astype(np.longdouble)
    return given.astype(np.float32, order="C")


def _positive(value: object, key: str, unit: str) -> float:
    number = as_float(value)
    if number is None or not 0.0 < number < math.inf:
        raise ProblemError(f"{key} must be a number{unit} above 0, and finite; got {show(value)}")
    return number


def check_colors(colors: object, count: int) -> list[tuple[float, float, float]]:
    """Return red, green and blue of so many classes; raise ProblemError for what are no colors, or too few."""
    try:
        listed = [tuple(float(value) for value in color[:3]) for color in colors]  # type: ignore[attr-defined]
    except FOREIGN_ERRORS:
        raise ProblemError(f"`colors` must be a list of red, green and blue, each 0..1; got {show(colors)}") from None
    if len(listed) < count:
        raise ProblemError(f"`colors` must hold one color per class, {count}; got {len(listed)}")
    for color in listed:
        if len(color) != 3 or not all(0.0 <= value <= 1.0 for value in color):
            raise ProblemError(f"`colors` must be red, green and blue, each 0..1; got {show(color)}")
    return listed[:count]  # type: ignore[return-value]


def _either(choices: Sequence[str]) -> str:
    return " or ".join(f'"{choice}"' for choice in choices)
