"""Placements read back, from every format that they are written in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputFileError
from ..problem.given_values import as_path
from .array_files import read_arrays
from .bodies import READ_COLUMNS, Bodies, bodies_from_columns
from .body_formats import FORMATS
from .csv_files import read_csv
from .placement_files import check_ending

__all__ = ["READABLE", "load_placement"]

# Endings of all files that are read.
READABLE = (".npz", ".csv", *FORMATS)


def load_placement(path: str | Path) -> Bodies:
    """Read where bodies are from a file that :func:`~esh.write_placement` or another program wrote.

    Args:
        path: A file with one of the endings of :func:`~esh.write_placement`. Of others' files, every USD point instancer and every
            glTF node with instances is read, and tables need the columns x and y; what a file does not say is upright, of its
            own size, of one class, and has the area NaN. Units and axes become meters and z up.

    Raises:
        InputFileError: A file that cannot be read.
        EshError: Another ending, or a library that the format needs and that is not installed.
    """
    path = as_path(path)
    ending = check_ending(path, READABLE)
    try:
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputFileError(f"{path} cannot be read: {' '.join(reason.split()).lower()}") from None
    if ending == ".npz":
        return _read_npz(path)
    if ending == ".csv":
        return _read_csv(path)
    return FORMATS[ending].read(path)


def _read_npz(path: Path) -> Bodies:
    arrays = read_arrays(path)
    position = arrays.pop("position", None)
    if position is None or position.ndim != 2 or position.shape[1] not in (2, 3):
        raise InputFileError(f"{path} must hold an array `position` of shape [n, 2]")
    columns = dict(zip("xyz", position.T, strict=False))
    for name in ("normal", "tangent"):
        if name in arrays and arrays[name].shape == (len(position), 3):
            columns |= {f"{name}_{axis}": values for axis, values in zip("xyz", arrays[name].T, strict=True)}
    columns |= {key: arrays[key] for key in arrays if key not in ("class_name", "size_name", "bends")}
    names: dict[str, Any] = {"class": [str(name) for name in arrays.get("class_name", [])]}
    if all(key in arrays for key in ("class_index", "size_index", "size_name")):
        names["size"] = _size_names(
            arrays["class_index"], arrays["size_index"], arrays["size_name"], len(names["class"])
        )
    return bodies_from_columns(columns, names, str(path))


def _read_csv(path: Path) -> Bodies:
    columns = read_csv(path, READ_COLUMNS).columns
    names = columns.pop("class_name", None)
    size_names = columns.pop("size_name", None)
    labels: list[str] = []
    sizes: list[list[str]] = []
    if "class_index" in columns and names is not None:
        pairs = sorted({(_whole(c), str(k)) for c, k in zip(columns["class_index"], names, strict=True)})
        labels = [name for _, name in pairs] if [c for c, _ in pairs] == list(range(len(pairs))) else []
    if labels and "size_index" in columns and size_names is not None:
        sizes = _size_names(columns["class_index"], columns["size_index"], size_names, len(labels))
    return bodies_from_columns(columns, {"class": labels, "size": sizes}, str(path))


def _size_names(
    class_index: Sequence[Any] | np.ndarray, size_index: Sequence[Any] | np.ndarray, names: Any, class_count: int
) -> list[list[str]]:
    """Return the names of the sizes of every class, from what every body says of its own."""
    triples = sorted(
        {(_whole(c), _whole(s), str(name)) for c, s, name in zip(class_index, size_index, names, strict=True)}
    )
    found: list[list[str]] = [[] for _ in range(class_count)]
    for c, s, name in triples:
        if 0 <= c < class_count and 0 <= s < len(triples):
            own = found[c]
            # A size that no body has is called by its number.
            own += [f"size {number + 1}" for number in range(len(own), s)]
            if s == len(own):
                own.append(name)
    return found


def _whole(text: Any) -> int:
    try:
        return int(float(text))
    except (ValueError, OverflowError):
        return -1
