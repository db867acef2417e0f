"""Bodies as tables: PLY points, Parquet and GeoJSON, with the columns of :meth:`~.bodies.Bodies.columns`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import EshError, InputFileError
from .bodies import READ_COLUMNS, Bodies, bodies_from_columns, read_names
from .extras import import_extra
from .input_file import kind_and_reason_of

__all__ = ["read_geojson", "read_parquet", "read_ply", "write_geojson", "write_parquet", "write_ply"]

# What PLY calls NumPy's types. It has no 64-bit whole numbers.
PLY_TYPES = {"f8": "double", "f4": "float", "i4": "int"}
# Whole numbers up to here are doubles.
MOST_IDS = 2**53
# Where names are kept: a comment's first word, a key of metadata, a member of an object.
KEY = "esh"


def write_ply(file: BinaryIO, bodies: Bodies, folder: Path) -> None:
    """Write points with a property for every column, binary.

    Raises:
        EshError: Ids that doubles cannot hold.
    """
    if bodies.id.size and np.abs(bodies.id).max() > MOST_IDS:
        raise EshError(f"ids in a .ply file must be at most {MOST_IDS:,}; write .usdc or .parquet instead")
    columns = {key: _ply_column(values) for key, values in bodies.columns().items()}
    dtype = np.dtype([(key, values.dtype.newbyteorder("<")) for key, values in columns.items()])
    vertices = np.empty(len(bodies.position), dtype)
    for key, values in columns.items():
        vertices[key] = values
    properties = [f"property {PLY_TYPES[values.dtype.str[1:]]} {key}" for key, values in columns.items()]
    lines = [
        *("ply", "format binary_little_endian 1.0", f"comment {KEY} {bodies.names()}"),
        *(f"element vertex {len(vertices)}", *properties, "end_header"),
    ]
    file.write("".join(f"{line}\n" for line in lines).encode("ascii"))
    file.write(vertices.tobytes())


def _ply_column(values: np.ndarray) -> np.ndarray:
    if values.dtype != np.int64:
        return values
    return values.astype(np.int32 if not values.size or np.abs(values).max() < 2**31 else np.float64)


def read_ply(path: Path) -> Bodies:
    """Read the points of a PLY file, ours or any other."""
    import trimesh

    names: dict[str, Any] = {}
    with path.open("rb") as file:
        for line in file:
            words = line.decode("utf-8", "replace").strip().split(" ", 2)
            if words[:2] == ["comment", KEY]:
                names = read_names(words[-1])
            if words == ["element", "vertex", "0"] and names:
                # A file of ours that holds nobody.
                return bodies_from_columns({"x": np.zeros(0), "y": np.zeros(0)}, names, str(path))
            if words[0] == "end_header":
                break
    try:
        with path.open("rb") as file:
            raw = trimesh.load_scene(file, file_type="ply").geometry.values()
            vertex = next(iter(raw)).metadata["_ply_raw"]["vertex"]["data"]
            columns = {key: np.asarray(vertex[key]).ravel() for key in _keys(vertex)}
    except Exception as error:  # whatever trimesh stumbles over
        raise InputFileError(f"{path} cannot be read as a PLY file of points: {kind_and_reason_of(error)}") from None
    return bodies_from_columns(columns, names, str(path))


def _keys(vertex: Any) -> list[str]:
    return list(vertex.dtype.names) if isinstance(vertex, np.ndarray) else list(vertex)


def write_parquet(file: BinaryIO, bodies: Bodies, folder: Path) -> None:
    """Write a table with a row for every body; the names of classes and sizes are columns, too."""
    arrow = import_extra("pyarrow", "parquet", "a .parquet file")
    parquet = import_extra("pyarrow.parquet", "parquet", "a .parquet file")
    columns: dict[str, Any] = bodies.columns()
    columns["angle"] = bodies.angle
    first = np.concatenate([[0], np.cumsum([len(names) for names in bodies.size_name])]).astype(np.int32)
    flat = [name for names in bodies.size_name for name in names]
    for key, index, values in (
        ("class_name", bodies.class_index, list(bodies.class_name)),
        ("size_name", first[bodies.class_index] + bodies.size_index, flat),
    ):
        columns[key] = arrow.DictionaryArray.from_arrays(arrow.array(index, arrow.int32()), values)
    table = arrow.table(columns).replace_schema_metadata({KEY: bodies.names()})
    parquet.write_table(table, file, compression="zstd")


def read_parquet(path: Path) -> Bodies:
    """Read a table that has at least the columns x and y."""
    parquet = import_extra("pyarrow.parquet", "parquet", "a .parquet file")
    try:
        table = parquet.read_table(path)
        names = read_names((table.schema.metadata or {}).get(KEY.encode(), b"").decode("utf-8", "replace"))
        for place, key in enumerate(table.column_names):
            if key == "geometry" and hasattr(table.schema.field(place).type, "num_fields"):
                # Points of GeoParquet: their parts become columns.
                parts = table[key].combine_chunks().flatten()
                names_of_parts = [table.schema.field(place).type.field(k).name for k in range(len(parts))]
                table = table.remove_column(place)
                for name, values in zip(names_of_parts, parts, strict=True):
                    table = table.append_column(name, values)
        columns = {key: table[key].to_numpy() for key in table.column_names if key not in ("class_name", "size_name")}
    except (ValueError, OSError, NotImplementedError) as error:  # pyarrow's own errors are of these kinds
        raise InputFileError(f"{path} cannot be read as a Parquet file: {kind_and_reason_of(error)}") from None
    return bodies_from_columns(columns, names, str(path))


def write_geojson(file: BinaryIO, bodies: Bodies, folder: Path) -> None:
    """Write a point with properties for every body, in the domain's meters; meant for small placements."""
    columns = bodies.columns()
    flat = not bodies.position[:, 2].any()
    place = bodies.position[:, :2] if flat else bodies.position
    upright = flat and not bodies.rotation[:, 1:3].any()
    left_out = {"x", "y", "z", "prototype_index"} | ({f"rotation_{axis}" for axis in "wxyz"} if upright else set())
    kept = {key: values.tolist() for key, values in columns.items() if key not in left_out}
    kept["angle"] = bodies.angle.tolist()
    kept["prototype_index"] = bodies.prototype_index.tolist()
    kept["class_name"] = [bodies.class_name[c] for c in bodies.class_index.tolist()]
    kept["size_name"] = [
        bodies.size_name[c][s] for c, s in zip(bodies.class_index.tolist(), bodies.size_index.tolist(), strict=True)
    ]
    file.write(f'{{"type": "FeatureCollection", "{KEY}": {bodies.names()}, "features": ['.encode("ascii"))
    for number, (coordinates, values) in enumerate(zip(place.tolist(), zip(*kept.values(), strict=True), strict=True)):
        feature = {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": coordinates},
            # JSON has no number for an area that is not known.
            "properties": {key: None if value != value else value for key, value in zip(kept, values, strict=True)},
        }
        file.write(((",\n" if number else "\n") + json.dumps(feature)).encode("ascii"))
    file.write(b"\n]}\n")


def read_geojson(path: Path) -> Bodies:
    """Read the points of a GeoJSON file, ours or any other, with those of their properties that are columns of ours."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        features = [f for f in content["features"] if f["geometry"]["type"] == "Point"]
        place = [(*map(float, f["geometry"]["coordinates"]), 0.0)[:3] for f in features]
    except (ValueError, KeyError, TypeError) as error:
        raise InputFileError(
            f"{path} cannot be read as a GeoJSON file of points: {kind_and_reason_of(error)}"
        ) from None
    columns: dict[str, Any] = dict(zip("xyz", np.reshape(np.array(place, np.float64), (-1, 3)).T, strict=True))
    properties = [f.get("properties") or {} for f in features]
    for key in (key for key in READ_COLUMNS if key not in columns):
        # A property of the same name that somebody else gave another meaning is none of ours.
        values = [p.get(key) for p in properties]
        if properties and all(isinstance(v, (int, float)) or (key == "area" and v is None) for v in values):
            columns[key] = np.array(values, np.int64 if key == "id" else np.float64)
    names = content.get(KEY)
    return bodies_from_columns(columns, names if isinstance(names, dict) else {}, str(path))
