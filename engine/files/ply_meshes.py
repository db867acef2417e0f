"""Meshes from PLY files, in text and in binary, with polygons of any number of corners, each cut into triangles by itself.

Trimesh does not read faces of different numbers of corners in binary, as Blender writes them, and makes fans of concave ones.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..problem.surface import SurfaceMesh
from .polygons import triangles_of

__all__ = ["color_shares", "read_ply_mesh"]

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4"},
    **{"double": "f8", "float64": "f8"},
}
FORMATS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
# What those who write PLY files call the corners of faces, and coordinates of images.
CORNERS = ("vertex_indices", "vertex_index")
UV_OF_VERTICES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
UV_OF_CORNERS = "texcoord"
CHANNELS = ("red", "green", "blue")
COLOR = "color"
# What numbers in text are kept as.
DOUBLE = np.dtype("<f8")
# What NumPy's types are called by the module struct.
CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}


@dataclass(frozen=True)
class _Property:
    """A property of an element: its name, the type of its values, and that of their number where it is a list."""

    name: str
    dtype: np.dtype
    count_dtype: np.dtype | None = None


@dataclass(frozen=True)
class _List:
    """Lists of a property, one for every row: how many values each has, and the byte that they start at."""

    dtype: np.dtype
    count: np.ndarray
    start: np.ndarray

    def values(self, body: bytes, rows: np.ndarray) -> np.ndarray:
        """Values of some rows whose lists are equally long, shape ``[m, n]``."""
        length = int(self.count[rows[0]]) * self.dtype.itemsize
        at = self.start[rows][:, None] + np.arange(length)
        return np.ascontiguousarray(np.frombuffer(body, np.uint8)[at]).view(self.dtype)


@dataclass(frozen=True)
class _Element:
    """What a file says of one kind of things: how many there are, and their properties in their order."""

    name: str
    count: int
    properties: list[_Property]


Column = np.ndarray | _List
# Name of a property, type of its values, and of their number where it is a list.
Stored = tuple[str, np.dtype, np.dtype | None]


def read_ply_mesh(path: Path) -> SurfaceMesh | None:
    """Read the mesh of a PLY file; None where it has no faces.

    Attributes are the properties of its vertices by their names, their colors as ``color``, 0..1, and three that end in _x, _y
    and _z as a vector, too. Coordinates of images are those of corners, or of vertices.

    Raises:
        ValueError: It is no PLY file, or ends too early.
        ProblemError: As :class:`SurfaceMesh` says.
    """
    elements, body, in_text = _parts_of(path.read_bytes())
    columns: dict[str, dict[str, Column]] = {}
    at = 0
    for element in elements:
        columns[element.name], at = _read(element, body, at, in_text)
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    values = {key: column for key, column in vertex.items() if isinstance(column, np.ndarray)}
    lists = {key: column for key, column in face.items() if isinstance(column, _List)}
    corners = next((lists[key] for key in CORNERS if key in lists), None)
    if corners is None or not all(axis in values for axis in "xyz"):
        return None
    vertices = np.stack([values[axis] for axis in "xyz"], axis=1).astype(np.float64)
    triangles, uv = _triangles(body, corners, vertices, lists.get(UV_OF_CORNERS))
    if not len(triangles):
        return None
    pair = next((pair for pair in UV_OF_VERTICES if all(key in values for key in pair)), None)
    if uv is None and pair is not None:
        uv = np.stack([values[key] for key in pair], axis=1).astype(np.float64)
    attributes = {key: column for key, column in values.items() if key not in ("x", "y", "z")}
    if all(key in attributes for key in CHANNELS):
        attributes.setdefault(COLOR, np.stack([color_shares(attributes[key]) for key in CHANNELS], axis=1))
    return SurfaceMesh(vertices, triangles, path.stem, attributes | _vectors(attributes), uv)


def _vectors(attributes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Attributes whose names end in _x, _y and _z, as Blender writes vectors, under the names before these; none that are taken."""
    names = [key.removesuffix("_x") for key in attributes if key.endswith("_x")]
    of_names = {name: [attributes.get(f"{name}_{axis}") for axis in "xyz"] for name in names if name not in attributes}
    return {
        name: np.stack([axis for axis in axes if axis is not None], axis=1)
        for name, axes in of_names.items()
        if name and all(axis is not None for axis in axes)
    }


def color_shares(channel: np.ndarray) -> np.ndarray:
    """Channels of colors as shares, 0..1: whole numbers go up to the largest of their type."""
    return channel / np.iinfo(channel.dtype).max if channel.dtype.kind in "iu" else channel.astype(np.float64)


def _parts_of(content: bytes) -> tuple[list[_Element], bytes, bool]:
    """Elements of a file as its head names them, what follows, and whether that was text: then it is numbers of double precision."""
    head, end, body = content.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    kind = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), None)
    if not content.startswith(b"ply") or not end or kind not in FORMATS:
        raise ValueError("its head is not that of a PLY file")
    elements: list[_Element] = []
    for line in lines:
        if line[:1] == ["element"] and len(line) == 3 and line[2].isdecimal():
            elements.append(_Element(line[1], int(line[2]), []))
        elif line[:1] == ["property"] and elements and (read := _property(line, FORMATS[kind])):
            elements[-1].properties.append(read)
        elif line[:1] in (["element"], ["property"]):
            raise ValueError(f"its head says {' '.join(line)}")
    if kind != "ascii":
        return elements, body.partition(b"\n")[2], False
    return elements, np.array(body.split(), dtype=np.float64).tobytes(), True


def _property(line: list[str], order: str) -> _Property | None:
    """A property from the words of its line; None of what is none."""
    types = [np.dtype(order + TYPES[word]) for word in line[1:-1] if word in TYPES]
    if len(line) == 3 and len(types) == 1:
        return _Property(line[-1], types[0])
    if len(line) == 5 and line[1] == "list" and len(types) == 2:
        return _Property(line[-1], types[1], types[0])
    return None


def _read(element: _Element, body: bytes, at: int, in_text: bool) -> tuple[dict[str, Column], int]:
    """Columns of an element that begins at a byte, and where the next one begins."""
    stored = [
        (p.name, DOUBLE if in_text else p.dtype, DOUBLE if in_text and p.count_dtype is not None else p.count_dtype)
        for p in element.properties
    ]
    if not stored or not element.count:
        return {}, at
    columns = _read_alike(stored, body, at, element.count) or _read_one_by_one(stored, body, at, element.count)
    if not columns:
        raise ValueError(f'it ends before the last "{element.name}"')
    result, end = columns
    for p in element.properties:
        column = result[p.name]
        if isinstance(column, np.ndarray):
            result[p.name] = column.astype(p.dtype.newbyteorder("="))
    return result, end


def _read_alike(stored: list[Stored], body: bytes, at: int, count: int) -> tuple[dict[str, Column], int] | None:
    """Columns of rows whose lists are all as long as those of the first; None where they are not."""
    first, step = _row(stored, body, at), 0
    offsets = []
    for (_, dtype, count_dtype), length in zip(stored, first, strict=False):
        offsets.append(step)
        step += dtype.itemsize if count_dtype is None else count_dtype.itemsize + length * dtype.itemsize
    if len(first) < len(stored) or at + count * step > len(body):
        return None
    rows = np.frombuffer(body, np.uint8, count * step, at).reshape(count, step)
    result: dict[str, Column] = {}
    for (name, dtype, count_dtype), length, offset in zip(stored, first, offsets, strict=True):
        head = dtype if count_dtype is None else count_dtype
        values = np.ascontiguousarray(rows[:, offset : offset + head.itemsize]).view(head)[:, 0]
        if count_dtype is None:
            result[name] = values
            continue
        if (values != length).any():
            return None
        start = at + offset + head.itemsize + step * np.arange(count)
        result[name] = _List(dtype, np.full(count, length), start)
    return result, at + count * step


def _row(stored: list[Stored], body: bytes, at: int) -> list[int]:
    """How many values each property of a row has that begins at a byte; fewer where the file ends within it."""
    lengths: list[int] = []
    for _, dtype, count_dtype in stored:
        length = 1
        if count_dtype is not None:
            if at + count_dtype.itemsize > len(body):
                return lengths
            length = _whole(np.frombuffer(body, count_dtype, 1, at)[0])
            at += count_dtype.itemsize
        at += length * dtype.itemsize
        lengths.append(length)
    return lengths if at <= len(body) else lengths[:-1]


def _whole(length: float) -> int:
    if not 0 <= length < 2**31 or length != int(length):
        raise ValueError(f"a list in it is {length:g} long")
    return int(length)


def _read_one_by_one(stored: list[Stored], body: bytes, at: int, count: int) -> tuple[dict[str, Column], int] | None:
    """Columns of rows whose lists differ in length; None where the file ends before the last."""
    steps = [(dtype.itemsize, None if number is None else _struct(number)) for _, dtype, number in stored]
    found: list[list[int]] = [[] for _ in stored]
    lengths: list[list[int]] = [[] for _ in stored]
    try:
        for _ in range(count):
            for k, (size, read) in enumerate(steps):
                length = 1
                if read is not None:
                    length = _whole(read.unpack_from(body, at)[0])
                    at += read.size
                lengths[k].append(length)
                found[k].append(at)
                at += length * size
            if at > len(body):
                return None
    except struct.error:
        return None
    result: dict[str, Column] = {}
    for (name, dtype, count_dtype), starts, numbers in zip(stored, found, lengths, strict=True):
        column = _List(dtype, np.array(numbers), np.array(starts))
        result[name] = column if count_dtype is not None else column.values(body, np.arange(count))[:, 0]
    return result, at


def _struct(dtype: np.dtype) -> struct.Struct:
    return struct.Struct(dtype.str[0].replace("|", "<") + CODES[dtype.str[1:]])


def _triangles(
    body: bytes, corners: _List, vertices: np.ndarray, uv: _List | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Triangles of polygons in their order, shape ``[t, 3]``, and coordinates of images at their corners, ``[t, 3, 2]``."""
    triangles, maps, polygon = [np.zeros((0, 3), np.int64)], [np.zeros((0, 3, 2))], [np.zeros(0, np.int64)]
    for count in np.unique(corners.count[corners.count > 2]).tolist():
        rows = np.flatnonzero(corners.count == count)
        index = corners.values(body, rows).astype(np.int64)
        cut = triangles_of(index, vertices)
        row = np.arange(len(rows))[:, None, None]
        triangles.append(index[row, cut].reshape(-1, 3))
        polygon.append(np.repeat(rows, count - 2))
        if uv is not None and (uv.count == 2 * corners.count).all():
            place = uv.values(body, rows).astype(np.float64).reshape(len(rows), count, 2)
            maps.append(place[row, cut].reshape(-1, 3, 2))
    order = np.argsort(np.concatenate(polygon), kind="stable")
    found = np.concatenate(triangles)[order]
    return found, np.concatenate(maps)[order] if len(maps) == len(triangles) and len(found) else None
