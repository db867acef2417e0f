"""What objects keep off: other objects, collections, curves with a width, and what other scatters have placed.

Here they are read, and laid into the rectangle of a chart, where they count as they are seen from above; what they are on a whole
surface says :mod:`.obstacles_on_surface`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.geometry.convex_polygon import convex_hull, enclosing_polygon, width_of
from ...engine.problem.clumps import occupied
from ...engine.problem.footprint import MOST_CORNERS
from ...engine.problem.given_values import show
from ...engine.problem.obstacles import Obstacle
from ...engine.problem.prepared_class import PreparedClass
from ...engine.problem.settings import Settings, belongs_to, described, setting
from ...engine.surface.triangle_mesh import TriangleMesh
from ..densities.density_source import Known
from ..densities.shapes import check_shapes, read_shapes, shape_objects
from ..result.attributes import INSTANCE_INDEX
from ..result.display import shown_objects
from ..result.standing_now import LyingNow, lying_now, standing_now
from ..targets.mesh_attributes import read_attribute
from ..targets.target import is_result

# Warp is not imported before something is computed.
if TYPE_CHECKING:
    from ...engine.surface.chart import Chart
    from ..classes.survey import Survey

__all__ = [
    "FreePlace",
    "ObstacleSource",
    "ScatterObstacle",
    "Stood",
    "StoredObstacle",
    "obstacles_in",
    "read_obstacles",
]

# Cells along the longer side of the rectangle that obstacles are drawn into, at most; at least a power of two that gives so many of
# them to a body's spacing, as far as there are so many. Where few more bodies are wanted they stay as they are.
CELLS, FEWEST_CELLS = 2048, 512
CELLS_PER_SPACING = 24.0
# Obstacles that are met by their outlines, at most: of more, each of which is small, an image is quicker and as good.
MOST_CONVEX = 2000
# A shape is convex where of its hull, so many cells along its longer side, it lacks no larger share.
CELLS_OF_SHAPE = 64
MOST_LACKING = 0.03
# How far beyond the border they are looked for, as a share of the target's longer side.
BESIDE = 0.1
KEY = "`obstacles`"


@belongs_to("scatter")
@described
@dataclass(frozen=True, eq=False)
class ScatterObstacle(Settings):
    """Something that objects keep off.

    Seen from above, faces cover the ground below and above them. Edges without faces, as curves have, and single points do so as far
    as ``width`` says. On a whole surface all of these cover what of it is nearest to them, if they are near: no farther off than a
    quarter of their width; and closed meshes what lies inside them. Of the result of another scatter, every object counts with its
    outline as it stands there.
    """

    source: bpy.types.Object | bpy.types.Collection | Sequence[bpy.types.Object | bpy.types.Collection] = field(
        metadata=setting("What it is", more="An object, a collection, or a list of them", check=check_shapes)
    )
    width: float = field(
        default=0.0,
        metadata=setting(
            "Width given to curves, and to other edges without faces", unit="m", low=0.0, soft_high=100.0, label="Width"
        ),
    )
    margin: float = field(
        default=0.0,
        metadata=setting(
            "Distance that objects keep from its edge",
            more="Their whole footprints where overlap is avoided, their middles elsewhere",
            unit="m",
            low=0.0,
            soft_high=100.0,
            label="Margin",
        ),
    )

    def _key(self, name: str) -> str:
        return f"`{name}` of an obstacle"


@dataclass(frozen=True)
class FreePlace:
    """A disc that objects keep off, where one was removed by hand.

    Attributes:
        x: Its middle in the world [m].
        y: Likewise.
        radius: How far objects keep off it [m], as from a :class:`ScatterObstacle`.
        z: How high it is [m]: on a whole surface it is a ball; None where nobody knows.
    """

    x: float
    y: float
    radius: float
    z: float | None = None


ObstacleSource: TypeAlias = ScatterObstacle | FreePlace | bpy.types.Object | bpy.types.Collection


@dataclass(frozen=True, eq=False)
class Stood:
    """What another scatter has placed.

    Attributes:
        position: In the world's x and y [m], shape ``[n, 2]``.
        axes: Where the x and y axes of its outlines point there, in columns, as long as a meter of them is [m], shape ``[n, 2, 2]``.
        variant: Which of the meshes, shape ``[n]``.
        meshes: What is placed, at scale 1; None where it has no faces.
        lying: How its outlines lie along its own surface.
    """

    position: np.ndarray
    axes: np.ndarray
    variant: np.ndarray
    meshes: tuple[TriangleMesh | None, ...]
    lying: LyingNow

    def outlines(self, survey: Survey) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Give of every mesh that covers ground which ones it is, shape ``[n]``, and its outline's corners at scale 1, ``[k, 2]``.

        There are as few of these as footprints have, so that each is met as one of those.
        """
        for number, mesh in enumerate(self.meshes):
            own = np.flatnonzero(self.variant == number)
            if mesh is None or not len(own):
                continue
            try:
                corners = np.array(survey.outline(mesh, KEY).corners)
            except ProblemError:  # it covers no ground
                continue
            yield own, enclosing_polygon(corners, MOST_CORNERS)


@dataclass(frozen=True, eq=False)
class StoredObstacle:
    """An obstacle as it was when it was read: what any thread may look at.

    Attributes:
        shapes: Of every object faces, edges and points in the world's x and y [m], shape ``[t, 3, 2]``.
        stood: What other scatters have placed.
        reach: How far it reaches beyond these [m].
        place: Where something was removed, in the world [m]; what it is at a height that nobody knows has one of NaN.
        solids: Of every object faces, edges and points in space [m], shape ``[t, 3, 3]``.
    """

    shapes: tuple[np.ndarray, ...]
    stood: tuple[Stood, ...]
    reach: float
    place: tuple[float, float, float] | None = None
    solids: tuple[np.ndarray, ...] = ()

    def triangles(self, survey: Survey) -> np.ndarray:
        """All of it, with the outlines of what other scatters have placed, shape ``[t, 3, 2]``."""
        fans = [_fan(corners) for stood in self.stood for corners in _outlines(stood, survey)]
        return np.concatenate([np.empty((0, 3, 2)), *self.shapes, *fans])


def read_obstacles(obstacles: object, known: Known, without: Sequence[bpy.types.Object] = ()) -> list[StoredObstacle]:
    """Read obstacles as they stand. Only the main thread may call this.

    Args:
        obstacles: A list of :class:`ScatterObstacle`, objects and collections.
        known: What was read already; gets what is read now.
        without: Objects that are no obstacles although a collection holds them.

    Raises:
        ProblemError: Something else, or what has been removed from the file.
    """
    if not isinstance(obstacles, Sequence) or isinstance(obstacles, str):
        raise ProblemError(f"{KEY} must be a list of ScatterObstacle, objects and collections; got {show(obstacles)}")
    return [_read(entry, known, {item.session_uid for item in without}) for entry in obstacles]


def _read(entry: object, known: Known, without: set[int]) -> StoredObstacle:
    if isinstance(entry, bpy.types.Object | bpy.types.Collection):
        entry = ScatterObstacle(entry)
    if isinstance(entry, FreePlace):
        place = entry.x, entry.y, np.nan if entry.z is None else entry.z
        return StoredObstacle((np.full((1, 3, 2), place[:2], np.float64),), (), entry.radius, place)
    if not isinstance(entry, ScatterObstacle):
        raise ProblemError(
            f"{KEY} must be a list of ScatterObstacle, objects and collections; got {show(entry)} among them"
        )
    shapes, stood, solids = [], [], []
    for item in shape_objects(entry.source, KEY):
        if item.session_uid in without:
            continue
        if is_result(item):
            stood.append(_read_result(item))
        else:
            read = read_shapes(item, KEY, known)
            shapes.append(read.triangle)
            solids.append(read.solid)
    return StoredObstacle(tuple(shapes), tuple(stood), 0.5 * entry.width + entry.margin, solids=tuple(solids))


def _read_result(item: bpy.types.Object) -> Stood:
    from ..classes.object_outline import read_source

    stands = standing_now(item, bpy.context)
    variant = read_attribute(item.data, INSTANCE_INDEX)
    meshes = []
    for source in shown_objects(item):
        try:
            meshes.append(None if source is None else read_source(source, bpy.context, KEY))
        except ProblemError:
            meshes.append(None)
    # Seen from above, as outlines on slopes are while they are parted.
    lying = lying_now(item, bpy.context)
    return Stood(stands.position[:, :2], stands.axes[:, :2, :2], variant, tuple(meshes), lying)


def obstacles_in(
    obstacles: Sequence[StoredObstacle], chart: Chart, survey: Survey, classes: Sequence[PreparedClass]
) -> list[Obstacle]:
    """Return obstacles as they lie in the rectangle of a chart; touches nothing of Blender.

    What is convex is met exactly as it is, by outlines of any shape; the rest is drawn into an image.

    Args:
        obstacles: What was read.
        chart: Of the target.
        survey: Knows outlines.
        classes: Of the bodies that are to keep off.
    """
    cells = _cells_for(chart.size, classes)
    cell = float(max(chart.size)) / cells
    found: list[Obstacle] = []
    drawn: list[tuple[np.ndarray, float]] = []
    few = sum(len(o.shapes) + sum(len(stood.position) for stood in o.stood) for o in obstacles) <= MOST_CONVEX
    for obstacle in obstacles:
        # What is thinner than a cell is as wide as one.
        reach = max(obstacle.reach, 0.5 * cell)
        if not few:
            drawn.append((obstacle.triangles(survey) - chart.origin, reach))
            continue
        pieces: list[np.ndarray] = []
        for shape in obstacle.shapes:
            hull = _convex_corners(shape)
            if hull is None:
                drawn.append((shape - chart.origin, reach))
            else:
                pieces.append(hull)
        pieces += [corners for stood in obstacle.stood for outlines in _outlines(stood, survey) for corners in outlines]
        near = (corners - chart.origin for corners in pieces)
        # What reaches across the border may meet what stands beyond it.
        beside = reach + BESIDE * float(max(chart.size))
        found += [_obstacle_of(c, obstacle.reach, reach) for c in near if _comes_upon(c, beside, chart.size)]
    image = obstacle_image(drawn, chart.size, cells)
    return found if image is None else [*found, survey.drawn_obstacle(image)]


def _cells_for(size: np.ndarray, classes: Sequence[PreparedClass]) -> int:
    """How many cells obstacles are drawn into along the longer side of a rectangle of this size [m]."""
    crowded = max(c.body_count / occupied(c.density_image) for c in classes)
    wanted = CELLS_PER_SPACING * float(max(size)) * math.sqrt(crowded / float(np.prod(size)))
    cells = FEWEST_CELLS
    while cells < min(wanted, CELLS):
        cells *= 2
    return cells


def _obstacle_of(corners: np.ndarray, margin: float, reach: float) -> Obstacle:
    """An obstacle of convex corners ``[k, 2]`` [m]; of a single one a disc."""
    if len(corners) == 1:
        return Obstacle(disc=(*corners[0].tolist(), reach))
    return Obstacle(polygon=corners, margin=margin)


def _comes_upon(corners: np.ndarray, reach: float, size: np.ndarray) -> bool:
    """Whether anything within ``reach`` of corners may lie in a rectangle of this size [m]."""
    return bool(((corners.max(axis=0) > -reach) & (corners.min(axis=0) < size + reach)).all())


def _convex_corners(triangle: np.ndarray) -> np.ndarray | None:
    """Return the corners of the hull of a shape ``[t, 3, 2]``, where the shape fills it, shape ``[k, 2]``; None elsewhere."""
    from ...engine.surface.shapes_from_above import draw_shapes

    low, high = triangle.min(axis=(0, 1)), triangle.max(axis=(0, 1))
    if not (high > low).any():
        return low[None]
    hull = convex_hull(triangle.reshape(-1, 2))
    cell = float((high - low).max()) / CELLS_OF_SHAPE
    if len(hull) < 3 or width_of(hull) < cell:
        return None
    height, width = np.maximum(np.ceil((high - low) / cell).astype(int), 1)[::-1].tolist()
    size = np.array([width, height]) * cell
    own, full = np.zeros((height, width), bool), np.zeros((height, width), bool)
    draw_shapes(own, triangle - low, 0.5 * cell, size)
    draw_shapes(full, _fan(hull[None]) - low, 0.5 * cell, size)
    return hull if np.count_nonzero(full & ~own) <= MOST_LACKING * np.count_nonzero(full) else None


def obstacle_image(drawn: Sequence[tuple[np.ndarray, float]], size: np.ndarray, cells: int) -> np.ndarray | None:
    """Draw triangles of a rectangle of this size [m] and what is as near to them as is said with them; None where that is nothing."""
    cell = float(max(size)) / cells
    shape = int(max(1, round(float(size[1]) / cell))), int(max(1, round(float(size[0]) / cell)))
    image = np.zeros(shape, bool)
    for triangle, reach in drawn:
        if len(triangle):
            _draw(image, triangle, reach, size)
    return image if image.any() else None


def _outlines(stood: Stood, survey: Survey) -> list[np.ndarray]:
    """Return corners of the convex outlines of what stands, of each mesh those of shape ``[n, k, 2]``."""
    return [
        stood.position[own][:, None] + np.einsum("nij,kj->nki", stood.axes[own], corners)
        for own, corners in stood.outlines(survey)
    ]


def _fan(corners: np.ndarray) -> np.ndarray:
    """Return triangles that fill convex polygons ``[n, k, 2]``, shape ``[n * (k - 2), 3, 2]``."""
    first = np.broadcast_to(corners[:, :1], corners[:, 1:-1].shape)
    return np.stack([first, corners[:, 1:-1], corners[:, 2:]], axis=2).reshape(-1, 3, 2)


def _draw(image: np.ndarray, triangle: np.ndarray, reach: float, size: np.ndarray) -> None:
    """Set the cells of an image, row 0 at the largest y, whose middles are within ``reach`` of triangles in the rectangle [m]."""
    from ...engine.surface.shapes_from_above import draw_shapes

    low, high = triangle.min(axis=1) - reach, triangle.max(axis=1) + reach
    seen = ((high > 0.0) & (low < size)).all(axis=1)
    draw_shapes(image[::-1], triangle[seen], reach, size)
