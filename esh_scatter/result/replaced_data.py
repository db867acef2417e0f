"""Mesh and node group of a result beside undo, which may keep the object as it is, and frees what no step knows of.

Outside of undo steps a result gets another mesh or group only where a copy of it uses its own. Before undo it is given back what it
had, and after it what it got, where that is still there.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy

from ..targets.references import Reference
from .display import get_inputs, our_modifier, set_inputs

__all__ = ["Owned", "Replaced", "owned_by"]


class Owned(NamedTuple):
    """Mesh and node group of a result."""

    mesh: Reference
    group: Reference | None

    def is_same(self, other: Owned) -> bool:
        """Tell whether this is the same mesh and the same group."""
        groups = [None if one.group is None else one.group.uid for one in (self, other)]
        return self.mesh.uid == other.mesh.uid and groups[0] == groups[1]

    def give(self, item: bpy.types.Object) -> bool:
        """Give them to a result; tell whether they are there."""
        mesh, group = self.mesh.find(), None if self.group is None else self.group.find()
        modifier = our_modifier(item)
        if mesh is None or group is None or modifier is None:
            return False
        if item.data != mesh:
            item.data = mesh
        if modifier.node_group != group:
            shown = get_inputs(modifier)
            modifier.node_group = group
            set_inputs(modifier, shown)
        return True


def owned_by(item: bpy.types.Object) -> Owned:
    """Return what a result has now."""
    modifier = our_modifier(item)
    return Owned(Reference(item.data, "mesh"), None if modifier is None else Reference(modifier.node_group, "group"))


class Replaced:
    """A result that has got another mesh or another group since the last undo step.

    Args:
        item: The result.
        before: What it had.
    """

    def __init__(self, item: bpy.types.Object, before: Owned) -> None:
        self._item = Reference(item, "result")
        self._before = before
        self._now: Owned | None = None

    def put_back(self) -> None:
        """Give the result what it had before; in Edit Mode, which begins with a step of its own, nothing."""
        item, self._now = self._item.find(), None
        if isinstance(item, bpy.types.Object) and item.mode != "EDIT":
            now = owned_by(item)
            if self._before.give(item):
                self._now = now

    def take_again(self) -> bool:
        """Give the result what it had got, unless undo has freed that; tell whether there may be something to put back again."""
        item = self._item.find()
        if not isinstance(item, bpy.types.Object):
            return False
        return self._now is None or (owned_by(item).is_same(self._before) and self._now.give(item))
