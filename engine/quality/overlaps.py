"""Which outlines of a placement overlap, how deep and where: measured on what was placed, with nothing taken from contact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import largest_by_kind, sum_of_whole
from ..problem.body_footprints import BodyFootprints
from ..problem.domain import Domain
from ..problem.of_bodies import of_all, one_by_one
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..space.cell_sort import CellSort
from ..space.meeting import meeting_of
from ..space.size_levels import coarse_cells, levels_of
from ..space.space import Space
from . import kernels_overlaps, kernels_sheets
from .bodies_on_surface import BodiesOnSurface, bodies_on_surface
from .laid_out import bent_lines, laid_out
from .sheets import sheets_of

__all__ = [
    "TOLERANCE",
    "Overlaps",
    "find_overlaps",
    "find_overlaps_on_surface",
    "overlaps_from",
    "overlaps_of",
    "overlaps_of_each",
    "overlaps_of_fixed",
    "overlaps_of_fixed_on_surface",
    "overlaps_on_sheets",
]

# Outlines that touch do not overlap: this share of the narrower one's width is not seen.
TOLERANCE = 1e-3
# No body's overlaps are counted beyond this: footprints many times larger than the space would have n² of them.
MOST_OVERLAPS_PER_BODY = 200
# Bodies that are named.
MOST_NAMED = 10_000
# Levels of size in the plane, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
# Cells along every axis of the table in which bodies on a surface are looked up.
HASHED_CELLS = 128
# The same where there are several tables, one for each level of size.
HASHED_CELLS_OF_LEVELS = 64
# Over the largest reach, in whose units cells are made.
SMALLEST_REACH = 1e-6
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


def overlaps_of(
    placement: Placement,
    launcher: Launcher,
    footprints: BodyFootprints | None = None,
    on_device: wp.array | None = None,
    some: np.ndarray | None = None,
) -> Overlaps:
    """Return what overlaps in a placement: the outlines themselves, without the room that they keep from others.

    Where that room is below 1 they may overlap as far as it lets them, which does not count.

    Args:
        placement: The placement.
        launcher: Where to count.
        footprints: Those of the placement, where somebody has them already.
        on_device: Its positions, ``wp.vec2d``, where somebody has them already.
        some: Between which bodies overlaps count, shape ``[n]``, bool; None for all.
    """
    footprints = footprints or footprints_of_placement(placement)
    kind, apart = _kinds(placement, some)
    smaller = one_by_one(lambda room: np.minimum(room, 1.0), footprints.room)
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
        on_device=on_device,
        apart=apart,
        class_index=kind,
    )


def _kinds(placement: Placement, some: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Kinds of the bodies, and between which of these overlaps count: classes, and a kind for all bodies that are none of ``some``."""
    apart, number = placement.problem.balance.classes_apart, len(placement.problem.classes)
    if some is None:
        return placement.class_index, apart
    apart = np.ones((number, number), bool) if apart is None else apart
    return np.where(some, placement.class_index, number), np.pad(apart, (0, 1))


def overlaps_of_fixed(placement: Placement, launcher: Launcher, footprints: BodyFootprints) -> Overlaps:
    """Return what the fixed bodies of a placement overlap among themselves, which no run can part; see :func:`overlaps_of`.

    Bodies are numbered among the fixed ones.
    """
    own = np.flatnonzero(placement.fixed)
    tilt = footprints.tilts(placement.id, placement.problem.seed)
    return find_overlaps(
        replace(footprints, shape=footprints.shape[own], factor=footprints.factor[own], slope=footprints.slope[own]),
        placement.position[own],
        placement.angle[own],
        placement.length[own],
        placement.width[own],
        placement.problem.rectangle,
        launcher,
        smaller=np.minimum(footprints.room[own], 1.0),
        bends=None if placement.bends is None else placement.bends[own],
        tilt=None if tilt is None else tilt[own],
        apart=placement.problem.balance.classes_apart,
        class_index=placement.class_index[own],
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
    on_device: wp.array | None = None,
    apart: np.ndarray | None = None,
    class_index: np.ndarray | None = None,
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
        on_device: ``position`` on the device, ``wp.vec2d``, where it is there already.
        apart: Which classes keep apart, shape ``[classes, classes]``, bool; overlaps of others do not count. None where all do.
        class_index: Of every body, shape ``[n]``; asked for where ``apart`` is given.
    """
    if not len(position):
        return Overlaps(0)
    each = overlaps_of_each(
        footprints,
        position,
        angle,
        length,
        width,
        domain,
        launcher,
        smaller=smaller,
        fixed=fixed,
        bends=bends,
        tilt=tilt,
        on_device=on_device,
        apart=apart,
        class_index=class_index,
    )
    if each is None:
        return Overlaps(0)
    found, depth, partner = each
    space, one = Space.of(domain), int(np.argmax(depth))
    other = int(partner[one])
    middle = space.wrapped(position[one] + 0.5 * space.shortest(position[other] - position[one]))
    return overlaps_from(found, depth, (one, other), middle)


def overlaps_of_each(
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
    on_device: wp.array | None = None,
    apart: np.ndarray | None = None,
    class_index: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return what every body overlaps; for the arguments see :func:`find_overlaps`. There is one body at least.

    Returns:
        In how many others each lies, how deep at most [m], and in which of them; all of shape ``[n]``. None where nothing overlaps.
    """
    n = len(position)
    slope = footprints.slopes_at(position, domain.size, tilt)
    factor = of_all(1.0, n) if smaller is None else smaller
    bent = bent_lines(footprints, position, bends)
    place = launcher.array(position, wp.vec2d) if on_device is None else on_device
    shapes = laid_out(footprints, place, angle, length, width, factor, slope, bent, launcher)
    stays = of_all(np.int32(0), n) if fixed is None or not fixed.any() else fixed.astype(np.int32)
    shapes.fixed = launcher.alike(stays, wp.int32)
    shapes.meeting = meeting_of(launcher, class_index, apart)
    largest, lattice = _lattice(shapes, domain, launcher)
    space = Space.of(domain)
    found, deepest, partner = (launcher.empty(n, kind) for kind in (wp.int32, wp.float64, wp.int32))
    launcher.launch(
        kernels_overlaps.count_overlaps,
        n,
        [
            shapes,
            lattice,
            wp.vec2i(*space.images_within(2.0 * largest, MOST_IMAGES)),
            TOLERANCE,
            MOST_OVERLAPS_PER_BODY,
        ],
        [found, deepest, partner],
        grain=GRAIN_OF_NEIGHBORS,
    )
    if not sum_of_whole(launcher, found):
        return None
    return found.numpy(), deepest.numpy(), partner.numpy()


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
    if len(lying) > MOST_NAMED:
        # All of a million need not be sorted for that.
        lying = lying[depth[lying] >= np.partition(depth[lying], -MOST_NAMED)[-MOST_NAMED]]
    named = lying[np.argsort(-depth[lying], kind="stable")[:MOST_NAMED]]
    one, other = sorted(pair)
    return Overlaps(count, float(depth.max()), (one, other), tuple(middle.tolist()), tuple(named.tolist()))


def find_overlaps_on_surface(
    placement: Placement, bodies: BodiesOnSurface, launcher: Launcher, some: np.ndarray | None = None
) -> Overlaps:
    """Return what overlaps in a placement on a surface, as :func:`overlaps_of` does.

    Two outlines are compared where they see each other along one sheet of the surface: in the plane between those that touch it at
    the two bodies, as far apart as these are in a straight line. What it touches is the smooth surface that the triangles stand for.

    Args:
        placement: The placement.
        bodies: Its bodies, on the device.
        launcher: Where to run.
        some: Between which bodies overlaps count, shape ``[n]``, bool; None for all.
    """
    kind, apart = _kinds(placement, some)
    return overlaps_on_sheets(
        bodies,
        footprints_of_placement(placement),
        placement.length,
        placement.width,
        launcher,
        fixed=placement.fixed,
        bends=placement.bends,
        apart=apart,
        class_index=kind,
    )


def overlaps_of_fixed_on_surface(placement: Placement, launcher: Launcher) -> Overlaps:
    """Return what :func:`overlaps_of_fixed` does, for a placement on a surface."""
    own = np.flatnonzero(placement.fixed)
    footprints = footprints_of_placement(placement)
    return overlaps_on_sheets(
        bodies_on_surface(placement, launcher, own),
        replace(
            footprints,
            shape=footprints.shape[own],
            factor=footprints.factor[own],
            slope=footprints.slope[own],
            room=footprints.room[own],
        ),
        placement.length[own],
        placement.width[own],
        launcher,
        fixed=np.zeros(len(own), bool),
        bends=None if placement.bends is None else placement.bends[own],
        apart=placement.problem.balance.classes_apart,
        class_index=placement.class_index[own],
    )


def overlaps_on_sheets(
    bodies: BodiesOnSurface,
    footprints: BodyFootprints,
    length: np.ndarray,
    width: np.ndarray,
    launcher: Launcher,
    *,
    fixed: np.ndarray,
    bends: np.ndarray | None,
    apart: np.ndarray | None,
    class_index: np.ndarray,
    margin: np.ndarray | None = None,
) -> Overlaps:
    """Return what overlaps of outlines on a surface; see :func:`find_overlaps_on_surface`, and :func:`find_overlaps` for the rest.

    Args:
        bodies: Where they are, on the device.
        footprints: What they are.
        length: Lengths of the axes of lines [m], shape ``[n]``.
        width: Thicknesses of lines [m], shape ``[n]``.
        launcher: Where to run.
        fixed: Whether each is fixed, shape ``[n]``; pairs of such do not count.
        bends: Points along lines that bend [m].
        apart: Which classes keep apart; None where all do.
        class_index: Of each, shape ``[n]``.
        margin: What lies around the outlines [m], shape ``[n]``; None for nothing.
    """
    n, surface = len(length), bodies.points.surface
    if n == 0:
        return Overlaps(0)
    sheets, place = _sheets(bodies, launcher), bodies.position.numpy()
    bends = None if bends is None else _laid_flat(bends, place, sheets.normal.numpy(), sheets.along.numpy())
    pieces = 0 if bends is None else bends.shape[1] - 1
    most_corners = max([2, 2 * pieces, *(len(outline.corners) for outline in footprints.shapes)])
    shapes = _laid_on_sheets(footprints, length, width, bends, margin, n * most_corners, launcher)
    shapes.fixed = launcher.alike(fixed.astype(np.int32) if fixed.any() else of_all(np.int32(0), n), wp.int32)
    shapes.meeting = meeting_of(launcher, class_index, apart)
    unit = _largest_reach(shapes, launcher)
    # Only cells are in units.
    in_units = bodies.in_units(launcher, unit)
    # Grids go with what refers to them.
    levels, _grids = _grids_of_levels(shapes.reach.numpy() / unit, in_units, launcher)
    sheets.copies, sheets.most_corners = len(shapes.corner) - n * most_corners, most_corners
    found, deepest, partner = (launcher.empty(n, kind) for kind in (wp.int32, wp.float64, wp.int32))

    def count_them() -> int:
        launcher.launch(
            kernels_sheets.count_on_sheets,
            n,
            [levels, in_units, unit, sheets, shapes, TOLERANCE, MOST_OVERLAPS_PER_BODY],
            [found, deepest, partner],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return sum_of_whole(launcher, found)

    if not count_them():
        return Overlaps(0)
    # Only now it matters what belongs together.
    of_triangle, relations = sheets_of(surface, n, launcher)
    if of_triangle.max() > of_triangle.min():
        sheet = of_triangle[bodies.points.triangle]
        sheet, sheets.relations = relations.behind(sheet, int(of_triangle.max()) + 1)
        sheets.sheet = launcher.array(sheet, wp.int32)
        if not count_them():
            return Overlaps(0)
    depth = deepest.numpy()
    one = int(np.argmax(depth))
    other = int(partner.numpy()[one])
    return overlaps_from(found.numpy(), depth, (one, other), 0.5 * (place[one] + place[other]))


def _laid_on_sheets(
    footprints: BodyFootprints,
    length: np.ndarray,
    width: np.ndarray,
    bends: np.ndarray | None,
    margin: np.ndarray | None,
    spare_corners: int,
    launcher: Launcher,
) -> kernels_overlaps.Shapes:
    """Outlines as they lie in planes of their own, with so much around each [m]."""
    n = len(length)
    shapes = laid_out(
        footprints,
        launcher.zeros(n, wp.vec2d),
        of_all(0.0, n),
        length,
        width,
        np.minimum(footprints.room, 1.0),
        None,
        bent_lines(footprints, np.zeros((n, 2)), bends),
        launcher,
        spare_corners=spare_corners,
    )
    if margin is not None:
        for values, more in ((shapes.rounding, margin), (shapes.reach, margin), (shapes.width, 2.0 * margin)):
            values.assign(values.numpy() + more)
    return shapes


def _grids_of_levels(
    reach: np.ndarray, in_units: wp.array, launcher: Launcher
) -> tuple[kernels_sheets.GridsOfLevels, list[wp.HashGrid]]:
    """Bodies in grids by how far they reach, in units: many small ones do not lie in the cells of a few large ones."""
    level, level_reach = levels_of(np.maximum(reach, SMALLEST_REACH), coarse=True)
    order = np.argsort(level, kind="stable").astype(np.int32)
    first = np.searchsorted(level[order], np.arange(len(level_reach) + 1)).astype(np.int32)
    side = HASHED_CELLS if len(level_reach) == 1 else HASHED_CELLS_OF_LEVELS
    grids = []
    for m, sizes in enumerate(zip(2.0 * level_reach, coarse_cells(level_reach), strict=True)):
        own = launcher.array(order[first[m] : first[m + 1]], wp.int32)
        taken = launcher.empty(len(own), wp.vec3)
        launcher.launch(kernels_sheets.take_some, len(own), [own, in_units], [taken])
        # Nobody is larger than those of the first level.
        for size in sizes if m else sizes[:1]:
            grid = wp.HashGrid(side, side, side, device=launcher.device)
            grid.build(taken, float(size))
            grids.append(grid)
    identities = np.array([grid.id for grid in grids], np.uint64)
    levels = kernels_sheets.GridsOfLevels()
    levels.level = launcher.array(level, wp.int32)
    levels.reach = launcher.array(level_reach.astype(np.float32), float)
    levels.grid = launcher.array(np.concatenate([identities[:1], identities[1::2]]), wp.uint64)
    levels.coarse = launcher.array(np.concatenate([identities[:1], identities[2::2]]), wp.uint64)
    levels.first, levels.body = launcher.array(first, wp.int32), launcher.array(order, wp.int32)
    # A thousandth of the largest reach, and what single precision makes of places this far from the middle.
    levels.margin = 1e-3 + float(np.finfo(np.float32).eps * np.abs(in_units.numpy()).max())
    return levels, grids


def _sheets(bodies: BodiesOnSurface, launcher: Launcher) -> kernels_sheets.Sheets:
    """Bodies on a surface as kernels take them, all on one sheet of it."""
    n, surface = len(bodies.position), bodies.points.surface
    sheets = kernels_sheets.Sheets()
    sheets.position = bodies.position
    sheets.normal, sheets.along = launcher.empty(n, wp.vec3d), launcher.empty(n, wp.vec3d)
    sheets.flat = launcher.empty(n, wp.int32)
    corner_normal = launcher.array(surface.corner_normal.reshape(-1, 3), wp.vec3d)
    inputs = [bodies.triangle, bodies.barycentric, corner_normal, bodies.normal, bodies.tangent]
    launcher.launch(kernels_sheets.look_smoothly, n, inputs, [sheets.normal, sheets.along, sheets.flat])
    sheets.sheet = launcher.zeros(n, wp.int32)
    return sheets


def _laid_flat(bends: np.ndarray, position: np.ndarray, normal: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Points along lines that bend, in the planes that touch the surface at these: as far off as in a straight line.

    Args:
        bends: The points [m], shape ``[n, points, 3]``.
        position: Where the lines are, shape ``[n, 3]``.
        normal: Where the smooth surface looks to there.
        along: x axes of the planes.
    """
    way = bends - position[:, None]
    axes = np.stack([along, np.cross(normal, along)], axis=1)
    flat = np.einsum("nkd,nad->nka", way, axes)
    length, found = np.linalg.norm(way, axis=2), np.linalg.norm(flat, axis=2)
    return flat * (length / np.where(found > 0.0, found, 1.0))[:, :, None]


def _largest_reach(shapes: kernels_overlaps.Shapes, launcher: Launcher) -> float:
    """How far any outline reaches from its middle [m]."""
    alike = launcher.alike(of_all(np.int32(0), len(shapes.reach)), wp.int32)
    return float(largest_by_kind(launcher, shapes.reach, alike, 1)[0])


def _lattice(
    shapes: kernels_overlaps.Shapes, domain: Domain, launcher: Launcher
) -> tuple[float, kernels_overlaps.Lattice]:
    """The largest reach, and the cells that bodies lie in, by levels of size."""
    n = len(shapes.reach)
    level = launcher.empty(n, wp.int32)
    largest = _largest_reach(shapes, launcher)
    launcher.launch(kernels_overlaps.find_levels, n, [shapes.reach, largest, MOST_LEVELS - 1], [level])
    # Behind the last level that has bodies there is none; between two there may be one without: it has a single cell.
    most = largest_by_kind(launcher, shapes.reach, level, MOST_LEVELS)
    most = most[: int(np.flatnonzero(most).max(initial=0)) + 1]
    smallest = math.sqrt(domain.area / (2 * n + 64))
    cells = np.array([[max(1, int(side / max(2.0 * r, smallest))) for side in domain.size] for r in most])
    cells[most == 0.0] = 1
    first = np.concatenate([[0], np.cumsum(cells.prod(axis=1))])
    lattice = kernels_overlaps.Lattice()
    lattice.reach = launcher.array(most, wp.float64)
    for name, values in (("columns", cells[:, 0]), ("rows", cells[:, 1]), ("first_cell", first)):
        setattr(lattice, name, launcher.array(values.astype(np.int32), wp.int32))
    lattice.size = wp.vec2d(*domain.size)
    lattice.periodic = int(domain.periodic)
    cells_of_all = CellSort(launcher, n, int(first[-1]))
    cells_of_all.sort(kernels_overlaps.find_cells, [shapes.position, level, lattice])
    lattice.start, lattice.member = cells_of_all.cell_start, cells_of_all.order
    return largest, lattice
