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

    def is_there(self) -> bool:
        """Tell whether both are in the file."""
        return self.mesh.find() is not None and (self.group is None or self.group.find() is not None)

    def give(self, item: bpy.types.Object) -> bool:
        """Give them to a result; tell whether they are there."""
        if not self.is_there():
            return False
        mesh, group = self.mesh.find(), None if self.group is None else self.group.find()
        if item.data != mesh:
            item.data = mesh
        modifier = our_modifier(item) or next(
            (m for m in item.modifiers if m.type == "NODES" and not m.node_group), None
        )
        if modifier is not None and modifier.node_group != group:
            shown = get_inputs(modifier)
            modifier.node_group = group
            set_inputs(modifier, shown)
        return True


def owned_by(item: bpy.types.Object) -> Owned:
    """Return what a result has now."""
    modifier = our_modifier(item)
    return Owned(Reference(item.data, "mesh"), None if modifier is None else Reference(modifier.node_group, "group"))


class Replaced:
    """A result that has got another mesh or another group since the last undo step, which may be any of those that it had.

    Args:
        item: The result.
    """

    def __init__(self, item: bpy.types.Object) -> None:
        self._item = Reference(item, "result")
        # All that it had before, the oldest first, and what it had before it was put back.
        self._had: list[Owned] = []
        self._now: Owned | None = None

    def add(self, before: Owned) -> None:
        """The result has got others than these."""
        self._had.append(before)

    def put_back(self) -> None:
        """Give the result the oldest that it had, which all steps know; in Edit Mode, which begins with a step of its own, nothing."""
        item, self._now = self._item.find(), None
        if isinstance(item, bpy.types.Object) and item.mode != "EDIT":
            now = owned_by(item)
            self._had = [had for had in self._had if had.is_there()]
            if self._had and self._had[0].give(item):
                self._now = now

    def take_again(self) -> bool:
        """Give the result the last that it had, of what undo has left; tell whether there may be something to put back again."""
        item, now = self._item.find(), self._now
        if not isinstance(item, bpy.types.Object):
            return False
        if now is None:
            return bool(self._had)
        if not owned_by(item).is_same(self._had[0]):
            # Undo has given it what the step knows.
            return False
        while not now.give(item) and self._had:
            now = self._had.pop()
        return bool(self._had)
