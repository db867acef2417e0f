"""Results that somebody has copied, and their settings: a copy has none until it is made a scatter of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ..properties.copied_values import copy_values
from ..properties.kept_settings import OF_RESULT, kept_of
from ..properties.scene import ESH_PG_scene
from ..result.display import followed_targets, our_modifier
from ..result.node_group_contents import have_built_anew
from ..result.result import is_copy, rename_result
from ..targets.in_scenes import in_a_scene
from ..targets.target import RESULT_TARGET, is_result

__all__ = ["copied_from", "make_scatter_of"]


def copied_from(context: bpy.types.Context) -> Any | None:
    """Return the scatter of the scene whose result the active object is a copy of; None where it is none."""
    item, scatters = context.view_layer.objects.active, context.scene.esh_scatter.scatters
    if item is None or not is_result(item) or any(scatter.result == item for scatter in scatters):
        return None
    return next((one for one in scatters if one.result is not None and is_copy(item, one.result)), None)


def make_scatter_of(item: bpy.types.Object, settings: ESH_PG_scene, index: int | None) -> Any:
    """Add a scatter whose result an object is, with the settings that it was made with; return it.

    Args:
        item: A copy, or what has come from another file; it shows what it does until the next run.
        settings: Those of its scene.
        index: Which of the scatters it was copied from; None for what is no copy.
    """
    modifier = our_modifier(item)
    followed = followed_targets(modifier) if modifier is not None else []
    # A copy can follow another target than what it was made on.
    ground = followed[0].target if len(followed) == 1 and followed[0].target is not None else item.get(RESULT_TARGET)
    made = settings.add_scatter(ground)
    # What it was made with, not what the scatter of what it was copied from has come to ask for since. Older results lack it.
    source: Any = kept_of(item) or settings.scatters[index]
    left_out = OF_RESULT | {name for name in ("target", "target_kind", "target_collection") if ground is not None}
    names = [one.identifier for one in source.bl_rna.properties if one.identifier not in {"rna_type", *left_out}]
    copy_values(source, made, tuple(names))
    if index is None:
        # Its name is no other one's.
        made.result = item
    made.name = item.name
    if item.data.users > 1:
        item.data = item.data.copy()
    if modifier is not None and modifier.node_group.users > 1:
        modifier.node_group = modifier.node_group.copy()
        # It leads to the same parts; the next run makes it anew, with its own.
        have_built_anew(modifier.node_group)
    if ground is not None:
        item[RESULT_TARGET] = ground
    made.result = item
    rename_result(item, made.name)
    if index is None or not all(map(in_a_scene, made.targets)):
        _bring_along(made)
    return made


def _bring_along(scatter: Any) -> None:
    """Put into the scene what has come to the file with a result, and is in no scene yet: in none, it would count as deleted.

    What is placed goes into a hidden collection; targets, obstacles and the like are where they were, for all to see.
    """
    scene = scatter.id_data
    placed = {item for one in scatter.classes for size in one.sizes for item in _objects_of(size)}
    new = sorted((item for item in {*_objects_of(scatter)} if not in_a_scene(item)), key=lambda item: item.name_full)
    hidden = bpy.data.collections.new(f"{scatter.name} Sources") if placed & {*new} else None
    if hidden is not None:
        hidden.hide_viewport = hidden.hide_render = True
        scene.collection.children.link(hidden)
    for item in new:
        (hidden if hidden is not None and item in placed else scene.collection).objects.link(item)


def _objects_of(group: bpy.types.PropertyGroup) -> Iterator[bpy.types.Object]:
    """Go through the objects that settings name, also as members of a collection."""
    for told in group.bl_rna.properties:
        value = getattr(group, told.identifier)
        if isinstance(value, bpy.types.Object):
            yield value
        elif isinstance(value, bpy.types.Collection):
            yield from value.all_objects
        elif told.type == "COLLECTION":
            for entry in value:
                yield from _objects_of(entry)
