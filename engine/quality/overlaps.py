"""Which outlines of a placement overlap, how deep and where: measured on what was placed, with nothing taken from contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.domain import Domain
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..space.space import Space
from . import kernels_overlaps

__all__ = ["TOLERANCE", "Overlaps", "find_overlaps", "overlaps_from", "overlaps_of"]

# Outlines that touch do not overlap: this share of the narrower one's width is not seen.
TOLERANCE = 1e-3
# No body's overlaps are counted beyond this: footprints many times larger than the space would have n² of them.
MOST_OVERLAPS_PER_BODY = 200
# Bodies that are named.
MOST_NAMED = 10_000
# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
# Parts in which bodies are sorted into cells on a GPU; threads of a processor have one each.
PARTS_ON_GPU = 4096
# Periods to either side in which images of a body are looked for; of one that spans more of them, not all overlaps are found.
MOST_IMAGES = 4


@dataclass(frozen=True)
class Overlaps:
    """What overlaps.

    Attributes:
        count: Pairs of bodies whose outlines lie in each other by more than 1e-3 of the narrower one's width; a lower bound where a
            body overlaps more than 200 others.
        deepest: How deep the deepest of them is [m]: the shortest way that parts it.
        pair: The bodies of that pair, None where nothing overlaps.
        place: The middle between the two [m]: x and y, and z on a surface.
        bodies: Bodies that overlap others, those that lie deepest in another first, at most 10,000.
    """

    count: int
    deepest: float = 0.0
    pair: tuple[int, int] | None = None
    place: tuple[float, ...] | None = None
    bodies: tuple[int, ...] = ()


def overlaps_of(placement: Placement, launcher: Launcher, footprints: BodyFootprints | None = None) -> Overlaps:
    """Return what overlaps in a placement: the outlines themselves, without the room that they keep from others.

    Where that room is below 1 they may overlap as far as it lets them, which does not count. ``footprints`` are the placement's, where
    somebody has them already.
    """
    footprints = footprints or footprints_of_placement(placement)
    smaller = np.minimum(footprints.room, 1.0)
    return find_overlaps(
        footprints,
        placement.position,
        placement.angle,
        placement.length,
        placement.width,
        placement.problem.rectangle,
        launcher,
        smaller=smaller,
        fixed=placement.fixed,
        bends=placement.bends,
        tilt=footprints.tilts(placement.id, placement.problem.seed),
    )


def find_overlaps(
    footprints: BodyFootprints,
    position: np.ndarray,
    angle: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    domain: Domain,
    launcher: Launcher,
    *,
    smaller: np.ndarray | None = None,
    fixed: np.ndarray | None = None,
    bends: np.ndarray | None = None,
    tilt: np.ndarray | None = None,
) -> Overlaps:
    """Return what overlaps.

    Args:
        footprints: Outlines of the bodies.
        position: Where these are [m], shape ``[n, 2]``.
        angle: How they are turned [rad], shape ``[n]``.
        length: Lengths of the axes of lines [m], shape ``[n]``.
        width: Thicknesses of lines [m], shape ``[n]``.
        domain: The domain.
        launcher: Where to count.
        smaller: Factor on every outline, at most 1, shape ``[n]``.
        fixed: Whether a body is fixed, shape ``[n]``; pairs of such do not count, which no run can part.
        bends: Points along lines that bend [m], see :class:`~esh.engine.problem.placement.Placement`; capsules are bent as they are.
        tilt: How far outlines lean over, see :meth:`.body_footprints.BodyFootprints.tilts`.
    """
    n = len(position)
    if n == 0:
        return Overlaps(0)
    device = launcher.device
    slope = footprints.slopes_at(position, domain.size, tilt)
    factor = np.ones(n) if smaller is None else smaller
    bent = _bent_lines(footprints, position, bends)
    shapes = _laid_out(footprints, position, angle, length, width, factor, slope, bent, launcher)
    stays = np.zeros(n, np.int32) if fixed is None else fixed.astype(np.int32)
    shapes.fixed = wp.array(stays, dtype=wp.int32, device=device)
    reach = shapes.reach.numpy()
    lattice = _lattice(shapes, reach, domain, launcher)
    space = Space.of(domain)
    found, deepest, partner = (launcher.empty(n, kind) for kind in (wp.int32, wp.float64, wp.int32))
    launcher.launch(
        kernels_overlaps.count_overlaps,
        n,
        [
            shapes,
            lattice,
            wp.vec2i(*space.images_within(2.0 * float(reach.max()), MOST_IMAGES)),
            TOLERANCE,
            MOST_OVERLAPS_PER_BODY,
        ],
        [found, deepest, partner],
        grain=GRAIN_OF_NEIGHBORS,
    )
    depth = deepest.numpy()
    one = int(np.argmax(depth))
    other = int(partner.numpy()[one])
    middle = space.wrapped(position[one] + 0.5 * space.shortest(position[other] - position[one]))
    return overlaps_from(found.numpy(), depth, (one, other), middle)


def overlaps_from(found: np.ndarray, depth: np.ndarray, pair: tuple[int, int], middle: np.ndarray) -> Overlaps:
    """Return what was found of every body.

    Args:
        found: With how many others each overlaps, shape ``[n]``.
        depth: How deep the deepest of these is [m], shape ``[n]``; 0 where there is none.
        pair: The two bodies that lie deepest in each other.
        middle: The middle between them [m], shape ``[2]``, or ``[3]`` on a surface.
    """
    count = int(found.sum(dtype=np.int64)) // 2
    if count == 0:
        return Overlaps(0)
    lying = np.flatnonzero(depth > 0.0)
    named = lying[np.argsort(-depth[lying], kind="stable")[:MOST_NAMED]]
    one, other = sorted(pair)
    return Overlaps(count, float(depth.max()), (one, other), tuple(middle.tolist()), tuple(named.tolist()))


class _BentLines(NamedTuple):
    """Lines that are bent: their bodies ``[m]``, where the points of each begin ``[m + 1]``, and the way to these ``[points, 2]``."""

    body: np.ndarray
    start: np.ndarray
    point: np.ndarray


def _bent_lines(footprints: BodyFootprints, position: np.ndarray, bends: np.ndarray | None) -> _BentLines:
    if bends is None:
        return _BentLines(np.zeros(0, np.int32), np.zeros(1, np.int32), np.zeros((0, 2)))
    there = np.isfinite(bends).all(axis=2)
    count = np.where(footprints.shape == CAPSULE, there.sum(axis=1), 0)
    body = np.flatnonzero(count >= 2)
    start = np.concatenate([[0], np.cumsum(count[body])])
    point = (bends[body] - position[body, None])[there[body]]
    return _BentLines(body.astype(np.int32), start.astype(np.int32), point)


def _laid_out(
    footprints: BodyFootprints,
    position: np.ndarray,
    angle: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    smaller: np.ndarray,
    slope: np.ndarray | None,
    bent: _BentLines,
    launcher: Launcher,
) -> kernels_overlaps.Shapes:
    """What lies where, but for what is fixed; without slopes all lies in horizontal planes."""
    device, n = launcher.device, len(position)

    def numbers(values: np.ndarray) -> wp.array:
        return launcher.array(values, wp.float64)

    outlines = footprints.shapes
    cores = [*(outline.corners for outline in outlines), np.array([[-1.0, 0.0], [1.0, 0.0]])]
    start = np.concatenate([[0], np.cumsum([len(core) for core in cores])]).astype(np.int32)
    shape = np.where(footprints.shape == CAPSULE, len(outlines), footprints.shape).astype(np.int32)
    given = kernels_overlaps.Given()
    given.shape = launcher.array(shape, wp.int32)
    given.factor, given.angle, given.length = numbers(footprints.factor), numbers(angle), numbers(length)
    given.width, given.smaller = numbers(width), numbers(smaller)
    given.start = wp.array(start, dtype=wp.int32, device=device)
    given.corner = wp.array(np.concatenate(cores), dtype=wp.vec2d, device=device)
    middles = np.array([*(outline.middle for outline in outlines), np.zeros(2)])
    given.middle = wp.array(middles, dtype=wp.vec2d, device=device)
    given.shape_rounding = numbers(np.array([*(outline.rounding for outline in outlines), 0.0]))
    given.shape_reach = numbers(np.array([*(outline.circumradius for outline in outlines), 0.0]))
    given.shape_width = numbers(np.array([*(outline.width - 2.0 * outline.rounding for outline in outlines), 0.0]))
    given.capsule = len(outlines)
    given.slope = launcher.array(np.zeros((0, 2)) if slope is None else slope, wp.vec2d)
    pieces = np.zeros(n, np.int32)
    pieces[bent.body] = np.diff(bent.start) - 1
    first = np.zeros(n + 1, np.int32)
    np.cumsum(np.where(pieces > 0, 2 * pieces, np.diff(start)[shape]), out=first[1:])
    shapes = kernels_overlaps.Shapes()
    shapes.position = launcher.array(position, wp.vec2d)
    shapes.first_corner = launcher.array(first, wp.int32)
    shapes.corner = launcher.empty(int(first[-1]), wp.vec4d)
    shapes.rounding, shapes.reach, shapes.width = (launcher.empty(n, wp.float64) for _ in range(3))
    shapes.pieces = launcher.array(pieces, wp.int32)
    launcher.launch(kernels_overlaps.lay_out, n, [given], [shapes])
    if len(bent.body):
        lines = [launcher.array(values, wp.int32) for values in (bent.body, bent.start)]
        points = launcher.array(bent.point, wp.vec2d)
        launcher.launch(kernels_overlaps.lay_out_bent, len(bent.body), [*lines, points, given.smaller], [shapes])
    return shapes


def _lattice(
    shapes: kernels_overlaps.Shapes, reach: np.ndarray, domain: Domain, launcher: Launcher
) -> kernels_overlaps.Lattice:
    """The cells that bodies lie in, by levels of size."""
    device, n = launcher.device, len(reach)
    level = launcher.empty(n, wp.int32)
    largest = float(reach.max())
    launcher.launch(kernels_overlaps.find_levels, n, [shapes.reach, largest, MOST_LEVELS - 1], [level])
    levels = level.numpy()
    # Between two levels there may be one without bodies: it has a single cell.
    most = np.array([reach.max(where=levels == m, initial=0.0) for m in range(int(levels.max()) + 1)])
    smallest = math.sqrt(domain.area / (2 * n + 64))
    cells = np.array([[max(1, int(side / max(2.0 * r, smallest))) for side in domain.size] for r in most])
    cells[most == 0.0] = 1
    first = np.concatenate([[0], np.cumsum(cells.prod(axis=1))])
    lattice = kernels_overlaps.Lattice()
    lattice.reach = wp.array(most, dtype=wp.float64, device=device)
    for name, values in (("columns", cells[:, 0]), ("rows", cells[:, 1]), ("first_cell", first)):
        setattr(lattice, name, wp.array(values.astype(np.int32), dtype=wp.int32, device=device))
    lattice.size = wp.vec2d(*domain.size)
    lattice.periodic = int(domain.periodic)
    cell, cell_count = launcher.empty(n, wp.int32), int(first[-1])
    lattice.start, lattice.member = launcher.empty(cell_count + 1, wp.int32), launcher.empty(n, wp.int32)
    launcher.launch(kernels_overlaps.find_cells, n, [shapes.position, level, lattice], [cell])
    parts = min(cell_count, PARTS_ON_GPU if device.is_cuda else launcher.thread_count)
    launcher.launch(
        kernels_overlaps.sort_into_cells,
        parts,
        [cell, cell_count, parts],
        [lattice.start, lattice.member],
        grain=1,
    )
    return lattice
