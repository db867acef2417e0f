"""What a result was made with, as plain data.

What is at its default is not in a record. So a setting that is new needs nothing here: older records lack it, and are as current with
its default as they were without it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import bpy

from ...engine.problem.look_at import LookAt
from ...engine.problem.scatter_settings import TargetSettings
from ...engine.problem.settings import settings_of
from ..classes.name_lists import names_in
from ..classes.standing import Unread
from ..result import pins
from ..targets import checksums
from ..targets.target import members_of
from .influential_settings import LOOKS, WITHOUT_INFLUENCE

__all__ = [
    "completed",
    "looks_of",
    "only_counts_differ",
    "only_looks_differ",
    "record",
    "same",
    "same_surface",
    "state_of_targets",
    "with_pins_of",
    "without_unread",
]

# How a record says that there is nothing of something: no obstacles, no places set by hand and no pins, no curve.
NOTHING: tuple[Any, ...] = ([], [[], []])
# What says how many there are, of a class and of a size.
COUNTS = {"count_kind", "total", "per_area", "distance", "cover_share", "count", "share"}
# What objects show at once, but has an influence where their outlines are kept apart: they are as large and as turned as this says.
OF_OUTLINES = ("align_to_normal", "random_turn", "scale_jitter", "tilt")
# What of these and of where a class looks has none all the same, where turns have none, and where leaning has none either.
OF_TURNS, OF_LEANING = {"random_turn", *LOOKS}, {"align_to_normal", "tilt"}


def record(scatter: Any, classes: Sequence[Any]) -> dict[str, Any]:
    """Return every setting that has an influence on a result, and what the things that it names hold.

    Args:
        scatter: The settings.
        classes: Those of its classes that take part.

    Returns:
        Ready for JSON: ``target``, ``scatter``, and ``classes`` by their numbers, in their order, with their ``sizes``; ``names`` of
        these and of what was looked into, which have no influence.
    """
    more = OF_OUTLINES if scatter.avoid_overlap else ()
    target = scatter.first_target
    called = {str(c.uid): c.name for c in classes}
    names = dict(called)
    return {
        "target": target and state_of_targets(scatter),
        "scatter": _without_defaults(_values(scatter, names, "scatter") | _kept_off(scatter), scatter.bl_rna),
        "classes": {
            str(c.uid): {
                "values": _without_defaults(
                    _values(c, names, str(c.uid), more)
                    | (_turned_to(c) if more else {})
                    | _points_along(c, target, names)
                    | {"may_overlap": _numbers_of(c.names_that_may_overlap, called)},
                    c.bl_rna,
                ),
                **_where_it_looks(c),
                "layers": [
                    _layer(layer, scatter, names, f"{c.uid}.layer {number}")
                    for number, layer in enumerate(layer for layer in c.layers if layer.use)
                ],
                "sizes": [
                    _without_defaults(
                        _values(size, names, f"{c.uid}.{number}") | {"variants": sorted(size.weights.items())},
                        size.bl_rna,
                    )
                    for number, size in enumerate(c.sizes)
                ],
            }
            for c in classes
        },
        "names": names,
    }


def _numbers_of(names: set[str], called: Mapping[str, str]) -> list[str]:
    """Return the numbers of the classes with some names, which may be renamed; ``called`` are the names of all, by their numbers."""
    return sorted(uid for uid, name in called.items() if name in names)


def looks_of(body_class: Any) -> list[float] | None:
    """Return where the object is that a class looks at; None where it looks at none."""
    look = body_class.look_at() if body_class.look_at_object is not None else None
    return None if look is None else [round(x, 4) for x in look.point]


def only_looks_differ(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Tell whether two records differ in nothing but in where objects are that classes look at."""

    def without(record: dict[str, Any]) -> dict[str, Any]:
        classes = {
            uid: {k: v for k, v in one.items() if k != "looks"} for uid, one in record.get("classes", {}).items()
        }
        return {**record, "classes": classes}

    return before != now and without(before) == without(now)


def only_counts_differ(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Tell whether two records differ in nothing but in counts and in which classes there are."""

    def without(values: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if name not in COUNTS}

    def of(record: dict[str, Any], uid: str) -> dict[str, Any]:
        one = record["classes"][uid]
        return {**one, "values": without(one["values"]), "sizes": [without(size) for size in one["sizes"]]}

    if any(before.get(key) != now[key] for key in now if key not in ("classes", "names")):
        return False
    return all(of(before, uid) == of(now, uid) for uid in now["classes"] if uid in before["classes"])


def _where_it_looks(body_class: Any) -> dict[str, Any]:
    """Return where the object is that a class looks at; the result shows it at once only where somebody sees it move."""
    looks = looks_of(body_class)
    return {} if looks is None else {"looks": looks}


def _turned_to(body_class: Any) -> dict[str, Any]:
    """Return where a class looks if that has an influence on who overlaps whom."""
    look = None if body_class.is_round else body_class.look_at()
    if look is None:
        return {}
    values = {f"look_at_{name}": getattr(look, name) for name in settings_of(LookAt)}
    return {"use_look_at": True, **values, "look_at_point": [round(x, 4) for x in look.point]}


def _points_along(body_class: Any, target: bpy.types.Object | None, names: dict[str, str]) -> dict[str, Any]:
    """Return what a class's long objects lie along, as far as that is an object or an attribute of the target."""
    if body_class.direction_kind == "CURVE" and body_class.direction_object is not None:
        item = body_class.direction_object
        names[f"{body_class.uid}.direction_object"] = item.name
        # It counts where it stands.
        return {"direction_object": [[checksums.of_object(item), checksums.pose_of(item)]]}
    if body_class.direction_kind == "ATTRIBUTE" and target is not None:
        name = body_class.direction_attribute
        return {"direction_attribute": [name, checksums.of_attribute(target, name)]}
    return {}


def state_of_targets(scatter: Any) -> list[Any]:
    """Return what the targets look like and where they stand; of a single object without a further list."""
    return _states_of(scatter, checksums.of_ground)


def _states_of(scatter: Any, number_of: Callable[[bpy.types.Object], int]) -> list[Any]:
    found = [[number_of(item), checksums.pose_of(item)] for item in scatter.targets]
    return found[0] if scatter.target_kind == "OBJECT" else found


def same_surface(before: dict[str, Any], scatter: Any) -> bool:
    """Tell whether a scatter stands on the same surface as it did, by the record of then: the same shape, and the same of it."""
    if not before or before["target"] != json.loads(json.dumps(state_of_targets(scatter))):
        return False
    defaults, then = _defaults(scatter.bl_rna), before["scatter"]
    return all(getattr(scatter, name) == then.get(name, defaults[name]) for name in settings_of(TargetSettings))


def completed(before: dict[str, Any], scatter: Any) -> dict[str, Any]:
    """Return a record of any version as it would be made now: older ones have what is at its default, too."""
    if not before:
        return before
    of_classes = scatter.bl_rna.properties["classes"].fixed_type
    of_layers, of_sizes = (of_classes.properties[name].fixed_type for name in ("layers", "sizes"))
    classes = {
        uid: {
            **one,
            "values": _without_defaults({**one["values"], **_overlap_by_numbers(one["values"], before)}, of_classes),
            "layers": [_layer_without_defaults(layer, of_layers) for layer in one.get("layers", [])],
            "sizes": [_without_defaults(size, of_sizes) for size in one["sizes"]],
        }
        for uid, one in before["classes"].items()
    }
    target = before["target"]
    # Older ones looked at what subdivision makes of a target.
    if target and scatter.first_target and target == _states_of(scatter, checksums.of_shape):
        target = state_of_targets(scatter)
    values = _without_defaults(before["scatter"], scatter.bl_rna)
    return {**before, "target": target, "scatter": values, "classes": classes}


def _overlap_by_numbers(values: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """Return which classes a class may overlap, by their numbers also where an older record has their names."""
    told = values.get("may_overlap", [])
    called = {uid: name for uid, name in before["names"].items() if uid in before["classes"]}
    return {"may_overlap": _numbers_of(names_in(told), called) if isinstance(told, str) else told}


def same(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Tell whether two records stand for the same result: names do not count."""
    equal = all(before.get(key) == value for key, value in now.items() if key != "names")
    return equal and list(before["classes"]) == list(now["classes"])


def without_unread(record: dict[str, Any], unread: Mapping[str, int]) -> dict[str, Any]:
    """Return a record without what of how objects stand had no influence on where the last run has put them.

    Args:
        record: Of then or of now.
        unread: How much that was, by the numbers of its classes, as results keep it.
    """
    if not any(unread.values()):
        return record

    def read(uid: str, values: dict[str, Any]) -> dict[str, Any]:
        level = unread.get(uid, Unread.NOTHING)
        idle = (OF_TURNS if level >= Unread.TURNS else set()) | (OF_LEANING if level >= Unread.LEANS else set())
        return {name: value for name, value in values.items() if name not in idle}

    classes = record.get("classes", {})
    return {**record, "classes": {uid: {**one, "values": read(uid, one["values"])} for uid, one in classes.items()}}


def _without_defaults(values: dict[str, Any], of: Any) -> dict[str, Any]:
    """Return the values that differ from the defaults of a group's properties; ``of`` is Blender's description of the group."""
    defaults = _defaults(of)
    return {
        name: value
        for name, value in values.items()
        if value not in NOTHING and not (name in defaults and value == defaults[name])
    }


def _layer_without_defaults(values: dict[str, Any], of: Any) -> dict[str, Any]:
    """Return the same of a layer, and its kind, which says what else counts."""
    return {"kind": values["kind"], **_without_defaults(values, of)}


# Defaults of the groups' properties, by the groups' identifiers: to ask Blender for all of them takes as long as the rest of a record.
_DEFAULTS: dict[str, dict[str, Any]] = {}


def _defaults(of: Any) -> dict[str, Any]:
    """Return the defaults of a group's properties by their names."""
    if of.identifier not in _DEFAULTS:
        _DEFAULTS[of.identifier] = {prop.identifier: _default(prop) for prop in of.properties}
    return _DEFAULTS[of.identifier]


def _default(prop: Any) -> Any:
    """Return the default of a property; what lies in a list of its own has none."""
    if prop.type in ("POINTER", "COLLECTION"):
        return None
    return list(prop.default_array) if getattr(prop, "is_array", False) else prop.default


@lru_cache(maxsize=8)
def _influential(group: Any) -> tuple[str, ...]:
    """Return the names of the properties of a group that have an influence on the result."""
    names = (prop.identifier for prop in group.bl_rna.properties if prop.type != "COLLECTION")
    return tuple(name for name in names if name not in WITHOUT_INFLUENCE | {"rna_type"})


def _values(group: Any, names: dict[str, str], key: str, more: Sequence[str] = ()) -> dict[str, Any]:
    """Return the values of a group; of what it points to, the number of its contents, and in ``names`` what it is called."""
    values: dict[str, Any] = {}
    kind: Any = type(group)
    unused = group.unused if hasattr(group, "unused") else ()
    for name in (*_influential(kind), *more):
        if name in unused:
            continue
        value = getattr(group, name)
        if isinstance(value, bpy.types.ID):
            names[f"{key}.{name}"] = value.name
            value = _contents(value, as_one=getattr(group, "placed_as_one", False))
        elif isinstance(value, bpy.types.bpy_prop_array):
            value = list(value)
        values[name] = value
    return values


def _contents(item: bpy.types.ID, *, as_one: bool = False) -> int:
    if isinstance(item, bpy.types.Image):
        return checksums.of_image(item)
    if isinstance(item, bpy.types.Object | bpy.types.Collection):
        return checksums.of_collection(item) if as_one else checksums.of_members(members_of(item))
    return 0


def _kept_off(scatter: Any) -> dict[str, Any]:
    """Return what the objects of a scatter keep off, and where that stands."""
    return {
        "obstacles": [
            [
                round(one.width, 6),
                round(one.margin, 6),
                *([checksums.of_shape(i), checksums.pose_of(i)] for i in one.items if i != scatter.result),
            ]
            for one in scatter.obstacles
            if one.ready
        ],
        "free_places": [
            [[*(round(x, 4) for x in one.place), round(one.radius, 4)] for one in scatter.free_places],
            _pinned(scatter),
        ],
        "keep_off_others": [checksums.of_points(result) for result in scatter.other_results()],
    }


def with_pins_of(scatter: Any, record: dict[str, Any]) -> dict[str, Any]:
    """Return the record that a run began with, with what stays of the result that it has written."""
    pinned, values = _pinned(scatter), record["scatter"]
    places = [values.get("free_places", NOTHING[1])[0], pinned]
    of_run = {name: value for name, value in values.items() if name != "free_places"}
    return {**record, "scatter": of_run if places in NOTHING else {**of_run, "free_places": places}}


def _pinned(scatter: Any) -> list[int]:
    """Return what stays of the result by hand."""
    result = scatter.result_in(scatter.id_data)
    return [] if result is None else pins.checksum_of(result)


def _layer(layer: Any, scatter: Any, names: dict[str, str], key: str) -> dict[str, Any]:
    """Return what of a layer's settings has an influence, those of its kind, and what the things hold that it names."""
    values: dict[str, Any] = {"kind": layer.kind}
    target = scatter.first_target
    for name in layer.influential_of(layer.kind):
        value = getattr(layer, name)
        if name == "camera":
            values[name] = _view(value)
        elif isinstance(value, bpy.types.Object | bpy.types.Collection):
            names[f"{key}.{name}"] = value.name
            items = value.all_objects if isinstance(value, bpy.types.Collection) else [value]
            # Near to them, it counts where they stand; every run changes its own result, which may lie among them.
            values[name] = [[checksums.of_object(i), checksums.pose_of(i)] for i in items if i != scatter.result]
        elif isinstance(value, bpy.types.ID):
            names[f"{key}.{name}"] = value.name
            values[name] = _contents(value)
        elif target is not None and name == "vertex_group":
            values[name] = [value, checksums.of_weights(target, value)]
        elif target is not None and (name == "attribute" or (name == "uv_map" and layer.image_mapping == "UV")):
            values[name] = [value, checksums.of_attribute(target, value)]
        else:
            values[name] = list(value) if isinstance(value, bpy.types.bpy_prop_array) else value
    return _layer_without_defaults({**values, "curve": layer.curve_record()}, layer.bl_rna)


def _view(camera: bpy.types.Object | None) -> list[Any] | None:
    """Return what a camera sees; of None, the scene's."""
    scene = bpy.context.scene
    camera = camera or scene.camera
    if camera is None:
        return None
    lens, render = camera.data, scene.render
    numbers = [lens.type, lens.lens, lens.ortho_scale, lens.sensor_fit, lens.sensor_width, lens.sensor_height]
    numbers += [lens.shift_x, lens.shift_y, render.resolution_x, render.resolution_y]
    return [checksums.pose_of(camera), *numbers, render.pixel_aspect_x, render.pixel_aspect_y]
