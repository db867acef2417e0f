"""A tile as a file: GeoParquet or NumPy arrays, with numbers that are unique in the whole domain."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..files.extras import import_extra
from .bodies import PartBodies
from .looking import looking_turns

if TYPE_CHECKING:
    from .plan import Plan

__all__ = ["TILE_WRITERS", "angles_of", "bends_of", "check_tile_ending", "tile_name", "widths_of", "world_position"]


def tile_name(plan: Plan, number: int, ending: str) -> str:
    """Name of a tile's file: its row from below and its column from the left, counted from 0."""
    columns, rows = plan.layout.tiles
    digits = max(3, len(str(max(columns, rows) - 1)))
    return f"tile-{number // columns:0{digits}d}-{number % columns:0{digits}d}{ending}"


def world_position(plan: Plan, position: np.ndarray) -> np.ndarray:
    """Where positions in the domain [m], shape ``[n, 2]``, are in the world, if a density's file says where it lies."""
    if plan.georeference is None:
        return position
    place, (rows, columns) = plan.georeference
    extent = np.array([place.pixel[0] * columns, place.pixel[1] * rows])
    return np.array([place.left, place.bottom]) + position * (extent / plan.layout.size)


def _columns(plan: Plan, bodies: PartBodies) -> dict[str, np.ndarray]:
    """What is said of every body beside its place."""
    groups = plan.groups
    group = groups.group_of(bodies.identity)
    columns: dict[str, np.ndarray] = {
        "id": bodies.identity,
        "class_index": groups.class_index[group].astype(np.int32),
        "size_index": groups.size_index[group].astype(np.int32),
        "area": groups.areas(bodies.identity),
    }
    if plan.longest > 0.0 or groups.outlined or any(c.look_at is not None for c in plan.problem.classes):
        columns["angle"] = angles_of(plan, bodies, group)
    if plan.longest > 0.0:
        columns |= {"length": bodies.length, "width": widths_of(plan, bodies, group, columns["area"])}
    if len(groups.fixed_identity):
        columns["fixed"] = groups.is_fixed(bodies.identity)
    if groups.outlined:
        drawn = groups.outlines(bodies.identity)
        columns |= {"variant": drawn.variant, "scale": drawn.scale}
    return columns


def angles_of(plan: Plan, bodies: PartBodies, group: np.ndarray) -> np.ndarray:
    """How bodies lie [rad], as a placement says it: lines within half a turn, unless they have outlines."""
    sizes = plan.groups.sizes
    outlined = np.array([size.footprint is not None for size in sizes])[group]
    line = np.array([size.line is not None for size in sizes])[group]
    axis = np.where(line, bodies.angle, 0.0)
    lying = np.where(outlined, _within(axis + bodies.turn, 2.0 * math.pi), _within(axis, math.pi))
    looking = looking_turns(plan, bodies, lying)
    # Outlines that were parted stay as they were turned then.
    return np.where(outlined, lying, looking) if plan.problem.avoid_overlap else looking


def _within(angle: np.ndarray, period: float) -> np.ndarray:
    """Angles between minus and plus half of a period; those that are, are left as they are."""
    half = 0.5 * period
    return np.where((angle >= -half) & (angle < half), angle, np.mod(angle + half, period) - half)


def _bends(plan: Plan, bodies: PartBodies) -> np.ndarray | None:
    """What :func:`bends_of` returns, in the world."""
    places = bends_of(plan, bodies)
    return None if places is None else world_position(plan, places.reshape(-1, 2)).reshape(places.shape)


def bends_of(plan: Plan, bodies: PartBodies) -> np.ndarray | None:
    """Positions of the charges on lines that may bend [m], shape ``[n, charges, 2]``, NaN elsewhere; None without any."""
    if not plan.bending:
        return None
    result = np.full((len(bodies), plan.bending, 2), np.nan)
    group = plan.groups.group_of(bodies.identity)
    for g in np.unique(group).tolist():
        line = plan.groups.sizes[g].line
        if line is None or line.straightness is None:
            continue
        own = np.flatnonzero(group == g)
        places = line.charge_places()
        along = 0.5 * bodies.length[own, None] * places
        across = bodies.bend[own, : len(places)]
        cosine, sine = np.cos(bodies.angle[own, None]), np.sin(bodies.angle[own, None])
        offset = np.stack([along * cosine - across * sine, along * sine + across * cosine], axis=-1)
        result[own, : len(places)] = bodies.position[own, None] + offset
    return result


def widths_of(plan: Plan, bodies: PartBodies, group: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Thickness of lines [m], 0 for dots: their own, or that of capsules of the mean length asked for."""
    result = np.zeros(len(bodies))
    for g in np.unique(group).tolist():
        line = plan.groups.sizes[g].line
        if line is None:
            continue
        own = group == g
        result[own] = line.thickness(area[own], float(np.mean(line.length)))
    return result


def _write_npz(file: BinaryIO, plan: Plan, bodies: PartBodies) -> None:
    nothing = np.zeros(len(bodies))
    bends = _bends(plan, bodies)
    columns: dict[str, Any] = {"angle": nothing, "length": nothing, "width": nothing} | _columns(plan, bodies)
    # As placements are written: names by class, and those of sizes by body.
    names = np.array([size.name for size in plan.groups.sizes], np.str_)
    np.savez(
        file,
        position=world_position(plan, bodies.position),
        **columns,
        **({} if bends is None else {"bends": bends}),
        class_name=np.array([c.name for c in plan.problem.classes], np.str_),
        size_name=names[plan.groups.group_of(bodies.identity)],
    )


def _write_parquet(file: BinaryIO, plan: Plan, bodies: PartBodies) -> None:
    arrow = import_extra("pyarrow", "parquet", "tiles as .parquet files")
    parquet = import_extra("pyarrow.parquet", "parquet", "tiles as .parquet files")
    position = world_position(plan, bodies.position)
    columns = _columns(plan, bodies)
    ranges = any(isinstance(size.area, tuple) for size in plan.groups.sizes)
    point = arrow.StructArray.from_arrays(
        [arrow.array(np.ascontiguousarray(position[:, axis])) for axis in (0, 1)], names=["x", "y"]
    )
    table: dict[str, Any] = {"id": columns.pop("id"), "geometry": point}
    for key, values in columns.items():
        # As exact as anybody needs, and much smaller.
        small = np.int16 if key.endswith("index") or key == "variant" else np.float32
        table[key] = values if values.dtype == bool else values.astype(small)
    bends = _bends(plan, bodies)
    if bends is not None:
        # Of every point x, then y.
        flat = arrow.array(bends.ravel(), from_pandas=False)
        table["bends"] = arrow.FixedSizeListArray.from_arrays(flat, 2 * plan.bending)
    described: dict[str, Any] = {"encoding": "point", "geometry_types": ["Point"], "crs": None}
    if plan.georeference is not None and plan.georeference[0].crs is not None:
        described["crs"] = json.loads(plan.georeference[0].crs)
    if len(bodies):
        described["bbox"] = [*position.min(axis=0).tolist(), *position.max(axis=0).tolist()]
    classes = [c.name for c in plan.problem.classes]
    sizes = [[size.name for size in c.sizes] for c in plan.problem.classes]
    metadata = {
        "geo": json.dumps({"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": described}}),
        "esh": json.dumps({"class": classes, "size": sizes}),
    }
    ranges = ranges or plan.groups.outlined
    split = [key for key in ("angle", "length", "width", "scale") if key in table] + (["area"] if ranges else [])
    parquet.write_table(
        arrow.table(table).replace_schema_metadata(metadata),
        file,
        compression="zstd",
        use_dictionary=[key for key in table if key not in ("id", "geometry", "bends", *split)],
        column_encoding={"id": "DELTA_BINARY_PACKED"}
        | {key: "BYTE_STREAM_SPLIT" for key in ("geometry.x", "geometry.y", *split)},
    )


# A format is one entry here; the command line, its help and its messages read it.
TILE_WRITERS: dict[str, Callable[[BinaryIO, Plan, PartBodies], None]] = {
    ".parquet": _write_parquet,
    ".npz": _write_npz,
}


def check_tile_ending(ending: str) -> None:
    """Find out whether what an ending needs is installed."""
    if ending == ".parquet":
        import_extra("pyarrow.parquet", "parquet", "tiles as .parquet files")
