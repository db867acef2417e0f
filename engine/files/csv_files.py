"""Tables of text: placements as this program writes them, and tables from elsewhere that have the same columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from ..errors import InputFileError
from ..problem.validation import show
from .cell_text import name_in_cell
from .placement_columns import COLUMNS

if TYPE_CHECKING:
    from ..problem.placement import Placement

__all__ = ["read_csv", "write_csv"]


def write_csv(file: BinaryIO, placement: Placement) -> None:
    """Write a line for every body, its columns named in the first line."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    rows = csv.writer(text, lineterminator="\n")
    columns = [column for column in COLUMNS if column.when.holds(placement)]
    rows.writerow(column.name for column in columns)
    # Python writes the shortest digits that read back as the same number.
    rows.writerows(zip(*(column.values(placement) for column in columns), strict=True))
    text.detach()


def read_csv(path: Path, numbers: Collection[str]) -> dict[str, np.ndarray]:
    """Read columns of a table, by name.

    Args:
        path: The file.
        numbers: Columns that hold numbers: float64, but ``id`` int64. An empty cell is what :data:`.placement_columns.COLUMNS` says.

    Returns:
        Those of them that are there, ``x`` and ``y`` in any case; and columns of names, of which ``COLUMNS`` knows.

    Raises:
        InputFileError: A file that is no table, a line of another length, or a number that is none.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file)
            names = [name.strip() for name in next(rows, [])]
            # A line may go on in the next one, and an empty one says nothing.
            lines = [(rows.line_num, row) for row in rows if row]
    except (OSError, ValueError, csv.Error) as error:
        raise InputFileError(f"{path} cannot be read as a table: {' '.join(str(error).split())[:200]}") from None
    for needed in ("x", "y"):
        if needed not in names:
            raise InputFileError(f"{path} must have a column `{needed}`; its columns are {show(', '.join(names))}")
    for number, line in lines:
        if len(line) != len(names):
            raise InputFileError(f"{path} must have {len(names)} cells in every line; line {number} has {len(line)}")
    cells = dict(
        zip(names, zip(*(line for _, line in lines), strict=True) if lines else [()] * len(names), strict=True)
    )
    empty = {column.name: column.otherwise for column in COLUMNS}
    found: dict[str, np.ndarray] = {}
    for column in COLUMNS:
        if column.text and column.name in cells:
            found[column.name] = np.array(list(map(name_in_cell, cells[column.name])), dtype=np.str_)
    for name in (name for name in names if name in numbers):
        where = f"{path} must hold numbers in its column `{name}`"
        at = [number for number, _ in lines]
        found[name] = _numbers(cells[name], empty.get(name, np.nan), where, at, whole=name == "id")
    return found


def _numbers(cells: Sequence[str], otherwise: float, where: str, lines: Sequence[int], *, whole: bool) -> np.ndarray:
    """Numbers in cells; whole ones as int64, which floats would not count exactly."""
    values: list[float] = []
    for cell, line in zip(cells, lines, strict=True):
        try:
            values.append((_whole(cell) if whole else float(cell)) if cell.strip() else otherwise)
        except ValueError:
            raise InputFileError(f"{where}; line {line} has {show(cell)}") from None
    # A number beyond int64 is a float here, which only an id that is wrong can be.
    fits = whole and all(float(value).is_integer() and abs(value) < 2**63 for value in values)
    return np.array(values, np.int64 if fits else np.float64)


def _whole(cell: str) -> int | float:
    """A whole number that fits into an id, or whatever number it is."""
    value = float(cell)
    try:
        number = int(cell)
    except ValueError:
        return value
    return number if abs(number) < 2**63 else value
