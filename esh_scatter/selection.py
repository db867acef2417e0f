"""From objects that are selected to classes: one for each, named after it, its size measured, and a pleasant count."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import bpy

from ..engine.errors import ProblemError
from .target import is_result

if TYPE_CHECKING:
    from .properties.body_class import ESH_PG_class
    from .properties.scatter import ESH_PG_scatter

__all__ = ["Measured", "add_classes", "measure", "pleasant_counts", "sources_in"]

# What has a footprint: others, such as lights and cameras, are passed over.
SCATTERED_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class Measured(NamedTuple):
    """An object to place.

    Attributes:
        item: The object.
        area: Ground that one takes [m²].
        upright: Whether it is taller than it is wide, as a tree is and a plank is not.
    """

    item: bpy.types.Object
    area: float
    upright: bool


def sources_in(candidates: Iterable[bpy.types.Object], target: bpy.types.Object | None) -> list[bpy.types.Object]:
    """Return those of some objects that can be placed on a target, by name."""
    found = [item for item in candidates if item != target and item.type in SCATTERED_TYPES and not is_result(item)]
    return sorted(found, key=lambda item: item.name_full)


def measure(items: Sequence[bpy.types.Object], context: bpy.types.Context) -> tuple[list[Measured], list[str]]:
    """Measure objects as they stand.

    Returns:
        Those that take ground, and the names of those that take none.
    """
    from .footprint import measure_footprint

    measured, flat = [], []
    for item in items:
        try:
            footprint = measure_footprint(item, context)
        except ProblemError:
            flat.append(item.name)
            continue
        upright = item.dimensions.z > max(footprint.length, footprint.width)
        measured.append(Measured(item, footprint.area, upright))
    return measured, flat


def pleasant_counts(areas: Sequence[float], ground: float, cover: float, most: int) -> list[int]:
    """Return how many of each object look good together: small ones outnumber large ones, but take less ground.

    Args:
        areas: Ground that one of each takes [m²].
        ground: Area of the target [m²].
        cover: Share of the ground that all of them take together.
        most: Largest number of all together.

    Returns:
        Counts in inverse proportion to the objects' widths, at least one of each.
    """
    if not areas:
        return []
    factor = cover * ground / sum(math.sqrt(area) for area in areas)
    wanted = [factor / math.sqrt(area) for area in areas]
    factor = min(1.0, most / max(sum(wanted), 1e-30))
    return [max(1, round(number * factor)) for number in wanted]


def add_classes(scatter: ESH_PG_scatter, measured: Sequence[Measured], counts: Sequence[int]) -> list[ESH_PG_class]:
    """Add a class for each object to a scatter's settings, and return them."""
    from .properties.names import unused_name

    made = []
    for one, count in zip(measured, counts, strict=True):
        body_class = scatter.add_class()
        # Lists of names are separated by commas.
        name = one.item.name.replace(",", " ")
        body_class.name = unused_name(name, {other.name for other in scatter.classes[:-1]})
        size = body_class.sizes[0]
        size.source_kind, size.source_object, size.count = "OBJECT", one.item, count
        # Trees stand upright; what lies, lies on the slope.
        body_class.align_to_normal = 0.0 if one.upright else 1.0
        made.append(body_class)
    return made
