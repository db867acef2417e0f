"""How many bodies a run will place, how long it takes and how much memory, as far as that can be told beforehand."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ..targets.target import extent_of, members_of, read_triangles
from .body_class import DERIVED_COUNTS

__all__ = ["area_of", "bodies_ahead", "question"]

# Seconds for each body and step on two cores, and bytes for each body: measured at 100,000 to 1,000,000 discs; and what a run takes
# at least, as it is said [s, GB].
SECONDS_A_STEP = 0.8e-6
BYTES = 1200
SHORTEST, SMALLEST = 1.0, 0.1


def bodies_ahead(scatter: Any) -> int:
    """Return how many bodies the next run will place; what the ground decides is estimated, as if densities were white."""
    ready = scatter.ready_classes()
    ground = 0.0
    if any(c.count_kind not in ("SIZES", "TOTAL") for c in ready):
        ground = sum(area_of(item) for item in scatter.targets)
    return sum(_of_class(body_class, ground) for body_class in ready)


def question(scatter: Any, count: int) -> str:
    """Return what a run of so many bodies will take, as a sentence."""
    seconds = max(SHORTEST, _seconds_a_step(scatter) * scatter.max_steps * count)
    time = f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
    return f"{count:,} objects will take about {time} and {max(SMALLEST, BYTES * count / 1e9):.1f} GB of memory"


def _seconds_a_step(scatter: Any) -> float:
    """Return seconds for each body and step: as in the last run, if that was large enough to tell."""
    report = scatter.report
    placed = sum(size["placed"] for entry in report["classes"] for size in entry["sizes"]) if report else 0
    if report and placed >= 10_000 and report["steps"]:
        return report["seconds"] / placed / report["steps"]
    return SECONDS_A_STEP


def _of_class(body_class: Any, ground: float) -> int:
    kind = body_class.count_kind
    if kind not in DERIVED_COUNTS and kind != "COVER":
        return body_class.count
    if kind == "PER_AREA":
        return math.ceil(body_class.per_area * ground)
    if kind == "DISTANCE":
        return math.ceil(ground * 2.0 / (math.sqrt(3.0) * body_class.distance**2))
    share = body_class.cover_share if kind == "SHARE" else 1.0
    return math.ceil(share * ground / _footprint(body_class))


def _footprint(body_class: Any) -> float:
    """Return the mean ground that one object takes, as far as its extent tells it [m²]."""
    areas = []
    for size in body_class.sizes:
        if size.area_kind != "MESH":
            areas.append(size.area if size.area_kind == "VALUE" else 0.5 * (size.area + size.area_largest))
            continue
        items = [size.source] if size.placed_as_one else members_of(size.source)
        areas += [0.25 * math.pi * float(extent_of(item, bpy.context)[:2].prod()) for item in items]
    return max(body_class.scale**2 * float(np.mean(areas)) if areas else 1.0, 1e-9)


def area_of(target: bpy.types.Object) -> float:
    """Return the area of a mesh's faces in the world, as they are stored [m²]."""
    mesh = target.data
    if not len(mesh.polygons):
        # It may not even have positions.
        return 0.0
    return float(read_triangles(mesh, np.array(target.matrix_world), target.name).areas().sum())
