"""Ground that large bodies take, where small ones cannot be.

Small bodies are as even as they can be where they have their density beside the large ones. So their coverage error counts the
ground of these as it counts that of obstacles: nothing is asked for there.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.domain import Domain
from ..problem.ground_of_large import LARGE, ground_radius
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface
from . import kernels_taken_ground
from .groups_by_area import GroupsByArea
from .sheets import sheets_of

__all__ = ["LEAST_FREE", "TakenGround", "taken_ground"]

# Cells along every axis of the table that bodies are looked up in.
CELLS = 64
# Threads of a GPU that share the rows of cells that a body covers.
LANES_ON_GPU = 64
# At least so large a share of what a class asks for has to be free; where less is, its density counts as it is.
LEAST_FREE = 0.1


class TakenGround:
    """Ground that bodies take: that within a radius of a segment.

    Args:
        launcher: Runs the kernels.
        middle: Middle of every segment [m], shape ``[n, 3]``.
        half: From there to its end [m], shape ``[n, 3]``.
        radius: [m], shape ``[n]``.
        normal: Where the ground looks to there, shape ``[n, 3]``.
        triangle: Triangle of a surface that each stands on, shape ``[n]``, and the sheet of every triangle; None in a rectangle.
    """

    def __init__(
        self,
        launcher: Launcher,
        middle: np.ndarray,
        half: np.ndarray,
        radius: np.ndarray,
        normal: np.ndarray,
        triangle: tuple[np.ndarray, np.ndarray] | None,
    ) -> None:
        self._launcher = launcher
        none: np.ndarray = np.zeros(0, np.int32)
        self._triangle, self._sheet = (none, none) if triangle is None else triangle
        # In float32, from near by and in a unit that fits.
        self._origin, self._unit = middle.mean(axis=0), float(radius.max() + np.linalg.norm(half, axis=1).max())
        self._middle, self._half, self._radius, self._normal = middle, half, radius, normal

    def _capsules(self, origin: np.ndarray) -> kernels_taken_ground.Capsules:
        launcher, capsules = self._launcher, kernels_taken_ground.Capsules()
        capsules.middle = launcher.array((self._middle - origin) / self._unit, wp.vec3)
        capsules.half = launcher.array(self._half / self._unit, wp.vec3)
        capsules.radius = launcher.array(self._radius / self._unit, float)
        return capsules

    @cached_property
    def _table(self) -> tuple[wp.HashGrid, kernels_taken_ground.Capsules, wp.array, wp.array]:
        """Where bodies are looked up that may reach a point; they, where the ground looks to under them, and its sheets."""
        launcher, capsules = self._launcher, self._capsules(self._origin)
        grid = wp.HashGrid(CELLS, CELLS, CELLS, device=launcher.device)
        launcher.send()
        grid.build(capsules.middle, 1.0)
        return grid, capsules, launcher.array(self._normal, wp.vec3), self._sheets(self._triangle)

    def _sheets(self, triangle: np.ndarray) -> wp.array:
        return self._launcher.array(self._sheet[triangle].astype(np.int32), wp.int32)

    def in_cells(self, domain: Domain, shape: tuple[int, int]) -> np.ndarray:
        """Return 1 for every cell of a rectangle that is free, and 0 for others, of this shape; row 0 at the bottom."""
        launcher, (rows, columns) = self._launcher, shape
        free = launcher.own_array(np.ones(rows * columns, np.float32), float)
        lanes = LANES_ON_GPU if launcher.device.is_cuda else 1
        size = [length / self._unit for length in domain.size]
        inputs = [self._capsules(np.zeros(3)), lanes, rows, columns, *size, int(domain.periodic)]
        launcher.launch(
            kernels_taken_ground.take_cells, lanes * len(self._radius), inputs, [free], grain=GRAIN_OF_NEIGHBORS
        )
        return free.numpy().reshape(shape)

    def at(self, points: PointsOnSurface) -> np.ndarray:
        """Return 1 for points of a surface that are free, and 0 for others, shape ``[n]``."""
        launcher = self._launcher
        grid, capsules, facing, stands_on = self._table
        free = launcher.empty(len(points.triangle), float)
        place = launcher.array((points.position - self._origin) / self._unit, wp.vec3)
        launcher.launch(
            kernels_taken_ground.find_free,
            len(free),
            [
                grid.id,
                place,
                launcher.array(points.normal, wp.vec3),
                self._sheets(points.triangle),
                capsules,
                facing,
                stands_on,
                1.0,
            ],
            [free],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return free.numpy().astype(np.float64)


def taken_ground(
    placement: Placement,
    launcher: Launcher,
    groups: GroupsByArea,
    group: int,
    area: np.ndarray,
    footprints: BodyFootprints,
) -> TakenGround | None:
    """Return the ground that large bodies take from a group of others; None where there are none.

    They are longer than wide by as much as their outlines: each is taken for a capsule of its width and area.

    Args:
        placement: The placement.
        launcher: Runs the kernels.
        groups: Its bodies, as they are measured together.
        group: Of which of these groups.
        area: Footprints of all bodies [m²], shape ``[n]``.
        footprints: Their outlines.
    """
    problem, own = placement.problem, groups.own[group]
    if not problem.avoid_overlap or len(groups.own) < 2 or not len(area[own]):
        return None
    class_index = groups.of_class[group]
    large = (groups.index != group) & (area >= LARGE * float(area[own].mean()))
    if problem.balance.classes_apart is not None:
        large &= problem.balance.classes_apart[class_index][placement.class_index]
    if not large.any():
        return None
    some, body_class = np.flatnonzero(large), problem.classes[class_index]
    around = np.average(
        [ground_radius(body_class, size) for size in body_class.sizes],
        weights=np.bincount(placement.size_index[own], minlength=len(body_class.sizes)),
    )
    along, length, radius, shift = _as_capsules(placement, footprints, some)
    half = 0.5 * length[:, None] * along
    triangle = None
    if isinstance(problem.domain, Surface):
        assert placement.mesh is not None and placement.triangle is not None and placement.barycentric is not None
        points = problem.domain.locate(placement.mesh[some], placement.triangle[some], placement.barycentric[some])
        triangle = points.triangle, sheets_of(problem.domain, len(area), launcher)[0]
    return TakenGround(
        launcher,
        _in_space(placement, some, shift) + _position(placement, some),
        _in_space(placement, some, half),
        radius + float(around),
        np.broadcast_to([0.0, 0.0, 1.0], (len(some), 3)) if placement.normal is None else placement.normal[some],
        triangle,
    )


def _as_capsules(
    placement: Placement, footprints: BodyFootprints, some: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bodies as capsules of their widths and areas.

    Returns:
        Directions of their axes, shape ``[n, 2]``; lengths of these [m] and radii [m], shape ``[n]``, with what they keep for
        themselves; and from their positions to their middles [m], shape ``[n, 2]``.
    """
    shape, scale = footprints.shape[some], footprints.factor[some]
    room, gap = footprints.room[some], footprints.gap[some]
    of_shape = [(outline.width, outline.area, *_axis(outline.corners)) for outline in footprints.shapes]
    width, area, axis, middle = (np.array(values) for values in zip(*of_shape, strict=True))
    width, area = width[shape] * scale * room, area[shape] * (scale * room) ** 2
    length = np.maximum(area - 0.25 * math.pi * width**2, 0.0) / width
    # On a surface the tangent is a body's own x axis.
    heading = placement.angle[some] if placement.tangent is None else np.zeros(len(some))
    turn = heading + np.where(footprints.is_outline[some], axis[shape], 0.0)
    is_capsule = shape == CAPSULE
    length = np.where(is_capsule, placement.length[some] * room, length)
    width = np.where(is_capsule, placement.width[some] * room, width)
    shift = middle[shape] * (scale * room * ~is_capsule)[:, None]
    cosine, sine = np.cos(heading), np.sin(heading)
    shift = np.stack([cosine * shift[:, 0] - sine * shift[:, 1], sine * shift[:, 0] + cosine * shift[:, 1]], axis=1)
    return np.stack([np.cos(turn), np.sin(turn)], axis=1), length, 0.5 * width + 0.5 * gap, shift


def _axis(corners: np.ndarray) -> tuple[float, np.ndarray]:
    """Angle [rad] of the direction in which corners extend the farthest, and the middle between them."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    away = corners - corners.mean(axis=0)
    direction = np.linalg.eigh(away.T @ away)[1][:, -1]
    return math.atan2(direction[1], direction[0]), 0.5 * (low + high)


def _position(placement: Placement, some: np.ndarray) -> np.ndarray:
    position = placement.position[some]
    return position if position.shape[1] == 3 else np.pad(position, ((0, 0), (0, 1)))


def _in_space(placement: Placement, some: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors along the ground [m], shape ``[n, 2]``, in space, shape ``[n, 3]``: on a surface x is along tangents."""
    if placement.normal is None or placement.tangent is None:
        return np.pad(vector, ((0, 0), (0, 1)))
    normal, tangent = placement.normal[some], placement.tangent[some]
    return vector[:, :1] * tangent + vector[:, 1:] * np.cross(normal, tangent)
