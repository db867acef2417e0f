"""The settings that a result was made with, kept with its object: they come along where it is appended to another file."""

from __future__ import annotations

from typing import Any

import bpy

from ..targets.target import is_result
from .copied_values import copy_values

__all__ = ["OF_RESULT", "keep_settings", "kept_of"]

# What belongs to the result of a scatter, not to its settings.
OF_RESULT = {"name", "uid", "live", "result", "report_json", "ran_with", "placed"}


def keep_settings(scatter: Any, item: bpy.types.Object) -> None:
    """Keep the settings of a scatter with its result; what is linked, or overrides that, has those it came with."""
    if item.library is not None or item.override_library is not None:
        return
    kept = item.esh_made_with.scatters
    kept.clear()
    names = [one.identifier for one in scatter.bl_rna.properties if one.identifier not in {"rna_type", *OF_RESULT}]
    copy_values(scatter, kept.add(), tuple(names), own_curves=False)


def kept_of(item: bpy.types.Object | None) -> Any | None:
    """Return the settings that a local result came with which is no scatter's of this file; None where there are none."""
    if item is None or item.library is not None or not is_result(item) or not item.esh_made_with.scatters:
        return None
    if any(scatter.result == item for scene in bpy.data.scenes for scatter in scene.esh_scatter.scatters):
        return None
    return item.esh_made_with.scatters[0]
