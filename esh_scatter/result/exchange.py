"""Results to and from files of other programs: as instances, with the objects themselves beside or within."""

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...engine.errors import EshError, ProblemError
from ...engine.files.bodies import Bodies, Prototype
from ...engine.files.body_formats import FORMATS
from ...engine.files.placement_files import check_ending, check_writable, write_bodies
from ...engine.files.placement_reader import load_placement
from ...engine.files.quaternions import multiply_xyzw, wxyz_of_axes
from ...engine.problem.given_values import as_path, show
from ..targets.target import RESULT_TAG, check_exists, extent_of, put_offset
from .attributes import INSTANCE_INDEX, ROTATION, SCALE
from .display import matrix_of_points, shown_objects
from .result import CLASS_NAMES, write_result
from .standing_now import heights, moved_with

__all__ = ["export_result", "import_placement"]

# Formats that take objects in or refer to them -> ending of the files that objects are exported to.
_OBJECT_FILES = {".usd": ".usdc", ".usdc": ".usdc", ".usda": ".usdc", ".glb": ".glb"}


def export_result(path: str | Path, result: bpy.types.Object | None = None) -> None:
    """Write a result for other programs: every instance with its transform, its id, class and size.

    Args:
        path: Ends in ``.usd``, ``.usdc``, ``.usda`` (the objects lie beside it, in a folder, and are referred to), ``.glb`` (they lie
            in it), ``.ply``, ``.parquet`` or ``.geojson`` (points only).
        result: What a scatter made, as it is now; None takes the active object.

    Raises:
        EshError: No result, another ending, a file that cannot be written, or a missing library.
    """
    path = as_path(path)
    item = bpy.context.view_layer.objects.active if result is None else result
    item = _check_result(item)
    _expose_usd()
    ending = check_ending(path, FORMATS)
    FORMATS[ending].check()
    check_writable(path)
    bodies, sources = _read_result(item)
    if ending not in _OBJECT_FILES:
        write_bodies(path, bodies)
        return
    if ending == ".glb":
        with tempfile.TemporaryDirectory(prefix="esh-objects-") as beside:
            write_bodies(path, _with_objects(bodies, sources, Path(beside), ".glb"))
        return
    folder = path.with_name(f"{path.stem}_objects")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise EshError(f"{folder} cannot be made: {(error.strerror or str(error)).lower()}") from None
    write_bodies(path, _with_objects(bodies, sources, folder, _OBJECT_FILES[ending]))


def import_placement(
    path: str | Path,
    sources: Mapping[str, bpy.types.Object] | None = None,
    *,
    name: str | None = None,
) -> bpy.types.Object:
    """Make a result object of a placement in a file, with one instance for every body.

    Args:
        path: A file that :func:`~esh.load_placement` reads.
        sources: Objects to instance, by the name of the prototype in the file or of the class; prisms stand in for the rest.
        name: Of the new object; None takes that of the file.

    Raises:
        EshError: A file that cannot be read, or a source that is no object.
    """
    _expose_usd()
    path = as_path(path)
    bodies = load_placement(path)
    if not len(bodies.position):
        raise EshError(f"{path} must hold at least one body; it has none")
    given = dict(sources or {})
    for key, source in given.items():
        if not isinstance(source, bpy.types.Object):
            raise ProblemError(f'`sources["{key}"]` must be an object; got {show(source)}')
        check_exists(source, f'`sources["{key}"]`')
    name = name or path.stem
    scene = bpy.context.scene
    made: list[bpy.types.Object] = []
    chosen: list[bpy.types.Object] = []
    # Which source a body has: by its prototype's name, else by its class's.
    pairs, index = np.unique(
        np.stack([bodies.prototype_index, bodies.class_index], axis=1), axis=0, return_inverse=True
    )
    for p, c in pairs.tolist():
        source = given.get(bodies.prototypes[p].name) or given.get(bodies.class_name[c])
        if source is None:
            source = next((item for item in made if item["esh_prototype"] == p), None)
            if source is None:
                source = _stand_in(bodies.prototypes[p], p)
                made.append(source)
        chosen.append(source)
    if made:
        collection = bpy.data.collections.new(f"{name} objects")
        scene.collection.children.link(collection)
        for item in made:
            collection.objects.link(item)
        # Seen where they are instanced, not where they are.
        collection.hide_viewport = collection.hide_render = True
    attributes = {
        "id": ("INT", bodies.id.astype(np.int32)),
        "class_index": ("INT", bodies.class_index),
        "size_index": ("INT", bodies.size_index),
        INSTANCE_INDEX: ("INT", index.ravel().astype(np.int32)),
        ROTATION: ("QUATERNION", bodies.rotation),
        SCALE: ("FLOAT_VECTOR", bodies.scale),
    }
    item = write_result(scene, None, None, name, chosen, bodies.position, attributes)
    item[CLASS_NAMES] = json.dumps([bodies.class_name, bodies.size_name])
    return item


def _check_result(item: object) -> bpy.types.Object:
    if not isinstance(item, bpy.types.Object):
        raise ProblemError(f"`result` must be an object that a scatter made; got {show(item)}")
    check_exists(item, "`result`")
    if not item.get(RESULT_TAG) or item.type != "MESH":
        raise ProblemError(f'`result` must be an object that a scatter made; "{item.name}" is not one')
    return item


def _expose_usd() -> None:
    """Let Blender's own USD library be imported, where pip has installed none."""
    bpy.utils.expose_bundled_modules()


def _read_result(item: bpy.types.Object) -> tuple[Bodies, list[bpy.types.Object | bpy.types.Collection]]:
    """Return the points of a result as they stand in the world, and what is instanced on them."""
    placed = shown_objects(item)
    if not placed:
        raise ProblemError(
            f'"{item.name}" must have the modifier that shows its objects; it was removed: scatter again'
        )
    sources = [source for source in placed if source is not None]
    if len(sources) < len(placed):
        raise ProblemError(f'an object that "{item.name}" places was removed from the file; scatter again')
    mesh = item.data
    count = len(mesh.vertices)

    def read(key: str, kind: str, width: int, default: float) -> np.ndarray:
        attribute = mesh.attributes.get(key)
        dtype = np.int32 if kind == "INT" else np.float32
        values = np.full(count * width, default, dtype)
        if attribute is not None and attribute.data_type == kind:
            attribute.data.foreach_get("vector" if kind == "FLOAT_VECTOR" else "value", values)
        return values.reshape(count, width) if width > 1 else values

    now = moved_with(item, read("position", "FLOAT_VECTOR", 3, 0.0).astype(np.float64), bpy.context, heights(item))
    position, rotation = now.position, _turned(now.turned, read(ROTATION, "QUATERNION", 4, 0.0))
    scale = read(SCALE, "FLOAT_VECTOR", 3, 1.0)
    world = matrix_of_points(item)
    if not np.allclose(world, np.eye(4)):
        shift, turn, factor = Matrix(world.tolist()).decompose()
        if not np.allclose(list(factor), factor[0]):
            raise ProblemError(f'"{item.name}" must have the same scale along all axes; apply its scale first')
        position = position @ world[:3, :3].T + np.array(shift)
        own = np.roll(np.array(turn, np.float64), -1)[None, :]
        rotation = np.roll(multiply_xyzw(own, np.roll(rotation, -1, axis=1)), 1, axis=1).astype(np.float32)
        scale = scale * np.float32(factor[0])
    class_index = read("class_index", "INT", 1, 0)
    size_index = read("size_index", "INT", 1, 0)
    names = json.loads(item.get(CLASS_NAMES, "[[], []]"))
    class_name = _names(names[0], int(class_index.max(initial=-1)) + 1, "class")
    size_name = tuple(
        _names(
            names[1][c] if c < len(names[1]) else [],
            int(size_index[class_index == c].max(initial=-1)) + 1,
            "size",
        )
        for c in range(len(class_name))
    )
    mesh_id = mesh.attributes.get("id")
    unknown = np.full(count, np.nan)
    bodies = Bodies(
        position=position,
        rotation=rotation,
        scale=scale,
        prototype_index=read(INSTANCE_INDEX, "INT", 1, 0),
        prototypes=tuple(_prototype(source) for source in sources),
        id=np.arange(count, dtype=np.int64) if mesh_id is None else read("id", "INT", 1, 0).astype(np.int64),
        class_index=class_index,
        size_index=size_index,
        class_name=class_name,
        size_name=size_name,
        length=np.zeros(count),
        width=np.zeros(count),
        area=unknown,
        fixed=np.zeros(count, bool),
        variant=np.zeros(count, np.int32),
        factor=unknown,
    )
    return bodies, sources


def _turned(turned: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Quaternions (w, x, y, z) of objects that are turned so, and mirrored, ``[n, 3, 3]``; where that is nothing they are the same."""
    changed = np.flatnonzero((turned != np.eye(3)).any(axis=(1, 2)))
    if not len(changed):
        return rotation
    first = np.roll(wxyz_of_axes(turned[changed, :, 0], turned[changed, :, 2]), -1, axis=1)
    mirrored = np.linalg.det(turned[changed])[:, None] < 0.0
    # Objects themselves cannot be mirrored: they are along their y once more, as where what they stand on was mirrored.
    before = rotation[changed] * np.where(mirrored, [1.0, -1.0, 1.0, -1.0], 1.0)
    result = rotation.copy()
    result[changed] = np.roll(multiply_xyzw(first, np.roll(before, -1, axis=1)), 1, axis=1)
    return result


def _names(given: Sequence[str], least: int, otherwise: str) -> tuple[str, ...]:
    return (*given, *(f"{otherwise} {number + 1}" for number in range(len(given), least)))


def _prototype(source: bpy.types.Object | bpy.types.Collection) -> Prototype:
    """Return what stands for an object, or a collection as one: a box as large as it is, around its origin."""
    size = extent_of(source, bpy.context)
    x, y = 0.5 * np.maximum(size[:2], 1e-3)
    return Prototype(source.name, np.array([(-x, -y), (x, -y), (x, y), (-x, y)]), max(float(size[2]), 1e-3))


def _with_objects(
    bodies: Bodies, sources: Sequence[bpy.types.Object | bpy.types.Collection], folder: Path, ending: str
) -> Bodies:
    """Export every source to a file of its own, and return the bodies with these as their assets."""
    prototypes = []
    for number, (prototype, source) in enumerate(zip(bodies.prototypes, sources, strict=True)):
        word = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in source.name)
        asset = folder / f"{number + 1}_{word}{ending}"
        _export_object(source, asset)
        prototypes.append(replace(prototype, assets=(asset,)))
    return replace(bodies, prototypes=tuple(prototypes))


def _at_origin(source: bpy.types.Object | bpy.types.Collection) -> bpy.types.Object:
    """Return an object as ``source`` is instanced: with its own rotation and scale, at the origin, with its modifiers."""
    if isinstance(source, bpy.types.Collection):
        put_offset(source, bpy.context)
        copy = bpy.data.objects.new(source.name, None)
        copy.instance_type, copy.instance_collection = "COLLECTION", source
        return copy
    copy = source.copy()
    copy.parent = None
    copy.constraints.clear()
    copy.animation_data_clear()
    _, rotation, scale = source.matrix_world.decompose()
    copy.rotation_mode = "QUATERNION"
    copy.location, copy.rotation_quaternion, copy.scale = (0.0, 0.0, 0.0), rotation, scale
    copy.hide_viewport = copy.hide_render = False
    return copy


def _export_object(source: bpy.types.Object | bpy.types.Collection, path: Path) -> None:
    """Export an object, or a collection as one."""
    context = bpy.context
    copy = _at_origin(source)
    layer = context.view_layer
    active = layer.objects.active
    selected = list(context.selected_objects)
    context.scene.collection.objects.link(copy)
    try:
        for item in selected:
            item.select_set(False)
        copy.select_set(True)
        layer.objects.active = copy
        if path.suffix == ".glb":
            outcome = bpy.ops.export_scene.gltf(
                filepath=str(path), export_format="GLB", use_selection=True, export_apply=True, export_animations=False
            )
        else:
            outcome = bpy.ops.wm.usd_export(
                filepath=str(path), selected_objects_only=True, export_animation=False, root_prim_path="/object"
            )
        if outcome != {"FINISHED"} or not path.is_file():
            raise EshError(f'"{source.name}" cannot be exported as {path.name}')
    except RuntimeError as error:  # what operators report
        raise EshError(f'"{source.name}" cannot be exported: {" ".join(str(error).split())}') from None
    finally:
        bpy.data.objects.remove(copy)
        for item in selected:
            item.select_set(True)
        layer.objects.active = active


def _stand_in(prototype: Prototype, number: int) -> bpy.types.Object:
    """Make an object that shows where bodies are: a prism on their outline."""
    outline = prototype.outline
    count = len(outline)
    corners = [(x, y, z) for z in (0.0, prototype.height) for x, y in outline.tolist()]
    sides = [(i, (i + 1) % count, (i + 1) % count + count, i + count) for i in range(count)]
    mesh = bpy.data.meshes.new(prototype.name)
    mesh.from_pydata(corners, [], [tuple(reversed(range(count))), tuple(range(count, 2 * count)), *sides])
    material = bpy.data.materials.new(prototype.name)
    material.diffuse_color = (*prototype.color, 1.0)
    mesh.materials.append(material)
    item = bpy.data.objects.new(prototype.name, mesh)
    item["esh_prototype"] = number
    return item
