"""The problem: which bodies, how many, how large, following which density, in which domain.

Conventions used in the whole engine: metres, square metres and radians; x to the right, y up; the domain is the
rectangle ``[0, size[0]] x [0, size[1]]``. A density image has shape ``[height, width]``, row 0 is its top (largest y),
and it is stretched over the whole domain whatever its resolution or aspect.
"""

from __future__ import annotations

import math
import numbers
import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np

from .errors import ProblemError

__all__ = ["Balance", "BodyClass", "Domain", "Problem", "Size"]

Boundary = Literal["open", "periodic"]
# What the `__array__`, `__iter__` or `__repr__` of somebody else's object may raise.
FOREIGN_ERRORS = (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError)
Kind = TypeVar("Kind")
BOUNDARIES: tuple[str, ...] = ("open", "periodic")


# Beyond these, squares and ratios of lengths leave the range of float32.
SMALLEST_LENGTH = 1e-9
LARGEST_LENGTH = 1e12
MOST_ELONGATED = 10_000


@dataclass(frozen=True)
class Domain:
    """The rectangle in which bodies are placed.

    Args:
        size: Extent along x and y [m].
        boundary: ``"open"`` (bodies stay inside, nothing lies beyond) or ``"periodic"`` (the result can be tiled).

    Raises:
        ProblemError: A size that is not positive and finite, or an unknown boundary.
    """

    size: tuple[float, float]
    boundary: Boundary = "open"

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", check_domain_size(self.size))
        object.__setattr__(self, "boundary", check_boundary(self.boundary))

    @property
    def area(self) -> float:
        """Area of the rectangle [m²]."""
        return self.size[0] * self.size[1]

    @property
    def periodic(self) -> bool:
        """Whether opposite edges are joined."""
        return self.boundary == "periodic"


@dataclass(frozen=True)
class Balance:
    """How the aims of the sampler are weighed against each other.

    Args:
        class_separation: The paper's alpha, 0..1: 0 places every class as if it were alone, 1 spreads only the union.
        size_emphasis: The paper's C >= 1, with C_i = C^i for size rank i: how much more the larger sizes are spread
            evenly among themselves.

    Raises:
        ProblemError: A value outside these ranges.
    """

    class_separation: float = 0.5
    size_emphasis: float = 2.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "class_separation", check_class_separation(self.class_separation))
        object.__setattr__(self, "size_emphasis", check_size_emphasis(self.size_emphasis))


@dataclass(frozen=True)
class Size:
    """One size of a class: so many bodies of this footprint.

    Args:
        name: Unique within its class.
        area: Footprint of one body [m²]; its charge.
        count: Number of bodies; placed exactly.

    Raises:
        ProblemError: An area that is not positive and finite, or a count that is not a whole number >= 1.
    """

    name: str
    area: float
    count: int

    def __post_init__(self) -> None:
        name = check_name(self.name, "`name` of a size")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "area", check_area(self.area, f'`area` of size "{name}"'))
        object.__setattr__(self, "count", check_count(self.count, f'`count` of size "{name}"'))


@dataclass(frozen=True, eq=False)
class BodyClass:
    """One class of bodies (pines; mushrooms) that follows one density.

    Args:
        name: Unique within the problem.
        sizes: At least one :class:`Size`.
        density: Image of shape ``[height, width]``, values >= 0, any scale, any real or boolean dtype; or a number > 0
            for a uniform density. Where it is zero, no body of the class is placed. Kept as a float32 copy.

    Raises:
        ProblemError: A density that is negative, not finite, zero everywhere or not a two-dimensional image; no size;
            two sizes of one name.
    """

    name: str
    sizes: Sequence[Size]
    density: np.ndarray | float = 1.0

    def __post_init__(self) -> None:
        name = check_name(self.name, "`name` of a class")
        where = f'class "{name}"'
        sizes = _as_tuple(self.sizes, Size, f"`sizes` of {where}")
        if not sizes:
            raise ProblemError(f"{where} must have at least one size; got none")
        check_unique([size.name for size in sizes], f"size names of {where}")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "sizes", sizes)
        object.__setattr__(self, "density", check_density(self.density, f"`density` of {where}"))

    @property
    def density_image(self) -> np.ndarray:
        """The density as an array of shape ``[height, width]``, float32 (``[1, 1]`` when it is uniform)."""
        return np.asarray(self.density)

    @property
    def count(self) -> int:
        """Number of bodies in all sizes."""
        return sum(size.count for size in self.sizes)


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that :func:`~esh.engine.relaxation.solve` needs to know.

    Args:
        domain: Where.
        classes: What; at least one :class:`BodyClass`.
        balance: How the aims are weighed.
        seed: The same problem, seed and device give the same bytes.

    Raises:
        ProblemError: No class, two classes of one name, or a seed that is not a whole number >= 0.
    """

    domain: Domain
    classes: Sequence[BodyClass]
    balance: Balance = field(default_factory=Balance)
    seed: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.domain, Domain):
            raise ProblemError(f"`domain` must be a Domain; got {show(self.domain)}")
        if not isinstance(self.balance, Balance):
            raise ProblemError(f"`balance` must be a Balance; got {show(self.balance)}")
        classes = _as_tuple(self.classes, BodyClass, "`classes`")
        if not classes:
            raise ProblemError("a problem must have at least one class; got none")
        check_unique([body_class.name for body_class in classes], "class names")
        object.__setattr__(self, "classes", classes)
        object.__setattr__(self, "seed", check_seed(self.seed))

    @property
    def body_count(self) -> int:
        """Number of bodies of all classes and sizes."""
        return sum(body_class.count for body_class in self.classes)

    def body_indices(self) -> tuple[np.ndarray, np.ndarray]:
        """Class and size index of every body, shapes ``[body_count]``, int32, in class, then size order."""
        groups = [(c, s, size.count) for c, k in enumerate(self.classes) for s, size in enumerate(k.sizes)]
        class_index, size_index, count = np.array(groups, dtype=np.int64).T
        return np.repeat(class_index, count).astype(np.int32), np.repeat(size_index, count).astype(np.int32)

    def body_areas(self) -> np.ndarray:
        """Footprint of every body [m²], shape ``[body_count]``, float64, in the same order."""
        sizes = [size for body_class in self.classes for size in body_class.sizes]
        return np.repeat([size.area for size in sizes], [size.count for size in sizes])


# The checks below are one per kind of value. Each takes the name that the value has for whoever wrote it (a field here,
# a key of a recipe there), so that every front end names the value in its own words and none repeats the rules.


def check_domain_size(value: object, key: str = "`domain.size`") -> tuple[float, float]:
    """Return the two lengths [m]; raise ProblemError unless both are usable and less than 10,000 times each other."""
    entries = (
        tuple(value) if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0) else ()
    )
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two lengths in metres, x and y; got {show(value)}")
    width, height = (_positive(entry, key, " in metres") for entry in entries)
    if not all(SMALLEST_LENGTH <= length <= LARGEST_LENGTH for length in (width, height)):
        raise ProblemError(
            f"{key} must lie between {SMALLEST_LENGTH:g} and {LARGEST_LENGTH:g} metres; got {show(value)}"
        )
    if max(width, height) > MOST_ELONGATED * min(width, height):
        raise ProblemError(f"{key} must not be more than {MOST_ELONGATED:,} times longer than wide; got {show(value)}")
    return width, height


def check_boundary(value: object, key: str = "`domain.boundary`") -> Boundary:
    """Return the boundary; raise ProblemError unless it is one of ``BOUNDARIES``."""
    if not isinstance(value, str) or value not in BOUNDARIES:
        raise ProblemError(f"{key} must be {_either(BOUNDARIES)}; got {show(value)}")
    return "periodic" if value == "periodic" else "open"


def check_class_separation(value: object, key: str = "`balance.class_separation`") -> float:
    """Return the paper's alpha; raise ProblemError unless it is within 0..1."""
    number = _as_float(value)
    if number is None or not 0.0 <= number <= 1.0:
        raise ProblemError(
            f"{key} must be a number between 0 (each class by itself) and 1 (only the union); got {show(value)}"
        )
    return number


def check_size_emphasis(value: object, key: str = "`balance.size_emphasis`") -> float:
    """Return the paper's C; raise ProblemError unless it is 1 or more, and finite."""
    number = _as_float(value)
    if number is None or not 1.0 <= number < math.inf:
        raise ProblemError(f"{key} must be a number of 1 or more, and finite; got {show(value)}")
    return number


def check_name(value: object, key: str) -> str:
    """Return the name; raise ProblemError unless it can be shown on one line and written to any file."""
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be a text that is not empty; got {show(value)}")
    # Line breaks would tear reports apart, and lone surrogates cannot be written as UTF-8.
    if not value.isprintable():
        raise ProblemError(f"{key} must be a text on one line, without control characters; got {show(value)}")
    return str(value)


def check_area(value: object, key: str) -> float:
    """Return the footprint [m²]; raise ProblemError unless it is above 0 and no larger than any domain."""
    area = _positive(value, key, " in m²")
    if not SMALLEST_LENGTH**2 <= area <= LARGEST_LENGTH**2:
        raise ProblemError(
            f"{key} must be a number in m² between {SMALLEST_LENGTH**2:g} and {LARGEST_LENGTH**2:g}; got {show(value)}"
        )
    return area


def check_count(value: object, key: str) -> int:
    """Return the count; raise ProblemError unless it is a whole number of at least 1 (120.0 is, ``True`` is not)."""
    if _is_real(value) and value >= 1 and value < math.inf and value == int(value):  # type: ignore[operator, call-overload]
        return int(value)  # type: ignore[call-overload]
    raise ProblemError(f"{key} must be a whole number of at least 1; got {show(value)}")


def check_seed(value: object, key: str = "`seed`") -> int:
    """Return the seed; raise ProblemError unless it is a whole number that fits 63 bits."""
    if isinstance(value, numbers.Integral) and _is_real(value) and 0 <= int(value) < 2**63:
        return int(value)
    raise ProblemError(f"{key} must be a whole number of at least 0 and below 2**63; got {show(value)}")


def check_density(value: object, key: str) -> np.ndarray:
    """Return a new float32 array of shape ``[height, width]``; raise ProblemError if it means no density."""
    if isinstance(value, (str, bytes, bool, np.bool_)) or value is None:
        raise ProblemError(f"{key} must be an image (an array of numbers) or a number; got {show(value)}")
    try:
        given = np.asarray(value)
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
        raise ProblemError(f"{key} must be above 0 somewhere; it is 0 everywhere")
    # Only ratios matter: values that float32, or a sum of them, cannot hold are brought into its range.
    if not 1e-20 < float(largest) < 1e20:
        given = given.astype(np.longdouble) / largest.astype(np.longdouble)
    return given.astype(np.float32, order="C")


def check_unique(names: Sequence[str], what: str) -> None:
    """Raise ProblemError if a name stands there twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ProblemError(f'{what} must differ from each other; "{name}" stands there {names.count(name)} times')
        seen.add(name)


def show(value: object) -> str:
    """Return ``value`` as a sentence shows it: short, on one line, and never failing."""
    if isinstance(value, numbers.Integral) and _is_real(value):
        whole = int(value)
        # Python refuses to print whole numbers of thousands of digits.
        return str(whole) if abs(whole) < 10**18 else f"{'-' if whole < 0 else ''}about 1e{_digits(abs(whole)) - 1}"
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.12g}"
    if isinstance(value, str):
        text = ascii(value) if not value.isprintable() else f'"{value}"'
        return text if len(text) <= 62 else f'{text[:58]}..."'
    try:
        text = " ".join(reprlib.repr(value).split())
    except FOREIGN_ERRORS:
        text = f"a {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:77]}..."


def _digits(whole: int) -> int:
    return int(math.log10(whole)) + 1


def _is_real(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))


def _as_float(value: object) -> float | None:
    """Return a real number as float (infinite where it is too large for one), None for anything else and for NaN."""
    if not _is_real(value):
        return None
    try:
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        return math.inf if value > 0 else -math.inf  # type: ignore[operator]
    return None if math.isnan(number) else number


def _positive(value: object, key: str, unit: str) -> float:
    number = _as_float(value)
    if number is None or not 0.0 < number < math.inf:
        raise ProblemError(f"{key} must be a number{unit} above 0, and finite; got {show(value)}")
    return number


def _as_tuple(value: object, kind: type[Kind], key: str) -> tuple[Kind, ...]:
    try:
        entries = tuple(value) if isinstance(value, Iterable) and not isinstance(value, (str, bytes)) else None
    except FOREIGN_ERRORS:
        entries = None
    if entries is None or not all(isinstance(entry, kind) for entry in entries):
        raise ProblemError(f"{key} must be a list of {kind.__name__}; got {show(value)}")
    return entries


def _either(choices: Sequence[str]) -> str:
    return " or ".join(f'"{choice}"' for choice in choices)
