"""What a recipe says of outlines: the key ``footprint`` of a size, and those that go with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import ProblemError
from ..problem import validation
from ..problem.footprint import Footprint
from ..problem.footprints import Footprints
from ..problem.given_values import show
from ..problem.settings import settings_of

__all__ = ["FOOTPRINT_KEYS", "OUTLINES", "check_footprint", "written_outlines"]

# What the key `footprint` says itself, and the keys that go with it.
OUTLINES = ("variants", "weights")
FOOTPRINT_KEYS = tuple(name for name in settings_of(Footprints) if name not in OUTLINES)
ACCEPTED = (
    "{ disc = radius }, { capsule = [length, width] }, { rectangle = [length, width] } or { polygon = [[x, y], ...] }"
)
# Of every outline: what it is made by.
_KINDS: dict[str, Callable[[Any, float], Footprint]] = {
    "disc": lambda value, rounding: Footprint.disc(value),
    "capsule": lambda value, rounding: Footprint.capsule(*_two(value, "capsule")),
    "rectangle": lambda value, rounding: Footprint.rectangle(*_two(value, "rectangle"), rounding),
    "polygon": lambda value, rounding: Footprint.polygon(value, rounding),
    # As they are: what a recipe is written with.
    "corners": lambda value, rounding: Footprint(value, rounding),
}
_ROUNDED = ("rectangle", "polygon", "corners")


def check_footprint(value: object, key: str) -> tuple[tuple[Footprint, ...], tuple[float, ...] | None]:
    """Return the outlines that a `footprint` describes, one table or a list of them, and their weights where it has some."""
    given = value if isinstance(value, list) else [value]
    tables: list[dict[str, Any]] = [table for table in given if isinstance(table, dict)]
    if not tables or len(tables) < len(given):
        raise ProblemError(f"{key} must be {ACCEPTED}, or a list of such; got {show(value)}")
    outlines = tuple(_outline(table, key) for table in tables)
    if not any("weight" in table for table in tables):
        return outlines, None
    return outlines, tuple(
        validation.check_at_least_zero(table.get("weight", 1.0), f"`weight` of {key}") for table in tables
    )


def written_outlines(footprints: Footprints) -> list[dict[str, Any]]:
    """Return the value of the key ``footprint`` to write."""
    none: list[Any] = [None] * len(footprints.outlines)
    weights = none if footprints.weights is None else list(footprints.weights)
    tables = []
    for outline, weight in zip(footprints.outlines, weights, strict=True):
        table: dict[str, Any] = {"corners": outline.corners.tolist()}
        if outline.rounding:
            table["rounding"] = outline.rounding
        if weight is not None:
            table["weight"] = weight
        tables.append(table)
    return tables


def _outline(table: dict[str, Any], key: str) -> Footprint:
    kinds = [name for name in table if name in _KINDS]
    unknown = [name for name in table if name not in _KINDS and name not in ("rounding", "weight")]
    if len(kinds) != 1 or unknown:
        raise ProblemError(f"{key} must be {ACCEPTED}, with `rounding` and `weight` where wanted; got {show(table)}")
    kind = kinds[0]
    if "rounding" in table and kind not in _ROUNDED:
        raise ProblemError(f"`rounding` of {key} is only for a rectangle or a polygon; got it beside `{kind}`")
    try:
        return _KINDS[kind](table[kind], validation.check_at_least_zero(table.get("rounding", 0.0), "`rounding`"))
    except ProblemError as error:
        raise ProblemError(f"{key}: {error}") from None


def _two(value: object, kind: str) -> tuple[Any, Any]:
    if not isinstance(value, list) or len(value) != 2:
        raise ProblemError(f"`{kind}` must be two lengths in meters, length and width; got {show(value)}")
    return value[0], value[1]
