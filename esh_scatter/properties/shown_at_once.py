"""What the result shows at once when a setting of a class changes, without solving.

The properties of a class call these functions, so this module does not import it.
"""

import bpy
from bpy.types import PropertyGroup

from .names import scatter_of

__all__ = ["paint_class_anew", "show_class_anew", "stand_class_anew"]


def _points_of_class(body_class: PropertyGroup) -> tuple[bpy.types.Object, int] | None:
    """Return the result and the number that a class has in it, or None where it has no points."""
    from ..result.kept_ground import CLASSES_OF_POINTS

    result = scatter_of(body_class).result_in(body_class.id_data)
    if result is None or result.type != "MESH":
        return None
    uids = list(result.data.get(CLASSES_OF_POINTS, ()))
    return (result, uids.index(body_class.uid)) if body_class.uid in uids else None


def stand_class_anew(body_class: PropertyGroup, _context: object) -> None:
    """Change in the result how the objects of a class stand; where that cannot be done, the result is out of date."""
    from ..result.kept_ground import can_stand_anew, stand_anew

    found = _points_of_class(body_class)
    if found and can_stand_anew(found[0]):
        stand_anew(*found, body_class.standing(), body_class.look_at())
        scatter_of(body_class).remember_look(body_class)
    elif scatter_of(body_class).report_json and not body_class.mute:
        scatter_of(body_class).ran_with = "{}"


def paint_class_anew(body_class: PropertyGroup, _context: object) -> None:
    """Give the points of a class its color."""
    from ..result.kept_ground import paint_points

    if found := _points_of_class(body_class):
        paint_points(*found, tuple(body_class.color))


def show_class_anew(body_class: PropertyGroup, _context: object) -> None:
    """Show or hide the objects of a class."""
    from ..result.kept_ground import hide_points

    if found := _points_of_class(body_class):
        hide_points(*found, viewport=not body_class.show_viewport, render=not body_class.show_render)
