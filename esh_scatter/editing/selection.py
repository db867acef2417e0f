"""From objects that are selected to classes: one for each, named after it, its size measured, and a pleasant count."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.footprint import Footprint
from ...engine.problem.scatter_settings import TargetSettings
from ...engine.surface.chart import Chart
from ...engine.surface.whole_surface import WholeSurface
from ..classes.flat_objects import lift_for
from ..classes.object_outline import NoFacesError, outline_of, read_source
from ..classes.sunk_objects import is_sunk, own_heights
from ..classes.survey import Survey
from ..classes.upright_objects import align_where, is_upright
from ..targets.references import Reference
from ..targets.targets import check_targets, read_targets
from .left_out import LeftOut, Why

if TYPE_CHECKING:
    from ...engine.surface.mesh_outline import Outline
    from ...engine.surface.triangle_mesh import TriangleMesh
    from ..properties.body_class import ESH_PG_class
    from ..properties.scatter import ESH_PG_scatter

__all__ = ["Measured", "SelectionSurvey", "add_classes", "measure", "pleasant_counts"]

# Ground is scattered on from above if so much of what does not look down is seen there: of hills all is, however steep, of a ball
# most, of a wall a twentieth. What looks down may be a terrain's bottom.
LEAST_OPEN = 0.4
# What covers so much of the ground as one object may be more of it: the next tile of a terrain.
AS_LARGE = 0.8
# What leans over by less is a wall, and does not look down.
WALL = 0.1


class Measured(NamedTuple):
    """An object to place, or a collection as one.

    Attributes:
        item: The object or the collection.
        area: Ground that one covers [m²].
        taken: Ground that others are kept off [m²]: with the inside of a ring, and what lies between letters.
        upright: Whether it is taller than it is wide, as a tree is and a plank is not.
        stand_on: What of it touches the ground: its lowest point where its origin is in the middle of it, or beside and below it;
            or else the origin.
        lift: How far it is to lie above the ground, because it has no thickness [m].
    """

    item: bpy.types.Object | bpy.types.Collection
    area: float
    taken: float
    upright: bool
    stand_on: str
    lift: float


def measure(
    items: Sequence[bpy.types.Object | bpy.types.Collection], context: bpy.types.Context
) -> tuple[list[Measured], LeftOut]:
    """Measure objects as they stand, and collections as one.

    Returns:
        Those that take ground, and the names of those that take none.
    """
    measured: list[Measured] = []
    left_out: dict[Why, list[str]] = {why: [] for why in Why}
    for item in items:
        _, mesh = _read(item, context)
        if isinstance(mesh, Why):
            left_out[mesh].append(item.name)
            continue
        try:
            outline = outline_of(mesh, "`area`")
        except ProblemError:
            left_out[Why.FLAT].append(item.name)
            continue
        measured.append(_measured(item, mesh, outline))
    return measured, left_out


def _measured(item: bpy.types.Object | bpy.types.Collection, mesh: TriangleMesh, outline: Outline) -> Measured:
    """Return what is known of something that takes ground."""
    height = float(np.ptp(mesh.position[:, 2]))
    stands = is_upright(mesh, outline)
    taken = outline.area if outline.is_around else Footprint.polygon(outline.corners).area
    lift = 0.0 if stands else lift_for(float(np.ptp(mesh.position[:, :2], axis=0).max()), height)
    return Measured(item, outline.area, taken, stands, _stand_on(item, mesh, outline), lift)


class SelectionSurvey:
    """What is to be known of a selection before it is scattered: read when it is made, worked out in any thread.

    Args:
        ground: The mesh to scatter on, or a collection of some.
        items: What to place.
        context: Whose view layer.
        settings: Which part of the ground. Where nothing of it is seen from above, it is the whole surface; without settings also
            where most of it is walls, or hidden.

    Attributes:
        device: Where it runs.
        settings: Which part of the ground is scattered on, once it is solved.
        survey: What it has worked out, for the run that follows.
        area: Of the ground [m²], once it is solved.

    Raises:
        EshError: The ground cannot be scattered on.
    """

    device = "cpu"

    def __init__(
        self,
        ground: bpy.types.Object | bpy.types.Collection | None,
        items: Sequence[bpy.types.Object | bpy.types.Collection],
        context: bpy.types.Context,
        settings: TargetSettings | None = None,
    ) -> None:
        objects, _ = check_targets(ground, context)
        self.settings = settings or TargetSettings()
        self._chooses = settings is None
        self._ground = read_targets(objects, context, set(), self.settings)
        self._items = [_read(item, context) for item in items]
        self._outlines: list[Outline | None] = []
        self.survey = Survey()
        self.area = self._seen = 0.0
        self._longest = math.inf

    def solve(self, _progress: object = None, _ask: object = None) -> None:
        """Work it out; touches nothing of Blender.

        Raises:
            EshError: The ground has no surface.
        """
        try:
            chart = self.survey.begin(self._ground, self.settings)
        except ProblemError:
            chart = self._whole()
        if self._chooses and isinstance(chart, Chart) and _open_share(chart) < LEAST_OPEN:
            chart = self._whole()
        self.area = self._seen = float(np.sum(chart.area))
        if isinstance(chart, Chart):
            self._seen = float(np.count_nonzero(chart.area) * chart.cell.prod())
            self._longest = float(chart.size.max())
        for _, mesh in self._items:
            try:
                self._outlines.append(None if isinstance(mesh, Why) else self.survey.outline(mesh, "`area`"))
            except ProblemError:
                self._outlines.append(None)

    def _whole(self) -> Chart | WholeSurface:
        self.settings = replace(self.settings, surface="whole")
        return self.survey.begin(self._ground, self.settings)

    def ground_for(self, measured: Sequence[Measured]) -> float:
        """Return how much ground there is for some objects [m²]: of a steep slope what stands upright takes more than it covers."""
        return self._seen if any(one.upright for one in measured) else self.area

    def as_large(self, measured: Sequence[Measured]) -> list[str]:
        """Return the names of objects that are as large as the ground, and do not stand upright: more ground, perhaps."""
        return [one.item.name for one in measured if not one.upright and one.area > AS_LARGE * self._seen]

    def larger(self, measured: Sequence[Measured]) -> list[str]:
        """Return the names of objects of which one covers more than all of the ground: that is another one, most likely."""
        return [one.item.name for one in measured if one.area > self._seen]

    def measured(self) -> tuple[list[Measured], LeftOut]:
        """Return what :func:`measure` does, of what is still there; what is longer than the ground is left out, too."""
        found: list[Measured] = []
        left_out: dict[Why, list[str]] = {why: [] for why in Why}
        for (reference, mesh), outline in zip(self._items, self._outlines, strict=True):
            item = reference.find()
            if item is None:
                continue
            if isinstance(mesh, Why):
                left_out[mesh].append(item.name)
            elif outline is None:
                left_out[Why.FLAT].append(item.name)
            elif outline.is_long and outline.length > self._longest:
                left_out[Why.LONG].append(item.name)
            else:
                found.append(_measured(item, mesh, outline))
        return found, left_out


def _open_share(chart: Chart) -> float:
    """Return the area that can be seen from above over that of all that does not look down; of either side of faces."""
    area, cosine = chart.view.mesh.areas(), chart.view.cosine
    most = max(float(area[cosine > -WALL].sum()), float(area[cosine < WALL].sum()))
    return float(chart.area.sum()) / max(most, 1e-300)


def _read(
    item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context
) -> tuple[Reference, TriangleMesh | Why]:
    """Return what to place, and its mesh, or why it has none that could be measured."""
    mesh: TriangleMesh | Why
    try:
        mesh = read_source(item, context, "`area`")
    except NoFacesError:
        mesh = Why.BARE
    except ProblemError:
        mesh = Why.REPEATS
    return Reference(item, "object to place"), mesh


def _stand_on(item: bpy.types.Object | bpy.types.Collection, mesh: TriangleMesh, outline: Outline) -> str:
    """Return what of an object touches the ground, as a class has it: what is not far below the origin is meant to be in it."""
    low, high = own_heights(item) or (float(mesh.position[:, 2].min()), float(mesh.position[:, 2].max()))
    # What lies beside its origin and above it, as where its location was applied, has no foot there.
    is_apart = low > 0.0 and math.hypot(*outline.center) > outline.length
    return "LOWEST" if is_apart or is_sunk(low, high) else "ORIGIN"


def pleasant_counts(areas: Sequence[float], ground: float, cover: float, most: int) -> list[int]:
    """Return how many of each object look good together: small ones outnumber large ones, but take less ground.

    Args:
        areas: Ground that one of each takes [m²].
        ground: Area of the target [m²].
        cover: Share of the ground that all of them take together.
        most: Largest number of all together.

    Returns:
        Counts in inverse proportion to the objects' widths, at least one of each.
    """
    if not areas:
        return []
    factor = cover * ground / sum(math.sqrt(area) for area in areas)
    wanted = [factor / math.sqrt(area) for area in areas]
    factor = min(1.0, most / max(sum(wanted), 1e-30))
    return [max(1, round(number * factor)) for number in wanted]


def add_classes(scatter: ESH_PG_scatter, measured: Sequence[Measured], counts: Sequence[int]) -> list[ESH_PG_class]:
    """Add a class for each object to a scatter's settings, and return them."""
    made = []
    for one, count in zip(measured, counts, strict=True):
        body_class = scatter.add_class()
        size = body_class.sizes[0]
        size.count = count
        size.place(one.item)
        body_class.align_to_normal = align_where(one.upright)
        body_class.stand_on, body_class.offset = one.stand_on, one.lift
        made.append(body_class)
    return made
