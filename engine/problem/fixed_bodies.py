"""Bodies that are where they are: they repel others and keep them off, and do not move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import ProblemError
from . import validation
from .domain import Domain
from .prepared_class import PreparedClass
from .surface import Surface
from .validation import show

if TYPE_CHECKING:
    from .placement import Placement

__all__ = ["FixedBodies", "FixedBody", "FixedTable", "fixed_table"]

# A class or a size: by its name, or by its index.
Label = str | int


@dataclass(frozen=True)
class FixedBody:
    """One body that does not move.

    Args:
        position: Where it is [m], inside the domain; on a surface x, y and z, on that.
        body_class: Name of its class, or index.
        size: Name of its size, or index.
        angle: Direction of its long axis [rad]; that of a dot is kept and means nothing to others.
        length: Length of its axis [m], of a line; None for the length that is asked for there.
        area: Its footprint [m²]; None for that of its size, the mean one of a range.
        id: Its identity, a whole number of 0 or more that no other body has; None for a free one.
        variant: Which of the outlines of its size it has, where there are several.
        scale: Factor on that outline; None for that which gives it its area where the outline does, else 1.
    """

    position: tuple[float, ...]
    body_class: Label = 0
    size: Label = 0
    angle: float = 0.0
    length: float | None = None
    area: float | None = None
    id: int | None = None
    variant: int = 0
    scale: float | None = None


@dataclass(frozen=True, eq=False)
class FixedBodies:
    """Bodies that do not move, as arrays; every value but the position may be one for all of them.

    Args:
        position: Where they are [m], shape ``[m, 2]``, inside the domain; on a surface ``[m, 3]``.
        body_class: Names of their classes, or indices.
        size: Names of their sizes, or indices.
        angle: Directions of their long axes [rad].
        length: Lengths of their axes [m], of lines; NaN or None for the length that is asked for there.
        area: Footprints [m²]; NaN or None for that of the size, the mean one of a range.
        id: Identities, whole numbers of 0 or more that no two bodies share; -1 or None for free ones.
        variant: Which of the outlines of their sizes they have.
        scale: Factors on these; NaN or None as in :class:`FixedBody`.
        mesh: On a surface, meshes that they are on; together with the following it says where they are exactly, and on which side of
            a thin wall. None where only positions are known.
        triangle: Triangles of these meshes, -1 for unknown ones.
        barycentric: Weights of these triangles' corners, shape ``[m, 3]``.

    Raises:
        ProblemError: Shapes that do not fit each other, or values that are none.
    """

    position: np.ndarray
    body_class: Label | Sequence[Label] | np.ndarray = 0
    size: Label | Sequence[Label] | np.ndarray = 0
    angle: float | np.ndarray = 0.0
    length: float | np.ndarray | None = None
    area: float | np.ndarray | None = None
    id: np.ndarray | None = None
    variant: int | np.ndarray = 0
    scale: float | np.ndarray | None = None
    mesh: int | np.ndarray | None = None
    triangle: np.ndarray | None = None
    barycentric: np.ndarray | None = None

    def __post_init__(self) -> None:
        position = _numbers(self.position, "`fixed.position`")
        if position.ndim != 2 or position.shape[1] not in (2, 3):
            raise ProblemError(
                f"`fixed.position` must have shape [count, 2], or [count, 3] on a surface; got shape {list(position.shape)}"
            )
        m = len(position)
        if not np.isfinite(position).all():
            raise ProblemError("`fixed.position` must be finite everywhere; it holds NaN or infinity")
        values = {
            "position": position,
            "body_class": _labels(self.body_class, m, "`fixed.body_class`"),
            "size": _labels(self.size, m, "`fixed.size`"),
            "angle": _each(0.0 if self.angle is None else self.angle, m, "`fixed.angle`"),
            "length": _each(np.nan if self.length is None else self.length, m, "`fixed.length`"),
            "area": _each(np.nan if self.area is None else self.area, m, "`fixed.area`"),
            "id": _ids(self.id, m),
            "variant": _each(self.variant, m, "`fixed.variant`"),
            "scale": _each(np.nan if self.scale is None else self.scale, m, "`fixed.scale`"),
            "mesh": _each(0 if self.mesh is None else self.mesh, m, "`fixed.mesh`").astype(np.int64),
            "triangle": _each(-1 if self.triangle is None else self.triangle, m, "`fixed.triangle`").astype(np.int64),
            "barycentric": _weights(self.barycentric, m),
        }
        if not ((values["variant"] >= 0.0) & (values["variant"] % 1.0 == 0.0)).all():
            raise ProblemError(f"`fixed.variant` must be whole numbers of 0 or more; got {show(self.variant)}")
        values["variant"] = np.minimum(values["variant"], 2.0**31 - 1.0).astype(np.int32)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if not np.isfinite(values["angle"]).all():
            raise ProblemError("`fixed.angle` must be finite everywhere; it holds NaN or infinity")
        for name in ("length", "area", "scale"):
            wrong = values[name][~(np.isnan(values[name]) | ((values[name] > 0.0) & np.isfinite(values[name])))]
            # A dot has no axis, and files say so with 0.
            wrong = wrong[wrong != 0.0] if name == "length" else wrong
            if len(wrong):
                raise ProblemError(f"`fixed.{name}` must be above 0, and finite; got {show(float(wrong[0]))}")

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def of_placement(cls, placement: Placement, chosen: np.ndarray | None = None) -> FixedBodies:
        """Fix bodies of a placement where they are, with their identities.

        Args:
            placement: A result.
            chosen: Which ones: indices, or a truth value for each; None for all.
        """
        pick = slice(None) if chosen is None else np.asarray(chosen)
        names = [c.name for c in placement.problem.classes]
        sizes = [[size.name for size in c.sizes] for c in placement.problem.classes]
        pairs = zip(placement.class_index[pick].tolist(), placement.size_index[pick].tolist(), strict=True)
        labels = [(names[c], sizes[c][s]) for c, s in pairs]
        return cls(
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
    outside = np.zeros(0, np.int64)
    if isinstance(domain, Domain):
        outside = np.flatnonzero(((position < 0.0) | (position > np.array(domain.size))).any(axis=1))
    if len(outside):
        at = position[outside[0]]
        raise ProblemError(
            f"`fixed.position` must lie inside the domain, {domain.size[0]:g} by {domain.size[1]:g} m; got {show(at.tolist())}"
        )
    names = [c.name for c in classes]
    class_index = np.concatenate(
        [_indices(np.asarray(part.body_class, dtype=object), names, "`fixed.body_class`") for part in parts]
    )
    labels = np.concatenate([np.asarray(part.size, dtype=object) for part in parts])
    size_index = np.zeros(len(position), np.int32)
    area = np.concatenate([np.asarray(part.area, dtype=np.float64) for part in parts])
    length = np.concatenate([np.asarray(part.length, dtype=np.float64) for part in parts])
    for c in np.unique(class_index).tolist():
        own = class_index == c
        sizes = classes[c].sizes
        size_index[own] = _indices(labels[own], [s.name for s in sizes], f'`fixed.size` of class "{names[c]}"')
        area[own] = np.where(np.isnan(area[own]), np.array([s.mean_area for s in sizes])[size_index[own]], area[own])
        has_axis = np.array([s.kind.has_axis for s in sizes])[size_index[own]]
        length[own] = np.where(has_axis & (length[own] > 0.0), length[own], np.nan)
    if (length > max(domain.size)).any():
        raise ProblemError(
            f"`fixed.length` must not be longer than the domain, {max(domain.size):g} m; got {show(float(np.nanmax(length)))}"
        )
    ids = np.concatenate([np.asarray(part.id) for part in parts])
    given_ids, times = np.unique(ids[ids >= 0], return_counts=True)
    if (times > 1).any():
        raise ProblemError(f"`fixed.id` must differ from body to body; got {given_ids[times > 1][0]} twice")
    angle = np.concatenate([np.asarray(part.angle) for part in parts])
    order = np.lexsort((size_index, class_index))
    variant = np.concatenate([np.asarray(part.variant) for part in parts])
    scale = np.concatenate([np.asarray(part.scale) for part in parts])
    columns = (position, class_index, size_index, angle, length, area, ids, variant, scale, *places)
    return FixedTable(*(column[order] for column in columns))


def _positions(
    parts: Sequence[FixedBodies], domain: Domain | Surface
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Positions of bodies, and what is known of them on a surface: meshes, triangles and weights."""
    width = 3 if isinstance(domain, Surface) else 2
    for part in parts:
        if part.position.shape[1] != width:
            where = "on a surface x, y and z" if width == 3 else "in a rectangle x and y"
            raise ProblemError(f"`fixed.position` must be {where} in meters; got {part.position.shape[1]} coordinates")
    position = np.concatenate([part.position for part in parts])
    mesh = np.concatenate([np.asarray(part.mesh) for part in parts])
    triangle = np.concatenate([np.asarray(part.triangle) for part in parts])
    barycentric = np.concatenate([np.asarray(part.barycentric) for part in parts])
    known = np.flatnonzero(triangle >= 0)
    if isinstance(domain, Surface) and len(known):
        position[known] = domain.locate(mesh[known], triangle[known], barycentric[known]).position
    return position, (mesh, triangle, barycentric)


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
        return FixedBodies(*part)
    if not isinstance(part, FixedBody):
        raise ProblemError(f"`fixed` must be a FixedBodies, or a list of FixedBody; got {show(part)} among them")
    position = _numbers(part.position, "`fixed.position`")
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


def _numbers(value: object, key: str) -> np.ndarray:
    try:
        array = validation.as_reals(value)
    except validation.FOREIGN_ERRORS:
        raise ProblemError(f"{key} must be numbers; got {show(value)}") from None
    return array


def _each(value: object, count: int, key: str) -> np.ndarray:
    array = _numbers(value, key)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != count):
        raise ProblemError(
            f"{key} must be one number, or one for each of {count} bodies; got shape {list(array.shape)}"
        )
    return np.broadcast_to(array, (count,)).copy()


def _weights(value: object, count: int) -> np.ndarray:
    if value is None:
        return np.full((count, 3), 1.0 / 3.0)
    weights = _numbers(value, "`fixed.barycentric`")
    if weights.shape != (count, 3):
        raise ProblemError(f"`fixed.barycentric` must have shape [{count}, 3]; got shape {list(weights.shape)}")
    return weights


def _ids(value: object, count: int) -> np.ndarray:
    numbers = _each(-1 if value is None else value, count, "`fixed.id`")
    if not ((numbers >= -1) & (numbers == np.floor(numbers)) & (numbers < 2**31)).all():
        raise ProblemError("`fixed.id` must be whole numbers of 0 or more, below 2**31, or -1 for free ones")
    return numbers.astype(np.int64)


def _labels(value: object, count: int, key: str) -> np.ndarray:
    """Names and indices, one per body, shape ``[count]``, objects."""
    labels = np.empty(count, dtype=object)
    if isinstance(value, str) or validation.is_real(value):
        labels[:] = [value] * count
        return labels
    entries = list(value) if isinstance(value, Iterable) and not isinstance(value, bytes) else None
    if entries is None or len(entries) != count:
        raise ProblemError(f"{key} must be a name or an index, or one for each of {count} bodies; got {show(value)}")
    labels[:] = [entry.item() if isinstance(entry, np.generic) else entry for entry in entries]
    return labels


def _indices(labels: np.ndarray, names: list[str], key: str) -> np.ndarray:
    """Indices of names; what is a number already is one."""
    known: dict[object, int] = {name: index for index, name in enumerate(names)}
    known.update((index, index) for index in range(len(names)))
    result = np.empty(len(labels), np.int32)
    for place, label in enumerate(labels.tolist()):
        found = known.get(label) if isinstance(label, (str, int)) and not isinstance(label, bool) else None
        if found is None:
            accepted = ", ".join(f'"{name}"' for name in names)
            raise ProblemError(f"{key} must be one of {accepted}, or an index of them; got {show(label)}")
        result[place] = found
    return result
