"""What the result shows at once when a setting of a class changes, without solving.

The properties of a class call these functions, so this module does not import it.
"""

import bpy
from bpy.types import PropertyGroup

from .names import scatter_of

__all__ = ["choose_variants_anew", "paint_class_anew", "place_others", "show_class_anew", "stand_class_anew"]


def _points_of_class(body_class: PropertyGroup) -> tuple[bpy.types.Object, int] | None:
    """Return the result and the number that a class has in it, or None where it has no points."""
    from ..result.kept_ground import CLASSES_OF_POINTS

    result = scatter_of(body_class).result_in(body_class.id_data)
    if result is None or result.type != "MESH":
        return None
    uids = list(result.data.get(CLASSES_OF_POINTS, ()))
    return (result, uids.index(body_class.uid)) if body_class.uid in uids else None


def stand_class_anew(body_class: PropertyGroup, _context: object) -> None:
    """Change in the result how the objects of a class stand; where that cannot be done, the result is out of date.

    Of a class that is new since the last run, there is nothing to change.
    """
    from ..result.kept_ground import can_stand_anew, stand_anew
    from ..solving import counted_again

    found = _points_of_class(body_class)
    if found and can_stand_anew(found[0]):
        counted_again.changes()
        stand_anew(*found, body_class.standing(), body_class.look_at())
        scatter_of(body_class).remember_look(body_class)
    elif not body_class.mute and scatter_of(body_class).ran_with_class(body_class):
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


def choose_variants_anew(variant: PropertyGroup, _context: object) -> None:
    """Place the objects of a size as often as their weights say, where all of them cover the same ground."""
    from ..result.kept_variants import choose_anew

    size, body_class = _part_of(variant, ".variants["), _part_of(variant, ".sizes[")
    found, number = _points_of_class(body_class), _number_of(size)
    if found is not None and choose_anew(found[0], (found[1], number), *size.choices()):
        scatter_of(body_class).remember_variants(body_class, number)
        _stand_on_lowest(body_class)
        _go_on(body_class)


def place_others(size: PropertyGroup, _context: object) -> None:
    """Show what a size places now in its points, where that covers the same ground as what it has placed."""
    from ..result import kept_variants

    body_class = _part_of(size, ".sizes[")
    found, scatter = _points_of_class(body_class), scatter_of(body_class)
    if found is None or not scatter.targets or body_class not in scatter.ready_classes():
        return
    result, number = found
    where = number, _number_of(size)
    if kept_variants.place_others(result, where, size.as_argument(), scatter.targets, body_class.scale):
        if kept_variants.choose_anew(result, where, *size.choices()):
            scatter.remember_variants(body_class, where[1])
        scatter.remember_sources(body_class, where[1])
        _stand_on_lowest(body_class)
        _go_on(body_class)


def _stand_on_lowest(body_class: PropertyGroup) -> None:
    """Have others stand on their lowest points, where the class does: how high these are differs."""
    if body_class.stand_on == "LOWEST":
        stand_class_anew(body_class, None)


def _part_of(item: PropertyGroup, within: str) -> PropertyGroup:
    """Return what holds the list that an item, or what that belongs to, is in."""
    return item.id_data.path_resolve(item.path_from_id().rpartition(within)[0])


def _number_of(item: PropertyGroup) -> int:
    """Return which of its list an item is."""
    return int(item.path_from_id().rpartition("[")[2].rstrip("]"))


def _go_on(body_class: PropertyGroup) -> None:
    """Have Live go on from what the result shows now, and what leans counted again once that was all."""
    from ..solving import counted_again, live

    counted_again.changes()
    live.reset(body_class.id_data, scatter_of(body_class))
