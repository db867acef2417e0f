"""From positions to the figures of a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..heat.heat_mesh import HeatMeshes
from ..problem.body_footprints import DISC, BodyFootprints
from ..problem.cover import share_of_ground
from ..problem.notes_on_settings import notes_on_settings
from ..problem.of_bodies import is_same
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..problem.prepared_class import PreparedClass
from ..problem.report import ClassReport, Report, SizeReport
from ..problem.surface import Surface
from ..space.support import images_for_kernels
from . import kernels_spacing
from .bodies_on_surface import bodies_on_surface
from .coverage import Coverage
from .errors_of_few import ErrorsExplained, explain_errors
from .footprint_areas import footprint_areas
from .groups_by_area import bodies_by_class, groups_by_area
from .measured_bodies import MeasuredBodies, measured_bodies
from .notes import (
    notes_on_distant_outlines,
    notes_on_fixed,
    notes_on_fixed_places,
    notes_on_overlaps,
    notes_on_places,
    notes_on_what_is_not_parted,
    solid_bodies,
)
from .out_of_place import OutOfPlace, out_of_place
from .overlaps import (
    Overlaps,
    find_overlaps_on_surface,
    overlaps_of,
    overlaps_of_fixed,
    overlaps_of_fixed_on_surface,
)
from .spacing import Spacing, measure_spacing
from .surface_measurement import measure_on_surface
from .surface_out_of_place import out_of_place_on_surface
from .taken_ground import taken_ground

__all__ = ["Parting", "measure"]

# Distances are known in single precision: what is so many times as large is larger.
CLEARLY = 1.001
INWARDS = "a closed mesh looks inwards: bodies lie on its inner side; flip its normals if the outer one is meant"
REPEATED = "faces of two meshes lie in one place: twice as many bodies stand there; leave one out if it is a copy"


class Parting(StrEnum):
    """Whether it was tried to part bodies that are to keep apart."""

    DONE = "done"
    # Nobody has asked for it yet.
    TO_COME = "to come"
    # Whoever ran a problem has stopped before.
    STOPPED = "stopped"


def measure(
    placement: Placement, launcher: Launcher, heat: HeatMeshes | None = None, parting: Parting = Parting.DONE
) -> Report:
    """Measure a placement.

    Args:
        placement: What was placed; a report that it has is not looked at.
        launcher: Where to count neighbors.
        heat: Meshes of its surface that heat spreads on, if known.
        parting: Whether it was tried to part its bodies, so that notes say what helps.

    Returns:
        The report of a run without steps; whoever ran them adds steps, seconds and whether they converged.
    """
    problem, domain = placement.problem, placement.problem.domain
    if isinstance(domain, Surface):
        return _report_on_surface(placement, launcher, heat, parting)
    area = problem.areas_as_outlined(problem.shared_areas(), placement.variant, placement.scale)
    has_lines = any(size.line is not None for c in problem.classes for size in c.sizes) and placement.width.any()
    axes = (placement.angle, placement.length) if has_lines else ()
    bodies = measured_bodies(launcher, domain, placement.position, *axes)
    footprints = footprints_of_placement(placement)
    errors, whole, explained = _coverage_errors(placement, bodies, area, footprints)
    ground = domain.area * share_of_ground([c.density_image for c in problem.classes])
    covered = float(footprint_areas(placement, footprints, area).sum() / ground)
    spacing = measure_spacing(bodies, _number_density(bodies, problem.classes))
    overlaps = _overlaps(placement, launcher, footprints, bodies, spacing)
    notes = notes_on_settings(problem) + explained.notes
    misplaced = out_of_place(placement, launcher, footprints)
    among_solid = _among_solid(
        placement, overlaps, lambda some: overlaps_of(placement, launcher, footprints, bodies.position, some)
    )
    notes += _notes_on_contact(placement, overlaps, among_solid, covered, misplaced, parting)
    of_fixed = Overlaps(0)
    if problem.avoid_overlap and np.count_nonzero(placement.fixed) > 1:
        of_fixed = overlaps_of_fixed(placement, launcher, footprints)
    notes += notes_on_fixed(of_fixed)
    if placement.fixed.any():
        # As if only the others were.
        notes += notes_on_fixed_places(out_of_place(replace(placement, fixed=~placement.fixed), launcher, footprints))
    apart = [spacing]
    if len(problem.classes) > 1:
        apart = [_spacing_of_class(placement, index, launcher) for index in range(len(problem.classes))]
    return Report(
        steps=0,
        converged=False,
        seconds=0.0,
        device=str(launcher.device.alias),
        coverage_error=whole,
        smallest_spacing=spacing and spacing.smallest,
        closest=spacing and spacing.closest,
        usual=spacing and spacing.usual,
        order=spacing and spacing.order,
        overlaps=overlaps.count,
        deepest_overlap=overlaps.deepest,
        deepest_pair=overlaps.pair,
        deepest_place=overlaps.place,
        overlapping=overlaps.bodies,
        in_obstacles=misplaced.in_obstacles,
        deepest_in_obstacle=misplaced.deepest,
        beyond_border=misplaced.beyond_border,
        farthest_beyond_border=misplaced.farthest,
        fixed_overlaps=of_fixed.count,
        covered=covered,
        classes=_class_reports(placement, errors, explained.kept_off, apart),
        notes=tuple(notes),
    )


def _coverage_errors(
    placement: Placement, bodies: MeasuredBodies, area: np.ndarray, footprints: BodyFootprints
) -> tuple[list[float], float, ErrorsExplained]:
    """Coverage errors of the classes and of all bodies together, and why they are large."""
    groups, classes = groups_by_area(placement, area), placement.problem.classes
    coverage = Coverage(bodies, area, groups.index)
    targets = [(c.density_image, sum((s.count or 0) * s.mean_area for s in c.sizes)) for c in classes]
    beside = []
    for group, c in enumerate(groups.of_class):
        image, charge = targets[c]
        taken = taken_ground(placement, bodies.launcher, groups, group, area, footprints)
        beside.append([(image if taken is None else coverage.beside(image, taken), charge)])
    of_groups = [coverage.error(target, group) for group, target in enumerate(beside)]
    whole = coverage.error(targets) if len(of_groups) > 1 else of_groups[0]

    def excess(k: int) -> float:
        made = [
            coverage.excess(placement.fixed, target, group) if groups.of_class[group] == k else 0.0
            for group, target in enumerate(beside)
        ]
        return groups.of_classes(made)[k]

    errors = groups.of_classes(of_groups)
    return errors, whole, explain_errors(placement, area, groups, errors, whole, excess)


def _overlaps(
    placement: Placement,
    launcher: Launcher,
    footprints: BodyFootprints,
    bodies: MeasuredBodies,
    spacing: Spacing | None,
) -> Overlaps:
    """What overlaps; looked for only where some body is no disc, or the closest two are no farther apart than the largest is wide."""
    if spacing is not None and is_same(footprints.shape) and footprints.shape[0] == DISC:
        widest = 2.0 * float(footprints.factor[0] if is_same(footprints.factor) else footprints.factor.max())
        if widest * CLEARLY < min(spacing.closest, spacing.reach):
            return Overlaps(0)
    return overlaps_of(placement, launcher, footprints, bodies.position)


def _among_solid(placement: Placement, overlaps: Overlaps, look: Callable[[np.ndarray], Overlaps]) -> Overlaps:
    """What overlaps of solid bodies among themselves where nothing keeps them apart, by what looks at some bodies, shape ``[n]``."""
    if placement.problem.avoid_overlap or not overlaps.count:
        return overlaps
    solid = solid_bodies(placement.problem)
    if solid.all():
        return overlaps
    return look(solid) if solid.any() else Overlaps(0)


def _notes_on_contact(
    placement: Placement,
    overlaps: Overlaps,
    among_solid: Overlaps,
    covered: float,
    misplaced: OutOfPlace,
    parting: Parting,
) -> list[str]:
    """What is to be said of bodies that lie on each other or where they may not."""
    parted = parting is Parting.DONE
    notes = notes_on_overlaps(placement, overlaps, among_solid, covered, parted)
    notes += notes_on_places(placement.problem, misplaced, parted)
    if not parted:
        notes += notes_on_what_is_not_parted(placement.problem, overlaps, misplaced, parting is Parting.STOPPED)
    return notes


def _report_on_surface(placement: Placement, launcher: Launcher, heat: HeatMeshes | None, parting: Parting) -> Report:
    """What :func:`measure` returns, for a placement on a surface."""
    found = measure_on_surface(placement, launcher, heat)
    notes = notes_on_settings(placement.problem)
    surface = placement.problem.domain
    if isinstance(surface, Surface) and surface.looks_inwards:
        notes.append(INWARDS)
    if isinstance(surface, Surface) and surface.repeated:
        notes.append(REPEATED)
    explained = explain_errors(placement, placement.area, found.groups, found.errors, found.whole, found.excess)
    notes += explained.notes
    overlaps = found.overlaps
    misplaced = out_of_place_on_surface(placement, launcher)
    among_solid = _among_solid(
        placement,
        overlaps,
        lambda some: find_overlaps_on_surface(placement, bodies_on_surface(placement, launcher), launcher, some),
    )
    notes += _notes_on_contact(placement, overlaps, among_solid, found.covered, misplaced, parting)
    notes += notes_on_distant_outlines(placement.problem)
    of_fixed = Overlaps(0)
    if placement.problem.avoid_overlap and np.count_nonzero(placement.fixed) > 1:
        of_fixed = overlaps_of_fixed_on_surface(placement, launcher)
    notes += notes_on_fixed(of_fixed)
    if placement.fixed.any():
        notes += notes_on_fixed_places(out_of_place_on_surface(placement, launcher, fixed=True))
    return Report(
        steps=0,
        converged=False,
        seconds=0.0,
        device=str(launcher.device.alias),
        coverage_error=found.whole,
        smallest_spacing=found.smallest,
        closest=found.closest,
        usual=found.usual,
        overlaps=overlaps.count,
        deepest_overlap=overlaps.deepest,
        deepest_pair=overlaps.pair,
        deepest_place=overlaps.place,
        overlapping=overlaps.bodies,
        in_obstacles=misplaced.in_obstacles,
        deepest_in_obstacle=misplaced.deepest,
        fixed_overlaps=of_fixed.count,
        covered=found.covered,
        classes=_class_reports(placement, found.errors, explained.kept_off),
        notes=tuple(notes),
    )


def _class_reports(
    placement: Placement, errors: list[float], kept_off: Sequence[int], apart: Sequence[Spacing | None] = ()
) -> tuple[ClassReport, ...]:
    problem, class_index, size_index = placement.problem, placement.class_index, placement.size_index
    return tuple(
        ClassReport(
            c.name,
            errors[i],
            tuple(
                SizeReport(s.name, s.mean_area, s.count or 0, placed, problem.fixed.number_of(i, number))
                for number, (s, placed) in enumerate(zip(c.sizes, _placed(size_index[of_class]), strict=True))
            ),
            *_of_spacing(apart[i] if apart else None),
            kept_off=i in kept_off,
        )
        for i, (c, of_class) in enumerate(
            zip(problem.classes, bodies_by_class(class_index, len(problem.classes)), strict=True)
        )
    )


def _placed(size_index: np.ndarray) -> list[int]:
    """How many bodies there are of every size, which come one size after the other."""
    last = int(size_index[-1]) if len(size_index) else -1
    return np.diff(np.searchsorted(size_index, np.arange(last + 2, dtype=size_index.dtype))).tolist()


def _of_spacing(spacing: Spacing | None) -> tuple[float | None, float | None]:
    """Smallest distance over the hexagonal spacing, and order."""
    return (None, None) if spacing is None else (spacing.smallest, spacing.order)


def _spacing_of_class(placement: Placement, index: int, launcher: Launcher) -> Spacing | None:
    """How far the bodies of a class are apart, beside the spacing of the class alone."""
    own = bodies_by_class(placement.class_index, index + 1)[index]
    bodies = measured_bodies(launcher, placement.problem.rectangle, placement.position[own])
    return measure_spacing(bodies, _number_density(bodies, placement.problem.classes[index : index + 1]))


def _number_density(bodies: MeasuredBodies, classes: Sequence[PreparedClass]) -> wp.array:
    """Number of bodies of some classes per square unit that is asked for at every body."""
    images = [c.density_image for c in classes]
    per_pixel = [
        c.body_count / (bodies.space.area * float(image.mean(dtype=np.float64)))
        for c, image in zip(classes, images, strict=True)
    ]
    result = bodies.launcher.empty(bodies.count, float)
    bodies.launcher.launch(
        kernels_spacing.find_number_density,
        bodies.count,
        [
            bodies.pose,
            bodies.launcher.array(np.array(per_pixel), float),
            images_for_kernels(bodies.launcher, images, bodies.space.size, to_support=False),
            wp.vec2(*bodies.space.size),
        ],
        [result],
    )
    return result
