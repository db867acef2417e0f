"""Which outlines of a placement lie in obstacles or reach across the border: measured on what was placed, not taken from contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.body_footprints import BodyFootprints
from ..problem.domain import Domain
from ..problem.footprint import Footprint
from ..problem.of_bodies import one_by_one
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..space.meeting import meeting_of
from . import kernels_out_of_place, kernels_overlaps
from .laid_out import bent_lines, laid_out
from .overlaps import TOLERANCE, find_overlaps

__all__ = ["OutOfPlace", "out_of_place"]

# Width of a pixel over that of the narrowest body at most, and pixels along either side of an image at most; its own may be more.
PIXELS_OF_NARROWEST = 0.25
MOST_PIXELS = 2048


@dataclass(frozen=True)
class OutOfPlace:
    """What lies where it may not; fixed bodies do not count.

    Attributes:
        in_obstacles: Bodies whose outlines lie in an obstacle, or in its margin, by more than 1e-3 of the narrower one's width; at
            least so many, where they are more than 10,000.
        deepest: How deep the deepest of them does [m]: the shortest way out, of images of a pixel's middle.
        beyond_border: Bodies whose outlines reach across the border, where these are to lie inside of it.
        farthest: How far the farthest of them does [m].
    """

    in_obstacles: int = 0
    deepest: float = 0.0
    beyond_border: int = 0
    farthest: float = 0.0


def out_of_place(placement: Placement, launcher: Launcher, footprints: BodyFootprints | None) -> OutOfPlace:
    """Return what of a placement in a rectangle lies where it may not, where footprints are to keep apart.

    Where they may overlap only the middles of bodies keep off obstacles, which they do whatever happens. ``footprints`` are the
    placement's, where somebody has them already.
    """
    problem = placement.problem
    domain, n = problem.rectangle, len(placement.position)
    if not n or not problem.avoid_overlap or not (problem.obstacles or domain.inset):
        return OutOfPlace()
    footprints = footprints or footprints_of_placement(placement)
    shapes = _shapes_of(placement, footprints, launcher)
    beyond, drawn = launcher.zeros(n, wp.float64), launcher.zeros(n, wp.float64)
    if domain.inset:
        inputs = [shapes, wp.vec2d(*domain.size), TOLERANCE]
        launcher.launch(kernels_out_of_place.find_beyond_border, n, inputs, [beyond])
    for obstacle in problem.obstacles:
        if obstacle.image is not None:
            narrowest = float(shapes.width.numpy().min())
            inputs = [shapes, _drawn(obstacle.image, obstacle.margin, domain, narrowest, launcher), TOLERANCE]
            launcher.launch(kernels_out_of_place.find_in_image, n, inputs, [drawn], grain=GRAIN_OF_NEIGHBORS)
    across, depth = beyond.numpy(), drawn.numpy()
    pieces = [piece for obstacle in problem.obstacles for piece in obstacle.pieces]
    deepest, inside = _in_pieces(placement, footprints, pieces, launcher)
    inside[depth > 0.0] = True
    return OutOfPlace(
        int(inside.sum()), max(deepest, float(depth.max())), int(np.count_nonzero(across)), float(across.max())
    )


def _shapes_of(placement: Placement, footprints: BodyFootprints, launcher: Launcher) -> kernels_overlaps.Shapes:
    """The outlines as they lie there; where their room is below 1, they are as much smaller."""
    position, domain = placement.position, placement.problem.rectangle
    tilt = footprints.tilts(placement.id, placement.problem.seed)
    shapes = laid_out(
        footprints,
        launcher.array(position, wp.vec2d),
        placement.angle,
        placement.length,
        placement.width,
        one_by_one(lambda room: np.minimum(room, 1.0), footprints.room),
        footprints.slopes_at(position, domain.size, tilt),
        bent_lines(footprints, position, placement.bends),
        launcher,
    )
    shapes.fixed = launcher.alike(placement.fixed.astype(np.int32), wp.int32)
    shapes.meeting = meeting_of(launcher, None, None)
    return shapes


def _drawn(
    image: np.ndarray, margin: float, domain: Domain, narrowest: float, launcher: Launcher
) -> kernels_out_of_place.Drawn:
    """An obstacle as kernels take it, in pixels so small that the narrowest body [m] does not lie between their middles."""
    for axis, (count, length) in enumerate(zip(image.shape, domain.size[::-1], strict=True)):
        times = min(math.ceil(length / count / (PIXELS_OF_NARROWEST * narrowest)), MOST_PIXELS // count)
        image = np.repeat(image, max(times, 1), axis=axis)
    rows, columns = image.shape
    before = np.zeros((rows, columns + 1), np.int32)
    np.cumsum(image[::-1], axis=1, out=before[:, 1:])
    drawn = kernels_out_of_place.Drawn()
    drawn.before = launcher.array(before.ravel(), wp.int32)
    drawn.rows, drawn.columns = rows, columns
    drawn.size, drawn.periodic, drawn.margin = wp.vec2d(*domain.size), int(domain.periodic), margin
    return drawn


def _in_pieces(
    placement: Placement, footprints: BodyFootprints, pieces: Sequence[Footprint], launcher: Launcher
) -> tuple[float, np.ndarray]:
    """How deep the deepest body lies in convex pieces of the ground [m], and which lie in any of them, shape ``[n]``, bool."""
    n, more = len(placement.position), len(pieces)
    inside = np.zeros(n, bool)
    if not more:
        return 0.0, inside

    def behind(values: np.ndarray, value: float) -> np.ndarray:
        return np.concatenate([values, np.full(more, value, values.dtype)])

    middle = np.array([piece.middle for piece in pieces])
    outlines = [Footprint(piece.corners - place, piece.rounding) for piece, place in zip(pieces, middle, strict=True)]
    domain = placement.problem.rectangle
    if domain.periodic:
        middle = np.mod(middle, domain.size)
    together = replace(
        footprints,
        shapes=(*footprints.shapes, *outlines),
        shape=np.concatenate([footprints.shape, len(footprints.shapes) + np.arange(more, dtype=np.int32)]),
        factor=behind(footprints.factor, 1.0),
        slope=behind(footprints.slope, -1),
    )
    tilt = footprints.tilts(placement.id, placement.problem.seed)
    # Only pairs of a body and a piece count.
    found = find_overlaps(
        together,
        np.concatenate([placement.position, middle]),
        behind(placement.angle, 0.0),
        behind(placement.length, 0.0),
        behind(placement.width, 0.0),
        domain,
        launcher,
        smaller=behind(np.minimum(footprints.room, 1.0), 1.0),
        fixed=behind(placement.fixed, 1),
        bends=None if placement.bends is None else _with_none(placement.bends, more),
        tilt=None if tilt is None else np.concatenate([tilt, np.zeros((more, tilt.shape[1]))]),
        apart=np.array([[False, True], [True, False]]),
        class_index=np.concatenate([np.zeros(n, np.int32), np.ones(more, np.int32)]),
    )
    inside[[body for body in found.bodies if body < n]] = True
    return found.deepest, inside


def _with_none(bends: np.ndarray, more: int) -> np.ndarray:
    return np.concatenate([bends, np.full((more, *bends.shape[1:]), np.nan)])
