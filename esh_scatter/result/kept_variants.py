"""Which of a size's objects stands on each point of a result: changed there at once where all of them cover the same ground."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.surface.mesh_outline import Outline
from ..classes.scatter_class import ScatterSize
from ..classes.sources import SizeShape, SourceReader, lowest_points, measure_size, variants_of
from ..classes.survey import Survey
from ..targets.mesh_attributes import read_attribute, write_attribute
from .attributes import INSTANCE_INDEX, PINNED
from .kept_ground import LOWEST_POINTS, SEED
from .node_group_contents import PLACE_FAMILY, kind_of, placing_inputs

__all__ = ["VARIANTS", "choose_anew", "lowest_told", "place_others", "variants_told"]

# Custom property of a result's mesh: of every size what it places, and what ground that covers, as JSON.
VARIANTS = "esh_scatter_variants"
# Directions in which outlines are compared, and the share of their extent by which those may differ that count as the same.
DIRECTIONS = 32
ALIKE = 2e-3


def variants_told(shapes: Sequence[SizeShape]) -> str:
    """Return what a result keeps of the sizes of its classes, one after the other."""
    return json.dumps([{"objects": list(shape.objects), **_ground_of(shape)} for shape in shapes])


def lowest_told(shapes: Sequence[SizeShape], scales: Sequence[float]) -> list[float]:
    """Return what a result keeps of its objects' lowest points [m], by their numbers; ``scales`` are those of the sizes' classes."""
    found: dict[int, float] = {}
    for shape, scale in zip(shapes, scales, strict=True):
        found |= dict(zip(shape.objects, lowest_points(shape, scale), strict=True))
    return [found.get(number, 0.0) for number in range(max(found, default=-1) + 1)]


def _ground_of(shape: SizeShape) -> dict[str, Any]:
    """Return the ground that each of a size's objects covers: a disc of an area, an outline, or None where they differ."""
    if not shape.own_outlines and shape.line is None and not isinstance(shape.area, tuple):
        return {"disc": shape.area}
    told = [_told(outline) for outline in shape.outlines]
    alike = all(one is not None and _same(one, told[0]) for one in told)
    return {"outline": told[0] if alike else None, "long": shape.line is not None}


def _told(outline: Outline | None) -> list[float] | None:
    """Return an outline as lengths [m]: of its area the root, its sides, and how far it reaches from the origin in all directions."""
    if outline is None:
        return None
    angle = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    reach = (np.array(outline.corners) @ np.stack([np.cos(angle), np.sin(angle)])).max(axis=0)
    return [float(f"{x:.6g}") for x in (outline.area**0.5, outline.length, outline.width, *reach.tolist())]


def _same(one: list[float] | None, other: list[float] | None) -> bool:
    """Tell whether two outlines are the same, as :func:`_told` has told them."""
    if one is None or other is None:
        return False
    return bool(np.abs(np.subtract(one, other)).max() <= ALIKE * one[1])


def _same_ground(one: dict[str, Any], other: dict[str, Any]) -> bool:
    if "disc" in one or "disc" in other:
        return one.get("disc") is not None and one.get("disc") == other.get("disc")
    return one["long"] == other["long"] and _same(one["outline"], other["outline"])


def _kept(result: bpy.types.Object, size: tuple[int, int]) -> dict[str, Any] | None:
    """Return what a result keeps of a size, by the numbers of its class and its own; None where it keeps nothing."""
    from .result import CLASS_NAMES

    mesh = result.data
    names, told = result.get(CLASS_NAMES, ""), mesh.get(VARIANTS, "")
    if result.mode == "EDIT" or not names or not told or INSTANCE_INDEX not in mesh.attributes:
        return None
    counts = [len(of_class) for of_class in json.loads(names)[1]]
    kept = json.loads(told)
    if len(kept) != sum(counts) or size[0] >= len(counts) or size[1] >= counts[size[0]]:
        return None
    found: dict[str, Any] = kept[sum(counts[: size[0]]) + size[1]]
    return found


def _same_kind(before: bpy.types.ID | None, now: bpy.types.ID) -> bool:
    """Tell whether a result that places one thing can place another one just so."""
    return now == before or (before is not None and kind_of(now) == kind_of(before) != PLACE_FAMILY)


def choose_anew(
    result: bpy.types.Object, size: tuple[int, int], items: Sequence[bpy.types.Object], weights: Sequence[float]
) -> bool:
    """Put a size's objects on its points as often as weights say, at once; tell whether that was possible.

    What is pinned stays what it is. Where the objects cover different ground, or are others than the result shows, nothing is changed.

    Args:
        result: The result.
        size: Numbers of the class and of the size.
        items: The size's objects.
        weights: How often each is placed.
    """
    kept, mesh = _kept(result, size), result.data
    if kept is None or kept.get("outline", kept.get("disc")) is None or not any(weights):
        return False
    inputs = placing_inputs(result)
    if len(inputs) <= max(kept["objects"], default=-1):
        return False
    if [inputs[number].default_value for number in kept["objects"]] != list(items):
        return False
    own = (read_attribute(mesh, "class_index") == size[0]) & (read_attribute(mesh, "size_index") == size[1])
    if PINNED in mesh.attributes:
        own &= ~read_attribute(mesh, PINNED)
    given = np.array(weights, np.float64)
    even = None if (given == given[0]).all() else given
    chosen = variants_of(read_attribute(mesh, "id")[own], len(items), even, int(mesh[SEED]))
    index = read_attribute(mesh, INSTANCE_INDEX)
    index[own] = np.array(kept["objects"], np.int32)[chosen]
    write_attribute(mesh, INSTANCE_INDEX, index)
    mesh.update()
    return True


def place_others(
    result: bpy.types.Object, size: tuple[int, int], asked: ScatterSize, targets: list[bpy.types.Object], scale: float
) -> bool:
    """Show other objects at a size's points, at once; tell whether that was possible: these have to cover the same ground.

    Args:
        result: The result.
        size: Numbers of the class and of the size.
        asked: The size as it is now.
        targets: What is scattered on.
        scale: Of its class.
    """
    kept, inputs = _kept(result, size), placing_inputs(result)
    if kept is None or len(inputs) <= max(kept["objects"], default=-1):
        return False
    others = [number for one in json.loads(result.data[VARIANTS]) if one != kept for number in one["objects"]]
    if set(others) & set(kept["objects"]) or json.loads(result.data[VARIANTS]).count(kept) > 1:
        # What another size shows, too, would change with it.
        return False
    reader = SourceReader(targets, bpy.context)
    try:
        shape = measure_size(asked, reader.read(asked, "the size"), "none", Survey(), scale)
        placed = [reference.get() for reference in reader.objects]
    except ProblemError:
        # The next run says it.
        return False
    changed = [inputs[number] for number in kept["objects"]]
    fitting = all(_same_kind(socket.default_value, now) for now, socket in zip(placed, changed, strict=False))
    if len(placed) != len(changed) or not fitting or not _same_ground(kept, _ground_of(shape)):
        return False
    for socket, item in zip(changed, placed, strict=True):
        socket.default_value = item
    lowest = list(result.data.get(LOWEST_POINTS, ()))
    for number, value in zip(kept["objects"], lowest_points(shape, scale), strict=True):
        if number < len(lowest):
            lowest[number] = value
    if lowest:
        result.data[LOWEST_POINTS] = lowest
    return True
