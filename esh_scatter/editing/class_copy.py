"""Copying settings from one class of the sidebar to another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bpy.types import PropertyGroup

from ...engine.problem.body_class import ClassSettings
from ...engine.problem.scatter_settings import Standing
from ...engine.problem.settings import settings_of
from ..properties.copied_values import copy_values
from ..properties.described import shown_settings
from ..properties.influential_settings import LOOKS

__all__ = ["CLASS_PARTS", "KEPT_APART", "copy_class"]

# Settings of a class that say how much room each of its bodies takes.
KEPT_APART = ("room", "gap")
# Parts of a class's settings that are copied together: label, description, names of the properties.
CLASS_PARTS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "DENSITY": (
        "Density",
        "Where there are many and where few",
        ("layers", "layer_index"),
    ),
    "STANDING": ("Rotation and Scale", "How objects stand, and how much they vary", (*settings_of(Standing), *LOOKS)),
    "DETAIL": (
        "Direction and Detail",
        "Where long ones point, and what is done to the density",
        (
            *("direction_kind", "direction_angle", "direction_image", "direction_object", "direction_attribute"),
            "may_overlap",
            *(shown.name for shown in shown_settings(ClassSettings, (*KEPT_APART, "look_at"))),
        ),
    ),
    "COUNT": (
        "Sizes and Counts",
        "What is placed, how many, and how much room each takes",
        ("count_kind", "total", "per_area", "distance", "cover_share", "sizes", *KEPT_APART),
    ),
}


def copy_class(source: PropertyGroup, to: PropertyGroup, parts: Mapping[str, Any]) -> None:
    """Copy parts of the settings of a class, keys of :data:`CLASS_PARTS`, to another; color, switches and own names stay."""
    # What comes with the settings of another class stands as these say.
    to.waits_for_first = to.waits_for_first and "COUNT" not in parts
    for part in parts:
        copy_values(source, to, CLASS_PARTS[part][2])
