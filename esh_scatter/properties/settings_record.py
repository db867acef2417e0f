"""What a result was made with, as plain data, and in words what has changed since."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import bpy

from .influence import WITHOUT_INFLUENCE

__all__ = ["changes", "layer_record", "plain_default", "record"]

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
            str(c.uid): {
                "values": _values(c, more),
                "layers": [layer_record(layer) for layer in c.layers if layer.use],
                "sizes": [_values(size) for size in c.sizes],
            }
            for c in classes
        },
    }


def layer_record(layer: Any) -> dict[str, Any]:
    """Return what of a layer's settings has an influence: those of its kind."""
    values = {name: _plain(getattr(layer, name)) for name in ("kind", *layer.influential_of(layer.kind))}
    return {**values, "curve": layer.curve_record()}


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
        layers = [layer for layer in group.layers if layer.use]
        layers_before = old[uid].get("layers", [])
        if [layer["kind"] for layer in layers_before] != [layer["kind"] for layer in one["layers"]]:
            found.append(f"density of {group.name}")
        else:
            for layer_before, layer_now, layer in zip(layers_before, one["layers"], layers, strict=True):
                where = group.name if len(layers) == 1 else f"{group.name}, {layer.label}"
                found += [f"{what} of {where}" for what in _differing(layer_before, layer_now, layer)]
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


@lru_cache(maxsize=8)
def _influential(group: Any) -> tuple[str, ...]:
    """Return the names of the properties of a group that have an influence on the result."""
    names = (told.identifier for told in group.bl_rna.properties if told.type != "COLLECTION")
    return tuple(name for name in names if name not in WITHOUT_INFLUENCE | {"rna_type"})


def _values(group: Any, more: Sequence[str] = ()) -> dict[str, Any]:
    kind: Any = type(group)
    return {name: _plain(getattr(group, name)) for name in (*_influential(kind), *more)}


def plain_default(group: Any, name: str) -> Any:
    """Return the default of a property of a group as records have it."""
    told = group.bl_rna.properties[name]
    if told.type == "POINTER":
        return None
    return list(told.default_array) if getattr(told, "is_array", False) else told.default


def _plain(value: Any) -> Any:
    if isinstance(value, bpy.types.ID):
        return value.name_full
    return list(value) if isinstance(value, bpy.types.bpy_prop_array) else value
