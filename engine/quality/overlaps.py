"""Which outlines of a placement overlap, how deep and where: measured on what was placed, with nothing taken from contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBOURS, Launcher
from ..problem.body_footprints import CAPSULE, BodyFootprints, footprints_of_placement
from ..problem.domain import Domain
from ..problem.footprint import Footprint
from ..problem.placement import Placement
from . import kernels_overlaps

__all__ = ["TOLERANCE", "Overlaps", "find_overlaps", "overlap_count", "overlaps_of"]

# Outlines that touch do not overlap: this share of the narrower one's width is not seen.
TOLERANCE = 1e-3
# No body's overlaps are counted beyond this: footprints many times larger than the space would have n² of them.
MOST_OVERLAPS_PER_BODY = 200
# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
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
        place: The middle between the two [m].
    """

    count: int
    deepest: float = 0.0
    pair: tuple[int, int] | None = None
    place: tuple[float, float] | None = None


def overlaps_of(placement: Placement, launcher: Launcher) -> Overlaps:
    """Return what overlaps in a placement: the outlines themselves, without the room that they keep from others.

    Where that room is below 1 they may overlap as far as it lets them, which does not count.
    """
    footprints = footprints_of_placement(placement)
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
    )


def overlap_count(
    position: np.ndarray,
    area: np.ndarray,
    domain: Domain,
    launcher: Launcher,
    *,
    angle: np.ndarray | None = None,
    length: np.ndarray | None = None,
    width: np.ndarray | None = None,
) -> int:
    """Number of pairs of discs and capsules that overlap; see :class:`Overlaps`.

    Args:
        position: Body positions [m], shape ``[n, 2]``.
        area: Footprints of dots [m²], shape ``[n]``: discs.
        domain: The domain.
        launcher: Where to count.
        angle: Directions of the axes [rad], shape ``[n]``; None where all are dots.
        length: Lengths of the axes [m], shape ``[n]``.
        width: Thicknesses of the capsules around them [m], shape ``[n]``; 0 for dots. One that bends counts as straight.
    """
    n = len(position)
    zero, one = np.zeros(n), np.ones(n)
    lines = zero > 0.0 if width is None else np.asarray(width) > 0.0
    footprints = BodyFootprints(
        (Footprint.disc(1.0),),
        np.where(lines, CAPSULE, 0).astype(np.int32),
        np.sqrt(area / math.pi),
        zero,
        lines,
        lines,
        np.zeros(n, np.int32),
        one,
        zero,
    )
    given = [zero if values is None else np.asarray(values, dtype=np.float64) for values in (angle, length, width)]
    return find_overlaps(footprints, position, given[0], given[1], given[2], domain, launcher).count


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
    """
    n = len(position)
    if n == 0:
        return Overlaps(0)
    device = launcher.device
    factor = np.ones(n) if smaller is None else smaller
    first, corner, rounding, reach, narrow = _bodies(footprints, angle, length, width, factor)
    shapes = kernels_overlaps.Shapes()
    shapes.position = wp.array(np.ascontiguousarray(position, np.float64), dtype=wp.vec2d, device=device)
    shapes.first_corner = wp.array(first, dtype=wp.int32, device=device)
    shapes.corner = wp.array(corner, dtype=wp.vec4d, device=device)
    shapes.rounding, shapes.reach, shapes.width = (
        wp.array(values, dtype=wp.float64, device=device) for values in (rounding, reach, narrow)
    )
    stays = np.zeros(n, bool) if fixed is None else fixed
    shapes.fixed = wp.array(stays.astype(np.int32), dtype=wp.int32, device=device)
    level, lattice = _lattice(position, reach, domain, device)
    images = [
        min(MOST_IMAGES, int(min(2.0 * reach.max() / side + 0.5, 1e6))) if domain.periodic else 0
        for side in domain.size
    ]
    found, deepest, partner = (launcher.empty(n, kind) for kind in (wp.int32, wp.float64, wp.int32))
    launcher.launch(
        kernels_overlaps.find_overlaps,
        n,
        [
            shapes,
            wp.array(level, dtype=wp.int32, device=device),
            lattice,
            wp.vec2i(*images),
            TOLERANCE,
            MOST_OVERLAPS_PER_BODY,
        ],
        [found, deepest, partner],
        grain=GRAIN_OF_NEIGHBOURS,
    )
    count = int(found.numpy().sum(dtype=np.int64)) // 2
    if count == 0:
        return Overlaps(0)
    depth = deepest.numpy()
    one = int(np.argmax(depth))
    other = int(partner.numpy()[one])
    way = position[other] - position[one]
    if domain.periodic:
        way -= np.array(domain.size) * np.round(way / np.array(domain.size))
    middle = position[one] + 0.5 * way
    if domain.periodic:
        middle = np.mod(middle, domain.size)
    pair = (min(one, other), max(one, other))
    return Overlaps(count, float(depth[one]), pair, (float(middle[0]), float(middle[1])))


def _bodies(
    footprints: BodyFootprints, angle: np.ndarray, length: np.ndarray, width: np.ndarray, factor: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """First corner, corners with normals, rounding, reach and smallest width of every body."""
    lines = footprints.shape == CAPSULE
    counts = np.array([len(outline.corners) for outline in footprints.shapes] + [2])[footprints.shape]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    corner = np.zeros((int(first[-1]), 4))
    scale = footprints.factor * factor
    rounding = np.where(lines, 0.5 * width * factor, 0.0)
    core_width = np.zeros(len(angle))
    reach = np.where(lines, 0.5 * (length + width) * factor, 0.0)
    cos, sin = np.cos(angle), np.sin(angle)
    for number in [CAPSULE, *range(len(footprints.shapes))]:
        own = np.flatnonzero(footprints.shape == number)
        if not len(own):
            continue
        if number == CAPSULE:
            half = 0.5 * length[own] * factor[own]
            core = np.zeros((len(own), 2, 2))
            core[:, 0, 0], core[:, 1, 0] = -half, half
        else:
            outline = footprints.shapes[number]
            core = outline.corners[None] * scale[own, None, None]
            rounding[own] = outline.rounding * scale[own]
            core_width[own] = (outline.width - 2.0 * outline.rounding) * scale[own]
            reach[own] = outline.circumradius * scale[own]
        x = core[..., 0] * cos[own, None] - core[..., 1] * sin[own, None]
        y = core[..., 0] * sin[own, None] + core[..., 1] * cos[own, None]
        edge_x, edge_y = np.roll(x, -1, axis=1) - x, np.roll(y, -1, axis=1) - y
        size = np.hypot(edge_x, edge_y)
        size[size == 0.0] = 1.0
        places = first[own, None] + np.arange(core.shape[1])
        corner[places] = np.stack([x, y, edge_y / size, -edge_x / size], axis=-1)
    return first, corner, rounding, reach, core_width + 2.0 * rounding


def _lattice(
    position: np.ndarray, reach: np.ndarray, domain: Domain, device: wp.Device
) -> tuple[np.ndarray, kernels_overlaps.Lattice]:
    """Levels of the bodies, and the cells that they lie in."""
    n = len(position)
    level = np.clip(np.floor(np.log2(reach.max() / reach)), 0, MOST_LEVELS - 1).astype(np.int64)
    level = np.unique(level, return_inverse=True)[1].ravel()
    most = np.array([reach[level == m].max() for m in range(int(level.max()) + 1)])
    smallest = math.sqrt(domain.area / (2 * n + 64))
    cells = np.array([[max(1, int(side / max(2.0 * r, smallest))) for side in domain.size] for r in most])
    first = np.concatenate([[0], np.cumsum(cells.prod(axis=1))])
    at = np.clip((position / domain.size * cells[level]).astype(np.int64), 0, cells[level] - 1)
    key = first[level] + at[:, 1] * cells[level, 0] + at[:, 0]
    lattice = kernels_overlaps.Lattice()
    lattice.reach = wp.array(most, dtype=wp.float64, device=device)
    start = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=int(first[-1])))])
    for name, values in (
        ("columns", cells[:, 0]),
        ("rows", cells[:, 1]),
        ("first_cell", first),
        ("start", start),
        ("member", np.argsort(key, kind="stable")),
    ):
        setattr(lattice, name, wp.array(values.astype(np.int32), dtype=wp.int32, device=device))
    lattice.size = wp.vec2d(*domain.size)
    lattice.periodic = int(domain.periodic)
    return level.astype(np.int32), lattice
