"""From a placement on a surface to the figures of its report."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import least_and_number, median_of_least
from ..heat.heat_mesh import HeatMesh, HeatMeshes
from ..problem.body_footprints import BodyFootprints
from ..problem.cover import ground_on_surface
from ..problem.of_bodies import of_all
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..problem.prepared_class import PreparedClass
from ..problem.surface import PointsOnSurface, Surface
from ..problem.surface_density import SurfaceDensity
from . import kernels_surface_spacing
from .bodies_on_surface import BodiesOnSurface, bodies_on_surface
from .footprint_areas import footprint_areas
from .groups_by_area import GroupsByArea, bodies_by_class, groups_by_area
from .overlaps import Overlaps, find_overlaps_on_surface
from .sheets import sheets_of
from .spacing import HEXAGONAL_SPACING
from .taken_ground import LEAST_FREE, taken_ground

__all__ = ["measure_on_surface"]

# Distances of neighbors are looked for this far, in spacings of a typical density.
NEIGHBORS = 2.0
# Cells along every axis of the table that neighbors are looked up in.
CELLS = 128
# Where a smaller share of the typical number of bodies is asked for, those that stand there belong beside it.
NEXT_TO_NONE = 0.02
# A class of far fewer bodies than there are in all is measured on a mesh for fewer: each is for a quarter of those of the one before,
# and for so many times as many as the class has at least. Heat spreads by more steps the wider its spacing is beside that of a mesh.
# Measured on 3 bodies among 2,000 on a tube of 192 slivers: on meshes for 2,003, 500 and 125 bodies their errors differ by .1 percent,
# on one for 7 by 2, and take 1.4, .4 and .2 s.
FEWER = 4
LEAST_OF_MESH = 16


class SurfaceFigures(NamedTuple):
    """What is measured of a placement on a surface; see :class:`~esh.engine.problem.report.Report`.

    Attributes:
        groups: Which bodies are measured together.
        errors: Coverage error of every class.
        whole: Of all bodies together.
        smallest: Smallest spacing over that of a hexagonal lattice; None where no two bodies are neighbors.
        closest: Smallest distance of neighbors [m].
        usual: Median distance to the nearest neighbor [m].
        overlaps: What of the footprints overlaps.
        covered: Sum of the footprints over the area where bodies may be.
        excess: Returns which part of the coverage error of a class is made where fixed bodies are more than its density asks for.
    """

    groups: GroupsByArea
    errors: list[float]
    whole: float
    smallest: float | None
    closest: float | None
    usual: float | None
    overlaps: Overlaps
    covered: float
    excess: Callable[[int], float]


def measure_on_surface(placement: Placement, launcher: Launcher, meshes: HeatMeshes | None) -> SurfaceFigures:
    """Measure a placement on a surface, by meshes that heat spreads on if there are any."""
    problem, surface = placement.problem, placement.problem.domain
    assert isinstance(surface, Surface)
    bodies, area = bodies_on_surface(placement, launcher), placement.area
    groups, footprints = groups_by_area(placement, area), footprints_of_placement(placement)
    beside = [_density_beside(placement, bodies, groups, k, area, footprints, launcher) for k in range(len(groups.own))]
    meshes = meshes or HeatMeshes(launcher, surface)
    errors, whole, excess = _coverage_errors(placement, bodies, meshes, groups, area, beside)
    share, _ = ground_on_surface(problem, surface, 0.0)
    taken = float(footprint_areas(placement, footprints, area).sum())
    covered = taken / (surface.area * max(share, 1e-9))
    smallest, closest, usual = _spacing(placement, bodies, launcher) or (None, None, None)
    overlaps = find_overlaps_on_surface(placement, bodies, launcher)
    return SurfaceFigures(groups, errors, whole, smallest, closest, usual, overlaps, covered, excess)


def _coverage_errors(
    placement: Placement,
    bodies: BodiesOnSurface,
    meshes: HeatMeshes,
    groups: GroupsByArea,
    area: np.ndarray,
    beside: Sequence[SurfaceDensity | None],
) -> tuple[list[float], float, Callable[[int], float]]:
    """Coverage errors of all classes, and of all bodies together; and what tells the ``excess`` of a class.

    ``beside`` are the densities of the groups beside larger bodies; None where there are none.
    """
    classes, n = placement.problem.classes, len(area)
    mesh, standing = meshes.of(n), [bodies.points.triangle[own] for own in groups.own]
    count, of_class = [len(own) for own in standing], bodies_by_class(placement.class_index, len(classes))

    def charges(group: int, on: HeatMesh, amount: np.ndarray) -> wp.array:
        own = of_class[groups.of_class[group]]
        of_group = np.where(groups.index[own] == group, amount[own], 0.0)
        return on.deposit.charges(bodies.triangle[own], bodies.barycentric[own], of_group)

    targets, of_all_groups, errors = [], [], []
    for group, total in enumerate(groups.total):
        body_class = classes[groups.of_class[group]]
        density = body_class.density_on if body_class.varies_on_surface else None
        targets.append(mesh.target(density, standing[group] if density else None))
        of_all_groups.append(charges(group, mesh, area))
        charge, target, coarser = of_all_groups[group], targets[group], meshes.of(_count_of_mesh(count[group], n))
        here = beside[group] or density
        if coarser is not mesh:
            charge = charges(group, coarser, area)
        if here is not density or coarser is not mesh:
            target = coarser.target(here, standing[group] if here else None)
        errors.append(coarser.error(charge, total, target, count[group]))

    def excess(k: int) -> float:
        # On the mesh of all: where a group has another one, its bodies are few and their errors alike on both.
        fixed, made = np.where(placement.fixed, area, 0.0), np.zeros(len(errors))
        for group in np.flatnonzero(np.equal(groups.of_class, k)).tolist():
            here = beside[group]
            target = targets[group] if here is None else mesh.target(here, standing[group])
            made[group] = mesh.excess(charges(group, mesh, fixed), groups.total[group], target, count[group])
        return groups.of_classes(made.tolist())[k]

    if len(errors) == 1:
        return errors, errors[0], excess
    target = mesh.mixed(targets, _shares(classes, groups))
    charge = mesh.mixed(of_all_groups, [1.0] * len(errors))
    return groups.of_classes(errors), mesh.error(charge, sum(groups.total), target, n), excess


def _shares(classes: Sequence[PreparedClass], groups: GroupsByArea) -> list[float]:
    """Return which share of all that is asked for each group is: that of its class, by what bodies take."""
    amount = np.array([sum((s.count or 0) * s.mean_area for s in c.sizes) for c in classes])
    of_class = (amount / amount.sum())[groups.of_class]
    return (of_class * (groups.total / np.bincount(groups.of_class, groups.total)[groups.of_class])).tolist()


def _density_beside(
    placement: Placement,
    bodies: BodiesOnSurface,
    groups: GroupsByArea,
    group: int,
    area: np.ndarray,
    footprints: BodyFootprints,
    launcher: Launcher,
) -> SurfaceDensity | None:
    """Density of a group at points, without the ground that large bodies take from it; None where hardly any or nearly all is."""
    taken = taken_ground(placement, launcher, groups, group, area, footprints)
    body_class = placement.problem.classes[groups.of_class[group]]
    if taken is None:
        return None

    def beside(points: PointsOnSurface) -> np.ndarray:
        return body_class.density_on(points) * taken.at(points)

    sample = bodies.points.surface.sample()
    enough = float(beside(sample).sum()) >= LEAST_FREE * float(body_class.density_on(sample).sum())
    return beside if enough else None


def _count_of_mesh(count: int, most: int) -> int:
    """For how many bodies the mesh is made on which ``count`` of ``most`` are measured."""
    while most // FEWER >= LEAST_OF_MESH * max(count, 1):
        most //= FEWER
    return most


def _spacing(placement: Placement, bodies: BodiesOnSurface, launcher: Launcher) -> tuple[float, float, float] | None:
    """Distances to the nearest body of the same sheet: smallest over the hexagonal spacing asked for there, smallest, median [m]."""
    problem, points, n = placement.problem, bodies.points, len(placement.position)
    surface = points.surface
    if n < 2:
        return None
    # A number for each, or one for all.
    number: np.ndarray | float = 0.0
    for c in problem.classes:
        asked = c.density_on(points) / c.density_on(surface.sample()).mean() if c.varies_on_surface else 1.0
        number = number + c.body_count / surface.area * asked
    # Where most have come to be where none are asked for, as many as there are on average.
    typical = float(np.median(number)) or n / surface.area
    unit = 1.0 / math.sqrt(typical)
    position = bodies.in_units(launcher, unit)
    grid = wp.HashGrid(CELLS, CELLS, CELLS, device=launcher.device)
    grid.build(position, NEIGHBORS)
    of_triangle, relations = sheets_of(surface, n, launcher)
    one_sheet = of_triangle.min() == of_triangle.max()
    sheet = of_all(np.int32(0), n) if one_sheet else of_triangle[points.triangle]
    related = 0
    if not one_sheet:
        sheet, related = relations.behind(sheet, int(of_triangle.max()) + 1)
    distance, nearest = launcher.empty(n, float), launcher.empty(n, wp.int32)
    launcher.launch(
        kernels_surface_spacing.find_nearest_body,
        n,
        [grid.id, position, bodies.normal, launcher.alike(sheet, wp.int32), related, NEIGHBORS],
        [distance, nearest],
        grain=GRAIN_OF_NEIGHBORS,
    )
    least, found = least_and_number(launcher, distance, NEIGHBORS)
    if not found:
        return None
    usual = median_of_least(launcher, distance, found) * unit
    if isinstance(number, np.ndarray):
        near = distance.numpy()
        there = near < NEIGHBORS
        # Beside the edge of a density some stand where next to none are asked for: the denser of two places counts.
        asked = np.maximum(number, number[nearest.numpy()])[there]
        asked = np.where(asked > NEXT_TO_NONE * typical, asked, typical)
        smallest = float((near[there] * unit * np.sqrt(asked)).min())
    else:
        smallest = least * unit * math.sqrt(number)
    return smallest / HEXAGONAL_SPACING, least * unit, usual
