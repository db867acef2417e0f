"""What a result was made with, as plain data, and in words what has changed since."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import bpy

from .influence import WITHOUT_INFLUENCE

__all__ = ["changes", "completed", "record"]

# What objects show at once, but have an influence where their outlines are kept apart: they are as large and as turned as this says.
OF_OUTLINES = ("random_turn", "scale_jitter")


def record(scatter: Any, classes: Sequence[Any], target: Any) -> dict[str, Any]:
    """Return every setting that has an influence on a result.

    Args:
        scatter: The settings.
        classes: Those of its classes that take part.
        target: What is known of the mesh.

    Returns:
        Ready for JSON: ``target``, ``scatter``, and ``classes`` by their numbers, in their order, with their ``sizes``.
    """
    more = OF_OUTLINES if scatter.avoid_overlap else ()
    return {
        "target": target,
        "scatter": _values(scatter),
        "classes": {
            str(c.uid): {"values": _values(c, more), "sizes": [_values(size) for size in c.sizes]} for c in classes
        },
    }


def completed(before: dict[str, Any], scatter: Any) -> dict[str, Any]:
    """Return a record with what settings that are newer than it would have had then: their defaults."""
    if not before:
        return before
    kind: Any = type(scatter)
    names = _influential(kind)
    return {**before, "scatter": {**{name: _default(scatter, name) for name in names}, **before["scatter"]}}


def changes(before: dict[str, Any], now: dict[str, Any], scatter: Any) -> list[str]:
    """Name what differs between two records, with the words of the sidebar; never empty."""
    if not before:
        return ["settings"]
    # Another mesh has another shape, which need not be said.
    same = before["scatter"]["target"] == now["scatter"]["target"]
    found = ["shape or place of the target"] if same and before["target"] != now["target"] else []
    found += _differing(before["scatter"], now["scatter"], scatter)
    old, new = before["classes"], now["classes"]
    groups = {str(c.uid): c for c in scatter.classes}
    for uid, one in new.items():
        group = groups[uid]
        if uid not in old:
            found.append(f"{group.name} is new")
            continue
        found += [f"{what} of {group.name}" for what in _differing(old[uid]["values"], one["values"], group)]
        if len(old[uid]["sizes"]) != len(one["sizes"]):
            found.append(f"sizes of {group.name}")
            continue
        for size_before, size_now, size in zip(old[uid]["sizes"], one["sizes"], group.sizes, strict=True):
            where = group.name if len(group.sizes) == 1 else f"{group.name}, {size.name}"
            found += [f"{what} of {where}" for what in _differing(size_before, size_now, size)]
    found += [
        f"without {groups[uid].name}" if uid in groups else "a class was removed" for uid in old if uid not in new
    ]
    return list(dict.fromkeys(found)) or ["the order of the classes" if list(old) != list(new) else "settings"]


def _differing(before: dict[str, Any], now: dict[str, Any], group: Any) -> list[str]:
    properties = group.bl_rna.properties
    return [properties[name].name.lower() for name, value in now.items() if before.get(name) != value]


def _default(group: Any, name: str) -> Any:
    told = group.bl_rna.properties[name]
    if told.type == "POINTER":
        return None
    return list(told.default_array) if getattr(told, "is_array", False) else told.default


@lru_cache(maxsize=8)
def _influential(group: Any) -> tuple[str, ...]:
    """Return the names of the properties of a group that have an influence on the result."""
    names = (told.identifier for told in group.bl_rna.properties if told.type != "COLLECTION")
    return tuple(name for name in names if name not in WITHOUT_INFLUENCE | {"rna_type"})


def _values(group: Any, more: Sequence[str] = ()) -> dict[str, Any]:
    values = {}
    kind: Any = type(group)
    for name in (*_influential(kind), *more):
        value = getattr(group, name)
        if isinstance(value, bpy.types.ID):
            value = value.name_full
        elif isinstance(value, bpy.types.bpy_prop_array):
            value = list(value)
        values[name] = value
    return values
