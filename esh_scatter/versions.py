"""Files that older versions saved: their settings are brought up to date when they are opened.

``Scene.esh_scatter.version`` says by which version of the settings a scene was saved; 0 was before there was such a number.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

__all__ = ["VERSION", "attach", "bring_up_to_date", "detach"]


def _keep_reports_current(settings: Any) -> None:
    """From 0 to 1: a run's settings are summed up in another way. What was up to date is so still."""
    for scatter in settings.scatters:
        if scatter.report_json and scatter.ran_with == _fingerprint_of_version_0(scatter):
            scatter.ran_with = _fingerprint_of_version_1(scatter)


def _stand_by_class(settings: Any) -> None:
    """From 1 to 2: how objects stand is said by class, classes have numbers, and a run's settings are kept readable."""
    for scatter in settings.scatters:
        current = scatter.report_json and scatter.ran_with == _fingerprint_of_version_1(scatter)
        for body_class in scatter.classes:
            body_class.known_name = body_class.name
            scatter.give_uid(body_class)
            for name in _STANDING_1:
                setattr(body_class, name, _stored(scatter, name))
            for size in body_class.sizes:
                # Notes whether the object to place is in a scene.
                size.source_object = size.source_object
        if current:
            scatter.ran_with = scatter.fingerprint()


def _layers_of_densities(settings: Any) -> None:
    """From 2 to 3: a density is a stack of layers, and a run's settings say what images and meshes hold. One density is one layer."""
    for scatter in settings.scatters:
        # As the step before leaves it.
        current = scatter.report_json and scatter.ran_with == scatter.fingerprint()
        for body_class in scatter.classes:
            _add_stored_layer(body_class)
        if current or _same_in_version_2(scatter):
            scatter.ran_with = scatter.fingerprint()


def _tell_notes_apart(settings: Any) -> None:
    """From 3 to 4: reports say what each of their notes is about, which was known by its words."""
    for scatter in settings.scatters:
        report = scatter.report
        if report is not None and "notes" in report:
            kinds = [_kind_of_note_3(note) for note in report["notes"]]
            scatter.report_json = json.dumps({**report, "note_kinds": kinds})


# From each version to the next; a new one goes to the end.
MIGRATIONS: tuple[Callable[[Any], None], ...] = (
    _keep_reports_current,
    _stand_by_class,
    _layers_of_densities,
    _tell_notes_apart,
)
VERSION = len(MIGRATIONS)


@persistent
def bring_up_to_date(*_arguments: object) -> None:
    """Bring the settings of every scene that can be changed to this version; Blender calls it when a file was opened."""
    for scene in bpy.data.scenes:
        settings = scene.esh_scatter
        if scene.is_editable and settings.version < VERSION:
            # What is read of objects, where they stand for example, is there only once the scene is evaluated.
            for layer in scene.view_layers:
                layer.update()
            for migrate in MIGRATIONS[settings.version :]:
                migrate(settings)
            settings.version = VERSION


def attach() -> None:
    """Have every file brought up to date that is opened from now on, and the one that is open."""
    for handlers in _handlers():
        handlers.append(bring_up_to_date)
    # While Blender starts it does not show its data; it opens a file then.
    if hasattr(bpy.data, "scenes"):
        bring_up_to_date()


def detach() -> None:
    """Leave files as they are from now on."""
    for handlers in _handlers():
        if bring_up_to_date in handlers:
            handlers.remove(bring_up_to_date)


def _handlers() -> list[list[Any]]:
    """Return what Blender calls when a file was opened, and when scenes were appended from another."""
    return [
        getattr(bpy.app.handlers, name)
        for name in ("load_post", "blend_import_post")
        if hasattr(bpy.app.handlers, name)
    ]


# What each version summed up, as it was then.

_SCATTER_0 = (
    *("class_separation", "size_emphasis", "avoid_overlap", "align_to_normal", "random_turn", "scale_jitter", "seed"),
    *("device", "max_steps"),
)
_CLASS_0 = (
    *("count_kind", "total"),
    *("density_kind", "image", "mapping", "uv_map", "vertex_group", "attribute", "invert"),
    *("direction_kind", "direction_angle", "direction_image", "density_correction", "may_overlap"),
    *("use_unsharp", "unsharp_amount", "unsharp_radius"),
)
_SIZE_0 = (
    *(
        "source_kind",
        "source_object",
        "source_collection",
        "count",
        "share",
        "area_kind",
        "area",
        "area_largest",
        "shape",
    ),
)


def _fingerprint_of_version_0(scatter: Any) -> str:
    target = scatter.target
    mesh = target and (target.name_full, len(target.data.vertices), [list(row) for row in target.matrix_world])
    values = [mesh, _values(scatter, _SCATTER_0)]
    for body_class in scatter.classes:
        values.append(_values(body_class, _CLASS_0))
        values.extend(_values(size, _SIZE_0) for size in body_class.sizes)
    return hashlib.sha256(repr(values).encode()).hexdigest()


# As 32 bits hold them.
_STANDING_1 = {"align_to_normal": 1.0, "random_turn": 6.2831854820251465, "scale_jitter": 0.0}
_SCATTER_1 = ("class_separation", "size_emphasis", "seed", "avoid_overlap", "device", "max_steps", *_STANDING_1)
_CLASS_1 = (
    *("density_kind", "image", "mapping", "uv_map", "vertex_group", "attribute", "invert"),
    *("direction_kind", "direction_angle", "direction_image", "may_overlap", "count_kind", "total", "sizes"),
    *("density_correction", "use_unsharp", "unsharp_amount", "unsharp_radius"),
)
_SIZE_1 = (
    *("source_kind", "source_object", "source_collection", "count", "share", "area_kind", "area", "area_largest"),
    *("distribution", "shape"),
)


def _fingerprint_of_version_1(scatter: Any) -> str:
    target = scatter.target
    mesh = target and (target.name_full, len(target.data.vertices), [list(row) for row in target.matrix_world])
    classes = []
    for body_class in scatter.classes:
        values = dict(zip(_CLASS_1, _values(body_class, _CLASS_1), strict=True))
        values["sizes"] = [list(zip(_SIZE_1, _values(size, _SIZE_1), strict=True)) for size in body_class.sizes]
        classes.append(list(values.items()))
    told = [("target", target and target.name_full), ("classes", classes)]
    told += zip(_SCATTER_1, _values(scatter, _SCATTER_1), strict=True)
    return hashlib.sha256(repr([mesh, told]).encode()).hexdigest()


# What a class said of its density up to version 2, and the words that numbers in a file stand for.
_DENSITY_2 = {
    "density_kind": "UNIFORM",
    "image": None,
    "mapping": "POSITION",
    "uv_map": "",
    "vertex_group": "",
    "attribute": "",
    "invert": False,
}
_WORDS_2 = {"density_kind": ("UNIFORM", "IMAGE", "VERTEX_GROUP", "ATTRIBUTE"), "mapping": ("POSITION", "UV")}
_DEFAULTS = {**_STANDING_1, **_DENSITY_2}


def _add_stored_layer(body_class: Any) -> None:
    """Add the layer that a class of version 2 stands for."""
    values = {name: _stored(body_class, name) for name in _DENSITY_2}
    kind = values.pop("density_kind")
    if kind != "UNIFORM":
        values["image_mapping"] = values.pop("mapping")
        body_class.add_layer(kind, **values)


_SCATTER_2 = ("target", "class_separation", "size_emphasis", "seed", "avoid_overlap", "device", "max_steps")
_CLASS_2 = (
    *(
        "mute",
        *_DENSITY_2,
        "direction_kind",
        "direction_angle",
        "direction_image",
        "may_overlap",
        "count_kind",
        "total",
    ),
    *("per_area", "distance", "cover_share", "density_correction", "use_unsharp", "unsharp_amount", "unsharp_radius"),
)


def _same_in_version_2(scatter: Any) -> bool:
    """Tell whether what version 2 noted of a scatter's run is what it would note now."""
    try:
        noted = json.loads(scatter.ran_with)
        before = noted["target"], noted["scatter"], list(noted["classes"].items())
    except (json.JSONDecodeError, TypeError, KeyError, AttributeError):
        return False
    target = scatter.target
    mesh = target and [target.name_full, len(target.data.vertices), [list(row) for row in target.matrix_world]]
    more = ("random_turn", "scale_jitter") if scatter.avoid_overlap else ()
    classes = []
    for body_class in scatter.ready_classes():
        sizes = [_named(size, _SIZE_1) for size in body_class.sizes]
        classes.append((str(body_class.uid), {"values": _named(body_class, (*_CLASS_2, *more)), "sizes": sizes}))
    return before == (mesh, _named(scatter, _SCATTER_2), classes)


# What notes had in them up to version 3, and what they were about.
_NOTES_3 = {"still overlap": "overlaps", "counts as uneven": "unequal areas", "the footprints cover ": "cover"}


def _kind_of_note_3(note: str) -> str:
    return next((kind for said, kind in _NOTES_3.items() if said in note), "other")


def _named(group: Any, names: tuple[str, ...]) -> dict[str, Any]:
    return dict(zip(names, _values(group, names), strict=True))


def _stored(group: Any, name: str) -> Any:
    """Return what a file holds of a property that a group no longer has, or its default."""
    # From Blender 5.0 on, properties that an extension defines lie apart from those that users add.
    stored = group.bl_system_properties_get() if hasattr(group, "bl_system_properties_get") else group
    value = _DEFAULTS[name] if stored is None else stored.get(name, _DEFAULTS[name])
    if name in _WORDS_2 and isinstance(value, int):
        return _WORDS_2[name][value]
    if name == "image":
        # What pointed to nothing is not nothing in a file.
        return value if isinstance(value, bpy.types.Image) else None
    return bool(value) if name == "invert" else value


def _values(group: Any, names: tuple[str, ...]) -> list[Any]:
    values = (getattr(group, name) if hasattr(group, name) else _stored(group, name) for name in names)
    return [value.name_full if isinstance(value, bpy.types.ID) else value for value in values]
