"""Bodies as files hold them: in space, each turned and scaled, one of a few prototypes; what writers and readers share."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import EshError, InputFileError
from ..problem.body_kind import disc_radius
from ..problem.footprint import Footprint
from ..problem.footprints import Footprints
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.size import Size
from .input_file import check_is_file
from .quaternions import wxyz_of_axes

__all__ = [
    "READ_COLUMNS",
    "AssetFiles",
    "Bodies",
    "Prototype",
    "bodies_from_columns",
    "bodies_of",
    "check_assets",
    "read_names",
    "trial_bodies",
]

AssetFiles = Mapping[str, str | Path | Sequence[str | Path]]

AN_ASSET = "an asset is a file with a model"
# Corners of the outline that stands in for a round body.
CORNERS = 16
# Bodies are counted from their middle where any is farther than this [m] from 0, if that is nearer by this factor.
FAR, NEARER = 1024.0, 0.25
# Classes take these colors in turn (Okabe and Ito's, which color-blind people can tell apart).
PALETTE = (
    *((0.0, 0.62, 0.45), (0.9, 0.62, 0.0), (0.34, 0.71, 0.91), (0.84, 0.37, 0.0)),
    *((0.0, 0.45, 0.7), (0.8, 0.47, 0.65), (0.94, 0.89, 0.26), (0.5, 0.5, 0.5)),
)


@dataclass(frozen=True, eq=False)
class Prototype:
    """An object that bodies are instances of.

    Attributes:
        name: Unique among the prototypes.
        outline: Its footprint around the origin [m], counter-clockwise, shape ``[corners, 2]``. Without an asset, a prism with this
            outline stands in for the object.
        height: Height of the prism [m].
        color: Color of the prism, red, green and blue, 0..1.
        assets: Files that hold the object, for formats that can refer to one or embed it. A format uses the first file that it can.
    """

    name: str
    outline: np.ndarray
    height: float
    color: tuple[float, float, float] = PALETTE[0]
    assets: tuple[Path, ...] = ()

    def asset(self, endings: tuple[str, ...], what: str) -> Path | None:
        """Return the first asset with one of these endings; None if there are no assets at all.

        Args:
            endings: Endings that the format can use.
            what: What is being written, for the message of the error.

        Raises:
            EshError: There are assets, but none has one of these endings, or the file does not exist.
        """
        fitting = [path for path in self.assets if path.suffix.lower() in endings]
        if self.assets and not fitting:
            raise EshError(
                f'the asset of "{self.name}" for {what} must end in {" or ".join(endings)}; got {self.assets[0]}'
            )
        if fitting:
            check_is_file(fitting[0], AN_ASSET)
        return fitting[0] if fitting else None


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies in space, z up, as files exchange them.

    Attributes:
        position: Positions [m], shape ``[n, 3]``, float64.
        rotation: Unit quaternions (w, x, y, z), shape ``[n, 4]``, float32.
        scale: Factors along the prototype's axes, shape ``[n, 3]``, float32.
        prototype_index: Index into ``prototypes``, shape ``[n]``, int32.
        prototypes: The objects that bodies are instances of.
        id: Identities, which stay with the bodies through edits, shape ``[n]``, int64.
        class_index: Index into ``class_name``, shape ``[n]``, int32.
        size_index: Index into the class's ``size_name``, shape ``[n]``, int32.
        class_name: Names of the classes.
        size_name: Names of the sizes of every class.
        length: Length of a line body's axis [m], shape ``[n]``, float64; 0 for dots.
        width: Thickness of a line body [m], shape ``[n]``, float64; 0 for dots.
        area: Footprint [m²], shape ``[n]``, float64; NaN where a file does not say.
        fixed: Whether a body was fixed, shape ``[n]``, bool.
        variant: Index of the body's outline among those of its size, shape ``[n]``, int32; 0 where there are none.
        factor: Scale factor on that outline, shape ``[n]``, float64; 1 where there is none, NaN where a file does not say.
        named: Whether the names of classes and sizes are known; where a file does not say, numbers take their place.
    """

    position: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    prototype_index: np.ndarray
    prototypes: tuple[Prototype, ...]
    id: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    class_name: tuple[str, ...]
    size_name: tuple[tuple[str, ...], ...]
    length: np.ndarray
    width: np.ndarray
    area: np.ndarray
    fixed: np.ndarray
    variant: np.ndarray
    factor: np.ndarray
    named: bool = True

    @property
    def angle(self) -> np.ndarray:
        """Turn about z [rad], counter-clockwise from x, shape ``[n]``, float64."""
        w, x, y, z = self.rotation.astype(np.float64).T
        return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    @property
    def has_outlines(self) -> bool:
        """Whether outlines are known that are not all the first ones of their sizes, as large as these; files say them only then."""
        return bool(self.variant.any() or (np.isfinite(self.factor) & (self.factor != 1.0)).any())

    @property
    def origin(self) -> np.ndarray:
        """Where formats whose positions are 32-bit floats count from [m], shape ``[3]``: whole meters, 0 unless all lie far from it.

        World coordinates are millions of meters, of which such floats hold half of one.
        """
        middle = np.zeros(3)
        if len(self.position):
            middle = np.rint(0.5 * (self.position.min(axis=0) + self.position.max(axis=0)))
        reach, extent = (float(np.abs(p).max(initial=0.0)) for p in (self.position, self.position - middle))
        return middle if reach > FAR and extent < NEARER * reach else np.zeros(3)

    def columns(self) -> dict[str, np.ndarray]:
        """Return everything that there is one value of for each body, as tables hold it; shapes ``[n]``."""
        return {
            "id": self.id,
            **dict(zip(("x", "y", "z"), self.position.T, strict=True)),
            **{name: getattr(self, name) for name in ("class_index", "size_index", "length", "width", "area")},
            **({"variant": self.variant, "scale": self.factor} if self.has_outlines else {}),
            **{f"rotation_{axis}": values for axis, values in zip("wxyz", self.rotation.T, strict=True)},
            **{f"scale_{axis}": values for axis, values in zip("xyz", self.scale.T, strict=True)},
            "prototype_index": self.prototype_index,
            "fixed": self.fixed.astype(np.int32),
        }

    def names(self) -> str:
        """Return the names that indices count, as JSON in ASCII on one line."""
        prototypes = [prototype.name for prototype in self.prototypes]
        return json.dumps({"class": self.class_name, "size": self.size_name, "prototype": prototypes})


# What is read of a table from elsewhere, beside names.
READ_COLUMNS = (
    *("id", "x", "y", "z", "class_index", "size_index", "length", "width", "area", "angle", "prototype_index", "fixed"),
    *("variant", "scale"),
    *(f"rotation_{axis}" for axis in "wxyz"),
    *(f"scale_{axis}" for axis in "xyz"),
    *(f"{name}_{axis}" for name in ("normal", "tangent") for axis in "xyz"),
)


def read_names(text: str) -> dict[str, Any]:
    """Return what :meth:`Bodies.names` wrote; empty where it is something else."""
    try:
        names = json.loads(text)
    except ValueError:
        return {}
    return names if isinstance(names, dict) else {}


def check_assets(problem: Problem, assets: AssetFiles) -> dict[tuple[int, int, int], tuple[Path, ...]]:
    """Return the assets of every class, size and variant of its outlines, by their indices.

    Raises:
        EshError: An asset for a class or size that does not exist.
        InputFileError: A file that does not exist.
    """
    left = {
        str(name): tuple(map(Path, [paths] if isinstance(paths, (str, Path)) else paths))
        for name, paths in assets.items()
    }
    files: dict[tuple[int, int, int], tuple[Path, ...]] = {}
    labels: dict[str, list[tuple[int, int, int]]] = {}
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            for v in range(len(_outlines(size))):
                name = f"{body_class.name}/{size.name}"
                for label in (body_class.name, name, f"{name}/{v}"):
                    labels.setdefault(label, []).append((c, s, v))
    # Those of a whole class first, then of a size, so that what is said of less replaces them.
    for label in sorted(labels, key=lambda label: -len(labels[label])):
        if label in left:
            files |= dict.fromkeys(labels[label], left.pop(label))
    if left:
        known = [f"{c.name}/{size.name}" for c in problem.classes for size in c.sizes]
        raise EshError(f"an asset must be for a class or a size ({', '.join(known)}); got {', '.join(map(repr, left))}")
    for path in (path for paths in files.values() for path in paths):
        check_is_file(path, AN_ASSET)
    return files


def bodies_of(placement: Placement, assets: AssetFiles | None = None) -> Bodies:
    """Return the bodies of a placement, flat on the plane z = 0 or standing on its surface, with a prototype for every size.

    Args:
        placement: What to write.
        assets: Files that hold the objects, by ``"class"``, ``"class/size"`` or, of a size with several outlines,
            ``"class/size/variant"``, counted from 0; the object's footprint is around its origin, and is its outline or has the
            size's mean area; its long axis lies along x, and z (in glTF: y) points up.

    Raises:
        EshError: See :func:`check_assets`.
    """
    problem = placement.problem
    count = len(placement.position)
    scale = np.ones((count, 3))
    if placement.normal is not None and placement.tangent is not None:
        position, rotation = placement.position, wxyz_of_axes(placement.tangent, placement.normal)
    else:
        half, still = 0.5 * np.asarray(placement.angle), np.zeros(count)
        position = np.column_stack([placement.position, still])
        rotation = np.stack([np.cos(half), still, still, np.sin(half)], axis=1)
    prototypes: list[Prototype] = []
    index = np.empty(count, np.int32)
    files = check_assets(problem, assets or {})
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            outlines = _outlines(size)
            for v, outline in enumerate(outlines):
                own = np.flatnonzero(
                    (placement.class_index == c) & (placement.size_index == s) & (placement.variant == v)
                )
                index[own] = len(prototypes)
                corners, height, scale[own] = _stand_in(placement, own, size, outline)
                color = PALETTE[c % len(PALETTE)]
                prototypes.append(Prototype(_label(problem, c, s, v), corners, height, color, files.get((c, s, v), ())))
    return Bodies(
        position=position,
        rotation=rotation.astype(np.float32),
        scale=scale.astype(np.float32),
        prototype_index=index,
        prototypes=tuple(prototypes),
        id=np.asarray(placement.id, np.int64),
        class_index=np.asarray(placement.class_index, np.int32),
        size_index=np.asarray(placement.size_index, np.int32),
        class_name=placement.class_name,
        size_name=tuple(tuple(size.name for size in body_class.sizes) for body_class in problem.classes),
        length=np.asarray(placement.length, np.float64),
        width=np.asarray(placement.width, np.float64),
        area=np.asarray(placement.area, np.float64),
        fixed=np.asarray(placement.fixed, bool),
        variant=np.asarray(placement.variant, np.int32),
        factor=np.asarray(placement.scale, np.float64),
    )


def trial_bodies(problem: Problem, assets: AssetFiles) -> Bodies:
    """Return a body for every asset, all in one place: whether a format can take them is known before there is a placement.

    Those of lines are stretched, since hardly two lines are equally long.

    Raises:
        EshError: See :func:`check_assets`.
    """
    files = check_assets(problem, assets)
    lines = [problem.classes[c].sizes[s].kind.has_axis for c, s, _ in files]
    still = np.zeros(len(files))
    columns = {"x": still, "y": still, "prototype_index": np.arange(len(files)), "scale_x": np.where(lines, 2.0, 1.0)}
    prototypes = tuple(
        Prototype(_label(problem, *place), _capsule(1.0, 0.0), 1.0, assets=paths) for place, paths in files.items()
    )
    return replace(bodies_from_columns(columns, {}, "a trial"), prototypes=prototypes)


def _label(problem: Problem, c: int, s: int, v: int) -> str:
    """What bodies of a class, a size and one of its outlines are called; no more is said than tells them apart."""
    body_class = problem.classes[c]
    size = body_class.sizes[s]
    if len(_outlines(size)) > 1:
        return f"{body_class.name}/{size.name}/{v}"
    return body_class.name if len(body_class.sizes) == 1 else f"{body_class.name}/{size.name}"


def _outlines(size: Size) -> tuple[Footprint | None, ...]:
    """The outlines that bodies of a size may have; None stands for a disc or a capsule of their own."""
    return size.footprint.outlines if isinstance(size.footprint, Footprints) else (None,)


def _stand_in(
    placement: Placement, own: np.ndarray, size: Size, outline: Footprint | None
) -> tuple[np.ndarray, float, np.ndarray]:
    """Corners and height of the prism that stands in for some bodies [m], and factors on it, shape ``[n, 3]``."""
    if outline is not None:
        factor = np.asarray(placement.scale, np.float64)[own, None]
        return outline.outline(CORNERS // 2), outline.width, np.repeat(factor, 3, axis=1)
    if not size.kind.has_axis:
        radius = float(disc_radius(size.mean_area))
        factor = np.sqrt(placement.area[own] / size.mean_area)[:, None]
        return _capsule(radius, 0.0), 2.0 * radius, np.repeat(factor, 3, axis=1)
    return _capsules(placement.length[own], placement.width[own])


def bodies_from_columns(columns: Mapping[str, Any], names: Mapping[str, Any], source: str) -> Bodies:
    """Return the bodies that a table holds; what it lacks is upright, unscaled and of one class.

    Args:
        columns: Name of a column -> its values, shapes ``[n]``; ``x`` and ``y`` are needed, see :meth:`Bodies.columns`;
            where there is no ``rotation_w``, ``normal_x`` and ``tangent_x`` to ``_z`` count, or else ``angle`` [rad].
        names: See :meth:`Bodies.names`; indices take the place of names that are missing.
        source: What messages call the file.

    Raises:
        InputFileError: A column that is missing, of another length, or holds something else than numbers.
    """
    for key in ("x", "y"):
        if key not in columns:
            raise InputFileError(f"{source} must hold the columns x and y; it holds {', '.join(columns) or 'none'}")
    count = len(columns["x"])
    column = partial(_column, columns, source)
    position = np.stack([column(key, 0.0) for key in ("x", "y", "z")], axis=1)
    rotation = _rotation(columns, source)
    class_index = _index(column("class_index", 0.0), f"{source}: class_index")
    size_index = _index(column("size_index", 0.0), f"{source}: size_index")
    class_name = _strings(names.get("class"), int(class_index.max(initial=-1)) + 1, "class")
    given = names.get("size")
    given = given if isinstance(given, (list, tuple)) else []
    size_name = tuple(
        _strings(
            given[c] if c < len(given) else None, int(size_index[class_index == c].max(initial=-1)) + 1, class_name[c]
        )
        for c in range(len(class_name))
    )
    if "prototype_index" in columns or "class_index" not in columns:
        prototype_index = _index(column("prototype_index", 0.0), f"{source}: prototype_index")
        labels = _strings(names.get("prototype"), int(prototype_index.max(initial=-1)) + 1, "prototype")
    else:
        # Every size has something of its own, as where placements are written with prototypes.
        pairs, index = np.unique(np.stack([class_index, size_index], axis=1), axis=0, return_inverse=True)
        prototype_index = index.ravel().astype(np.int32)
        labels = tuple(
            class_name[c] if len(size_name[c]) == 1 else f"{class_name[c]}/{size_name[c][s]}" for c, s in pairs.tolist()
        )
    area, length, width = column("area", math.nan), column("length", 0.0), column("width", 0.0)
    of_prototype = [np.flatnonzero(prototype_index == number) for number in range(len(labels))]
    scale = np.stack([column(f"scale_{axis}", 1.0) for axis in "xyz"], axis=1)
    prototypes = []
    for number, own in enumerate(of_prototype):
        prototype, factor = _known_only(labels[number], area[own], length[own], width[own], number)
        prototypes.append(prototype)
        if "scale_x" not in columns and "prototype_index" not in columns:
            scale[own] = factor
    return Bodies(
        position=position,
        rotation=rotation.astype(np.float32),
        scale=scale.astype(np.float32),
        prototype_index=prototype_index,
        prototypes=tuple(prototypes),
        # Not through float64: ids may be larger than what that counts exactly.
        id=np.asarray(columns["id"]).astype(np.int64) if "id" in columns else np.arange(count, dtype=np.int64),
        class_index=class_index,
        size_index=size_index,
        class_name=class_name,
        size_name=size_name,
        length=length,
        width=width,
        area=area,
        fixed=column("fixed", 0.0) != 0.0,
        variant=_index(column("variant", 0.0), f"{source}: variant"),
        factor=column("scale", math.nan),
        named=bool(names.get("class")),
    )


def _column(columns: Mapping[str, Any], source: str, key: str, default: float) -> np.ndarray:
    """A column of a table, or its default for every body."""
    count = len(columns["x"])
    try:
        values = np.asarray(columns[key] if key in columns else np.full(count, default), dtype=np.float64)
    except (TypeError, ValueError):
        raise InputFileError(f"{source}: column {key} must hold numbers") from None
    if values.shape != (count,):
        raise InputFileError(f"{source}: column {key} must hold one number per body, {count}; got {values.shape}")
    if key not in ("area", "scale") and not np.isfinite(values).all():
        raise InputFileError(f"{source}: column {key} must hold finite numbers")
    return values


def _rotation(columns: Mapping[str, Any], source: str) -> np.ndarray:
    """Quaternions of a table's bodies (w, x, y, z), of length 1, shape ``[n, 4]``; about z where there is only an angle."""
    axes = [[f"{name}_{axis}" for axis in "xyz"] for name in ("tangent", "normal")]
    if "rotation_w" not in columns and all(key in columns for keys in axes for key in keys):
        x, z = (np.stack([_column(columns, source, key, 0.0) for key in keys], axis=1) for keys in axes)
        z = _of_length_one(z, f"{source}: normals")
        # Others' may be a little askew.
        x = _of_length_one(x - (x * z).sum(axis=1, keepdims=True) * z, f"{source}: tangents, beside normals,")
        return wxyz_of_axes(x, z)
    if "rotation_w" not in columns:
        half = 0.5 * _column(columns, source, "angle", 0.0)
        return np.stack([np.cos(half), np.zeros(len(half)), np.zeros(len(half)), np.sin(half)], axis=1)
    rotation = np.stack([_column(columns, source, f"rotation_{axis}", 0.0) for axis in "wxyz"], axis=1)
    return _of_length_one(rotation, f"{source}: rotations")


def _of_length_one(vectors: np.ndarray, what: str) -> np.ndarray:
    norm = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (norm > 0.0).all():
        raise InputFileError(f"{what} must not be 0")
    return vectors / norm


def _known_only(
    label: str, area: np.ndarray, length: np.ndarray, width: np.ndarray, number: int
) -> tuple[Prototype, np.ndarray]:
    """What stands for bodies of which areas [m²], lengths and widths [m] are known, where they are, and factors on it, ``[n, 3]``."""
    color = PALETTE[number % len(PALETTE)]
    if len(width) and (width > 0.0).all():
        corners, height, factor = _capsules(length, width)
        return Prototype(label, corners, height, color), factor
    known = area[np.isfinite(area)]
    mean = float(known.mean()) if known.size else math.pi * 0.25
    radius = float(disc_radius(mean))
    factor = np.sqrt(np.where(np.isfinite(area), area, mean) / max(mean, 1e-300))
    return Prototype(label, _capsule(radius, 0.0), 2.0 * radius, color), np.repeat(factor[:, None], 3, axis=1)


def _capsules(length: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Corners and height of the prism that stands in for capsules [m], and factors on it, shape ``[n, 3]``."""
    radius, mean = 0.5 * float(width.mean()), float(length.mean())
    thicker = width / (2.0 * radius)
    longer = (length + width) / (mean + 2.0 * radius)
    return _capsule(radius, mean), 2.0 * radius, np.stack([longer, thicker, thicker], axis=1)


def _capsule(radius: float, length: float) -> np.ndarray:
    """Return the outline of a disc, or of a capsule along x, with as much area, shape ``[corners, 2]``."""
    angle = np.arange(CORNERS) * (2.0 * math.pi / CORNERS) - 0.5 * math.pi * (1.0 - 2.0 / CORNERS)
    corner = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # A polygon within a circle holds a little less than it.
    corner *= radius * math.sqrt(2.0 * math.pi / (CORNERS * math.sin(2.0 * math.pi / CORNERS)))
    corner[:, 0] += 0.5 * length * np.where(np.arange(CORNERS) < CORNERS // 2, 1.0, -1.0)
    return corner


def _index(values: np.ndarray, key: str) -> np.ndarray:
    if values.size and not (values.min() >= 0 and values.max() < 2**31 and (values == np.round(values)).all()):
        raise InputFileError(f"{key} must hold whole numbers of at least 0")
    return values.astype(np.int32)


def _strings(names: object, least: int, otherwise: str) -> tuple[str, ...]:
    given: Sequence[object] = names if isinstance(names, (list, tuple)) else ()
    return (*(str(name) for name in given), *(f"{otherwise} {number + 1}" for number in range(len(given), least)))
