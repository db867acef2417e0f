"""Whether a problem fits into this machine's memory, asked before anything is allocated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from ..field.field_meshes import charge_mesh, cutoff_of, target_mesh
from ..field.mirrored_field import COPIES
from ..problem.clumps import clump_size_of, crowding_of, memory_of_clumps, occupied
from ..problem.domain import Domain
from ..problem.given_values import show
from ..problem.interaction import LEVELS, most_levels
from ..problem.machine_memory import format_bytes, machine_memory
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import Size
from ..problem.surface import Surface
from ..problem.validation import MOST_BODIES
from ..space.asked_counts import typical_spacing
from ..space.comparison_grid import comparison_cells
from ..space.mesh_layout import MeshLayout
from ..space.space import Space
from .occupied_part import occupied_part

__all__ = ["check_counts", "check_memory", "required_memory"]

# Python, NumPy, Warp and its compiled kernels. Measured is the peak resident size of runs of a few bodies: 226 MB, and 280 MB where
# kernels are compiled first. What else lives in the process, like Blender, is not the run's.
BYTES_FIXED = 240_000_000
# Tables, poses, footprints, sorted copies and the report's arrays: what is left of the peaks of runs from 10,000 to 1,000,000 bodies.
BYTES_PER_BODY = 260
BYTES_PER_CHARGE = 180
# Of outlines that are parted: tables, and pairs that are near; and every corner, as it is turned and as it might be.
BYTES_PER_BODY_IN_CONTACT = 500
BYTES_PER_CORNER = 64
# Of charges that are guided meanwhile: a second field.
BYTES_PER_CHARGE_GUIDED = 100
# A body's weight as a group sees it.
BYTES_PER_CHARGE_AND_GROUP = 4
# Of a mesh, per node and group: charge, potential, attraction and length of a step.
BYTES_PER_NODE_AND_GROUP = 8 + 4 + 4 + 4
# Per pixel of a density: what was given, what is followed, the device's copy; and what is worked out for one image after the other.
BYTES_PER_PIXEL = 4 + 4 + 4
BYTES_PER_PIXEL_MEANWHILE = 8
# The way out of pixels that are empty, and while that is found; small images are taken to have some.
BYTES_PER_EMPTY_PIXEL = 8
BYTES_PER_EMPTY_PIXEL_MEANWHILE = 6
MANY_PIXELS = 2**20
# While the directions that lines have by a density are found: its tensors, in float64.
BYTES_PER_PIXEL_OF_DIRECTIONS = 56
# Of the longest side of an image: the weights of its pixels at the nodes of a mesh. Much only where it is a single row.
BYTES_PER_PIXEL_OF_A_SIDE = 170
# Per cell of the report's grid: charges, their difference from the target, and shares.
BYTES_PER_CELL = 8 + 4 + 4
# The start's pyramid: shares, and their sums in float64 on all levels.
BYTES_PER_CURVE_CELL = 4 + 8 * 4 / 3
# On a surface: tiles, nodes and their lists, and the report's finite elements; measured with 100,000 bodies on 20,000 triangles.
BYTES_PER_CHARGE_ON_SURFACE = 3800
BYTES_PER_TRIANGLE = 1200
# What bodies alone take beyond this is refused without a look at anything else [bytes].
MOST_FORETOLD = 10**14


def required_memory(problem: Problem) -> int:
    """Estimate the memory that solving ``problem`` takes at its peak [bytes].

    What bodies take, exact for counts of any size; images; and the meshes, which are laid out here as they will be.
    """
    of_bodies = BYTES_FIXED + problem.charge_count * _bytes_per_charge(problem)
    if of_bodies > MOST_FORETOLD or problem.charge_count > MOST_BODIES:
        return of_bodies
    if isinstance(problem.domain, Surface):
        triangles = len(problem.domain.triangle)
        return of_bodies + BYTES_PER_CHARGE_ON_SURFACE * problem.charge_count + BYTES_PER_TRIANGLE * triangles
    # Clumps are made before anything else.
    of_clumps = max((_required_for_clumps(c, problem.rectangle) for c in problem.classes if c.clustering), default=0)
    return max(of_bodies + _required_for_images(problem) + _required_for_meshes(problem), BYTES_FIXED + of_clumps)


def _required_for_clumps(body_class: PreparedClass, domain: Domain) -> int:
    """Estimate the memory that the clumps of a class took when they were made [bytes]."""
    image = body_class.density_image
    # It has its clumps by now.
    share = min(occupied(image) * (1.0 + crowding_of(body_class.clustering)), 1.0)
    size = clump_size_of(body_class.clump_size, domain, body_class.body_count, share)
    return memory_of_clumps(image.shape, size, domain)


def _required_for_images(problem: Problem) -> int:
    """Estimate the memory that a problem's densities take [bytes]."""
    images = _distinct_images(problem)
    empty = [image.size for image in images if image.size < MANY_PIXELS or not image.min() > 0.0]
    of_lines = [c.density_image.size for c in problem.classes if any(size.line is not None for size in c.sizes)]
    directions = BYTES_PER_PIXEL_OF_DIRECTIONS * max(of_lines, default=0) + sum(
        8 * c.density_image.size + (line.length.nbytes if isinstance(line.length, np.ndarray) else 0)
        for c in problem.classes
        for line in (size.line for size in c.sizes)
        if line is not None
    )
    side = max(max(image.shape) for image in images)
    meanwhile = BYTES_PER_PIXEL_MEANWHILE * max(image.size for image in images) + BYTES_PER_PIXEL_OF_A_SIDE * side
    way_out = BYTES_PER_EMPTY_PIXEL * sum(empty) + BYTES_PER_EMPTY_PIXEL_MEANWHILE * max(empty, default=0)
    return BYTES_PER_PIXEL * sum(image.size for image in images) + meanwhile + way_out + directions


def _required_for_meshes(problem: Problem) -> int:
    """What the meshes of the field and the grid of the report take."""
    groups = _group_count(problem)
    images = _distinct_images(problem)
    uniform = all(image.min() == image.max() for image in images)
    classes = len(problem.classes)
    unit = math.sqrt(problem.rectangle.area / problem.charge_count)
    space = Space.of(problem.rectangle, unit)
    spacing, charges = typical_spacing(problem) / unit, problem.charge_count
    part = occupied_part(problem)
    if part is not None:
        space = Space(part.extent(space.size))
    elif problem.rectangle.mirrored:
        # The mesh lies over the images beyond the borders as well.
        space, charges = space.with_mirror_images(), COPIES * charges
    coarse = charge_mesh(space, spacing, charge_count=charges, group_count=groups, on_gpu=False)
    fine = target_mesh(space, spacing, charge_count=charges, cutoff=cutoff_of(coarse), on_gpu=False, uniform=uniform)
    of_coarse = (
        groups * (BYTES_PER_NODE_AND_GROUP * coarse.node_count + _halves(coarse)) + 4 * classes * coarse.node_count
    )
    # While it is made; the report comes when that is over.
    rows = min(_rows_of_targets(problem), groups)
    of_fine = 4 * (len(images) + rows) * fine.node_count + rows * _halves(fine)
    kept_of_fine = 4 * rows * fine.node_count
    longer = max(problem.rectangle.size)
    cells = comparison_cells(problem.rectangle, problem.body_count)
    shape = [max(1.0, cells * length / longer) for length in problem.rectangle.size]
    # A blur of a spacing widens the grid by a few of them, that of single bodies doubles it.
    padding = 1.0 if problem.rectangle.periodic else 1.35 if problem.body_count > 500 else 4.0
    of_report = shape[0] * shape[1] * (BYTES_PER_CELL + 8.0 * padding)
    order = math.log2(math.sqrt(8.0 * max(c.body_count for c in problem.classes)) + 1.0)
    curve = 4.0 ** min(max(math.ceil(order), 3), 12) * BYTES_PER_CURVE_CELL
    of_field = of_coarse + _influence(coarse)
    while_made = of_fine + _influence(fine)
    # Where outlines are parted there may be a second field for a while.
    of_guidance = of_field + while_made if _has_outlines_with_corners(problem) else 0.0
    return int(of_field + max(while_made, kept_of_fine + max(of_report, curve, of_guidance)))


def _has_outlines_with_corners(problem: Problem) -> bool:
    outlines = (o for c in problem.classes for size in c.sizes for o in size.outlines)
    return problem.avoid_overlap and any(len(outline.corners) > 1 for outline in outlines)


def _rows_of_targets(problem: Problem) -> int:
    """Classes at most whose targets are no multiples of each other: those of one image, and as many bodies of the same areas, are."""
    alike = [
        (_content(c.density_image), tuple((size.count, size.mean_area) for size in c.sizes)) for c in problem.classes
    ]
    return len(set(alike))


def _halves(layout: MeshLayout) -> int:
    """Transformed rows of one mesh: real and imaginary halves."""
    return 4 * layout.shape[0] * (layout.padded[1] + 16)


def _influence(layout: MeshLayout) -> int:
    """The kernel's transform, and what it is made of."""
    return 4 * layout.padded[0] * layout.padded[1]


def _group_count(problem: Problem) -> int:
    sizes = [size for body_class in problem.classes for size in body_class.sizes]
    return sum(most_levels(size) for size in sizes)


def _bytes_per_charge(problem: Problem) -> int:
    per_charge = BYTES_PER_CHARGE + BYTES_PER_CHARGE_AND_GROUP * _group_count(problem)
    if _has_outlines_with_corners(problem):
        per_charge += BYTES_PER_CHARGE_GUIDED
    if not isinstance(problem.domain, Surface) and problem.rectangle.mirrored:
        per_charge *= COPIES
    # Lines have several charges each, dots one.
    per_body = BYTES_PER_BODY
    if problem.avoid_overlap:
        outlines = [o for c in problem.classes for size in c.sizes for o in size.outlines]
        most = max((len(outline.corners) for outline in outlines), default=1)
        per_body += BYTES_PER_BODY_IN_CONTACT + BYTES_PER_CORNER * most
    return per_charge + -(-per_body * problem.body_count // max(problem.charge_count, 1))


def _distinct_images(problem: Problem) -> list[np.ndarray]:
    return list({_content(c.density_image): c.density_image for c in problem.classes}.values())


def _content(image: np.ndarray) -> float | int:
    """What tells an image from others: a number of its own, or that of which a uniform one is full."""
    return float(image[0, 0]) if image.size == 1 else id(image)


def check_memory(problem: Problem) -> None:
    """Refuse a problem that this machine cannot hold.

    Raises:
        ProblemError: Naming the largest count, what all bodies would take and what the machine has.
    """
    available = machine_memory()
    if available is not None:
        _check_images(problem, available)
    required = required_memory(problem)
    fits = available is None or required <= available
    if fits and problem.body_count <= MOST_BODIES:
        return
    of_bodies = problem.charge_count * _bytes_per_charge(problem)
    if not fits and available is not None and required - of_bodies - BYTES_FIXED > max(of_bodies, BYTES_FIXED):
        raise ProblemError(
            f"solving this problem would take about {format_bytes(required)} of memory, most of it for the meshes of its "
            f"{_group_count(problem)} groups (sizes of classes, {LEVELS} for a range of areas), and this machine has "
            f"{format_bytes(available)}; use fewer of them, or a less elongated domain",
            Refusal(Reason.MEMORY_FOR_GROUPS, required, available),
        )
    sizes = [(k.name, size) for k in problem.classes for size in k.sizes]
    _refuse_counts(sizes, problem.body_count, required, None if fits else available, _bytes_per_charge(problem))


def check_counts(sizes: Sequence[tuple[str, Size]], avoid_overlap: bool) -> None:
    """Refuse counts that this machine cannot hold, before anything is made for every body: outlines, for example.

    Args:
        sizes: Of all classes, each with the name of its class, with their counts.
        avoid_overlap: Whether bodies push each other apart.

    Raises:
        ProblemError: As :func:`check_memory`, which knows more, will do for the whole problem.
    """
    available = machine_memory()
    bodies = sum(size.count or 0 for _, size in sizes)
    per_body = (
        BYTES_PER_BODY + BYTES_PER_CHARGE + (BYTES_PER_BODY_IN_CONTACT + BYTES_PER_CORNER if avoid_overlap else 0)
    )
    required = BYTES_FIXED + per_body * bodies
    fits = available is None or required <= available
    if not fits or bodies > MOST_BODIES:
        _refuse_counts(sizes, bodies, required, None if fits else available, per_body)


def _refuse_counts(
    sizes: Sequence[tuple[str, Size]], bodies: int, required: int, available: int | None, per_body: int
) -> NoReturn:
    """Raise ProblemError, which names the largest count; ``available`` is None where numbers run out before memory does."""
    class_name, size = max(sizes, key=lambda pair: pair[1].count or 0)
    alone = sum(name == class_name for name, _ in sizes) == 1
    who = (class_name, "" if alone else size.name)
    sentence = (
        f'`count` of size "{size.name}" of class "{class_name}" is too large ({show(size.count)}): '
        f"{show(bodies)} bodies in all would take about {format_bytes(required)} of memory"
    )
    if available is not None:
        most = min(max(available - BYTES_FIXED, 0) // per_body, MOST_BODIES)
        raise ProblemError(
            f"{sentence}, this machine has {format_bytes(available)}, enough for about {_rounded(most)}",
            Refusal(Reason.MEMORY_FOR_BODIES, bodies, float(f"{most:.1e}"), who),
        )
    raise ProblemError(
        f"{sentence}, and at most {MOST_BODIES} bodies can be placed",
        Refusal(Reason.TOO_MANY_BODIES, bodies, MOST_BODIES, who),
    )


def _check_images(problem: Problem, available: int) -> None:
    """Refuse densities that the machine cannot hold before they are looked at."""
    required = BYTES_FIXED + _required_for_images(problem)
    if required <= available:
        return
    largest = max(problem.classes, key=lambda c: c.density_image.size)
    height, width = largest.density_image.shape
    raise ProblemError(
        f'`density` of class "{largest.name}" is too large ({width} x {height} pixels): the densities would take about '
        f"{format_bytes(required)} of memory, and this machine has {format_bytes(available)}; use smaller images",
        Refusal(Reason.MEMORY_FOR_DENSITIES, required, available, (largest.name, "")),
    )


def _rounded(count: int) -> str:
    """Two digits are all that the estimate is worth."""
    return f"{float(f'{count:.1e}'):,.0f}"
