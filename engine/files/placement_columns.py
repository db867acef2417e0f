"""The columns of a placement as a table: what each is called, what it holds, and when it is there.

The writer and the reader of ``.csv`` files and the table in ``docs/command-line.md`` follow this list. A new column is an entry here,
and an array of the same name in ``.npz`` files where it is to be there, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .cell_text import as_cell

if TYPE_CHECKING:
    from ..problem.placement import Placement

__all__ = ["COLUMNS", "Column", "When", "is_marked", "size_names"]


@dataclass(frozen=True)
class When:
    """In which placements a column is.

    Attributes:
        words: The same in the documentation.
        holds: Tells it of a placement.
    """

    words: str
    holds: Callable[[Placement], bool]


@dataclass(frozen=True)
class Column:
    """A column of a table with a line for every body.

    Attributes:
        name: In the first line.
        unit: ``m``, ``m²``, ``rad``, or nothing.
        help: What it says.
        values: What it holds, for every body in the placement's order; numbers and texts of Python.
        when: In which placements it is.
        text: Whether it holds names, not numbers.
        otherwise: What an empty cell means where the table is read.
        bits: Of how many the whole numbers are that it holds, with their sign; 0 for other numbers.
    """

    name: str
    unit: str
    help: str
    values: Callable[[Placement], Sequence[Any]]
    when: When
    text: bool = False
    otherwise: float = float("nan")
    bits: int = 0


def is_marked(placement: Placement) -> bool:
    """Whether bodies have identities of their own, or are fixed."""
    import numpy as np

    return bool(placement.fixed.any() or (placement.id != np.arange(len(placement.id))).any())


def size_names(placement: Placement) -> list[str]:
    """Name of the size of every body."""
    names = [[size.name for size in body_class.sizes] for body_class in placement.problem.classes]
    return [names[c][s] for c, s in zip(placement.class_index.tolist(), placement.size_index.tolist(), strict=True)]


def _class_names(placement: Placement) -> list[str]:
    names = [body_class.name for body_class in placement.problem.classes]
    return [names[c] for c in placement.class_index.tolist()]


def _cells(names: Callable[[Placement], list[str]]) -> Callable[[Placement], list[str]]:
    return lambda placement: [as_cell(name) for name in names(placement)]


def _entry(name: str, column: int | None = None) -> Callable[[Placement], Sequence[Any]]:
    """Values of an array of the placement, or of one of its columns."""

    def values(placement: Placement) -> Sequence[Any]:
        array = getattr(placement, name)
        return (array if column is None else array[:, column]).tolist()

    return values


ALWAYS = When("always", lambda placement: True)
MARKED = When("where bodies are fixed, or were edited", is_marked)
ON_SURFACE = When("on a surface", lambda placement: placement.normal is not None)

COLUMNS: tuple[Column, ...] = (
    Column("x", "m", "position, to the right; 0 is the left edge of the domain", _entry("position", 0), ALWAYS),
    Column("y", "m", "position, up; 0 is the lower edge of the domain", _entry("position", 1), ALWAYS),
    Column("z", "m", "position, the third coordinate", _entry("position", 2), ON_SURFACE),
    Column("class_index", "", "number of the class, from 0", _entry("class_index"), ALWAYS, otherwise=0.0, bits=32),
    Column(
        "size_index",
        "",
        "number of the size in its class, from 0",
        _entry("size_index"),
        ALWAYS,
        otherwise=0.0,
        bits=32,
    ),
    Column(
        "angle",
        "rad",
        "how the outline is turned, or where the axis points; counter-clockwise from x",
        _entry("angle"),
        ALWAYS,
        otherwise=0.0,
    ),
    Column("length", "m", "of the axis; 0 for dots", _entry("length"), ALWAYS),
    Column("class_name", "", "name of the class", _cells(_class_names), ALWAYS, text=True),
    Column("size_name", "", "name of the size", _cells(size_names), ALWAYS, text=True),
    Column("width", "m", "of the capsule around the axis; 0 for dots", _entry("width"), ALWAYS),
    Column("area", "m²", "ground that the body takes", _entry("area"), ALWAYS),
    Column(
        "variant",
        "",
        "which of the outlines of its size the body has, from 0",
        _entry("variant"),
        ALWAYS,
        otherwise=0.0,
        bits=32,
    ),
    Column("scale", "", "factor on that outline", _entry("scale"), ALWAYS),
    Column("id", "", "identity", _entry("id"), MARKED, otherwise=-1.0, bits=64),
    Column("fixed", "", "1 if the body was fixed, else 0", lambda p: p.fixed.astype(int).tolist(), MARKED),
    *(
        Column(f"normal_{axis}", "", f"outward normal of the surface, along {axis}", _entry("normal", k), ON_SURFACE)
        for k, axis in enumerate("xyz")
    ),
    *(
        Column(f"tangent_{axis}", "", f"where the body points, along {axis}", _entry("tangent", k), ON_SURFACE)
        for k, axis in enumerate("xyz")
    ),
    Column("mesh", "", "number of the mesh, from 0", _entry("mesh"), ON_SURFACE),
    Column("triangle", "", "number of the triangle in the mesh, from 0", _entry("triangle"), ON_SURFACE),
    *(
        Column(
            f"weight_{k}",
            "",
            f"weight of the triangle's corner {k} in the position",
            _entry("barycentric", k),
            ON_SURFACE,
        )
        for k in range(3)
    ),
)
