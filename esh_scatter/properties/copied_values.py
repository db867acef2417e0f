"""Copying the values of one group of properties to another."""

from __future__ import annotations

import bpy
from bpy.types import PropertyGroup, bpy_prop_collection

from ..densities.density_curve import copy_curve

__all__ = ["copy_values"]


def copy_values(
    source: PropertyGroup, to: PropertyGroup, names: tuple[str, ...] | None = None, *, own_curves: bool = True
) -> None:
    """Copy properties, lists of groups with all that is in them; None copies all. Curves are copied, too, unless both may have one."""
    told = [one.identifier for one in source.bl_rna.properties if one.identifier != "rna_type"]
    values = {name: getattr(source, name) for name in names or told}
    # Curves first: the switch that uses one makes one where there is none.
    for name, value in sorted(values.items(), key=lambda one: not isinstance(one[1], bpy.types.NodeTree)):
        if isinstance(value, bpy_prop_collection):
            entries = getattr(to, name)
            entries.clear()
            for entry in value:
                copy_values(entry, entries.add(), own_curves=own_curves)
        elif own_curves and isinstance(value, bpy.types.NodeTree):
            setattr(to, name, copy_curve(value))
        else:
            setattr(to, name, value)
