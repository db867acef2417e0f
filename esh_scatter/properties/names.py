"""Names in the sidebar's lists: no two the same, and known by those who refer to them.

Properties call these functions when a name changes, so this module does not import their classes.
"""

from itertools import count

from bpy.types import Object, PropertyGroup

from ..classes.name_lists import joined_names

__all__ = [
    "KEPT",
    "NEW_CLASS",
    "class_of",
    "class_renamed",
    "follow_names",
    "keep_name_unused",
    "name_class_after",
    "outnamed",
    "scatter_of",
    "scatter_renamed",
    "take_name_of_result",
    "unused_name",
]

# What a class is called until something to place is chosen.
NEW_CLASS = "Class"

# Bytes of a name that every Blender keeps; what is longer may have been cut.
KEPT = 63


def unused_name(name: str, taken: set[str]) -> str:
    """Return ``name``, or ``name 2`` and so on where it is taken."""
    if name not in taken:
        return name
    stem, _, number = name.rpartition(" ")
    stem = stem if stem and number.isdecimal() else name
    return next(candidate for index in count(2) if (candidate := f"{stem} {index}") not in taken)


def keep_name_unused(item: PropertyGroup, _context: object) -> None:
    """Give ``item`` a name that no neighbor in its list has; an empty name becomes its kind's."""
    _keep_unused(item, set())


def _keep_unused(item: PropertyGroup, taken_elsewhere: set[str]) -> None:
    path, _, index = item.path_from_id().rpartition("[")
    siblings = item.id_data.path_resolve(path)
    position = int(index.rstrip("]"))
    taken = {sibling.name for number, sibling in enumerate(siblings) if number != position}
    name = unused_name(item.name.strip() or item.KIND, taken | taken_elsewhere)
    if name != item.name:
        item.name = name


def class_of(size: PropertyGroup) -> PropertyGroup:
    """Return the class that a size belongs to."""
    return size.id_data.path_resolve(size.path_from_id().rpartition(".sizes[")[0])


def name_class_after(size: PropertyGroup) -> None:
    """Name a class that nobody has named after what its first size places, also where that is another thing now."""
    body_class = class_of(size)
    stem, _, number = body_class.name.rpartition(" ")
    is_new = body_class.name == NEW_CLASS or (stem == NEW_CLASS and number.isdecimal())
    has_own = not is_new and body_class.name != body_class.named_after
    if size.source is not None and size == _naming_size(body_class) and not has_own:
        body_class.name = size.source.name
        body_class.named_after, size.names_class = body_class.name, True


def _naming_size(body_class: PropertyGroup) -> PropertyGroup | None:
    """Return the size after which a class is named: the only one, or what was so when there came more; None if that is gone."""
    sizes = body_class.sizes
    return sizes[0] if len(sizes) == 1 else next((size for size in sizes if size.names_class), None)


def outnamed(scatter: PropertyGroup) -> list[PropertyGroup]:
    """Return the classes that are named after what they place, and are called otherwise since that was renamed."""
    return [
        one for one in scatter.classes if one.name == one.named_after != "" and not _has_name_of_source(one, scatter)
    ]


def _has_name_of_source(body_class: PropertyGroup, scatter: PropertyGroup) -> bool:
    size = _naming_size(body_class)
    source = None if size is None else size.source
    if source is None:
        return True
    name = source.name.strip() or body_class.KIND
    stem, _, number = body_class.name.rpartition(" ")
    # Most have that name, and every drawing of the sidebar asks. It is numbered for a class that may be gone by now.
    if body_class.name == name or (stem == name and number.isdecimal()):
        return True
    return body_class.name == unused_name(name, {one.name for one in scatter.classes if one != body_class})


def follow_names(scatter: PropertyGroup) -> None:
    """Rename the classes that are named after what they place, where somebody has renamed that."""
    for body_class in outnamed(scatter):
        name_class_after(_naming_size(body_class))


def class_renamed(item: PropertyGroup, context: object) -> None:
    """Keep the name of a class unused, and have the classes that may overlap this one know it by its new name."""
    keep_name_unused(item, context)
    before, item.known_name = item.known_name, item.name
    if before and before != item.name:
        for other in scatter_of(item).classes:
            if before in other.names_that_may_overlap:
                others = other.names_that_may_overlap - {before} | {item.name}
                other.may_overlap = joined_names(others)


def scatter_renamed(item: PropertyGroup, _context: object) -> None:
    """Keep the name of a scatter unused, and rename its result; one without leaves results alone that have no scatter here."""
    from ..result.result import names_on, rename_result

    others = {scatter.result for scatter in item.id_data.esh_scatter.scatters}
    _keep_unused(item, names_on(item.id_data, item.chosen_target, others) if item.result is None else set())
    result = item.result_in(item.id_data)
    if result is not None and result.library is None:
        rename_result(result, item.name)


def take_name_of_result(item: PropertyGroup, result: Object) -> None:
    """Rename a scatter as somebody has renamed its result; that Blender numbers a name which is taken, or cuts it, is no new name."""
    name = result.name
    stem, _, number = name.rpartition(".")
    given = stem if stem and number.isdecimal() else name
    is_cut = len(given.encode()) >= KEPT - len(".001") and item.name.startswith(given)
    if item.name not in (name, given) and not is_cut:
        item.name = name


def scatter_of(item: PropertyGroup) -> PropertyGroup:
    """Return the scatter that a class belongs to, or a part of one, or an obstacle."""
    path = item.path_from_id()
    return item.id_data.path_resolve(path[: max(path.rfind(".classes["), path.rfind(".obstacles["))])
