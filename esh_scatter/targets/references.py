"""References to what a file holds that stay safe while it changes.

Blender frees what is removed, and moves everything on undo; Python objects that stood for it then lead into freed memory. The number
that Blender gives everything for as long as it runs stays.
"""

from __future__ import annotations

import bpy

from ...engine.errors import ProblemError

__all__ = ["Reference"]


class Reference:
    """Something in the file, looked up anew whenever it is asked for.

    Args:
        item: An object, a collection, a scene, a mesh or a node group.
        key: How sentences name it.
    """

    def __init__(self, item: bpy.types.ID, key: str) -> None:
        self._uid = item.session_uid
        kinds = {
            bpy.types.Scene: "scenes",
            bpy.types.Collection: "collections",
            bpy.types.Mesh: "meshes",
            bpy.types.NodeTree: "node_groups",
        }
        self._list = next((name for kind, name in kinds.items() if isinstance(item, kind)), "objects")
        self._name = item.name_full
        self._key = key

    @property
    def uid(self) -> int:
        """Its number."""
        return self._uid

    def find(self) -> bpy.types.ID | None:
        """Return it, or None where it is no longer in the file."""
        candidates = getattr(bpy.data, self._list)
        # Most are still called what they were.
        likely = candidates.get(self._name)
        if likely is not None and likely.session_uid == self._uid:
            return likely
        return next((item for item in candidates if item.session_uid == self._uid), None)

    def get(self) -> bpy.types.ID:
        """Return it.

        Raises:
            ProblemError: It is no longer in the file.
        """
        item = self.find()
        if item is None:
            raise ProblemError(
                f'{self._key} "{self._name}" was removed from the file during the run; nothing was placed, so scatter again'
            )
        return item
