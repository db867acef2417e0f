"""The inputs of a result's modifier: read, set, and kept when the result is made anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import bpy
import numpy as np

from ..targets.target import RESULT_TAG
from .node_group import DISPLAYS
from .node_group_contents import Followed, followed_in, placed_objects, target_inputs, undoes_own_transform

__all__ = [
    "begin_with_points",
    "follow",
    "followed_targets",
    "get_inputs",
    "input_property",
    "is_in_world",
    "matrix_of_points",
    "our_modifier",
    "set_inputs",
    "shown_objects",
]


# What inputs were called in earlier versions; the modifier's panel cut these names.
FORMER = {
    "Viewport Share": "Share",
    "Follow Target": "Follow",
    "Camera Culling": "Culling",
    "Limit Renders": "In Renders",
}


def our_modifier(item: bpy.types.Object) -> bpy.types.Modifier | None:
    """Return the modifier that places the objects of a result, or None where somebody has removed it."""
    return next(
        (m for m in item.modifiers if m.type == "NODES" and m.node_group is not None and m.node_group.get(RESULT_TAG)),
        None,
    )


def shown_objects(item: bpy.types.Object) -> list[bpy.types.Object | bpy.types.Collection | None]:
    """Return what a result shows, in the order that ``instance_index`` counts; None for what was removed.

    Nothing where somebody has removed its modifier.
    """
    modifier = our_modifier(item)
    return [] if modifier is None else placed_objects(modifier.node_group)


def matrix_of_points(item: bpy.types.Object) -> np.ndarray:
    """Return the matrix ``[4, 4]`` from a result's points to the world, as its instances are shown.

    What follows a target does so wherever the result itself stands: it is in the world.
    """
    return np.eye(4) if is_in_world(item) else np.array(item.matrix_world, np.float64)


def is_in_world(item: bpy.types.Object) -> bool:
    """Tell whether a result is shown where its target is, wherever it stands itself."""
    modifier = our_modifier(item)
    if modifier is None or not undoes_own_transform(modifier.node_group):
        return False
    there = any(one.target is not None for one in followed_targets(modifier))
    return there and bool(get_inputs(modifier).get("Follow", True))


def followed_targets(modifier: bpy.types.Modifier) -> list[Followed]:
    """Return what the points of a result follow, in the order of ``esh_target``; targets may be gone."""
    found = followed_in(modifier.node_group)
    chosen = get_inputs(modifier)
    names = target_inputs(len(found))
    return [
        told if told.target is not None else told._replace(target=chosen.get(name))
        for told, name in zip(found, names, strict=True)
    ]


def follow(modifier: bpy.types.Modifier, followed: Sequence[Followed]) -> None:
    """Have the points of a result follow these targets."""
    wanted = dict(zip(target_inputs(len(followed)), (one.target for one in followed), strict=True))
    there = get_inputs(modifier)
    # What is set is looked at anew by all that depends on it.
    if any(there.get(name) != target for name, target in wanted.items()):
        set_inputs(modifier, wanted)


def get_inputs(modifier: bpy.types.Modifier) -> dict[str, Any]:
    """Return the values of a modifier's inputs by name; of the menu, its word."""
    values = {}
    for name, identifier in _inputs(modifier):
        owner, key = _owner(modifier, identifier)
        if owner is None:
            continue
        value = getattr(owner, key) if key == "value" else owner.get(identifier)
        if name == "Display" and isinstance(value, int):
            # Up to Blender 5.1, a menu is a number: of its items, counted from 2 on since two were there before.
            value = _words(modifier).get(value, DISPLAYS[0])
        if value is not None:
            values[name] = value
    return values


def set_inputs(modifier: bpy.types.Modifier, values: Mapping[str, Any]) -> None:
    """Set inputs by name; those that the modifier does not have are passed over."""
    for name, identifier in _inputs(modifier):
        if name not in values:
            continue
        value = values[name]
        owner, key = _owner(modifier, identifier)
        if owner is None:
            continue
        if key == "value":
            owner.value = value
            continue
        if name == "Display":
            value = next(number for number, word in _words(modifier).items() if word == value)
        owner[identifier] = value
    modifier.id_data.update_tag()


def begin_with_points(item: bpy.types.Object) -> None:
    """Show the objects of a result as points in the viewport."""
    modifier = our_modifier(item)
    if modifier is not None:
        set_inputs(modifier, {"Display": DISPLAYS[2]})


def input_property(modifier: bpy.types.Modifier, name: str) -> tuple[Any, str] | None:
    """Return what a panel draws for an input: the owner of the property, and what it is called there."""
    identifier = dict(_inputs(modifier)).get(name)
    if identifier is None:
        return None
    owner, key = _owner(modifier, identifier)
    if owner is None:
        return None
    return (owner, "value") if key == "value" else (owner, f'["{identifier}"]')


def _inputs(modifier: bpy.types.Modifier) -> Iterator[tuple[str, str]]:
    group = modifier.node_group
    for item in group.interface.items_tree if group is not None else ():
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.socket_type != "NodeSocketGeometry":
            yield FORMER.get(item.name, item.name), item.identifier


def _owner(modifier: bpy.types.Modifier, identifier: str) -> tuple[Any, str]:
    """Return what holds an input's value, and how: from Blender 5.2 on a property, before that a custom property."""
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier, None), "value"
    return modifier, identifier


def _words(modifier: bpy.types.Modifier) -> dict[int, str]:
    """Return the words of the menu by the numbers that stand for them."""
    node = next(node for node in modifier.node_group.nodes if node.bl_idname == "GeometryNodeMenuSwitch")
    return dict(enumerate(item.name for item in node.enum_items))
