"""From a placement on a surface to the figures of its report."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface
from . import kernels_heat
from .heat import HeatMesh
from .overlaps import Overlaps, find_overlaps_on_surface
from .spacing import HEXAGONAL_SPACING

__all__ = ["measure_on_surface"]

# Distances of neighbors are looked for this far, in spacings of a typical density.
NEIGHBORS = 2.0
# Cells along every axis of the table that neighbors are looked up in.
CELLS = 128


class SurfaceFigures(NamedTuple):
    """What is measured of a placement on a surface; see :class:`~esh.engine.problem.report.Report`.

    Attributes:
        errors: Coverage error of every class.
        whole: Of all bodies together.
        smallest: Smallest spacing over that of a hexagonal lattice; None where no two bodies are neighbors.
        closest: Smallest distance of neighbors [m].
        usual: Median distance to the nearest neighbor [m].
        overlaps: What of the footprints overlaps.
        covered: Sum of the footprints over the area where bodies may be.
    """

    errors: list[float]
    whole: float
    smallest: float | None
    closest: float | None
    usual: float | None
    overlaps: Overlaps
    covered: float


def measure_on_surface(placement: Placement, launcher: Launcher) -> SurfaceFigures:
    """Measure a placement on a surface."""
    problem, surface = placement.problem, placement.problem.domain
    assert isinstance(surface, Surface)
    points = _points(placement, surface)
    area, class_index = placement.area, placement.class_index
    mesh = HeatMesh(launcher, surface, len(area))
    targets = [mesh.target(c.density_on if c.varies_on_surface else None) for c in problem.classes]
    charges, errors = [], []
    last = np.searchsorted(class_index, np.arange(len(problem.classes)), side="right")
    for k, body_class in enumerate(problem.classes):
        # Bodies come one class after the other.
        own = slice(int(last[k - 1]) if k else 0, int(last[k]))
        placed = mesh.charges(points.triangle[own], points.barycentric[own], area[own])
        charges.append(placed)
        errors.append(mesh.error(placed, targets[k], body_class.body_count))
    whole = errors[0]
    if len(errors) > 1:
        amount = [sum((s.count or 0) * s.mean_area for s in c.sizes) for c in problem.classes]
        target = np.average(targets, axis=0, weights=amount)
        whole = mesh.error(np.sum(charges, axis=0), target, len(area))
    sample = surface.sample()
    allowed = np.mean(np.any([c.density_on(sample) > 0.0 for c in problem.classes], axis=0))
    covered = float(area.sum() / (surface.area * max(float(allowed), 1e-9)))
    smallest, closest, usual = _spacing(placement, points, launcher) or (None, None, None)
    overlaps = find_overlaps_on_surface(placement, points, launcher)
    return SurfaceFigures(errors, whole, smallest, closest, usual, overlaps, covered)


def _spacing(placement: Placement, points: PointsOnSurface, launcher: Launcher) -> tuple[float, float, float] | None:
    """Distances to the nearest body of the same sheet: smallest over the hexagonal spacing asked for there, smallest, median [m]."""
    problem, surface, n = placement.problem, points.surface, len(placement.position)
    if n < 2:
        return None
    # A number for each, or one for all.
    number: np.ndarray | float = 0.0
    for c in problem.classes:
        asked = c.density_on(points) / c.density_on(surface.sample()).mean() if c.varies_on_surface else 1.0
        number = number + c.body_count / surface.area * asked
    unit = 1.0 / math.sqrt(float(np.median(number)))
    position, normal = _on_device(placement, surface, unit, launcher)
    reach = NEIGHBORS
    grid = wp.HashGrid(CELLS, CELLS, CELLS, device=launcher.device)
    grid.build(position, reach)
    distance = launcher.empty(n, float)
    launcher.launch(
        kernels_heat.nearest_distance,
        n,
        [grid.id, position, normal, reach],
        [distance],
        grain=GRAIN_OF_NEIGHBORS,
    )
    near = distance.numpy()
    found = near < reach
    if not found.any():
        return None
    closest = float(near.min()) * unit
    if isinstance(number, np.ndarray):
        smallest = float((near[found] * unit * np.sqrt(number[found])).min())
    else:
        smallest = closest * math.sqrt(number)
    return smallest / HEXAGONAL_SPACING, closest, float(np.median(near[found])) * unit


def _points(placement: Placement, surface: Surface) -> PointsOnSurface:
    assert placement.mesh is not None and placement.triangle is not None and placement.barycentric is not None
    return surface.locate(placement.mesh, placement.triangle, placement.barycentric)


def _on_device(placement: Placement, surface: Surface, unit: float, launcher: Launcher) -> tuple[wp.array, wp.array]:
    """Positions in a unit, from the surface's middle, and normals."""
    position = ((placement.position - 0.5 * (surface.low + surface.high)) / unit).astype(np.float32)
    assert placement.normal is not None
    normal = placement.normal.astype(np.float32)
    device = launcher.device
    return wp.array(position, dtype=wp.vec3, device=device), wp.array(normal, dtype=wp.vec3, device=device)
