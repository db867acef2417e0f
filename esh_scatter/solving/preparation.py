"""From what was read from Blender to the engine's problem; touches nothing of Blender, so it may run in any thread."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...engine.problem.balance import Balance
from ...engine.problem.body_class import BodyClass
from ...engine.problem.fixed_bodies import FixedBodies
from ...engine.problem.obstacles import Obstacle
from ...engine.problem.placement import Placement
from ...engine.problem.prepared_class import PreparedClass
from ...engine.problem.problem import Problem, SamplingSettings
from ...engine.problem.scatter_settings import ScatterSettings
from ...engine.problem.settings import values_of
from ...engine.problem.surface_directions import SurfaceDirection
from ...engine.surface.chart import Chart
from ...engine.surface.triangle_mesh import TriangleMesh
from ...engine.surface.whole_surface import WholeSurface
from ..classes.classes_from_above import ClassesFromAbove, directions_from_above
from ..classes.directions import DirectionSource
from ..classes.on_whole_surface import classes_on_surface
from ..classes.outlined_sizes import unread_of_standing
from ..classes.scatter_class import ScatterClass, standing_of
from ..classes.sources import SizeShape, SizeSource, measure_size
from ..classes.standing import Unread
from ..classes.survey import Survey
from ..densities.density_source import Density, DensityReader
from ..result.kept_ground import KeptPlaces
from ..result.leaning import SizeHulls
from ..result.pinned_bodies import Pins
from .obstacles import StoredObstacle, obstacles_in
from .obstacles_on_surface import obstacles_on

__all__ = ["Preparation", "Reading", "scales_of", "size_numbers"]


class Reading(NamedTuple):
    """What was read from Blender and is still to be worked out.

    Attributes:
        target: The target's mesh.
        sources: By class and size.
        densities: By class.
        directions: By class, as a :class:`Line` takes them, or what they are read from.
        obstacles: What objects keep off.
        pins: What stays of the result that is replaced, and which of its size's objects each is.
    """

    target: TriangleMesh
    sources: list[list[SizeSource]]
    densities: list[Density]
    directions: list[str | float | np.ndarray | DirectionSource]
    obstacles: list[StoredObstacle]
    pins: tuple[Pins, np.ndarray] | None


class Preparation:
    """Works out the problem of a scatter.

    Args:
        reading: What was read from Blender.
        chart: The target, seen from above or as a whole surface.
        classes: What the caller asks for.
        settings: How it is placed.
        survey: What is worked out only once.

    Attributes:
        problem: What the engine is to place.
        shapes: What the bodies of every size look like from above or along the surface: of all sizes, class by class.
        rooms: By class and size the room that objects have which are compared in space, None for others.
        hulls: What the objects of every size are in space; None where that is not needed.
        unread: How much of how its objects stand has no influence on where they are, by class.
    """

    def __init__(
        self,
        reading: Reading,
        chart: Chart | WholeSurface,
        classes: Sequence[ScatterClass],
        settings: ScatterSettings,
        survey: Survey,
    ) -> None:
        self._reading, self._chart, self._classes, self._settings = reading, chart, classes, settings
        self._scales = scales_of(classes, settings)
        domain = survey.domain(chart, settings)
        names = [scatter_class.name for scatter_class in classes]
        reader = DensityReader(chart.points, dict(zip(names, reading.densities, strict=True)))
        directions = [
            _direction_on(chart, one, survey, f'`direction` of class "{c.name}"')
            for one, c in zip(reading.directions, classes, strict=True)
        ]
        shapes_of_classes: list[list[SizeShape]] = []
        values_of_classes: list[np.ndarray] = []
        for number, scatter_class in enumerate(classes):
            scale = float(self._scales[number])
            shapes = [
                measure_size(size, source, directions[number], survey, scale)
                for size, source in zip(scatter_class.sizes, reading.sources[number], strict=True)
            ]
            values_of_classes.append(survey.density(scatter_class.name, reader, chart))
            shapes_of_classes.append(shapes)
        self.shapes = [shape for shapes in shapes_of_classes for shape in shapes]
        self.rooms = self._rooms_of_sizes(shapes_of_classes)
        self.hulls = self._hulls_of_sizes(survey)
        self.unread = self._unread_standing(shapes_of_classes)
        obstacles: list[Obstacle] = []
        if reading.obstacles and isinstance(chart, WholeSurface):
            free, obstacles = obstacles_on(reading.obstacles, chart, self.shapes, survey)
            values_of_classes = [values * free for values in values_of_classes]
        prepared = self._prepare_classes(shapes_of_classes, values_of_classes)
        if reading.obstacles and isinstance(chart, Chart):
            keeping_off = [c for c in prepared if isinstance(c, PreparedClass)]
            obstacles = obstacles_in(reading.obstacles, chart, survey, keeping_off)
        self.problem = Problem(
            domain,
            prepared,
            Balance(**values_of(settings, Balance)),
            **values_of(settings, SamplingSettings),
            obstacles=obstacles,
            fixed=self._fixed(),
            include_fixed=True,
        )

    def _rooms_of_sizes(self, shapes: Sequence[Sequence[SizeShape]]) -> list[list[float | None]]:
        """Return by class and size the room that objects with outlines of their own have, where these keep apart; None for others."""
        if not self._settings.avoid_overlap:
            return []
        return [
            [
                c.room if shape.own_outlines and len(_meshes_of(source)) == len(shape.objects) else None
                for shape, source in zip(of_class, sources, strict=True)
            ]
            for c, of_class, sources in zip(self._classes, shapes, self._reading.sources, strict=True)
        ]

    def _hulls_of_sizes(self, survey: Survey) -> list[SizeHulls | None]:
        """Return what the objects of all sizes are in space: of those that are compared, where anything may lean."""
        chart = self._chart
        standings = [standing_of(c, self._settings) for c in self._classes]
        leans = isinstance(chart, WholeSurface) or any(
            one.tilt > 0.0 or chart.slope(one.align_to_normal) is not None for one in standings
        )
        if not (leans and self.rooms):
            return [None] * len(self.shapes)
        rooms = [room for of_class in self.rooms for room in of_class]
        sources = [source for of_class in self._reading.sources for source in of_class]
        return [
            None if room is None else SizeHulls(shape.objects, tuple(map(survey.hull, _meshes_of(source))), room)
            for shape, source, room in zip(self.shapes, sources, rooms, strict=True)
        ]

    def _unread_standing(self, shapes: Sequence[Sequence[SizeShape]]) -> list[int]:
        if not self._settings.avoid_overlap:
            return [Unread.NOTHING] * len(shapes)
        chart, leaning = self._chart, None
        if isinstance(chart, Chart) and (slope := chart.slope(1.0)) is not None:
            leaning = slope, chart.area
        return [unread_of_standing(*pair, leaning) for pair in zip(self._classes, shapes, strict=True)]

    def _prepare_classes(
        self, shapes: Sequence[Sequence[SizeShape]], values: Sequence[np.ndarray]
    ) -> list[PreparedClass] | list[BodyClass]:
        """Return what the engine is to place, from densities at the chart's points."""
        chart, reading = self._chart, self._reading
        pins = None if reading.pins is None else reading.pins[0]
        staying = Counter() if pins is None else Counter(zip(pins.class_index, pins.size_index, strict=True))
        if isinstance(chart, Chart):
            name = reading.target.name
            return ClassesFromAbove(chart, name, self._classes, shapes, self._settings, staying).prepare(values)
        return classes_on_surface(chart, self._classes, shapes, values, self._settings, staying)

    def _fixed(self) -> Sequence[FixedBodies]:
        """Return the bodies that stay."""
        if self._reading.pins is None:
            return ()
        pins, variant = self._reading.pins
        scale, group = self._scales[pins.class_index], size_numbers(self._classes, pins)
        # All objects of a size have one footprint, unless each has its own.
        own_ones = np.array([shape.outlines_of_variants for shape in self.shapes])[group]
        outline = np.where(own_ones, variant, 0)
        if isinstance(self._chart, Chart):
            return (pins.fixed_in(self._chart, outline, scale),)
        # Those of a range have the ground that their objects were fitted to.
        area = np.full(len(variant), np.nan)
        for number, shape in enumerate(self.shapes):
            outlines = [outline for outline in shape.outlines if outline is not None]
            if isinstance(shape.area, tuple) and outlines:
                own = np.flatnonzero(group == number)
                area[own] = pins.fit[own] ** 2 * np.array([outline.area for outline in outlines])[variant[own]]
        return (pins.fixed_on(self._chart, area, outline, scale),)


def scales_of(classes: Sequence[ScatterClass], settings: ScatterSettings) -> np.ndarray:
    """Return the factor on the objects of every class, float64, shape ``[class_count]``."""
    return np.array([standing_of(c, settings).scale for c in classes], np.float64)


def size_numbers(classes: Sequence[ScatterClass], bodies: Pins | KeptPlaces | Placement) -> np.ndarray:
    """Return the number of every body's size among the sizes of all classes, class after class, shape ``[n]``."""
    first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in classes])])
    return first[bodies.class_index] + bodies.size_index


def _direction_on(
    chart: Chart | WholeSurface, direction: str | float | np.ndarray | DirectionSource, survey: Survey, key: str
) -> str | float | np.ndarray | SurfaceDirection:
    """Return a direction as a :class:`Line` takes it on a chart."""
    if not isinstance(direction, DirectionSource):
        return direction
    vectors = survey.directions(direction, chart, key)
    return chart.vectors(vectors) if isinstance(chart, WholeSurface) else directions_from_above(chart, vectors)


def _meshes_of(source: SizeSource) -> list[TriangleMesh]:
    """Return the meshes of what a size places that could be read."""
    return [mesh for mesh in source.meshes if isinstance(mesh, TriangleMesh)]
