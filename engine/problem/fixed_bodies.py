"""Bodies that are where they are: they repel others and keep them off, and do not move."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..errors import ProblemError
from . import validation
from .given_values import FOREIGN_ERRORS, as_reals, is_real, show
from .settings import Setting, Settings, as_given, described, same_setting, setting, settings_of, settle

if TYPE_CHECKING:
    from .placement import Placement

__all__ = ["FixedBodies", "FixedBody", "Origin", "WrongBodyError"]

# A class or a size: by its name, or by its index.
Label = str | int
# What stands for a value that is not said, where there may be one for each body.
_NOT_SAID = {
    "angle": 0.0,
    "length": math.nan,
    "area": math.nan,
    "id": -1,
    "variant": 0,
    "scale": math.nan,
    "mesh": 0,
    "triangle": -1,
}


@dataclass(frozen=True)
class Origin:
    """The file that bodies were read from.

    Attributes:
        path: What sentences call it.
        line: Of every body, in the file, shape ``[m]``; None where it has no lines.
        otherwise: Settings that are not from the file.
    """

    path: str
    line: np.ndarray | None = None
    otherwise: Collection[str] = ()

    def told(self, body: int, name: str) -> str:
        """Return where a setting of a body is from, as a sentence about it begins; empty where it is not from here."""
        if name in self.otherwise:
            return ""
        return f"{self.path}, " + (f"body {body + 1}: " if self.line is None else f"line {self.line[body]}: ")

    @staticmethod
    def key(name: str) -> str:
        """What recipes and tables call a setting."""
        return "class" if name == "body_class" else name


class WrongBodyError(ProblemError):
    """A value of one of several bodies that is none.

    Attributes:
        body: Which of them has it.
    """

    def __init__(self, said: str, body: int) -> None:
        super().__init__(said)
        self.body = body


def _refuse(wrong: np.ndarray, said: str) -> None:
    """Raise an error about the first body that has a wrong value, if there is any; shape ``[m]``, or none for a single value."""
    if wrong.any():
        raise WrongBodyError(said, int(np.argmax(wrong)))


def _check_positions(value: object, key: str) -> np.ndarray:
    try:
        position = None if isinstance(value, str) else as_reals(value)
    except FOREIGN_ERRORS:
        position = None
    if position is None or position.ndim != 2 or position.shape[1] not in (2, 3):
        raise ProblemError(
            f"{key} must be a list of positions, each x and y in meters, and z on a surface; got {show(value)}"
        )
    return _finite(position, key)


def _check_numbers(value: object, key: str) -> np.ndarray:
    """Return a number, or one for each body, float64."""
    try:
        given = np.array(value)
        numbers = given.astype(np.float64) if given.dtype.kind in "uifO" else None
    except FOREIGN_ERRORS:
        numbers = None
    if numbers is None or numbers.ndim > 1:
        raise ProblemError(f"{key} must be a number, or a list of one for every position; got {show(value)}")
    return numbers


def _check_angle(value: object, key: str) -> np.ndarray:
    numbers = _finite(_check_numbers(0.0 if value is None else value, key), key)
    most = validation.LARGEST_ANGLE
    wrong = np.abs(numbers) > most
    _refuse(wrong, f"{key} must be angles between {-most:g} and {most:g} radians; got {_first(numbers, wrong)}")
    return numbers


def _finite(numbers: np.ndarray, key: str) -> np.ndarray:
    wrong = ~np.isfinite(numbers)
    _refuse(
        wrong.any(axis=1) if wrong.ndim > 1 else wrong, f"{key} must be finite everywhere; it holds NaN or infinity"
    )
    return numbers


def _check_above_0(value: object, key: str) -> np.ndarray:
    """Return numbers above 0, or NaN for what is not said."""
    numbers = _check_numbers(value, key)
    wrong = ~(np.isnan(numbers) | ((numbers > 0.0) & np.isfinite(numbers)))
    _refuse(wrong, f"{key} must be above 0, and finite; got {_first(numbers, wrong)}")
    return numbers


def _first(numbers: np.ndarray, wrong: np.ndarray) -> str:
    """The first of the wrong ones, as sentences show it; empty where there is none."""
    return show(numbers[wrong][0]) if wrong.any() else ""


def _check_lengths(value: object, key: str) -> np.ndarray:
    numbers = _check_numbers(value, key)
    # A dot has no axis, and files say so with 0.
    _check_above_0(np.where(numbers == 0.0, np.nan, numbers), key)
    return numbers


def _check_whole(value: object, key: str) -> np.ndarray:
    """Return whole numbers, int64; -1 stands for one that is not said."""
    numbers = _check_numbers(value, key)
    wrong = ~((numbers >= -1) & (numbers == np.floor(numbers)) & (numbers < 2**31))
    accepted = "whole numbers of 0 or more, below 2**31, or -1 for free ones"
    _refuse(wrong, f"{key} must be {accepted}; got {_first(numbers, wrong)}")
    return numbers.astype(np.int64)


def _check_variant(value: object, key: str) -> np.ndarray:
    numbers = _check_numbers(value, key)
    wrong = ~((numbers >= 0.0) & (numbers % 1.0 == 0.0) & (numbers < 2**31))
    _refuse(wrong, f"{key} must be whole numbers of 0 or more, below 2**31; got {_first(numbers, wrong)}")
    return numbers.astype(np.int32)


def _check_weights(value: object, key: str) -> np.ndarray:
    try:
        weights = as_reals(value)
    except FOREIGN_ERRORS:
        weights = np.empty(0)
    if weights.ndim != 2 or weights.shape[1] != 3:
        raise ProblemError(f"{key} must be three numbers for every body; got {show(value)}")
    return weights


@described
@dataclass(frozen=True, eq=False)
class FixedBodies(Settings):
    """Bodies that do not move, as arrays; every value but the position may be one for all of them.

    Raises:
        ProblemError: Shapes that do not fit each other, or values that are none.
    """

    position: np.ndarray = field(
        metadata=setting(
            "Position inside the domain; on a surface x, y and z, on that",
            unit="m",
            more="Shape ``[m, 2]``; on a surface ``[m, 3]``",
            check=_check_positions,
        )
    )
    body_class: Label | Sequence[Label] | np.ndarray = field(
        default=0, metadata=setting("Class: its name, or its index", check=as_given)
    )
    size: Label | Sequence[Label] | np.ndarray = field(
        default=0, metadata=setting("Size: its name, or its index", check=as_given)
    )
    angle: float | np.ndarray = field(
        default=0.0,
        metadata=setting(
            "Direction of the long axis",
            unit="rad",
            more="That of a dot is kept and means nothing to others",
            check=_check_angle,
        ),
    )
    length: float | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Length of the axis, of a line",
            unit="m",
            more="NaN or None: the length that is asked for there",
            check=_check_lengths,
        ),
    )
    area: float | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Footprint",
            unit="m²",
            more="NaN or None: that of the size, the mean one of a range",
            check=_check_above_0,
        ),
    )
    id: np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Identity, a whole number of 0 or more that no other body has",
            more="-1 or None: a free one",
            check=_check_whole,
        ),
    )
    variant: int | np.ndarray = field(
        default=0,
        metadata=setting(
            "Which of the outlines of its size a body has, where there are several, counted from 0",
            check=_check_variant,
        ),
    )
    scale: float | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Factor on that outline",
            more="NaN or None: that which gives it its area where the outline does, else 1",
            check=_check_above_0,
        ),
    )
    mesh: int | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "On a surface, the mesh that a body is on",
            more="Together with the following it says where it is exactly, and on which side of a thin wall. None where only "
            "positions are known",
            check=_check_whole,
        ),
    )
    triangle: np.ndarray | None = field(
        default=None,
        metadata=setting("Triangle of this mesh", more="-1 or None: not known", check=_check_whole),
    )
    barycentric: np.ndarray | None = field(
        default=None,
        metadata=setting(
            "Weights of this triangle's corners",
            more="Shape ``[m, 3]``. NaN or None: where the triangle is nearest to the position",
            check=_check_weights,
        ),
    )
    # What sentences about them begin with; only readers of files know it.
    origin: ClassVar[Origin | None] = None
    # Whether triangles say where they are, as on a mesh that was bent since. Otherwise a position elsewhere is a mistake.
    stick: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        m = len(self.position)
        settle(self, body_class=_labels(self.body_class, m, self._key("body_class")))
        settle(self, size=_labels(self.size, m, self._key("size")))
        for name, not_said in _NOT_SAID.items():
            value = getattr(self, name)
            settle(self, **{name: _each(np.array(not_said) if value is None else value, m, self._key(name))})
        if self.barycentric is None:
            settle(self, barycentric=np.full((m, 3), np.nan))
        elif len(self.barycentric) != m:
            raise ProblemError(
                f"{self._key('barycentric')} must have shape [{m}, 3]; got shape {list(self.barycentric.shape)}"
            )

    def _key(self, name: str) -> str:
        return f"`fixed.{name}`"

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def of_placement(cls, placement: Placement, chosen: np.ndarray | None = None) -> FixedBodies:
        """Fix bodies of a placement where they are, with their identities; on a surface that was bent since, on their triangles.

        Args:
            placement: A result.
            chosen: Which ones: indices, or a truth value for each; None for all.
        """
        if not hasattr(placement, "class_index"):
            raise ProblemError(f"`placement` must be a Placement; got {show(placement)}")
        number = len(placement.position)
        pick = np.arange(number) if chosen is None else _chosen(chosen, number)
        names = [c.name for c in placement.problem.classes]
        sizes = [[size.name for size in c.sizes] for c in placement.problem.classes]
        pairs = zip(placement.class_index[pick].tolist(), placement.size_index[pick].tolist(), strict=True)
        labels = [(names[c], sizes[c][s]) for c, s in pairs]
        bodies = cls(
            placement.position[pick],
            [name for name, _ in labels],
            [size for _, size in labels],
            placement.angle[pick],
            placement.length[pick],
            placement.area[pick],
            placement.id[pick],
            placement.variant[pick],
            placement.scale[pick],
            None if placement.mesh is None else placement.mesh[pick],
            None if placement.triangle is None else placement.triangle[pick],
            None if placement.barycentric is None else placement.barycentric[pick],
        )
        settle(bodies, stick=True)
        return bodies


def _chosen(chosen: object, number: int) -> np.ndarray:
    """Return the numbers of the chosen ones of so many bodies."""
    try:
        found = np.arange(number)[np.asarray(chosen)]
    except FOREIGN_ERRORS:
        found = np.zeros((0, 0))
    if found.ndim != 1:
        raise ProblemError(
            f"`chosen` must be numbers of bodies, 0 to {number - 1}, or a truth value for each of {number}; got {show(chosen)}"
        )
    return found


def _of_one(name: str) -> dict[str, Setting]:
    """Describe a field of one body as that of several."""
    more = settings_of(FixedBodies)[name].setting.more.replace("NaN or None", "None").replace("-1 or None", "None")
    return same_setting(FixedBodies, name, check=as_given, more="" if name == "position" else more)


@described
@dataclass(frozen=True)
class FixedBody(Settings):
    """One body that does not move; a list of these is checked as :class:`FixedBodies` are."""

    position: tuple[float, ...] = field(metadata=_of_one("position"))
    body_class: Label = field(default=0, metadata=_of_one("body_class"))
    size: Label = field(default=0, metadata=_of_one("size"))
    angle: float = field(default=0.0, metadata=_of_one("angle"))
    length: float | None = field(default=None, metadata=_of_one("length"))
    area: float | None = field(default=None, metadata=_of_one("area"))
    id: int | None = field(default=None, metadata=_of_one("id"))
    variant: int = field(default=0, metadata=_of_one("variant"))
    scale: float | None = field(default=None, metadata=_of_one("scale"))


def _each(value: np.ndarray, count: int, key: str) -> np.ndarray:
    if value.ndim == 1 and len(value) != count:
        raise ProblemError(
            f"{key} must be one number, or one for each of {count} bodies; got shape {list(value.shape)}"
        )
    return np.broadcast_to(value, (count,)).copy()


def _labels(value: object, count: int, key: str) -> np.ndarray:
    """Names and indices, one per body, shape ``[count]``, objects."""
    labels = np.empty(count, dtype=object)
    if isinstance(value, str) or is_real(value):
        labels[:] = [value] * count
        return labels
    # An array without an axis calls itself iterable.
    single = isinstance(value, bytes) or (isinstance(value, np.ndarray) and value.ndim == 0)
    entries = list(value) if isinstance(value, Iterable) and not single else None
    if entries is None or len(entries) != count:
        raise ProblemError(f"{key} must be a name or an index, or one for each of {count} bodies; got {show(value)}")
    labels[:] = [entry.item() if isinstance(entry, np.generic) else entry for entry in entries]
    return labels
