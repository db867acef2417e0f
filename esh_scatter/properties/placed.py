"""Which objects a result was made of, told apart by pointers, so that neither renaming nor copying a scene changes them."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from typing import Any

import bpy
from bpy.props import IntProperty, PointerProperty
from bpy.types import PropertyGroup

__all__ = ["CLASSES", "ESH_PG_placed", "remember_placed", "replaced"]


class ESH_PG_placed(PropertyGroup):
    """What the last run saw: the target, or an object or collection to place."""

    item: PointerProperty(type=bpy.types.Object)
    collection: PointerProperty(type=bpy.types.Collection)
    # The number of the class, and which of its sizes; 0 is the target.
    uid: IntProperty(options={"HIDDEN"})
    size: IntProperty(options={"HIDDEN"})


def remember_placed(scatter: Any, only: tuple[int, int] | None = None) -> None:
    """Keep which objects the scatter's settings stand for now; of ``only`` one size, by the class's number and its own, that alone."""
    now = _now(scatter)
    if only is None:
        scatter.placed.clear()
    for (uid, size), chosen in now.items():
        if only is None:
            entry = scatter.placed.add()
            entry.uid, entry.size = uid, size
        elif only == (uid, size):
            entry = next(one for one in scatter.placed if (one.uid, one.size) == only)
        else:
            continue
        as_collection = isinstance(chosen, bpy.types.Collection)
        entry.collection, entry.item = (chosen, None) if as_collection else (None, chosen)


def replaced(scatter: Any) -> list[str]:
    """Name what stands for others than in the last run: "target", "object of Pine"."""
    found = []
    now = _now(scatter)
    names = {c.uid: c.name for c in scatter.classes}
    for entry in scatter.placed:
        # Classes and sizes that are gone are told with the settings.
        before, chosen = entry.collection or entry.item, now.get((entry.uid, entry.size))
        if chosen is None or chosen == before:
            continue
        if not entry.uid:
            found.append("target")
        elif before is not None and type(chosen) is not type(before):
            found.append(f"what {names[entry.uid]} places")
        else:
            kind = "collection" if isinstance(chosen, bpy.types.Collection) else "object"
            found.append(f"{kind} of {names[entry.uid]}")
    return list(dict.fromkeys(found))


def _now(scatter: Any) -> dict[tuple[int, int], bpy.types.ID | None]:
    """Return what stands for the target, and by class and size what is placed."""
    found: dict[tuple[int, int], bpy.types.ID | None] = {(0, 0): scatter.target}
    for body_class in scatter.ready_classes():
        for number, size in enumerate(body_class.sizes):
            found[body_class.uid, number] = size.source
    return found


CLASSES = (ESH_PG_placed,)
