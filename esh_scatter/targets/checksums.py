"""What images, meshes, weights and attributes hold, in one number each: equal as long as nothing in them changes.

Names do not count, and nothing is looked for: only what somebody asks about is read. While a window is drawn, a number that was worked
out lately is told again, the longer the more it cost; whoever needs the truth asks within :func:`now`.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import bpy
import numpy as np

from .depsgraph import evaluated_depsgraph
from .evaluated_mesh import evaluated_mesh
from .mesh_attributes import can_be_read, read_attribute
from .target import INSTANCE_INDEX, ROTATION, SCALE, origin_of, shown_collection, shown_members_of, world_matrix
from .vertex_groups import list_weights

__all__ = [
    "at_most",
    "is_old",
    "now",
    "of_attribute",
    "of_collection",
    "of_ground",
    "of_image",
    "of_members",
    "of_object",
    "of_points",
    "of_shape",
    "of_standing",
    "of_weights",
    "pose_of",
    "standing_number",
    "worked_out",
]

# Seconds for which a number is told again, at least, and in times of what it took to work it out: drawing spends 3 % on it at most.
SHORTEST, TIMES_COST = 0.3, 30.0
SHORTEST_SHARED = 0.02
# A number younger than this was worked out in the same drawing.
SAME_DRAWING = 0.1
# Numbers that are kept at most; whoever asks again gets the rest anew.
MOST_KEPT = 4096
# Decimals of rotation and scale that count; the rest is rounding.
DECIMALS = 5

# What says how a mesh is subdivided: attributes of it, and settings of the modifier.
_CREASES = ("crease_edge", "crease_vert")
_SUBDIVISION = ("levels", "subdivision_type", "quality", "use_limit_surface", "use_creases", "boundary_smooth")
# Other modifiers of which, beside the mesh, their settings say all that they do to its shape; and what has them look elsewhere.
_PLAIN = ("ARRAY", "CAST", "DISPLACE", "MIRROR", "SIMPLE_DEFORM", "SOLIDIFY", "TRIANGULATE")
_LOOKS_ELSEWHERE = ("UV", "CUSTOM_NORMAL")


class _Kept(NamedTuple):
    value: int
    time: float
    cost: float


_kept: dict[tuple[Any, ...], _Kept] = {}
_truth = False
_throttle = SHORTEST, TIMES_COST
# Whether something was told since it was last asked that may be old.
_old = False
_pixels = np.empty(0, np.float32)


@contextmanager
def now() -> Iterator[None]:
    """Have everything worked out anew within a ``with`` block."""
    global _truth
    before, _truth = _truth, True
    try:
        yield
    finally:
        _truth = before


@contextmanager
def at_most(share: float) -> Iterator[None]:
    """Have this share of the time go into working numbers out within a ``with`` block, if it takes so much."""
    global _throttle
    before, _throttle = _throttle, (SHORTEST_SHARED, 1.0 / share)
    try:
        yield
    finally:
        _throttle = before


def is_old() -> bool:
    """Tell whether numbers were told since the last call that may be old, so that what was drawn with them may be wrong."""
    global _old
    old, _old = _old, False
    return old


def of_image(image: bpy.types.Image | None) -> int:
    """Return the number of an image's pixels; of one with tiles the first tile's."""
    if image is None:
        return 0
    return worked_out(("image", image.session_uid), lambda: _image_number(image))


def of_shape(item: bpy.types.Object) -> int:
    """Return the number of a mesh object's vertices and corners, as they are stored and as its modifiers make them."""
    return _worked_out_of("shape", item, lambda: _shape_number(item))


def of_ground(item: bpy.types.Object) -> int:
    """Return the number of a target's shape: :func:`of_shape`, but of a mesh that is subdivided what it is made of, if that tells all.

    How subdivision rounds depends on whether the mesh has a UV map, which is nothing of its shape.
    """
    if item.type != "MESH" or item.data.shape_keys is not None:
        return of_shape(item)
    shown = [modifier for modifier in item.modifiers if modifier.show_viewport]
    if all(modifier.type != "SUBSURF" for modifier in shown) or any(_step(modifier) is None for modifier in shown):
        return of_shape(item)
    return _worked_out_of("subdivided", item, lambda: _subdivided_number(item))


def of_object(item: bpy.types.Object) -> int:
    """Return the number of an object to place: its shape, rotation and scale; where it stands does not count."""
    return _worked_out_of("object", item, lambda: _object_number(item))


def of_members(members: Sequence[bpy.types.Object]) -> int:
    """Return the number of several objects to place, in their order."""
    return zlib.crc32(np.array([of_object(item) for item in members], np.uint32).tobytes())


def of_collection(collection: bpy.types.Collection) -> int:
    """Return the number of a collection that is placed as one: its objects, and where these are about its origin."""
    origin = origin_of(collection, bpy.context)
    members = shown_members_of(collection)
    places = [world_matrix(item, bpy.context)[:3, 3] - origin for item in members]
    return zlib.crc32((np.round(np.array(places), DECIMALS) + 0.0).tobytes(), of_members(members))


def of_weights(item: bpy.types.Object, name: str) -> int:
    """Return the number of a vertex group's weights."""
    return _worked_out_of("weights", item, lambda: _weights_number(item, name), name)


def of_attribute(item: bpy.types.Object, name: str) -> int:
    """Return the number of an attribute's or a UV map's values; the active UV map where the name is empty."""
    return _worked_out_of("attribute", item, lambda: _attribute_number(item, name), name)


def of_points(result: bpy.types.Object) -> int:
    """Return the number of what stands on a result's points: where, how turned and how large."""
    return _worked_out_of("points", result, lambda: _points_number(result))


def of_standing(result: bpy.types.Object) -> int:
    """Return the number of what stands on a result's points, wherever the result itself is; 0 where that cannot be read."""
    return _worked_out_of("standing", result, lambda: _standing_number(result))


def standing_number(*values: np.ndarray) -> int:
    """Return the number of positions, rotations, scales and of what stands there, as a result's points have them."""
    return zlib.crc32(repr([_crc(one) for one in values]).encode())


def pose_of(item: bpy.types.Object) -> list[list[float]]:
    """Return where an object stands, how it is turned and scaled: four rows."""
    return [[round(value, DECIMALS + 1) for value in row] for row in item.matrix_world]


def worked_out(key: tuple[Any, ...], work: Callable[[], int]) -> int:
    """Return a number that was worked out lately, or work it out; ``key`` tells what it is of from all others."""
    global _old
    start = time.perf_counter()
    known = _kept.get(key)
    if known is not None and not (_truth or bpy.app.background):
        age = start - known.time
        if age < max(_throttle[0], _throttle[1] * known.cost):
            _old = _old or age > SAME_DRAWING
            return known.value
    value = work()
    if len(_kept) >= MOST_KEPT:
        _kept.clear()
    end = time.perf_counter()
    _kept[key] = _Kept(value, end, end - start)
    return value


def _worked_out_of(what: str, item: bpy.types.Object, work: Callable[[], int], name: str = "") -> int:
    """Return a number of an object as :func:`worked_out` does, but of a mesh in Edit Mode the last one from before."""
    key = what, item.session_uid, name
    known = _kept.get(key)
    if known is not None and isinstance(item.data, bpy.types.Mesh) and item.data.is_editmode:
        return known.value
    return worked_out(key, work)


def _crc(values: np.ndarray) -> int:
    return zlib.crc32(np.ascontiguousarray(values).data)


def _image_number(image: bpy.types.Image) -> int:
    """Sums of the bits of every row and of every column: more exact numbers take longer than to read does."""
    global _pixels
    count = len(image.pixels) if image.size[0] and image.size[1] else 0
    if count == 0:
        return 0
    if len(_pixels) < count:
        _pixels = np.empty(count, np.float32)
    pixels = _pixels[:count]
    image.pixels.foreach_get(pixels)
    rows = pixels.reshape(image.size[1], -1)
    # Two values at once, where rows hold an even number of them.
    rows = rows.view(np.uint64 if rows.shape[1] % 2 == 0 else np.uint32)
    sums = rows.sum(axis=1, dtype=np.uint64), rows.sum(axis=0, dtype=np.uint64)
    return zlib.crc32(_bytes_of(*sums), zlib.crc32(repr((*image.size, image.channels)).encode()))


def _bytes_of(*arrays: np.ndarray) -> bytes:
    return b"".join(array.tobytes() for array in arrays)


def _shape_number(item: bpy.types.Object) -> int:
    is_mesh = item.type == "MESH"
    stored = zlib.crc32(_mesh_bytes(item.data)) if is_mesh else 0
    made = not is_mesh or len(item.modifiers) or item.data.shape_keys is not None
    return _with(stored, zlib.crc32(_evaluated_bytes(item))) if made and item.mode != "EDIT" else stored


def _subdivided_number(item: bpy.types.Object) -> int:
    """Of what is stored, and of all that says what is made of it; as drivers and the simplified scene have it."""
    creases = [_values_number(item.data, name) for name in _CREASES]
    evaluated = item.evaluated_get(evaluated_depsgraph(bpy.context))
    steps = [_step(modifier) for modifier in evaluated.modifiers if modifier.show_viewport]
    render = bpy.context.scene.render
    simplified = render.simplify_subdivision if render.use_simplify else None
    return zlib.crc32(repr([creases, steps, simplified]).encode(), zlib.crc32(_mesh_bytes(item.data)))


def _step(modifier: bpy.types.Modifier) -> list[Any] | None:
    """Return what a modifier's settings say that it does to the shape; None where they do not tell all of it."""
    if modifier.type == "SUBSURF":
        return [getattr(modifier, name) for name in _SUBDIVISION]
    settings = _plain_settings(modifier, bpy.types.Modifier) if modifier.type in _PLAIN else None
    return None if settings is None else [modifier.type, *settings]


def _plain_settings(group: Any, base: Any) -> list[Any] | None:
    """Return the settings of a modifier or texture that others do not have, or None where it looks at other things than a texture."""
    found: list[Any] = []
    for told in group.bl_rna.properties:
        if told.identifier in base.bl_rna.properties:
            continue
        value = getattr(group, told.identifier)
        if isinstance(value, bpy.types.Texture):
            value = _plain_settings(value, bpy.types.ID)
            if value is None:
                return None
        elif (told.type == "STRING" and value) or value in _LOOKS_ELSEWHERE:
            # The name of a vertex group, of a UV map.
            return None
        elif told.type in ("POINTER", "COLLECTION") and value is not None:
            return None
        found.append(list(value) if getattr(told, "is_array", False) else value)
    return found


def _with(stored: int, made: int) -> int:
    """Return one number for what is stored and what modifiers make of it: while it is sculpted, only the one is up to date."""
    return stored if stored == made else zlib.crc32(f"{stored} {made}".encode())


def _mesh_bytes(mesh: bpy.types.Mesh) -> bytes:
    position = np.empty(3 * len(mesh.vertices), np.float32)
    corner = np.empty(len(mesh.loops), np.int32)
    if len(position) and "position" in mesh.attributes:
        mesh.attributes["position"].data.foreach_get("vector", position)
    if len(corner) and ".corner_vert" in mesh.attributes:
        mesh.attributes[".corner_vert"].data.foreach_get("value", corner)
    face = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", face)
    return repr([_crc(values) for values in (position, corner, face)]).encode()


def _evaluated_bytes(item: bpy.types.Object) -> bytes:
    evaluated = item.evaluated_get(evaluated_depsgraph(bpy.context))
    if evaluated.type == "MESH" and isinstance(evaluated.data, bpy.types.Mesh):
        return _mesh_bytes(evaluated.data)
    with evaluated_mesh(item, bpy.context) as mesh:
        return _mesh_bytes(mesh) if mesh is not None else b""


def _object_number(item: bpy.types.Object) -> int:
    turned = np.round(world_matrix(item, bpy.context)[:3, :3], DECIMALS) + 0.0
    shown = shown_collection(item)
    return zlib.crc32(turned.tobytes(), _shape_number(item) if shown is None else of_collection(shown))


def _weights_number(item: bpy.types.Object, name: str) -> int:
    group = item.vertex_groups.get(name)
    if group is None:
        return 0
    return _crc(list_weights(item.data, [group.index])[0])


def _attribute_number(item: bpy.types.Object, name: str) -> int:
    """Both as it is stored and as modifiers make it: it may be there only after them."""
    stored = _values_number(item.data, name)
    if not len(item.modifiers) or item.mode == "EDIT":
        return stored
    evaluated = item.evaluated_get(evaluated_depsgraph(bpy.context))
    return _with(stored, _values_number(evaluated.data, name)) if isinstance(evaluated.data, bpy.types.Mesh) else stored


def _values_number(mesh: bpy.types.Mesh, name: str) -> int:
    if not name:
        active = mesh.uv_layers.active
        name = active.name if active else ""
    attribute = mesh.attributes.get(name)
    if not can_be_read(attribute):
        return 0
    return zlib.crc32(f"{attribute.domain} {attribute.data_type}".encode(), _crc(read_attribute(mesh, name)))


def _points_number(result: bpy.types.Object) -> int:
    names = ("position", ROTATION, SCALE, INSTANCE_INDEX)
    return zlib.crc32(repr([pose_of(result), *(_values_number(result.data, name) for name in names)]).encode())


def _standing_number(result: bpy.types.Object) -> int:
    mesh, names = result.data, ("position", ROTATION, SCALE, INSTANCE_INDEX)
    if mesh.is_editmode or not all(can_be_read(mesh.attributes.get(name)) for name in names):
        return 0
    position, rotation, scale, index = (read_attribute(mesh, name) for name in names)
    return standing_number(position, rotation, scale[:, 0], index)
