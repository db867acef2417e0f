"""Results that somebody has copied, and their settings: a copy has none until it is made a scatter of its own."""

from __future__ import annotations

from typing import Any

import bpy

from ..properties.scene import ESH_PG_scene
from ..result.display import followed_targets, our_modifier
from ..result.node_group import have_built_anew
from ..result.result import is_copy, rename_result
from ..targets.target import RESULT_TARGET, is_result
from .class_copy import copy_values

__all__ = ["copied_from", "make_scatter_of"]

# What belongs to the result of a scatter, not to its settings.
_OF_RESULT = {"name", "uid", "live", "result", "report_json", "ran_with", "placed"}


def copied_from(context: bpy.types.Context) -> Any | None:
    """Return the scatter of the scene whose result the active object is a copy of; None where it is none."""
    item, scatters = context.view_layer.objects.active, context.scene.esh_scatter.scatters
    if item is None or not is_result(item) or any(scatter.result == item for scatter in scatters):
        return None
    return next((one for one in scatters if one.result is not None and is_copy(item, one.result)), None)


def make_scatter_of(item: bpy.types.Object, settings: ESH_PG_scene, index: int) -> Any:
    """Add a scatter whose result a copied one is, with the settings of the scatter that it was copied from; return it.

    Args:
        item: The copy, which shows what it does until the next run.
        settings: Those of its scene.
        index: Which of the scatters it was copied from.
    """
    modifier = our_modifier(item)
    followed = followed_targets(modifier) if modifier is not None else []
    # A copy can follow another target than what it was made on.
    ground = followed[0].target if len(followed) == 1 and followed[0].target is not None else item.get(RESULT_TARGET)
    made = settings.add_scatter(ground)
    source = settings.scatters[index]
    left_out = _OF_RESULT | {name for name in ("target", "target_kind", "target_collection") if ground is not None}
    names = [one.identifier for one in source.bl_rna.properties if one.identifier not in {"rna_type", *left_out}]
    copy_values(source, made, tuple(names))
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
    return made
