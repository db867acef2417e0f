"""Presets in Blender: a scatter's settings made from one, and one made from a scatter's settings."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import bpy

from ...engine.errors import EshError, ProblemError
from ...engine.problem.given_values import show
from ..classes.name_lists import joined_names
from ..classes.stand_ins import stand_in
from ..densities.density_curve import curve_node
from ..densities.image_pixels import any_image
from ..properties.amount_ahead import area_of
from ..targets.target import extent_of, members_of
from .beside_others import fit_beside_others, free_share
from .families import as_placed, heads_in
from .selection import measure

__all__ = ["Added", "add_scatter_of_preset", "apply_preset", "preset_of", "selected_for_preset"]

# At most so many objects of a class: small ones that somebody has chosen could be without end.
MOST = 20_000
# Seconds and settings of one's own machine are no part of a preset.
_NOT_OF_SCATTERS = {"name", "device", "class_index", "points_above", "cap"}
_NOT_OF_CLASSES = {"name", "color", "mute", "show_viewport", "show_render", "size_index", "layer_index", "may_overlap"}
_PLAIN = {"BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"}
_NOISE_SIZE = "noise_size"


class Added(NamedTuple):
    """What was made with a preset.

    Attributes:
        scatter: The settings.
        held: Which classes have fewer objects than it takes to cover what the preset says, as a sentence; empty where none has.
    """

    scatter: Any
    held: str


def add_scatter_of_preset(
    settings: Any,
    preset: Mapping[str, Any],
    ground: bpy.types.Object | bpy.types.Collection,
    chosen: Sequence[bpy.types.Object | bpy.types.Collection] = (),
) -> Added:
    """Add a scatter with the settings and classes of a preset to those of a scene.

    Args:
        settings: Of the scene.
        preset: As :func:`~esh.esh_scatter.editing.preset_files.read_preset` returns it.
        ground: The target.
        chosen: Objects for the classes, in their order, as far as there are any.

    Raises:
        EshError: It cannot be applied. Nothing was added.
    """
    before = settings.scatter_index
    scatter = settings.add_scatter(ground)
    try:
        scatter.name = str(preset.get("name") or scatter.name)
        free = max(free_share(scatter) * sum(map(area_of, scatter.targets)), 1e-6)
        wanted = apply_preset(scatter, preset, free, chosen)
        if scatter.other_results():
            fit_beside_others(scatter, free, chosen)
    except EshError:
        settings.scatters.remove(len(settings.scatters) - 1)
        settings.scatter_index = before
        raise
    return Added(scatter, _held(scatter, wanted))


def _held(scatter: Any, wanted: Mapping[int, int]) -> str:
    """Say of which classes the number is held; ``wanted`` is how many each would take, by its place among them."""
    classes = ((scatter.classes[number], most) for number, most in wanted.items())
    # Beside others, there may be no room for so many in any case.
    held = [f"{one.name} ({most:,} would cover what the preset says)" for one, most in classes if one.count == MOST]
    return f"Held at {MOST:,}: {', '.join(held)}. For more, raise Count" if held else ""


def selected_for_preset(
    context: bpy.types.Context, ground: bpy.types.Object | bpy.types.Collection
) -> list[bpy.types.Object | bpy.types.Collection]:
    """Return the selected objects that take the places of a preset's classes.

    Those that are scattered on that ground already do not: they are often still selected from when they were.
    """
    members = members_of(ground)
    scatters = (one for one in context.scene.esh_scatter.scatters if set(one.targets) & set(members))
    placed = {size.source for one in scatters for body_class in one.classes for size in body_class.sizes}
    return [item for item in as_placed(heads_in(context.selected_objects, members), members) if item not in placed]


def apply_preset(
    scatter: Any,
    preset: Mapping[str, Any],
    ground: float,
    chosen: Sequence[bpy.types.Object | bpy.types.Collection] = (),
) -> dict[int, int]:
    """Give a scatter the settings and classes of a preset; simple shapes stand in for objects.

    Args:
        scatter: Settings without classes.
        preset: As :func:`~esh.esh_scatter.editing.preset_files.read_preset` returns it.
        ground: Area of the target [m²].
        chosen: Objects for the classes, in their order, as far as there are any.

    Returns:
        How many it would take of classes that have fewer, by their places in the preset.

    Raises:
        ProblemError: A setting that is not known, or a value that it cannot have.
    """
    _set(scatter, preset.get("settings", {}), "settings", _NOT_OF_SCATTERS)
    made = []
    for one in preset["classes"]:
        body_class = scatter.add_class()
        body_class.name = one["name"]
        body_class.color = one.get("color", body_class.color[:])
        made.append(body_class)
    held = {}
    # Adding to a list moves what is in it.
    for number, one in enumerate(preset["classes"]):
        body_class = scatter.classes[len(scatter.classes) - len(made) + number]
        wanted = _fill(body_class, one, ground, chosen[number] if number < len(chosen) else None)
        if wanted > MOST:
            held[number] = wanted
    scatter.class_index = 0
    return held


def _fill(
    body_class: Any, one: Mapping[str, Any], ground: float, source: bpy.types.Object | bpy.types.Collection | None
) -> int:
    """Give a class its settings, and return how many objects it would take to cover what the preset says; 0 where it says a count."""
    where = f'class "{one["name"]}"'
    _set(body_class, one.get("settings", {}), f"settings of {where}", _NOT_OF_CLASSES)
    body_class.may_overlap = joined_names(one.get("may_overlap", ()))
    for number, values in enumerate(one.get("sizes", ())):
        size = body_class.sizes[0] if number == 0 else body_class.add_size()
        _set(size, values, f"sizes of {where}", ())
    body_class.size_index = 0
    for values in one.get("layers", ()):
        _add_layer(body_class, values, ground, where)
    count, cover = one.get("count", 100), one.get("cover")
    shape = one.get("stand_in", {})
    for size in body_class.sizes:
        if source is None:
            area = (
                cover * ground / count if cover else size.area if size.area_kind == "VALUE" else ground / (10 * count)
            )
            size.place(
                stand_in(
                    body_class.name,
                    shape.get("shape", "ball"),
                    shape.get("proportions", (1, 1, 1)),
                    area,
                    body_class.color,
                )
            )
        else:
            size.place(source)
    # What takes no ground, the run will say.
    measured = [] if source is None else measure([source], bpy.context)[0]
    if measured:
        body_class.stand_on = measured[0].stand_on
        body_class.offset = body_class.offset or measured[0].lift
    if not cover or body_class.count_kind != "SIZES":
        return 0
    wanted = 0
    if source is not None:
        wanted = math.ceil(cover * ground / measured[0].taken) if measured else 1
        count = min(MOST, wanted)
    body_class.sizes[0].count = max(1, round(count))
    return wanted


def _add_layer(body_class: Any, values: Mapping[str, Any], ground: float, where: str) -> None:
    given = {name: value for name, value in values.items() if name not in ("kind", "curve", _NOISE_SIZE)}
    kinds = body_class.layers.add()
    kinds.name = ""
    _set(kinds, {"kind": values.get("kind", "IMAGE")}, f"layers of {where}", ())
    # Noise is as large as a share of the ground's side.
    if _NOISE_SIZE in values:
        given["noise_scale"] = float(values[_NOISE_SIZE]) * math.sqrt(ground)
    _set(kinds, given, f"layers of {where}", ())
    if kinds.kind == "IMAGE" and kinds.image is None:
        kinds.image = any_image()
    curve = values.get("curve")
    if curve:
        kinds.use_curve = True
        _bend(kinds.curve, curve, where)


def _bend(tree: bpy.types.NodeTree, points: Any, where: str) -> None:
    node = curve_node(tree)
    assert node is not None
    curve = node.mapping.curves[0]
    try:
        pairs = [(float(x), float(y)) for x, y in points]
    except (TypeError, ValueError):
        raise ProblemError(f"`curve` in layers of {where} must be points (x, y); got {show(points)}") from None
    if len(pairs) < 2:
        raise ProblemError(f"`curve` in layers of {where} must be two points or more; got {show(points)}")
    while len(curve.points) < len(pairs):
        curve.points.new(0.5, 0.5)
    for point, location in zip(curve.points, pairs, strict=False):
        point.location = location
    node.mapping.update()


def _set(group: Any, values: Mapping[str, Any], where: str, left_out: Collection[str]) -> None:
    """Set plain properties of a group by name."""
    for name, value in values.items():
        told = group.bl_rna.properties.get(name)
        if told is None or told.type not in _PLAIN or told.is_hidden or name in left_out:
            raise ProblemError(f'{where} of the preset must be ones that the sidebar has; "{name}" is not')
        try:
            setattr(group, name, value)
        except (TypeError, ValueError) as error:
            text = str(error).splitlines()[0]
            raise ProblemError(f"`{name}` in {where} of the preset must have a value that fits; {text}") from None


def preset_of(scatter: Any) -> dict[str, Any]:
    """Return a scatter's settings as a preset; objects, images and the like are left to whoever uses it."""
    classes = []
    for body_class in scatter.classes:
        sizes = [_plain(size, {"name"}) for size in body_class.sizes]
        layers = []
        for layer in body_class.layers:
            names = {"kind", "use", "name", "class_name", *layer.influential_of(layer.kind)}
            values = _plain(layer, {"class_uid"}, names)
            # The kind even where it is the first of them.
            values = {"kind": layer.kind, **values}
            values.pop("use_curve", None)
            if layer.use_curve:
                values["curve"] = [list(record[:2]) for record in layer.curve_record()]
            layers.append(values)
        one: dict[str, Any] = {"name": body_class.name, "color": [round(value, 4) for value in body_class.color]}
        one["stand_in"] = {"shape": "ball", "proportions": _proportions(body_class)}
        one["settings"] = _plain(body_class, _NOT_OF_CLASSES)
        one["sizes"], one["layers"] = sizes, layers
        one["may_overlap"] = sorted(body_class.names_that_may_overlap)
        classes.append(one)
    # Each scatter that is made of it has a seed of its own.
    return {"name": scatter.name, "settings": _plain(scatter, {*_NOT_OF_SCATTERS, "seed"}), "classes": classes}


def _proportions(body_class: Any) -> list[float]:
    source = body_class.sizes[0].source_object if body_class.sizes else None
    extent = (
        [1.0, 1.0, 1.0] if source is None else [round(value, 3) for value in extent_of(source, bpy.context).tolist()]
    )
    return [max(value, 1e-3) for value in extent]


def _plain(group: Any, left_out: Collection[str], only: Collection[str] | None = None) -> dict[str, Any]:
    """Return the plain values of a group that are not what they are by default."""
    values: dict[str, Any] = {}
    for told in group.bl_rna.properties:
        name = told.identifier
        if told.type not in _PLAIN or told.is_hidden or name in left_out or (only is not None and name not in only):
            continue
        value = getattr(group, name)
        if getattr(told, "is_array", False):
            if list(value) != list(told.default_array):
                values[name] = [round(entry, 6) for entry in value]
        elif value != told.default:
            values[name] = round(value, 6) if isinstance(value, float) else value
    return values
