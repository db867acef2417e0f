"""What has changed since a result was made, in the words of the sidebar."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import bpy

from .influential_settings import LOOKS
from .settings_record import OF_OUTLINES

__all__ = ["changes"]

# What is said of an image or weights, and of an object or a collection, whose contents have changed.
PAINTED, EDITED = " painted", " edited"

# What is said where a target was changed for another, and under which key the name of a collection is kept that is one.
TARGET, TARGET_KIND, COLLECTION = "target", "target kind", "scatter.target_collection"

# What says what a size places.
SOURCES = ("source_kind", "source_object", "source_collection")


def changes(before: dict[str, Any], now: dict[str, Any], scatter: Any) -> list[str]:
    """Name what differs between two records, with the words of the sidebar; never empty."""
    if not before:
        return ["settings"]
    found = _differing(before["scatter"], now["scatter"], scatter)
    if before["target"] != now["target"]:
        found = [
            _what_of_target(before, now, found, scatter),
            *(what for what in found if what not in (TARGET, TARGET_KIND)),
        ]
    old, new = before["classes"], now["classes"]
    groups = {str(c.uid): c for c in scatter.classes}
    for uid in new:
        if uid in old:
            found += _differing_class(before, now, uid, groups[uid], scatter.avoid_overlap)
        else:
            found.append(f"{groups[uid].name} is new")
    found += [
        f"without {groups[uid].name}" if uid in groups else f"{before['names'].get(uid, 'a class')} was removed"
        for uid in old
        if uid not in new
    ]
    return list(dict.fromkeys(found)) or ["the order of the classes" if list(old) != list(new) else "settings"]


def _what_of_target(before: dict[str, Any], now: dict[str, Any], found: Sequence[str], scatter: Any) -> str:
    """Return what differs of the target, in words: more meshes, another one, or the same elsewhere or of another shape."""
    more = _added_meshes(before["target"], now["target"])
    if more:
        # As many objects on more ground stand less densely, which nothing else says before the run.
        fixed = any(c.count_kind in ("SIZES", "TOTAL") for c in scatter.ready_classes())
        return f"target ({more} more {'mesh' if more == 1 else 'meshes'}{'; fixed counts stay' if fixed else ''})"
    # Where it is the same collection, only its members differ.
    same_name = before["names"].get(COLLECTION) == now["names"].get(COLLECTION)
    other = TARGET_KIND in found or (TARGET in found and not same_name)
    return TARGET if other else "shape or place of the target"


def _added_meshes(before: list[Any] | None, now: list[Any] | None) -> int:
    """Return how many meshes stand beside all of before, by what records say of them; 0 where some of these changed."""
    if not before or not now:
        return 0
    old, new = (target if isinstance(target[0], list) else [target] for target in (before, now))
    known = {repr(mesh) for mesh in new}
    return max(0, len(new) - len(old)) if all(repr(mesh) in known for mesh in old) else 0


def _differing_class(before: dict[str, Any], now: dict[str, Any], uid: str, group: Any, apart: bool) -> list[str]:
    """Name what differs of a class that was there before; ``apart`` is whether outlines are kept apart."""
    old, new = before["classes"][uid], now["classes"][uid]

    def name_of(key: str) -> str:
        """Return what an image or object is called, if it still is called that."""
        name = now["names"].get(f"{uid}.{key}", "")
        return name if before["names"].get(f"{uid}.{key}") == name else ""

    # Where it is switched on or off to look somewhere, that says it.
    switched = old["values"].get("use_look_at") != new["values"].get("use_look_at")
    said = {*LOOKS} - {"use_look_at"} if switched else set()
    then, there = ({name: one["values"][name] for name in one["values"] if name not in said} for one in (old, new))
    found = _of(group.name, _differing(then, there, group, name_of, _idle(group, apart)))
    if old.get("looks") != new.get("looks"):
        moved = group.look_at_object if new.get("looks") else None
        found.append(f"place of {moved.name}" if moved else f"what {group.name} looks at")
    found += _differing_layers(old["layers"], new["layers"], group, name_of)
    if len(old["sizes"]) != len(new["sizes"]):
        return [*found, f"sizes of {group.name}"]
    for number, (size_before, size_now, size) in enumerate(zip(old["sizes"], new["sizes"], group.sizes, strict=True)):
        where = group.name if len(group.sizes) == 1 else f"{group.name}, {size.name}"
        # An object or a collection: of which kind it is, and which one, is one change.
        told = SOURCES if size_before.get("source_kind") != size_now.get("source_kind") else ()
        found += [f"what {where} places"] if told else []
        then, there = ({key: one[key] for key in one if key not in told} for one in (size_before, size_now))
        found += _of(where, _differing(then, there, size, _within(name_of, f"{number}."), size.unused))
    return found


def _of(where: str, found: list[str]) -> list[str]:
    """Say whose the values are that differ; images and objects are said by their names alone."""
    return [what if what.endswith((PAINTED, EDITED)) else f"{what} of {where}" for what in found]


def _within(name_of: Callable[[str], str], start: str) -> Callable[[str], str]:
    """Return what gives the names of a part of a class, whose keys begin like this."""
    return lambda key: name_of(start + key)


def _idle(body_class: Any, apart: bool) -> set[str]:
    """Return what of a class has no influence as its other settings are, and as outlines are kept apart or not."""
    idle = set(body_class.unused)
    if not apart:
        idle |= {*OF_OUTLINES, *LOOKS}
    if body_class.is_round:
        idle |= {*LOOKS}
    # Then the switch says it.
    return idle if body_class.use_look_at else idle | ({*LOOKS} - {"use_look_at"})


def _differing_layers(
    before: list[dict[str, Any]], now: list[dict[str, Any]], group: Any, name_of: Callable[[str], str]
) -> list[str]:
    """Name what differs between the layers of a class."""
    if [layer["kind"] for layer in before] != [layer["kind"] for layer in now]:
        return [f"density of {group.name}"]
    layers = [layer for layer in group.layers if layer.use]
    found = []
    for number, (layer_before, layer_now, layer) in enumerate(zip(before, now, layers, strict=True)):
        where = group.name if len(layers) == 1 else f"{group.name}, {layer.label}"
        found += _of(where, _differing(layer_before, layer_now, layer, _within(name_of, f"layer {number}.")))
    return found


def _differing(
    before: dict[str, Any],
    now: dict[str, Any],
    group: Any,
    name_of: Callable[[str], str] = lambda _key: "",
    idle: Collection[str] = (),
) -> list[str]:
    """Name the values that differ.

    Args:
        before: Values that tell something, by name.
        now: The same, now.
        group: That has them.
        name_of: Gives the name of what a value was looked into, where that is the same.
        idle: Names of what has no influence now.
    """
    properties = group.bl_rna.properties
    found = []
    # What is at its default now may have been another value before.
    ended = (name for name in before if name not in now and name in properties and name not in idle)
    for name in (*now, *ended):
        value = now.get(name)
        if before.get(name) == value:
            continue
        item = getattr(group, name)
        if isinstance(item, bpy.types.ID) and name in before and name_of(name):
            found.append(name_of(name) + (PAINTED if isinstance(item, bpy.types.Image) else EDITED))
        elif isinstance(value, list) and isinstance(item, str) and before.get(name, [None])[:1] == value[:1]:
            found.append((item or "UV map") + EDITED if name == "uv_map" else item + PAINTED)
        else:
            found.append(properties[name].name.lower())
    return found
