"""Vertex groups and UV maps that were renamed since a layer named them.

Blender tells nobody of that. So a layer keeps what groups or maps its targets had when its own was last among them: where as many are
there now, and only some are called otherwise, the one in the place of its own is that.
"""

from __future__ import annotations

import json
from typing import Any

from bpy.types import Object, PropertyGroup

from .names import scatter_of

__all__ = ["follow_renamed", "has_to_follow", "keep_names_on_mesh", "name_on_mesh"]

# Drawing the sidebar compares names on every target; of very many targets nothing is followed.
MOST_TARGETS = 16


def name_on_mesh(layer: PropertyGroup, name: str) -> str:
    """Return what the vertex group or UV map of a layer is called now.

    Args:
        layer: The layer.
        name: The property that names it: ``"vertex_group"`` or ``"uv_map"``.
    """
    return (_renamed(layer) if _property_of(layer) == name else "") or getattr(layer, name)


def keep_names_on_mesh(layer: PropertyGroup, _context: object = None) -> None:
    """Note what vertex groups or UV maps the targets of a layer have now; Blender calls it when another one is chosen."""
    known = json.dumps(_names_now(layer))
    # Writing the same would be a change all the same.
    if layer.names_on_mesh != known:
        layer.names_on_mesh = known


def has_to_follow(scatter: PropertyGroup) -> bool:
    """Whether :func:`follow_renamed` would change anything."""
    return any(_renamed(layer) or _is_unnoted(layer) for layer in _naming_layers(scatter))


def follow_renamed(scatter: PropertyGroup) -> None:
    """Call vertex groups and UV maps in the layers of a scatter as they are called by now, and note what others there are."""
    for layer in _naming_layers(scatter):
        if new := _renamed(layer):
            name = _property_of(layer)
            _rename_in_record(scatter, name, getattr(layer, name), new)
            setattr(layer, name, new)
        elif _is_unnoted(layer):
            keep_names_on_mesh(layer)


def _rename_in_record(scatter: PropertyGroup, name: str, old: str, new: str) -> None:
    """Have what the last run was made with called so, too: that is no change, and the result is no less up to date."""
    try:
        record = json.loads(scatter.ran_with)
    except json.JSONDecodeError:
        return
    layers = [layer for one in record.get("classes", {}).values() for layer in one.get("layers", ())]
    # Such a value is the name, and a number of what is stored under it.
    named = [layer for layer in layers if isinstance(layer.get(name), list) and layer[name][:1] == [old]]
    for layer in named:
        layer[name][0] = new
    if named:
        scatter.ran_with = json.dumps(record, separators=(",", ":"))


def _naming_layers(scatter: PropertyGroup) -> list[PropertyGroup]:
    layers = [layer for body_class in scatter.classes for layer in body_class.layers if _property_of(layer)]
    return layers if layers and len(scatter.targets) <= MOST_TARGETS else []


def _property_of(layer: PropertyGroup) -> str:
    """Return which property of a layer names something that its targets have; empty where none does."""
    if layer.kind == "VERTEX_GROUP":
        return "vertex_group" if layer.vertex_group else ""
    return "uv_map" if layer.kind == "IMAGE" and layer.image_mapping == "UV" and layer.uv_map else ""


def _names_now(layer: PropertyGroup) -> dict[str, list[str]]:
    """Return what can be named on each target, by its name; without targets that lack what the layer names.

    A group that was removed is not renamed, whatever comes into its place later.
    """
    name = _property_of(layer)
    targets = scatter_of(layer).targets if name else []
    found = {item.name: _names_on(item, name) for item in targets[: MOST_TARGETS + 1]}
    own = getattr(layer, name) if name else ""
    return {item: names for item, names in found.items() if own in names}


def _names_on(item: Object, name: str) -> list[str]:
    several: Any = item.vertex_groups if name == "vertex_group" else item.data.uv_layers
    return [one.name for one in several]


def _noted(layer: PropertyGroup) -> dict[str, list[str]]:
    return json.loads(layer.names_on_mesh) if layer.names_on_mesh else {}


def _is_unnoted(layer: PropertyGroup) -> bool:
    """Whether names have changed of which none is followed; asked where nothing is :func:`renamed <_renamed>`."""
    return _noted(layer) != _names_now(layer)


def _renamed(layer: PropertyGroup) -> str:
    """Return the new name of what a layer names, the same on all targets that had it; empty where one still has it, or it is gone."""
    name = _property_of(layer)
    targets = scatter_of(layer).targets if name else []
    if not 0 < len(targets) <= MOST_TARGETS:
        return ""
    own, noted = getattr(layer, name), _noted(layer)
    now = {item.name: _names_on(item, name) for item in targets}
    if any(own in names for names in now.values()):
        return ""
    found = {_new_name(own, noted[item], names) for item, names in now.items() if item in noted}
    return found.pop() if len(found) == 1 else ""


def _new_name(own: str, before: list[str], now: list[str]) -> str:
    """Return what is in the place of ``own`` now, if some were renamed and nothing else happened; empty otherwise."""
    if own not in before or len(now) != len(before):
        return ""
    changed = [(old, new) for old, new in zip(before, now, strict=True) if old != new]
    if any(old in now or new in before for old, new in changed):
        return ""
    return now[before.index(own)]
