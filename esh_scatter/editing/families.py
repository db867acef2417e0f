"""Objects that belong together: a trunk with leaves that hang on it, an empty that shows a collection. They are placed as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

from ..targets.in_scenes import in_a_scene
from ..targets.target import FAMILY_OF, is_result, members_of, put_offset, shown_collection

__all__ = ["CONVERTED", "as_placed", "heads_in", "metaballs_on", "unmeasured"]

# What has a footprint: others, such as lights and cameras, are passed over. Of metaballs Blender's nodes show nothing.
SCATTERED_TYPES = {"MESH", "CURVE", "SURFACE", "FONT"}
# What shows something that nothing measures, or that nodes do not show, until it is converted to a mesh.
CONVERTED = {"META", "CURVES", "POINTCLOUD", "GREASEPENCIL"}
# What has no footprint, and comes along where it hangs on something that has: the lamp of a post.
COMPANIONS = {"LIGHT"}
# What has no geometry and can be chosen for what hangs on it: rigs, and the empties that imported models hang on.
HOLDERS = {"EMPTY", "ARMATURE", "LATTICE", "LIGHT"}


def heads_in(candidates: Iterable[bpy.types.Object], targets: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return those of some objects that can be placed on targets, by name; what hangs on another of them is part of that one."""
    given = [item for item in candidates if item not in targets and not is_result(item)]
    found = {item for item in given if item.type in SCATTERED_TYPES or shown_collection(item) is not None}
    holders = [item for item in given if item.type in HOLDERS and item not in found]
    # To look for what hangs on them goes through the file.
    hanging = _hanging() if holders else {}
    found |= {item for item in holders if _family(item, hanging, targets)}
    heads = [item for item in found if not any(one in found for one in _ancestors(item))]
    return sorted(heads, key=lambda item: item.name_full)


def as_placed(
    heads: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> list[bpy.types.Object | bpy.types.Collection]:
    """Return what to place for objects that :func:`heads_in` found: the object, or a collection where it is more than that."""
    hanging, found = _hanging(), []
    for head in heads:
        family = _family(head, hanging, targets)
        found.append(_collection_of(head, family) if family and family != [head] else head)
    return found


def metaballs_on(heads: Sequence[bpy.types.Object]) -> list[str]:
    """Return the names of metaballs that hang on objects, and that nothing shows where these are placed."""
    hanging = _hanging() if heads else {}
    return sorted(item.name for head in heads for item in _with_hanging(head, hanging) if item.type == "META")


def unmeasured(candidates: Iterable[bpy.types.Object], heads: Sequence[bpy.types.Object]) -> list[str]:
    """Return the names of those of some objects that have to be converted to be placed; what hangs on ``heads`` is not."""
    found = [
        item for item in candidates if item.type in CONVERTED and not any(one in heads for one in _ancestors(item))
    ]
    return sorted(item.name for item in found)


def _ancestors(item: bpy.types.Object) -> Iterable[bpy.types.Object]:
    while item.parent is not None:
        item = item.parent
        yield item


def _hanging() -> dict[bpy.types.Object, list[bpy.types.Object]]:
    """Return what hangs on each object of the file; Blender goes through all of them for each that it is asked about."""
    hanging: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for item in bpy.data.objects:
        if item.parent is not None:
            hanging.setdefault(item.parent, []).append(item)
    return hanging


def _family(
    head: bpy.types.Object,
    hanging: dict[bpy.types.Object, list[bpy.types.Object]],
    targets: Sequence[bpy.types.Object],
) -> list[bpy.types.Object]:
    """Return what is placed of an object and all that hangs on it; nothing where there are only lights."""
    family = [
        item
        for item in _with_hanging(head, hanging)
        if (item.type in COMPANIONS or members_of(item)) and not is_result(item) and item not in targets
    ]
    return family if any(item.type not in COMPANIONS for item in family) else []


def _with_hanging(
    head: bpy.types.Object, hanging: dict[bpy.types.Object, list[bpy.types.Object]]
) -> Iterable[bpy.types.Object]:
    """Return an object and all that hangs on it; what was deleted from its scene still hangs there, and is left out."""
    waiting = [head]
    while waiting:
        item = waiting.pop()
        if in_a_scene(item):
            yield item
        waiting += hanging.get(item, ())


def _collection_of(head: bpy.types.Object, family: Sequence[bpy.types.Object]) -> bpy.types.Collection:
    """Return a collection of a family, about the origin of its head; that of before, where there is one."""
    found = next((one for one in bpy.data.collections if one.get(FAMILY_OF) == head), None)
    if found is None:
        # It is in no scene: the outliner shows its objects where they are.
        found = bpy.data.collections.new(head.name)
        found[FAMILY_OF] = head
    for item in set(found.objects) - set(family):
        found.objects.unlink(item)
    for item in set(family) - set(found.objects):
        found.objects.link(item)
    put_offset(found, bpy.context)
    return found
