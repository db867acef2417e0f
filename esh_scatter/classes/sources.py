"""What the sizes of a scatter place: read from Blender first, and then measured, which asks nothing of Blender.

The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.body_kind import disc_radius
from ...engine.problem.footprint import MOST_CORNERS, Footprint
from ...engine.problem.footprints import Footprints
from ...engine.problem.given_values import show
from ...engine.problem.line import Line
from ...engine.problem.size import Size
from ...engine.problem.surface_directions import SurfaceDirection
from ...engine.problem.validation import check_area_or_range
from ...engine.surface.chart import RESOLUTION
from ...engine.surface.mesh_outline import Outline
from ...engine.surface.triangle_mesh import TriangleMesh
from ..targets.references import Reference
from ..targets.target import check_exists, is_result, members_of, with_shown
from .object_outline import NoFacesError, read_source
from .scatter_class import ScatterSize
from .survey import Survey

__all__ = [
    "DISC_IN_POLYGON",
    "EDGE_SCALES",
    "SizeShape",
    "SizeSource",
    "SourceReader",
    "engine_size",
    "measure_size",
    "standing_on",
    "variant_footprints",
    "variants_of",
    "with_any_outline",
]

# Edges of densities are looked at as the paper looks at them in an image of about this many pixels a side.
EDGE_PIXELS = 256.0
EDGE_SCALES = (RESOLUTION / EDGE_PIXELS, 3.0 * RESOLUTION / EDGE_PIXELS)
# How much farther the corners of a polygon around a disc are than the disc's edge.
DISC_IN_POLYGON = 1.0 / math.cos(math.pi / MOST_CORNERS)


class SizeSource(NamedTuple):
    """What was read of the objects that a size places.

    Attributes:
        key: How sentences name the size.
        objects: The objects, by their numbers among those of the scatter.
        area: Ground that one takes, where it was given [m²].
        meshes: The objects' meshes, or why one has none; None where nothing has to be measured.
        weights: How often each of them is placed; None where all are alike.
    """

    key: str
    objects: tuple[int, ...]
    area: float | tuple[float, float] | None
    meshes: tuple[TriangleMesh | ProblemError | None, ...]
    weights: np.ndarray | None


@dataclass(frozen=True)
class SizeShape:
    """What a size's bodies and their instances have to do with each other.

    Attributes:
        objects: Its variants: the objects that it places, by their numbers among those of the scatter.
        own_outlines: Whether footprints are the objects' own outlines, and not a disc or a capsule that somebody asked for.
        outlines: Of the variants; None where nothing had to be measured.
        area: Ground that one body takes [m²], or the smallest and the largest.
        line: What long bodies are like; None where they are not long.
        line_given: Whether somebody asked for just such a line. It says how long and how wide bodies are, which may stretch and bend.
        weights: How often each variant is placed; None where all are alike.
    """

    objects: tuple[int, ...]
    own_outlines: bool
    outlines: tuple[Outline | None, ...]
    area: float | tuple[float, float]
    line: Line | None
    line_given: bool = False
    weights: np.ndarray | None = None

    @property
    def outlines_of_variants(self) -> bool:
        """Whether footprints are those of the variants: their outlines, or capsules around them where they are long."""
        return self.own_outlines or (self.line is not None and not self.line_given)


def _source_objects(
    source: object, targets: list[bpy.types.Object], key: str, *, as_one: bool
) -> list[bpy.types.Object] | list[bpy.types.Collection]:
    """Return what a size instances: the source itself, the variants in a collection, by name, or the collection as one."""
    if isinstance(source, bpy.types.Object | bpy.types.Collection):
        check_exists(source, f"`source` of {key}")
    if isinstance(source, bpy.types.Collection):
        members = members_of(source)
        if not members:
            where = f'collection "{source.name}"'
            raise ProblemError(f"`source` of {key} must hold objects with geometry; {where} has none")
    elif isinstance(source, bpy.types.Object):
        members = members_of(source)
        if not members:
            raise ProblemError(f'`source` of {key} must have geometry; object "{source.name}" is of type {source.type}')
    else:
        raise ProblemError(f"`source` of {key} must be an object or a collection; got {show(source)}")
    for member in with_shown(members):
        if member in targets:
            raise ProblemError(
                f'`source` of {key} must not hold the target "{member.name}", which would stand on itself'
            )
        if is_result(member):
            raise ProblemError(f'`source` of {key} must not hold the result of a scatter; "{member.name}" is one')
    return [source] if as_one and isinstance(source, bpy.types.Collection) else members


class SourceReader:
    """Reads what sizes place; what several of them place is read once. On the main thread only.

    Args:
        targets: What is scattered on, which nothing may place.
        context: Whose view layer.

    Attributes:
        objects: All that sizes place. They are looked up anew before they are used: a file may change during a run.
    """

    def __init__(self, targets: list[bpy.types.Object], context: bpy.types.Context) -> None:
        self.objects: list[Reference] = []
        self._targets, self._context = targets, context
        self._numbers: dict[int, int] = {}
        self._meshes: dict[int, TriangleMesh | ProblemError] = {}

    def read(self, size: ScatterSize, key: str) -> SizeSource:
        """Read the meshes of what a size places.

        Args:
            size: What is asked.
            key: How sentences name it.

        Raises:
            ProblemError: It places nothing, or what has no meaning.
        """
        members = _source_objects(size.source, self._targets, key, as_one=size.as_one)
        area = None if size.area is None else check_area_or_range(size.area, f"`area` of {key}")
        if size.line is not None and not isinstance(size.line, (bool, Line)):
            raise ProblemError(f"`line` of {key} must be true, false, a Line or None; got {show(size.line)}")
        meshes = [self._mesh(member, key) for member in members]
        if not isinstance(area, float):
            # A curve among the objects of a collection has nothing to show, and is passed over as a light is.
            measured = [number for number, mesh in enumerate(meshes) if not isinstance(mesh, NoFacesError)]
            members, meshes = ([every[number] for number in measured or [0]] for every in (members, meshes))
        weights = _weights(size, members, key)
        return SizeSource(key, tuple(self._number(member) for member in members), area, tuple(meshes), weights)

    def _mesh(self, member: bpy.types.Object | bpy.types.Collection, key: str) -> TriangleMesh | ProblemError:
        if member.session_uid not in self._meshes:
            try:
                self._meshes[member.session_uid] = read_source(member, self._context, f"`area` of {key}")
            except ProblemError as error:
                self._meshes[member.session_uid] = error
        return self._meshes[member.session_uid]

    def _number(self, member: bpy.types.Object | bpy.types.Collection) -> int:
        if self._numbers.setdefault(member.session_uid, len(self._numbers)) == len(self.objects):
            self.objects.append(Reference(member, "object to place"))
        return self._numbers[member.session_uid]


def _weights(size: ScatterSize, members: Sequence[bpy.types.ID], key: str) -> np.ndarray | None:
    """Return how often each of a size's variants is placed, None where all are alike."""
    if size.weights is None or len(members) < 2:
        return None
    weights = np.array([size.weights.get(member.name, 1.0) for member in members])
    if not weights.any():
        raise ProblemError(
            f"`weights` of {key} must be above 0 for at least one of its objects; they are 0 for all of them"
        )
    return None if (weights == weights[0]).all() else weights


def measure_size(
    size: ScatterSize,
    source: SizeSource,
    direction: str | float | np.ndarray | SurfaceDirection,
    survey: Survey,
    scale: float,
) -> SizeShape:
    """Measure the outlines that are needed, and decide whether the bodies are dots or lines; all of them larger by ``scale``."""
    area = source.area
    if isinstance(area, tuple):
        area = (scale**2 * area[0], scale**2 * area[1])
    elif area is not None:
        area = scale**2 * area
    outlines: tuple[Outline | None, ...] = (None,) * len(source.meshes)
    try:
        outlines = tuple(_outline(mesh, source.key, survey) for mesh in source.meshes)
    except ProblemError:
        # A given area needs no outline; a curve or a light plane on edge is then a dot.
        if area is None or isinstance(area, tuple) or size.line:
            raise
    if scale != 1.0:
        outlines = tuple(outline and outline.scaled(scale) for outline in outlines)
    measured = [outline for outline in outlines if outline is not None]
    if area is None:
        area = float(np.average([outline.area for outline in measured], weights=source.weights))
    line = size.line if isinstance(size.line, Line) else None
    if size.line is True or (size.line is None and measured and all(outline.is_long for outline in measured)):
        line = _line_around(measured, direction, area)
    # One area for all asks for discs of it, and a line for capsules; what is only told not to be long keeps its outline.
    own = not size.line and (size.area is None or isinstance(area, tuple)) and len(measured) == len(outlines)
    return SizeShape(source.objects, own, outlines, area, line, isinstance(size.line, Line), source.weights)


def _outline(mesh: TriangleMesh | ProblemError | None, key: str, survey: Survey) -> Outline | None:
    """Return the outline of a mesh, or raise why there is none."""
    if isinstance(mesh, ProblemError):
        raise mesh
    return None if mesh is None else survey.outline(mesh, f"`area` of {key}")


def _line_around(
    outlines: list[Outline], direction: str | float | np.ndarray | SurfaceDirection, area: float | tuple[float, float]
) -> Line:
    """A stiff capsule as long and as wide as the largest of the outlines, scaled to the largest area of a range."""
    scale = 1.0
    if isinstance(area, tuple):
        scale = math.sqrt(area[1] / min(outline.area for outline in outlines))
    length = scale * max(outline.length for outline in outlines)
    width = min(scale * max(outline.width for outline in outlines), 0.9 * length)
    return Line(
        length - width,
        direction,
        width=width,
        stretch_weights=(0.0, 0.1),
        tensor_scales=EDGE_SCALES,
    )


def _footprint(outline: Outline, long: bool) -> Footprint:
    """Return an object's outline as the solver takes it: around what stands on the point, of long ones along their axis."""
    corners = np.array(outline.corners) - standing_on(outline, long)
    if long:
        c, s = math.cos(outline.angle), math.sin(outline.angle)
        corners = corners @ np.array([[c, -s], [s, c]])
    return Footprint.polygon(corners)


def standing_on(outline: Outline, long: bool) -> tuple[float, float]:
    """Return what of an object stands on its point, from its origin [m]: of a long one its middle."""
    return outline.center if long else outline.foot


def lowest_points(shape: SizeShape, scale: float) -> list[float]:
    """Return how high the lowest points of a size's objects are above their origins [m]: of each before its class's scale."""
    return [0.0 if outline is None else outline.lowest / scale for outline in shape.outlines]


def variant_footprints(shape: SizeShape) -> list[Footprint]:
    """Return the footprints of what a size places: outlines of its own, or the capsules around them that were asked for."""
    measured = [outline for outline in shape.outlines if outline is not None]
    if shape.own_outlines:
        return [_footprint(outline, shape.line is not None) for outline in measured]
    return [Footprint.capsule(outline.length, outline.width) for outline in measured]


def with_any_outline(size: Size, shape: SizeShape, *, may_turn: bool) -> Size:
    """Return a size whose bodies have the outlines of what is placed there, turned and chosen somehow."""
    if shape.line_given:
        return size
    outlines = variant_footprints(shape) if shape.outlines_of_variants else disc_of_area(1.0, leans=True)
    return replace(size, footprint=Footprints(outlines, turn=0.0, may_turn=may_turn))


def disc_of_area(area: float, *, leans: bool) -> Footprint:
    """Return the disc that bodies are which are asked for as discs; of one that leans with the ground, a polygon around it."""
    radius = float(disc_radius(area))
    if not leans:
        return Footprint.disc(radius)
    angle = (2.0 * math.pi / MOST_CORNERS) * np.arange(MOST_CORNERS)
    around = radius * DISC_IN_POLYGON
    return Footprint.polygon(around * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def engine_size(size: ScatterSize, shape: SizeShape, scale_jitter: float) -> Size:
    """Return a size as the engine is asked for it, without the outlines of its bodies, whose scales vary so much."""
    area = shape.area
    if shape.outlines_of_variants and not isinstance(area, tuple):
        # Of as many larger ones as smaller ones the large ones take more than the small ones leave.
        area *= 1.0 + scale_jitter**2 / 3.0
    return Size(size.name, area, size.count, size.share, size.distribution, shape.line)


def variants_of(identity: np.ndarray, number: int, weights: np.ndarray | None, seed: int) -> np.ndarray:
    """Return which of so many variants points have, by their numbers; shape ``[n]``."""
    random = np.random.default_rng([seed, 1]).random((int(identity.max(initial=-1)) + 1, 3))
    if weights is None:
        return (random[identity, 0] * number).astype(int)
    ends = np.cumsum(weights) / np.sum(weights)
    # The last one that is placed at all ends at 1, whatever the rounding.
    return np.minimum(np.searchsorted(ends, random[identity, 0], side="right"), np.flatnonzero(weights)[-1])
