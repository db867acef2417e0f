"""Node groups of results beside undo, which frees parts that no step knows of: taken out before it, and made anew after it."""

from __future__ import annotations

import ast
from dataclasses import dataclass

import bpy

from ..targets.references import Reference
from .display import followed_targets, get_inputs, our_modifier, set_inputs
from .node_group import MADE_OF, Followed, Rest, build_node_group, placed_objects
from .result import NAME

__all__ = ["EmptiedGroup", "empty_group", "fill_group"]


@dataclass(frozen=True)
class EmptiedGroup:
    """What the node group of a result was made of before its parts were taken out; see :func:`empty_group`."""

    group: Reference
    name: str
    sources: tuple[Reference, ...]
    classes: tuple[str, ...]
    followed: tuple[tuple[Reference, int, bool | None, Rest | None], ...]


def empty_group(item: bpy.types.Object) -> EmptiedGroup | None:
    """Take all parts out of a result's node group, and return what it was made of; None where it has no group that can be made anew.

    Undo keeps a group as it is where the steps before and after it say the same of it. Parts that were made for it since are in
    neither, and are freed: it must not lead to them then.
    """
    modifier = our_modifier(item)
    group = modifier.node_group if modifier is not None else None
    if modifier is None or group is None or not group.is_editable or not group.get(MADE_OF):
        return None
    sources, followed = placed_objects(group), followed_targets(modifier)
    if any(source is None for source in sources) or any(one.target is None for one in followed):
        return None
    classes = ast.literal_eval(group[MADE_OF])[0]
    kept = EmptiedGroup(
        Reference(group, "group"),
        item.get(NAME, group.name),
        tuple(Reference(source, "source") for source in sources if source is not None),
        tuple(classes),
        tuple((Reference(one.target, "target"), *one[1:]) for one in followed),
    )
    for node in _part_nodes(group):
        node.node_tree = None
    return kept


def fill_group(kept: EmptiedGroup) -> None:
    """Make a group what it was before it was emptied, where it is still there, for all that show their objects by it."""
    group = kept.group.find()
    if not isinstance(group, bpy.types.NodeTree) or all(node.node_tree is not None for node in _part_nodes(group)):
        return
    sources = [source.find() for source in kept.sources]
    followed = [Followed(target.find(), vertices, over, rest) for target, vertices, over, rest in kept.followed]
    if any(source is None for source in sources) or any(one.target is None for one in followed):
        # The next run makes it anew.
        group[MADE_OF] = ""
        return
    found = [our_modifier(item) for item in bpy.data.objects]
    modifiers = [modifier for modifier in found if modifier is not None and modifier.node_group == group]
    shown = [get_inputs(modifier) for modifier in modifiers]
    for modifier in modifiers:
        modifier.node_group = None
    # Undo may bring back modifiers whose values go by the inputs that the group has.
    build_node_group(kept.name, sources, kept.classes, followed, group, same_inputs=True)
    for modifier, values in zip(modifiers, shown, strict=True):
        modifier.node_group = group
        set_inputs(modifier, values)


def _part_nodes(group: bpy.types.NodeTree) -> list[bpy.types.Node]:
    return [node for node in group.nodes if node.bl_idname == "GeometryNodeGroup"]
