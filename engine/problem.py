"""The problem: which bodies, how many, how large, following which density, in which domain.

Conventions used in the whole engine: metres, square metres and radians; x to the right, y up; the domain is the rectangle
``[0, size[0]] x [0, size[1]]``. A density image has shape ``[height, width]``, row 0 is its top (largest y), and it is
stretched over the whole domain whatever its resolution or aspect.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .errors import ProblemError

__all__ = ["Balance", "BodyClass", "Domain", "Problem", "Size"]

Boundary = Literal["open", "periodic"]
BOUNDARIES: tuple[str, ...] = ("open", "periodic")


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
        size = _as_sequence(self.size, "domain.size")
        if len(size) != 2:
            raise ProblemError(f"`domain.size` must be two lengths in metres, x and y; got {self.size!r}")
        for value in size:
            _check_positive(value, "domain.size")
        if self.boundary not in BOUNDARIES:
            raise ProblemError(f"`domain.boundary` must be {_either(BOUNDARIES)}; got {self.boundary!r}")
        object.__setattr__(self, "size", (float(size[0]), float(size[1])))

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
        _check_number(self.class_separation, "balance.class_separation")
        if not 0.0 <= self.class_separation <= 1.0:
            raise ProblemError(
                f"`balance.class_separation` must be between 0 (each class by itself) and 1 (only the union); "
                f"got {self.class_separation!r}"
            )
        _check_number(self.size_emphasis, "balance.size_emphasis")
        if not 1.0 <= self.size_emphasis < math.inf:
            raise ProblemError(f"`balance.size_emphasis` must be 1 or more, and finite; got {self.size_emphasis!r}")


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
        _check_name(self.name, "size.name")
        _check_positive(self.area, f'`area` of size "{self.name}"', unit=" in m²")
        if isinstance(self.count, bool) or not isinstance(self.count, numbers.Real) or self.count != self.count // 1:
            raise ProblemError(f'`count` of size "{self.name}" must be a whole number of at least 1; got {self.count!r}')
        if self.count < 1:
            raise ProblemError(f'`count` of size "{self.name}" must be a whole number of at least 1; got {self.count!r}')
        object.__setattr__(self, "area", float(self.area))
        object.__setattr__(self, "count", int(self.count))


@dataclass(frozen=True, eq=False)
class BodyClass:
    """One class of bodies (pines; mushrooms) that follows one density.

    Args:
        name: Unique within the problem.
        sizes: At least one :class:`Size`.
        density: Image of shape ``[height, width]``, values >= 0, any scale; or a number > 0 for a uniform density.
            Where it is zero, no body of the class is placed.

    Raises:
        ProblemError: A density that is negative, not finite, zero everywhere or not a two-dimensional image; no size;
            two sizes of one name.
    """

    name: str
    sizes: Sequence[Size]
    density: np.ndarray | float = 1.0

    def __post_init__(self) -> None:
        _check_name(self.name, "class.name")
        where = f'class "{self.name}"'
        sizes = tuple(self.sizes)
        if not sizes:
            raise ProblemError(f"{where} must have at least one size; got none")
        _check_unique([size.name for size in sizes], f"size names of {where}")
        object.__setattr__(self, "sizes", sizes)
        try:
            density = np.atleast_2d(np.asarray(self.density, dtype=np.float32))
        except (TypeError, ValueError):
            raise ProblemError(f"`density` of {where} must be an image or a number; got {self.density!r:.60}") from None
        if density.ndim != 2 or density.size == 0:
            raise ProblemError(f"`density` of {where} must have shape [height, width]; got {density.shape}")
        if not np.isfinite(density).all():
            raise ProblemError(f"`density` of {where} must be finite everywhere; it holds NaN or infinity")
        if density.min() < 0.0:
            raise ProblemError(f"`density` of {where} must be 0 or more everywhere; its smallest value is {density.min():g}")
        if density.max() <= 0.0:
            raise ProblemError(f"`density` of {where} must be above 0 somewhere; it is 0 everywhere")
        object.__setattr__(self, "density", density)

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
        classes = tuple(self.classes)
        if not classes:
            raise ProblemError("a problem must have at least one class; got none")
        _check_unique([body_class.name for body_class in classes], "class names")
        object.__setattr__(self, "classes", classes)
        if isinstance(self.seed, bool) or not isinstance(self.seed, numbers.Integral) or not 0 <= self.seed < 2**63:
            raise ProblemError(f"`seed` must be a whole number of at least 0; got {self.seed!r}")
        object.__setattr__(self, "seed", int(self.seed))

    @property
    def body_count(self) -> int:
        """Number of bodies of all classes and sizes."""
        return sum(body_class.count for body_class in self.classes)


def _as_sequence(value: object, key: str) -> Sequence[float]:
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise ProblemError(f"`{key}` must be two lengths in metres, x and y; got {value!r}")
    return value  # type: ignore[return-value]


def _check_number(value: object, key: str) -> None:
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or math.isnan(value):
        raise ProblemError(f"`{key}` must be a number; got {value!r}")


def _check_positive(value: object, key: str, unit: str = "") -> None:
    key = key if key.startswith("`") else f"`{key}`"
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not 0.0 < value < math.inf:
        raise ProblemError(f"{key} must be a number above 0, and finite{unit}; got {value!r}")


def _check_name(name: object, key: str) -> None:
    if not isinstance(name, str) or not name.strip():
        raise ProblemError(f"`{key}` must be a text that is not empty; got {name!r}")


def _check_unique(names: list[str], what: str) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ProblemError(f'{what} must differ from each other; "{name}" stands there {names.count(name)} times')


def _either(choices: Sequence[str]) -> str:
    return " or ".join(f'"{choice}"' for choice in choices)
