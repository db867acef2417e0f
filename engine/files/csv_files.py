"""Tables of text: placements as this program writes them, and tables from elsewhere that have the same columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import numpy as np

from ..errors import InputFileError
from ..problem.given_values import show
from .cell_text import name_in_cell
from .placement_columns import COLUMNS, Column

if TYPE_CHECKING:
    from ..problem.placement import Placement

__all__ = ["Table", "read_csv", "write_csv"]


def write_csv(file: BinaryIO, placement: Placement) -> None:
    """Write a line for every body, its columns named in the first line."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    rows = csv.writer(text, lineterminator="\n")
    columns = [column for column in COLUMNS if column.when.holds(placement)]
    rows.writerow(column.name for column in columns)
    # Python writes the shortest digits that read back as the same number.
    rows.writerows(zip(*(column.values(placement) for column in columns), strict=True))
    text.detach()


class Table(NamedTuple):
    """What was read of a table.

    Attributes:
        columns: Values by name, shape ``[n]`` each: float64, int64 where they are whole numbers, or names.
        line: Of every row, in the file, shape ``[n]``.
    """

    columns: dict[str, np.ndarray]
    line: np.ndarray


def read_csv(path: Path, numbers: Collection[str]) -> Table:
    """Read columns of a table.

    Args:
        path: The file.
        numbers: Columns that hold numbers. An empty cell is what :data:`.placement_columns.COLUMNS` says; that of an index
            without a name is refused.

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
    except UnicodeDecodeError:
        raise InputFileError(f"{path} must be text in UTF-8; save it as UTF-8 in the program that it is from") from None
    except (OSError, ValueError, csv.Error) as error:
        raise InputFileError(f"{path} cannot be read as a table: {' '.join(str(error).split())[:200]}") from None
    known = {column.name: column for column in COLUMNS}
    read = [name for name in names if name in numbers or (name in known and known[name].text)]
    for name in names:
        small = name.lower()
        if name not in known and small in known and small not in names:
            raise InputFileError(f"{path} must name its columns in small letters; it has {show(name)}")
    for needed in ("x", "y"):
        if needed not in names:
            raise InputFileError(f"{path} must have a column `{needed}`; its columns are {show(', '.join(names))}")
    for name in read:
        if read.count(name) > 1:
            raise InputFileError(f"{path} must have one column `{name}`; it has {read.count(name)}")
    for number, line in lines:
        if len(line) != len(names):
            raise InputFileError(f"{path} must have {len(names)} cells in every line; line {number} has {len(line)}")
    at = [number for number, _ in lines]
    columns: dict[str, np.ndarray] = {}
    for name in read:
        place = names.index(name)
        cells = [line[place] for _, line in lines]
        column = known.get(name)
        if column is not None and column.text:
            columns[name] = np.array(list(map(name_in_cell, cells)), dtype=np.str_)
        elif column is not None and column.bits:
            labels = f"{name.removesuffix('_index')}_name"
            named = [bool(line[names.index(labels)].strip()) for _, line in lines] if labels in read else None
            columns[name] = _whole_numbers(cells, column, str(path), at, named)
        else:
            otherwise = np.nan if column is None else column.otherwise
            columns[name] = _numbers(cells, otherwise, f"{path} must hold numbers in its column `{name}`", at)
    return Table(columns, np.array(at, np.int64))


def _numbers(cells: Sequence[str], otherwise: float, where: str, lines: Sequence[int]) -> np.ndarray:
    values: list[float] = []
    for cell, line in zip(cells, lines, strict=True):
        try:
            values.append(float(cell) if cell.strip() else otherwise)
        except ValueError:
            raise InputFileError(f"{where}; line {line} has {show(cell)}") from None
    return np.array(values, np.float64)


def _whole_numbers(
    cells: Sequence[str], column: Column, path: str, lines: Sequence[int], named: Sequence[bool] | None
) -> np.ndarray:
    """Numbers in cells, int64, which floats would not count exactly.

    Args:
        cells: What was read.
        column: Where.
        path: The file.
        lines: Of the cells in it.
        named: Whether the line has a name for what such a number counts; None where there is no column of names.
    """
    values: list[int] = []
    for place, (cell, line) in enumerate(zip(cells, lines, strict=True)):
        otherwise = None if column.name.endswith("_index") and not (named and named[place]) else int(column.otherwise)
        value = _whole(cell) if cell.strip() else otherwise
        fits = value is not None and -(2 ** (column.bits - 1)) <= value < 2 ** (column.bits - 1)
        if value is None or not fits:
            what = "whole numbers" if value is None else f"whole numbers of at most {column.bits} bits"
            raise InputFileError(f"{path} must hold {what} in its column `{column.name}`; line {line} has {show(cell)}")
        values.append(value)
    return np.array(values, np.int64)


def _whole(cell: str) -> int | None:
    """The whole number that a cell holds, also as 7.0 or 7e3; None for what is none."""
    try:
        return int(cell)
    except ValueError:
        pass
    try:
        value = float(cell)
    except ValueError:
        return None
    return int(value) if value.is_integer() else None
