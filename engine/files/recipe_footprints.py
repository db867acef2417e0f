"""What a recipe says of outlines: the keys ``footprint``, ``turn``, ``scale_jitter``, ``room`` and ``gap`` of a size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import ProblemError
from ..problem import validation
from ..problem.footprint import Footprint, Footprints
from ..problem.validation import show

__all__ = ["FOOTPRINT_KEYS", "check_footprint", "footprints_from"]

# Keys that go with `footprint`, and what each is by default.
FOOTPRINT_KEYS = {"turn": "free", "scale_jitter": 0.0, "room": 1.0, "gap": 0.0}
ACCEPTED = (
    "{ disc = radius }, { capsule = [length, width] }, { rectangle = [length, width] } or { polygon = [[x, y], ...] }"
)
# Of every outline: what it is made by.
_KINDS: dict[str, Callable[[Any, float], Footprint]] = {
    "disc": lambda value, rounding: Footprint.disc(value),
    "capsule": lambda value, rounding: Footprint.capsule(*_two(value, "capsule")),
    "rectangle": lambda value, rounding: Footprint.rectangle(*_two(value, "rectangle"), rounding),
    "polygon": lambda value, rounding: Footprint.polygon(value, rounding),
}
_ROUNDED = ("rectangle", "polygon")


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


def footprints_from(
    outlines: tuple[tuple[Footprint, ...], tuple[float, ...] | None], settings: dict[str, Any]
) -> Footprints:
    """Return the footprints of a size; ``settings`` holds those of :data:`FOOTPRINT_KEYS` that it has."""
    return Footprints(outlines[0], weights=outlines[1], **settings)


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
        raise ProblemError(f"`{kind}` must be two lengths in metres, length and width; got {show(value)}")
    return value[0], value[1]
