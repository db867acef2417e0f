"""Fixed bodies as the problem has them that they belong to: known by its classes and sizes, inside its domain, in its order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ProblemError
from ..geometry.nearest_on_triangles import nearest_in
from .domain import Domain
from .fixed_bodies import FixedBodies, FixedBody
from .footprints import Footprints
from .given_values import FOREIGN_ERRORS, as_reals, show
from .prepared_class import PreparedClass
from .settings import settle
from .surface import Surface

__all__ = ["FixedTable", "fixed_table"]

# Weights of a triangle's corners may be so far below 0, and their sum so far from 1.
ROUNDED_WEIGHT = 1e-3
# And positions so far from where weights say, as a share of the surface's extent, and of its coordinates, as float32 rounds them.
ROUNDED_PLACE = 2e-3
ROUNDED_COORDINATE = 1e-6


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
        position = as_reals(part.position)
    except FOREIGN_ERRORS:
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
