"""Bodies as instances in a binary glTF file (``EXT_mesh_gpu_instancing``), with the prototypes' meshes in it.

A ``.glb`` file is a chunk of JSON and a chunk of bytes, which is all that is packed here. glTF's y points up.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import EshError, InputFileError
from .bodies import Bodies, Prototype, bodies_from_columns
from .quaternions import multiply_xyzw, rotate_by_xyzw

__all__ = ["read_glb", "write_glb"]

EXTENSION = "EXT_mesh_gpu_instancing"
MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
# Attributes of instances beside their transforms -> columns. Floats: glTF has no 32-bit whole numbers for attributes.
ATTRIBUTES = {
    "_ID": "id",
    "_CLASS": "class_index",
    "_SIZE": "size_index",
    "_AREA": "area",
    "_LENGTH": "length",
    "_WIDTH": "width",
    "_FIXED": "fixed",
    "_VARIANT": "variant",
    "_SCALE": "scale",
}
# Of a node: where its mesh stands in the object that is instanced, which its instances' transforms contain; row by row.
PLACE = "esh_place"
# Whole numbers up to here are floats.
MOST_IDS = 2**24
# Members of a glTF file that others refer to by number, and the keys that do so anywhere below them.
LISTS = ("bufferViews", "accessors", "samplers", "images", "textures", "materials", "meshes")
NOT_HANDLED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}


class _Glb:
    """A file that is being put together."""

    def __init__(self) -> None:
        self.content: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "ESH Scatter"},
            "extensionsUsed": [EXTENSION],
            "extensionsRequired": [EXTENSION],
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self.parts: list[bytes] = []
        self.length = 0

    def add(self, member: str, entry: dict[str, Any]) -> int:
        """Add an entry to a list of the file and return its number."""
        entries = self.content.setdefault(member, [])
        entries.append(entry)
        return len(entries) - 1

    def add_bytes(self, data: bytes) -> int:
        """Add bytes at a multiple of 4 and return where they begin."""
        start = self.length
        padded = data + bytes(-len(data) % 4)
        self.parts.append(padded)
        self.length += len(padded)
        return start

    def add_array(self, values: np.ndarray, component: int, *, bounds: bool = False) -> int:
        """Add an accessor of an array ``[n]`` or ``[n, k]`` and return its number."""
        values = np.ascontiguousarray(values, TYPES[component])
        view = self.add(
            "bufferViews", {"buffer": 0, "byteOffset": self.add_bytes(values.tobytes()), "byteLength": values.nbytes}
        )
        kind = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
        accessor = {"bufferView": view, "componentType": component, "count": len(values), "type": kind}
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def write(self, file: BinaryIO) -> None:
        """Write the two chunks."""
        self.content["buffers"] = [{"byteLength": self.length}]
        text = json.dumps(self.content, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        if 12 + 16 + len(text) + self.length >= 2**32:
            raise EshError("a .glb file holds at most 4 GB; write .usdc or .parquet instead")
        file.write(struct.pack("<III", MAGIC, 2, 12 + 8 + len(text) + 8 + self.length))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", self.length, BINARY_CHUNK))
        for part in self.parts:
            file.write(part)


def write_glb(file: BinaryIO, bodies: Bodies, folder: Path) -> None:
    """Write a node for every prototype (for each of its meshes, where an asset has several) with all of its instances.

    Raises:
        EshError: An asset that is no .glb file, or ids that floats cannot hold.
    """
    if bodies.id.size and np.abs(bodies.id).max() >= MOST_IDS:
        raise EshError(f"ids in a .glb file must be below {MOST_IDS:,}; write .usdc or .parquet instead")
    glb, origin, columns = _Glb(), bodies.origin, bodies.columns()
    glb.content["scenes"][0]["extras"] = {"esh": json.loads(bodies.names())}
    for number, prototype in enumerate(bodies.prototypes):
        own = np.flatnonzero(bodies.prototype_index == number)
        if not own.size:
            continue
        asset = prototype.asset((".glb",), "a .glb file")
        meshes = [(_add_prism(glb, prototype), np.eye(4))] if asset is None else _add_asset(glb, asset)
        known = {key: columns[name][own] for key, name in ATTRIBUTES.items() if name in columns}
        numbers = {key: glb.add_array(values, FLOAT) for key, values in known.items() if np.isfinite(values).all()}
        for mesh, place in meshes:
            position, rotation, scale = _turned_up(
                bodies.position[own] - origin, bodies.rotation[own], bodies.scale[own]
            )
            extras: dict[str, Any] = {"esh_prototype": number}
            if not np.allclose(place, np.eye(4)):
                extras[PLACE] = place.ravel().tolist()
                position, rotation, scale = _compose(position, rotation, scale, place, str(asset))
            attributes = {
                "TRANSLATION": glb.add_array(position, FLOAT, bounds=True),
                "ROTATION": glb.add_array(rotation, FLOAT),
                "SCALE": glb.add_array(scale, FLOAT),
            }
            node: dict[str, Any] = {
                "name": prototype.name,
                "mesh": mesh,
                "extensions": {EXTENSION: {"attributes": attributes | numbers}},
                "extras": extras,
            }
            if origin.any():
                node["translation"] = [origin[0], origin[2], -origin[1]]
            glb.content["scenes"][0]["nodes"].append(glb.add("nodes", node))
    glb.write(file)


def read_glb(path: Path) -> Bodies:
    """Read the instances of a .glb file, ours or any other."""
    content, binary = _read_chunks(path)
    parts: list[dict[str, np.ndarray]] = []
    labels: dict[int, str] = {}
    try:
        for position, (node, place) in enumerate(_walk(content)):
            attributes = node.get("extensions", {}).get(EXTENSION, {}).get("attributes")
            if not attributes:
                continue
            number = int(node.get("extras", {}).get("esh_prototype", position))
            if number in labels and "esh_prototype" in node.get("extras", {}):
                continue  # another mesh of the same objects
            labels[number] = str(node.get("name", f"node {position}"))
            arrays = {key: _array(content, binary, index) for key, index in attributes.items()}
            _undo_place(arrays, node.get("extras", {}).get(PLACE))
            parts.append(_columns(arrays, place, number))
        extras = (content.get("scenes") or [{}])[content.get("scene", 0)].get("extras", {}).get("esh", {})
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputFileError(f"{path} cannot be read as a .glb file: {type(error).__name__}: {error}") from None
    if not parts and extras:
        # A file of ours that holds nobody.
        return bodies_from_columns({"x": np.zeros(0), "y": np.zeros(0)}, extras, str(path))
    if not parts:
        raise InputFileError(f"{path} must hold instances ({EXTENSION}); it has none")
    shared = [key for key in parts[0] if all(key in part for part in parts)]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in shared}
    if "id" in columns:
        order = np.argsort(columns["id"], kind="stable")
        if (np.diff(columns["id"][order]) != 0).all():
            columns = {key: values[order] for key, values in columns.items()}
    names = {"prototype": [labels.get(number, "") for number in range(max(labels) + 1)]}
    return bodies_from_columns(columns, names | (extras if isinstance(extras, dict) else {}), str(path))


def _turned_up(
    position: np.ndarray, rotation: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, quaternions (x, y, z, w) and scales with y up: z becomes y, and y becomes -z."""
    x, y, z = position.T
    qw, qx, qy, qz = rotation.T
    sx, sy, sz = scale.T
    return np.stack([x, z, -y], axis=1), np.stack([qx, qz, -qy, qw], axis=1), np.stack([sx, sz, sy], axis=1)


def _columns(arrays: dict[str, np.ndarray], place: np.ndarray, number: int) -> dict[str, np.ndarray]:
    count = max(len(values) for values in arrays.values())
    position = arrays.get("TRANSLATION", np.zeros((count, 3))).astype(np.float64)
    rotation = arrays.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))).astype(np.float64)
    scale = arrays.get("SCALE", np.ones((count, 3))).astype(np.float64)
    if not np.allclose(place[:3, :3], np.eye(3)):
        _, turn, factor = _decompose(place)
        position = rotate_by_xyzw(turn, factor * position)
        rotation, scale = multiply_xyzw(turn[None, :], rotation), scale * factor
    position = position + place[:3, 3]
    x, y, z = position.T
    columns = {"x": x, "y": -z, "z": y, "prototype_index": np.full(count, number)}
    qx, qy, qz, qw = rotation.T
    columns |= {"rotation_w": qw, "rotation_x": qx, "rotation_y": -qz, "rotation_z": qy}
    columns |= {"scale_x": scale[:, 0], "scale_y": scale[:, 2], "scale_z": scale[:, 1]}
    return columns | {name: arrays[key] for key, name in ATTRIBUTES.items() if key in arrays}


def _add_prism(glb: _Glb, prototype: Prototype) -> int:
    """Add the mesh that stands in for an object, with y up and flat faces."""
    outline = prototype.outline
    count = len(outline)
    x, z = outline[:, 0], -outline[:, 1]
    following = np.roll(outline, -1, axis=0)
    across = following - outline
    normal = np.stack([across[:, 1], np.zeros(count), across[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corners: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for height, up in ((0.0, -1.0), (prototype.height, 1.0)):
        first = len(corners) * count
        corners.append(np.column_stack([x, np.full(count, height), z]))
        normals.append(np.tile([0.0, up, 0.0], (count, 1)))
        fan = np.arange(1, count - 1)
        ends = (fan, fan + 1) if up > 0.0 else (fan + 1, fan)
        faces.append(first + np.stack([np.zeros(count - 2, int), *ends], axis=1))
    first = len(corners) * count
    for points in (outline, following):
        for height in (0.0, prototype.height):
            corners.append(np.column_stack([points[:, 0], np.full(count, height), -points[:, 1]]))
            normals.append(normal)
    ring = first + np.arange(count)
    low, high, low_next, high_next = (ring + k * count for k in range(4))
    faces += [np.stack([low, low_next, high_next], axis=1), np.stack([low, high_next, high], axis=1)]
    material = glb.add(
        "materials",
        {
            "name": prototype.name,
            "pbrMetallicRoughness": {"baseColorFactor": [*prototype.color, 1.0], "metallicFactor": 0.0},
        },
    )
    primitive = {
        "attributes": {
            "POSITION": glb.add_array(np.vstack(corners), FLOAT, bounds=True),
            "NORMAL": glb.add_array(np.vstack(normals), FLOAT),
        },
        "indices": glb.add_array(np.vstack(faces).ravel(), UNSIGNED_INT),
        "material": material,
    }
    return glb.add("meshes", {"name": prototype.name, "primitives": [primitive]})


def _add_asset(glb: _Glb, path: Path) -> list[tuple[int, np.ndarray]]:
    """Add what a .glb file holds; returns the numbers of its meshes and where they stand in it, shape ``[4, 4]``."""
    content, binary = _read_chunks(path)
    used = set(content.get("extensionsUsed", []))
    if used & NOT_HANDLED:
        raise EshError(f"{path} must not be compressed by {', '.join(sorted(used & NOT_HANDLED))}; export it without")
    if any("uri" in entry for entry in content.get("buffers", []) + content.get("images", [])):
        raise EshError(f"{path} must hold its buffers and images itself; export it as one .glb file")
    start = glb.add_bytes(binary)
    first = {member: len(glb.content.get(member, [])) for member in LISTS}
    for member in LISTS:
        for entry in content.get(member, []):
            glb.add(member, _renumbered(member, entry, first, start))
    for key in ("extensionsUsed", "extensionsRequired"):
        glb.content[key] = list(dict.fromkeys([*glb.content[key], *content.get(key, [])]))
    found = [(first["meshes"] + node["mesh"], place) for node, place in _walk(content) if "mesh" in node]
    if not found:
        raise EshError(f"{path} must hold a mesh; it has none")
    return found


def _renumbered(member: str, entry: dict[str, Any], first: dict[str, int], start: int) -> dict[str, Any]:
    """Return an entry of an asset with the numbers that its parts have in the file."""
    entry = json.loads(json.dumps(entry))
    if member == "bufferViews":
        return entry | {"buffer": 0, "byteOffset": entry.get("byteOffset", 0) + start}
    if member == "accessors":
        for holder in (entry, *(entry.get("sparse", {}).get(part, {}) for part in ("indices", "values"))):
            if "bufferView" in holder:
                holder["bufferView"] += first["bufferViews"]
    elif member == "images":
        entry["bufferView"] += first["bufferViews"]
    elif member == "textures":
        for holder in (entry, *entry.get("extensions", {}).values()):
            if "source" in holder:
                holder["source"] += first["images"]
        if "sampler" in entry:
            entry["sampler"] += first["samplers"]
    elif member == "materials":
        _shift_textures(entry, first["textures"])
    elif member == "meshes":
        for primitive in entry["primitives"]:
            primitive["attributes"] = {k: v + first["accessors"] for k, v in primitive["attributes"].items()}
            for target in primitive.get("targets", []):
                target.update({k: v + first["accessors"] for k, v in target.items()})
            for key, owner in (("indices", "accessors"), ("material", "materials")):
                if key in primitive:
                    primitive[key] += first[owner]
            # Which variant of its materials a mesh has is chosen by a list that is not brought along.
            primitive.get("extensions", {}).pop("KHR_materials_variants", None)
    return entry


def _shift_textures(value: Any, first: int) -> None:
    """Raise the numbers of textures anywhere in a material: they are the ``index`` of what is called ``…Texture``."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if key.endswith("Texture") and isinstance(entry, dict) and "index" in entry:
                entry["index"] += first
            _shift_textures(entry, first)


def _walk(content: dict[str, Any]) -> list[tuple[dict[str, Any], np.ndarray]]:
    """Return the nodes of the scene, parents first, and where each stands, shape ``[4, 4]``, columns last."""
    nodes = content.get("nodes", [])
    scenes = content.get("scenes") or [{"nodes": range(len(nodes))}]
    waiting = [(number, np.eye(4)) for number in reversed(list(scenes[content.get("scene", 0)].get("nodes", [])))]
    found: list[tuple[dict[str, Any], np.ndarray]] = []
    while waiting and len(found) <= len(nodes):  # a tree; what is none ends all the same
        number, parent = waiting.pop()
        node = nodes[number]
        place = parent @ _matrix(node)
        found.append((node, place))
        waiting += [(child, place) for child in reversed(node.get("children", []))]
    return found


def _matrix(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    quaternion = np.array(node.get("rotation", [0.0, 0.0, 0.0, 1.0]), np.float64)
    matrix[:3, :3] = rotate_by_xyzw(quaternion, np.eye(3)).T * np.array(node.get("scale", [1.0, 1.0, 1.0]))
    matrix[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return matrix


def _compose(
    position: np.ndarray, rotation: np.ndarray, scale: np.ndarray, place: np.ndarray, source: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the transforms of a mesh that stands at ``place`` in an object that is instanced."""
    shift, turn, factor = _decompose(place)
    turned = not np.allclose(np.abs(turn), [0.0, 0.0, 0.0, 1.0], atol=1e-6)
    if turned and not np.allclose(scale, scale[:, :1]):
        raise EshError(f"{source} must not turn its meshes, because long bodies stretch them: apply its rotations")
    return position + rotate_by_xyzw(rotation, scale * shift), multiply_xyzw(rotation, turn[None, :]), scale * factor


def _undo_place(arrays: dict[str, np.ndarray], place: object) -> None:
    """Take back what :func:`_compose` did to the transforms of instances: whoever reads them wants those of the objects."""
    if place is None or not {"TRANSLATION", "ROTATION", "SCALE"} <= set(arrays):
        return
    shift, turn, factor = _decompose(np.array(place, np.float64).reshape(4, 4))
    scale = arrays["SCALE"] / factor
    rotation = multiply_xyzw(arrays["ROTATION"].astype(np.float64), (turn * [-1.0, -1.0, -1.0, 1.0])[None, :])
    position = arrays["TRANSLATION"] - rotate_by_xyzw(rotation, scale * shift)
    arrays |= {"TRANSLATION": position, "ROTATION": rotation, "SCALE": scale}


def _decompose(place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return shift ``[3]``, quaternion (x, y, z, w) ``[4]`` and scale ``[3]`` of a matrix."""
    import trimesh

    factor = np.linalg.norm(place[:3, :3], axis=0)
    if np.linalg.det(place[:3, :3]) < 0.0:
        factor[0] = -factor[0]
    matrix = np.eye(4)
    matrix[:3, :3] = place[:3, :3] / factor
    return place[:3, 3], np.roll(trimesh.transformations.quaternion_from_matrix(matrix), -1), factor


def _array(content: dict[str, Any], binary: bytes, index: int) -> np.ndarray:
    """Return the values of an accessor, shape ``[n]`` or ``[n, k]``."""
    accessor = content["accessors"][index]
    view = content["bufferViews"][accessor["bufferView"]]
    dtype = np.dtype(TYPES[accessor["componentType"]])
    width = WIDTH[accessor["type"]]
    stride = view.get("byteStride", width * dtype.itemsize)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    count = accessor["count"]
    if start + max(count - 1, 0) * stride + width * dtype.itemsize > len(binary):
        raise ValueError("an accessor reaches beyond the file's bytes")
    values: np.ndarray = np.ndarray((count, width), dtype, binary, offset=start, strides=(stride, dtype.itemsize))
    if accessor.get("normalized"):
        values = np.maximum(values / np.float64(np.iinfo(dtype).max), -1.0)
    return values[:, 0] if width == 1 else values


def _read_chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputFileError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}") from None
    try:
        magic, version, _ = struct.unpack_from("<III", data)
        length, kind = struct.unpack_from("<II", data, 12)
        if (magic, version, kind) != (MAGIC, 2, JSON_CHUNK):
            raise ValueError
        content = json.loads(data[20 : 20 + length])
        start = 20 + length
        binary = b""
        if start < len(data):
            length, kind = struct.unpack_from("<II", data, start)
            binary = data[start + 8 : start + 8 + length] if kind == BINARY_CHUNK else b""
        if not isinstance(content, dict):
            raise ValueError
    except (struct.error, ValueError):
        raise InputFileError(f"{path} must be a binary glTF 2 file (.glb); it is something else") from None
    return content, binary
