"""From positions to the figures of a report."""

from __future__ import annotations

import numpy as np

from .contact import overlap_count
from .density import box_integrals, sample_density
from .device import Launcher
from .placement import Placement
from .problem import Problem
from .quality import coverage_error, smallest_spacing
from .report import ClassReport, Report, SizeReport

__all__ = ["measure", "survey"]

# Cells along the longer side on which the typical spacing and the space that bodies may use are measured.
SURVEY_CELLS = 256


def survey(problem: Problem) -> np.ndarray:
    """Asked number of bodies in every cell of a coarse grid over the domain, shape ``[rows, columns]``, float64."""
    size = problem.domain.size
    rows, columns = (max(1, round(SURVEY_CELLS * length / max(size))) for length in size[::-1])
    return np.sum([c.body_count * box_integrals(c.density_image, (rows, columns)) for c in problem.classes], axis=0)


def measure(placement: Placement, launcher: Launcher) -> Report:
    """Measure a placement.

    Args:
        placement: What was placed; its own report is not looked at.
        launcher: Where to count neighbours.

    Returns:
        The report of a run without steps; whoever ran them adds steps, seconds and whether they converged.
    """
    problem, position = placement.problem, placement.position
    domain = problem.domain
    class_index, size_index = placement.class_index, placement.size_index
    area = placement.area
    number_density = np.zeros(len(position))
    for c in problem.classes:
        share = sample_density(c.density_image, position, domain.size) / c.density_image.mean(dtype=np.float64)
        number_density += c.body_count / domain.area * share
    targets = [(c.density_image, sum((s.count or 0) * s.mean_area for s in c.sizes)) for c in problem.classes]
    covered = float(area.sum() / (domain.area * np.mean(survey(problem) > 0.0)))
    notes = [note for c in problem.classes for note in c.notes]
    if covered > 1.0:
        notes.append(
            f"the footprints add up to {covered:.0%} of the space where they may be: they cannot fit without overlap; "
            "lower the counts or the areas"
        )
    overlaps = overlap_count(
        position, area, domain, launcher, angle=placement.angle, length=placement.length, width=placement.width
    )
    if problem.avoid_overlap and overlaps:
        notes.append(
            f"{overlaps} pairs of footprints still overlap: the space where they may be cannot hold them all; lower the counts or "
            "the areas"
        )
    return Report(
        steps=0,
        converged=False,
        seconds=0.0,
        device=str(launcher.device.alias),
        coverage_error=coverage_error(position, area, targets, domain),
        smallest_spacing=smallest_spacing(position, number_density, domain, launcher),
        overlaps=overlaps,
        covered=covered,
        classes=tuple(
            ClassReport(
                c.name,
                coverage_error(position[class_index == i], area[class_index == i], c.density_image, domain),
                tuple(
                    SizeReport(s.name, s.mean_area, s.count or 0, int(((class_index == i) & (size_index == j)).sum()))
                    for j, s in enumerate(c.sizes)
                ),
            )
            for i, c in enumerate(problem.classes)
        ),
        notes=tuple(notes),
    )
