"""A result that Live has made beside undo, which may keep a scene as it is, and frees objects that no step knows of.

Where only a mesh differs between two steps, undo keeps the scene, also with what was linked into it since the last of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import bpy

from ..result.local_views import join_local_views
from ..targets.in_scenes import is_in, is_in_layer
from ..targets.references import Reference

__all__ = ["Kept", "NewResult"]

# A scatter of the sidebar. Its switch calls :mod:`.live`, so nothing that Live is made of imports its class.
Scatter: TypeAlias = bpy.types.PropertyGroup


class Kept(NamedTuple):
    """What a scatter keeps of its last run."""

    result: Reference | None
    report: str
    ran_with: str

    @classmethod
    def by(cls, scatter: Scatter) -> Kept:
        """Return what a scatter keeps now."""
        result = None if scatter.result is None else Reference(scatter.result, "result")
        return cls(result, scatter.report_json, scatter.ran_with)

    def found(self) -> bpy.types.Object | None:
        """Return the result that it kept, or None where there is none any more."""
        return None if self.result is None else self.result.find()

    def give(self, scatter: Scatter) -> None:
        """Have a scatter keep this."""
        scatter.result = self.found()
        scatter.report_json, scatter.ran_with = self.report, self.ran_with


class _Shown(NamedTuple):
    """How a view layer shows an object."""

    layer: str
    selected: bool
    hidden: bool
    active: bool

    def give(self, scene: bpy.types.Scene, item: bpy.types.Object) -> None:
        """Have it shown like this again, once it is linked."""
        layer = scene.view_layers.get(self.layer)
        if layer is None:
            return
        # Until then, what is new is not in the layer's list.
        layer.update()
        if not is_in_layer(layer, item):
            return
        item.hide_set(self.hidden, view_layer=layer)
        item.select_set(self.selected, view_layer=layer)
        if self.active:
            layer.objects.active = item


class NewResult:
    """A result that was made since the last undo step, or before it.

    Args:
        scatter: Its scatter.
        item: The result.
        before: What the scatter kept before.
        scatter_of: Finds a scatter of a scene by its number.
    """

    def __init__(
        self,
        scatter: Scatter,
        item: bpy.types.Object,
        before: Kept,
        scatter_of: Callable[[bpy.types.Scene | None, int], Scatter | None],
    ) -> None:
        self._scene, self._uid = Reference(scatter.id_data, "scene"), scatter.uid
        self._item, self._before = Reference(item, "result"), before
        self._scatter_of = scatter_of
        # What the scatter kept, and how view layers showed the result, while it is taken out of the scene.
        self._now: tuple[Kept, list[_Shown]] | None = None

    def take_out(self) -> None:
        """Take the result out of its scene, which is then as before it was made; while it is edited, leave it there."""
        scene, item, self._now = self._scene.find(), self._item.find(), None
        scatter = self._scatter_of(scene, self._uid)
        if scene is None or item is None or scatter is None or scatter.result != item or item.mode != "OBJECT":
            return
        if scene.collection.objects.get(item.name) != item:
            # It was moved elsewhere, in a step.
            return
        layers = [layer for layer in scene.view_layers if is_in_layer(layer, item)]
        self._now = (
            Kept.by(scatter),
            [
                _Shown(
                    layer.name,
                    item.select_get(view_layer=layer),
                    item.hide_get(view_layer=layer),
                    layer.objects.active == item,
                )
                for layer in layers
            ],
        )
        self._before.give(scatter)
        scene.collection.objects.unlink(item)

    def put_again(self) -> bool:
        """Put the result into its scene again where undo has left both; tell whether there may be something to take out again."""
        scene, item = self._scene.find(), self._item.find()
        scatter = self._scatter_of(scene, self._uid)
        if scene is None or item is None or scatter is None:
            return False
        if self._now is None:
            return True
        if scatter.result != self._before.found() or is_in(scene, item):
            # Undo has given the scene what the step knows.
            return False
        kept, shown = self._now
        scene.collection.objects.link(item)
        join_local_views(scene, item, scatter.chosen_target)
        for one in shown:
            one.give(scene, item)
        kept.give(scatter)
        return True
