"""Bodies that are where they are: they repel others and keep them off, and do not move."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from ..errors import ProblemError
from . import validation
from .domain import Domain
from .footprints import Footprints
from .nearest_on_triangles import nearest_in
from .prepared_class import PreparedClass
from .settings import Setting, Settings, as_given, described, same_setting, setting, settings_of, settle
from .surface import Surface
from .validation import FOREIGN_ERRORS, show

if TYPE_CHECKING:
    from .placement import Placement

__all__ = ["FixedBodies", "FixedBody", "FixedTable", "Origin", "WrongBodyError", "fixed_table"]

# Weights of a triangle's corners may be so far below 0, and their sum so far from 1.
ROUNDED_WEIGHT = 1e-3
# And positions so far from where weights say, as a share of the surface's extent, and of its coordinates, as float32 rounds them.
ROUNDED_PLACE = 2e-3
ROUNDED_COORDINATE = 1e-6
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
        position = None if isinstance(value, str) else validation.as_reals(value)
    except validation.FOREIGN_ERRORS:
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
    except validation.FOREIGN_ERRORS:
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
        weights = validation.as_reals(value)
    except validation.FOREIGN_ERRORS:
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


class FixedTable(NamedTuple):
    """Fixed bodies of a problem in class, then size order; shapes ``[m]`` and float64, unless said otherwise.

    Attributes:
        position: Shape ``[m, 2]`` [m]; ``[m, 3]`` on a surface.
        class_index: int32.
        size_index: int32.
        angle: [rad].
        length: [m]; NaN for the length that is asked for there, and for dots.
        area: [m²].
        id: int64; -1 for a free one.
        variant: int32.
        scale: NaN for what follows from the area.
        mesh: int64; on a surface, which of its meshes.
        triangle: int64; triangle of that mesh, -1 where only the position is known.
        barycentric: Weights of that triangle's corners, shape ``[m, 3]``.
    """

    position: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    area: np.ndarray
    id: np.ndarray
    variant: np.ndarray
    scale: np.ndarray
    mesh: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    def number_of(self, class_index: int, size_index: int) -> int:
        """How many there are of a size of a class."""
        return int(((self.class_index == class_index) & (self.size_index == size_index)).sum())


def fixed_table(given: object, classes: Sequence[PreparedClass], domain: Domain | Surface) -> FixedTable:
    """Check fixed bodies against the problem that they belong to, and put them into its order.

    Args:
        given: :class:`FixedBodies`, or a list of these and of :class:`FixedBody`.
        classes: The problem's classes.
        domain: Its domain.

    Raises:
        ProblemError: Something else, an unknown class or size, a position outside the domain, or an identity given twice.
    """
    parts = [_as_bodies(part) for part in _parts(given)]
    parts = [part for part in parts if len(part)]
    if not parts:
        nothing = np.zeros(0)
        none = np.zeros(0, np.int32)
        long = np.zeros(0, np.int64)
        width = 3 if isinstance(domain, Surface) else 2
        return FixedTable(
            np.zeros((0, width)),
            none,
            none,
            nothing,
            nothing,
            nothing,
            long,
            none,
            nothing,
            long,
            long,
            np.zeros((0, 3)),
        )
    position, places = _positions(parts, domain)
    names = [c.name for c in classes]
    labels = np.concatenate([np.asarray(part.body_class, dtype=object) for part in parts])
    class_index = _indices(parts, labels, np.arange(len(labels)), names, "body_class")
    labels = np.concatenate([np.asarray(part.size, dtype=object) for part in parts])
    size_index = np.zeros(len(position), np.int32)
    area = np.concatenate([np.asarray(part.area, dtype=np.float64) for part in parts])
    length = np.concatenate([np.asarray(part.length, dtype=np.float64) for part in parts])
    for c in np.unique(class_index).tolist():
        own = np.flatnonzero(class_index == c)
        sizes = classes[c].sizes
        size_index[own] = _indices(parts, labels, own, [s.name for s in sizes], "size", f'of class "{names[c]}" ')
        has_axis = np.array([s.kind.has_axis for s in sizes])[size_index[own]]
        length[own] = np.where(has_axis & (length[own] > 0.0), length[own], np.nan)
    long = np.flatnonzero(length > max(domain.size))
    if len(long):
        said = f"must not be longer than the domain, {max(domain.size):g} m; got {show(length[long[0]])}"
        raise _wrong(parts, long[0], "length", said)
    ids = np.concatenate([np.asarray(part.id) for part in parts])
    given_ids, times = np.unique(ids[ids >= 0], return_counts=True)
    if (times > 1).any():
        twice = given_ids[times > 1][0]
        again = np.flatnonzero(ids == twice)[1]
        raise _wrong(parts, again, "id", f"must differ from body to body; got {twice} twice")
    angle = np.concatenate([np.asarray(part.angle) for part in parts])
    order = np.lexsort((size_index, class_index))
    variant = _outlines(parts, class_index, size_index, classes)
    scale = np.concatenate([np.asarray(part.scale) for part in parts])
    area = np.where(np.isnan(area), _areas(class_index, size_index, variant, scale, classes), area)
    columns = (position, class_index, size_index, angle, length, area, ids, variant, scale, *places)
    return FixedTable(*(column[order] for column in columns))


def _outlines(
    parts: Sequence[FixedBodies], class_index: np.ndarray, size_index: np.ndarray, classes: Sequence[PreparedClass]
) -> np.ndarray:
    """Numbers of bodies' outlines, each of which its size has; where a size has none, numbers say nothing."""
    variant = np.concatenate([np.asarray(part.variant) for part in parts])
    for c, body_class in enumerate(classes):
        for s, size in enumerate(body_class.sizes):
            if not isinstance(size.footprint, Footprints):
                continue
            number = len(size.footprint.outlines)
            unknown = np.flatnonzero((class_index == c) & (size_index == s) & (variant >= number))
            if len(unknown):
                accepted = "0, its only footprint" if number == 1 else f"a whole number from 0 to {number - 1}"
                said = (
                    f'of size "{size.name}" of class "{body_class.name}" must be {accepted}; got {variant[unknown[0]]}'
                )
                raise _wrong(parts, unknown[0], "variant", said)
    return variant


def _areas(
    class_index: np.ndarray,
    size_index: np.ndarray,
    variant: np.ndarray,
    scale: np.ndarray,
    classes: Sequence[PreparedClass],
) -> np.ndarray:
    """Areas of bodies of which none is said [m²]: of their outlines where these have their own, or else the mean of the size."""
    area = np.empty(len(variant))
    for c, body_class in enumerate(classes):
        for s, size in enumerate(body_class.sizes):
            own = (class_index == c) & (size_index == s)
            area[own] = size.mean_area
            if size.outlines and not size.has_one_area:
                # The scale is only checked after this.
                with np.errstate(over="ignore"):
                    outlined = np.array([outline.area for outline in size.outlines])[variant[own]] * scale[own] ** 2
                # One whose scale is not said is scaled to its area.
                area[own] = np.where(np.isnan(outlined), area[own], outlined)
    return area


def _wrong(parts: Sequence[FixedBodies], body: int, name: str, said: str) -> ProblemError:
    """Return what to raise for a setting of one of the bodies of all parts: with its file and line, where it has some."""
    for part in parts:
        if body < len(part):
            if part.origin is None:
                return ProblemError(f"`fixed.{name}` {said}")
            return ProblemError(f"{part.origin.told(int(body), name)}`fixed.{part.origin.key(name)}` {said}")
        body -= len(part)
    raise AssertionError("no part has this body")


def _is_read(parts: Sequence[FixedBodies], body: int) -> bool:
    """Whether one of the bodies of all parts is from a recipe or a table, where nothing is named by an index."""
    last = np.cumsum([len(part) for part in parts])
    return parts[int(np.searchsorted(last, body, side="right"))].origin is not None


def _positions(
    parts: Sequence[FixedBodies], domain: Domain | Surface
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Positions of bodies, and what is known of them on a surface: meshes, triangles and weights."""
    width = 3 if isinstance(domain, Surface) else 2
    for part in parts:
        if part.position.shape[1] != width:
            where = "on a surface x, y and z" if width == 3 else "in a rectangle x and y"
            said = f"must be {where} in meters; got {part.position.shape[1]} coordinates"
            raise _wrong([part], 0, "position", said) if len(part) else ProblemError(f"`fixed.position` {said}")
    position = np.concatenate([part.position for part in parts])
    mesh = np.concatenate([np.asarray(part.mesh) for part in parts])
    triangle = np.concatenate([np.asarray(part.triangle) for part in parts])
    barycentric = np.concatenate([np.asarray(part.barycentric) for part in parts])
    if isinstance(domain, Surface):
        position, barycentric = _on_triangles(parts, domain, position, mesh, triangle, barycentric)
    if isinstance(domain, Domain):
        known = np.flatnonzero(triangle >= 0)
        if len(known):
            raise _wrong(parts, int(known[0]), "triangle", "is only for surfaces; a rectangle has no triangles")
        outside = np.flatnonzero(((position < 0.0) | (position > np.array(domain.size))).any(axis=1))
        if len(outside):
            extent = f"{domain.size[0]:g} by {domain.size[1]:g} m"
            said = f"must lie inside the domain, {extent}; got {show(position[outside[0]])}"
            raise _wrong(parts, outside[0], "position", said)
    return position, (mesh, triangle, barycentric)


def _on_triangles(
    parts: Sequence[FixedBodies],
    surface: Surface,
    position: np.ndarray,
    mesh: np.ndarray,
    triangle: np.ndarray,
    barycentric: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Bring bodies whose triangles are known onto these: positions, and weights of the triangles' corners."""
    known = np.flatnonzero(triangle >= 0)
    wrong = surface.wrong_triangle(mesh[known], triangle[known])
    if wrong is not None:
        name, row, said = wrong
        raise _wrong(parts, int(known[row]), name, said)
    weight, free = barycentric[known], np.isnan(barycentric[known]).all(axis=1)
    off = np.abs(weight.sum(axis=1) - 1.0)
    is_none = ~free & ~((weight >= -ROUNDED_WEIGHT).all(axis=1) & (off <= ROUNDED_WEIGHT))
    if is_none.any():
        row = int(np.argmax(is_none))
        said = f"must be three numbers of 0 or more whose sum is 1; got {show(weight[row])}"
        raise _wrong(parts, int(known[row]), "barycentric", said)
    third = np.full((len(known), 3), 1.0 / 3.0)
    corner = surface.position[surface.triangle[surface.locate(mesh[known], triangle[known], third).triangle]]
    for row in np.flatnonzero(free).tolist():
        place = position[known[row]]
        nearest = nearest_in(corner[row : row + 1], place)
        away = float(np.linalg.norm(nearest[0] @ corner[row] - place))
        if away > np.linalg.norm(corner[row] - np.roll(corner[row], 1, axis=0), axis=1).max():
            number = int(triangle[known[row]])
            said = f"must be one that `fixed.position` is near, if no `fixed.barycentric` is given; got {number}, {away:.3g} m away"
            raise _wrong(parts, int(known[row]), "triangle", said)
        on_mesh = surface.locate(mesh[known[[row]]], triangle[known[[row]]], nearest)
        # It may be turned round there, and back.
        weight[row] = on_mesh.barycentric[0]
    weight = np.maximum(weight, 0.0)
    total = weight.sum(axis=1, keepdims=True)
    result = np.full_like(barycentric, 1.0 / 3.0)
    # What was written by us is taken as it is.
    result[known] = np.where(np.abs(total - 1.0) > 1e-12, weight / total, weight)
    place = surface.locate(mesh[known], triangle[known], result[known]).position
    said_twice = ~free & ~np.concatenate([np.full(len(part), part.stick) for part in parts])[known]
    _check_near(parts, surface, known[said_twice], position[known[said_twice]], place[said_twice])
    position[known] = place
    return position, result


def _check_near(
    parts: Sequence[FixedBodies], surface: Surface, row: np.ndarray, position: np.ndarray, place: np.ndarray
) -> None:
    """Raise an error about the first of some bodies whose position is not where its triangle and weights say, ``place``."""
    rounded = ROUNDED_PLACE * max(surface.size)
    rounded += ROUNDED_COORDINATE * float(np.abs([surface.low, surface.high]).max())
    away = np.linalg.norm(position - place, axis=1)
    elsewhere = np.flatnonzero(away > rounded)
    if len(elsewhere):
        first = elsewhere[0]
        said = (
            f"must be where `fixed.triangle` and `fixed.barycentric` say, {show(np.round(place[first], 6))}; got "
            f"{show(position[first])}, {away[first]:.3g} m away"
        )
        raise _wrong(parts, int(row[first]), "position", said)


def _parts(given: object) -> tuple[object, ...]:
    if isinstance(given, (FixedBody, FixedBodies, FixedTable)):
        return (given,)
    if isinstance(given, Iterable) and not isinstance(given, (str, bytes, np.ndarray)):
        return tuple(given)
    raise ProblemError(f"`fixed` must be a FixedBodies, or a list of FixedBody; got {show(given)}")


def _as_bodies(part: object) -> FixedBodies:
    if isinstance(part, FixedBodies):
        return part
    if isinstance(part, FixedTable):
        bodies = FixedBodies(*part)
        settle(bodies, stick=True)
        return bodies
    if not isinstance(part, FixedBody):
        raise ProblemError(f"`fixed` must be a FixedBodies, or a list of FixedBody; got {show(part)} among them")
    try:
        position = validation.as_reals(part.position)
    except validation.FOREIGN_ERRORS:
        position = np.empty(0)
    if position.shape not in ((2,), (3,)):
        raise ProblemError(
            f"`fixed.position` must be two lengths in meters, x and y, or three on a surface; got {show(part.position)}"
        )
    return FixedBodies(
        position[None, :],
        [part.body_class],
        [part.size],
        part.angle,
        part.length,
        part.area,
        None if part.id is None else np.array([part.id]),
        part.variant,
        part.scale,
    )


def _each(value: np.ndarray, count: int, key: str) -> np.ndarray:
    if value.ndim == 1 and len(value) != count:
        raise ProblemError(
            f"{key} must be one number, or one for each of {count} bodies; got shape {list(value.shape)}"
        )
    return np.broadcast_to(value, (count,)).copy()


def _labels(value: object, count: int, key: str) -> np.ndarray:
    """Names and indices, one per body, shape ``[count]``, objects."""
    labels = np.empty(count, dtype=object)
    if isinstance(value, str) or validation.is_real(value):
        labels[:] = [value] * count
        return labels
    # An array without an axis calls itself iterable.
    single = isinstance(value, bytes) or (isinstance(value, np.ndarray) and value.ndim == 0)
    entries = list(value) if isinstance(value, Iterable) and not single else None
    if entries is None or len(entries) != count:
        raise ProblemError(f"{key} must be a name or an index, or one for each of {count} bodies; got {show(value)}")
    labels[:] = [entry.item() if isinstance(entry, np.generic) else entry for entry in entries]
    return labels


def _indices(
    parts: Sequence[FixedBodies], labels: np.ndarray, chosen: np.ndarray, names: list[str], name: str, of: str = ""
) -> np.ndarray:
    """Indices of the names that chosen ones of all bodies have; what is a number already is one.

    Args:
        parts: Where bodies are from.
        labels: Names and indices of all bodies.
        chosen: Numbers of bodies.
        names: All that there are.
        name: Of the setting.
        of: Whose it is, behind that in a sentence, with a blank.
    """
    known: dict[object, int] = {one: index for index, one in enumerate(names)}
    known.update((index, index) for index in range(len(names)))
    result = np.empty(len(chosen), np.int32)
    for place, label in enumerate(labels[chosen].tolist()):
        found = known.get(label) if isinstance(label, (str, int)) and not isinstance(label, bool) else None
        if found is None:
            accepted = ", ".join(f'"{one}"' for one in names)
            index = "" if _is_read(parts, chosen[place]) else ", or an index of them"
            said = f"{of}must be one of {accepted}{index}; got {show(label)}"
            raise _wrong(parts, chosen[place], name, said)
        result[place] = found
    return result
