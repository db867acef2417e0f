"""Fixed bodies from files: placements as this program writes them, or tables from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem.fixed_bodies import FixedBodies, Origin, WrongBodyError
from ..problem.given_values import as_path
from ..problem.settings import settle
from .array_files import read_arrays
from .body_formats import FORMATS
from .csv_files import read_csv
from .input_file import check_is_file
from .placement_files import one_of

__all__ = ["read_fixed_bodies"]

ACCEPTED = "fixed bodies are a .npz or .csv file, or one of the other formats that placements are written in"
# What is read of every body, beside its position and names.
NUMBERS = ("angle", "length", "area", "id", "class_index", "size_index", "variant", "scale")


class _Read(NamedTuple):
    """Values of bodies by name, and the line of each in its file; None where that has no lines."""

    columns: dict[str, np.ndarray]
    line: np.ndarray | None = None


def read_fixed_bodies(path: str | Path, *, body_class: str | None = None, size: str | None = None) -> FixedBodies:
    """Read bodies that are to stay where they are.

    Args:
        path: A ``.csv`` with a line of column names: ``x`` and ``y`` [m] are needed; ``class_name`` or ``class_index``, ``size_name``
            or ``size_index``, ``angle`` [rad], ``length`` [m], ``area`` [m²], ``id``, ``variant`` and ``scale`` are read, others are
            not looked at. Or a ``.npz`` with ``position`` [m], shape ``[n, 2]``, and the same names. Both are what
            :func:`~esh.write_placement` writes. An empty cell, but of an index without a name beside it, and NaN in ``length``,
            ``area`` and ``scale``, say nothing of a body. Or a file of another program, see :func:`~esh.load_placement`; bodies are
            seen from above.
        body_class: The class of all of them, whatever the file says.
        size: Their size, whatever the file says.

    Raises:
        InputFileError: A missing or damaged file, or one that holds something else.
    """
    path = as_path(path)
    readers = {".csv": _read_csv, ".npz": _read_npz} | dict.fromkeys(FORMATS, _read_bodies)
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputFileError(f"{path} must end in {one_of(readers)}; got the ending {path.suffix!r}")
    check_is_file(path, ACCEPTED)
    line: np.ndarray | None = None
    try:
        columns, line = reader(path)
        bodies = FixedBodies(
            columns["position"],
            _label(columns, "class", body_class),
            _label(columns, "size", size),
            columns.get("angle", 0.0),
            columns.get("length"),
            columns.get("area"),
            columns.get("id"),
            columns.get("variant", 0),
            columns.get("scale"),
        )
        given = {name for name, label in (("body_class", body_class), ("size", size)) if label is not None}
        settle(bodies, origin=Origin(str(path), line, given))
        return bodies
    except WrongBodyError as error:
        raise InputFileError(f"{Origin(str(path), line).told(error.body, '')}{error}") from None
    except ProblemError as error:
        raise InputFileError(f"{path}: {error}") from None
    except InputFileError:
        raise
    except (OSError, ValueError) as error:
        raise InputFileError(f"{path} cannot be read ({' '.join(str(error).split())}); {ACCEPTED}") from None


def _label(columns: dict[str, np.ndarray], what: str, chosen: str | None) -> str | int | Sequence[str | int]:
    """Class or size of every body: names where there are some."""
    if chosen is not None:
        return chosen
    for name in (f"{what}_name", f"{what}_index"):
        if name in columns:
            return columns[name].tolist()
    return 0


def _read_bodies(path: Path) -> _Read:
    bodies = FORMATS[path.suffix.lower()].read(path)
    columns = {key: getattr(bodies, key) for key in ("angle", "length", "area", "id", "class_index", "size_index")}
    if bodies.named:
        columns |= {"variant": bodies.variant, "scale": bodies.factor}
        pairs = zip(bodies.class_index.tolist(), bodies.size_index.tolist(), strict=True)
        columns["size_name"] = np.array([bodies.size_name[c][s] for c, s in pairs], dtype=np.str_)
        columns["class_name"] = np.array([bodies.class_name[c] for c in bodies.class_index.tolist()], dtype=np.str_)
    return _Read(columns | {"position": bodies.position[:, :2]})


def _read_csv(path: Path) -> _Read:
    table = read_csv(path, ("x", "y", "z", "normal_x", *NUMBERS))
    # Others' tables may have heights, too; those of placements on a surface have its normals.
    axes = "xyz" if {"z", "normal_x"} <= table.columns.keys() else "xy"
    position = np.stack([table.columns[axis] for axis in axes], axis=1)
    return _Read(table.columns | {"position": position}, table.line)


def _read_npz(path: Path) -> _Read:
    columns = read_arrays(path, ("position", "class_name", "size_name", *NUMBERS))
    names = columns.get("class_name")
    # Placements list the names that their indices count.
    if names is not None and "class_index" in columns:
        index = columns.pop("class_index")
        known = np.arange(len(names) if names.ndim == 1 else 0)
        if not np.isin(index, known).all():
            raise InputFileError(f"{path} must have a name for every `class_index`; it has {len(known)} names")
        columns["class_name"] = names[index.astype(np.int64)]
    return _Read(columns)
