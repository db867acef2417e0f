"""Node groups of results beside undo, which frees parts that no step knows of: taken out before it, and made anew after it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..targets.references import Reference
from .display import get_inputs, our_modifier, set_inputs
from .node_group import build_node_group
from .node_group_contents import MADE_OF, Followed, classes_of, followed_in, placed_objects

__all__ = ["EmptiedGroup", "empty_group", "fill_group"]


@dataclass(frozen=True)
class EmptiedGroup:
    """What a node group of results was made of before its parts were taken out; see :func:`empty_group`.

    What it follows are its inputs: the modifiers say which objects these are.
    """

    group: Reference
    made_of: str
    classes: tuple[str, ...]
    sources: tuple[Reference | None, ...]
    followed: tuple[Followed, ...]


def empty_group(group: bpy.types.NodeTree) -> EmptiedGroup:
    """Take all parts out of a node group, whoever uses it, and return what it was made of.

    Undo keeps a group as it is where the steps before and after it say the same of it. Parts that were made for it since are in
    neither, and are freed: it must not lead to them then.
    """
    kept = EmptiedGroup(
        Reference(group, "group"),
        group.get(MADE_OF, ""),
        tuple(classes_of(group)),
        tuple(None if source is None else Reference(source, "source") for source in placed_objects(group)),
        tuple(one._replace(target=None) for one in followed_in(group)),
    )
    for node in _part_nodes(group):
        node.node_tree = None
    return kept


def fill_group(kept: EmptiedGroup) -> None:
    """Make a group what it was before it was emptied, where it is still there, for all that show their objects by it."""
    group = kept.group.find()
    if not isinstance(group, bpy.types.NodeTree) or all(node.node_tree is not None for node in _part_nodes(group)):
        return
    # Of what undo has taken away nothing is shown; the next run makes the group anew.
    sources = [None if source is None else source.find() for source in kept.sources]
    found = [our_modifier(item) for item in bpy.data.objects]
    modifiers = [modifier for modifier in found if modifier is not None and modifier.node_group == group]
    shown = [get_inputs(modifier) for modifier in modifiers]
    for modifier in modifiers:
        modifier.node_group = None
    # Undo may bring back modifiers whose values go by the inputs that the group has.
    build_node_group(group.name, sources, kept.classes, kept.followed, group, same_inputs=True)
    group[MADE_OF] = kept.made_of
    for modifier, values in zip(modifiers, shown, strict=True):
        modifier.node_group = group
        set_inputs(modifier, values)


def _part_nodes(group: bpy.types.NodeTree) -> list[bpy.types.Node]:
    return [node for node in group.nodes if node.bl_idname == "GeometryNodeGroup"]
