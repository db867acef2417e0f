"""Scattering in Blender, for scripts: works in pip's ``bpy`` and in ``blender -b`` without anything registered.

:func:`scatter` does everything. :class:`ScatterJob` is the same in three phases, so that an operator can run the middle
one, which does not touch Blender, in a thread.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..engine.device.launcher import resolve_device
from ..engine.errors import EshError, ProblemError
from ..engine.problem.balance import Balance
from ..engine.problem.body_class import BodyClass, ClassSettings, Unsharp
from ..engine.problem.direction_field import density_directions, direction_from_rg
from ..engine.problem.fixed_bodies import FixedBodies
from ..engine.problem.footprint import Footprint, Footprints
from ..engine.problem.line import Line
from ..engine.problem.packing import packable_share, scale_to_fit
from ..engine.problem.placement import Placement
from ..engine.problem.prepared_class import PreparedClass, PreparedDensity, count_sizes, prepare_density
from ..engine.problem.problem import Problem, SamplingSettings
from ..engine.problem.report import Report
from ..engine.problem.scatter_settings import RunSettings, ScatterSettings, Standing
from ..engine.problem.settings import Settings, as_given, described, same_setting, setting, takes, values_of
from ..engine.problem.size import Size
from ..engine.problem.slopes import LEVEL, normal_of_slope, slope_at
from ..engine.problem.surface_directions import SLOPE
from ..engine.problem.validation import (
    as_float,
    check_area_or_range,
    check_class_count,
    check_count,
    check_density,
    check_direction,
    check_name,
    check_unique,
    show,
)
from ..engine.solve import solve
from ..engine.solver.solver import Progress
from ..engine.surface.chart import RESOLUTION, Chart
from ..engine.surface.footprint import Outline
from ..engine.surface.instances import Instances
from ..engine.surface.surface_points import SurfacePoints
from ..engine.surface.triangle_mesh import TriangleMesh
from ..engine.surface.whole_surface import WholeSurface
from .amount import Amount
from .densities import (
    AltitudeDensity,
    AttributeDensity,
    CameraDensity,
    ClassDensity,
    Density,
    DensityLayer,
    DensityReader,
    DensityStack,
    DistanceDensity,
    FacingDensity,
    ImageDensity,
    InsideDensity,
    NoiseDensity,
    SlopeDensity,
    VertexGroupDensity,
    attribute_names,
    image_pixels,
    read_density,
)
from .density_source import Known
from .following import follow_attributes, followed
from .footprint import read_source
from .kept_ground import BODY_ANGLE, BODY_LENGTH, SEED, ground_attributes
from .node_group import INSTANCE_INDEX, ROTATION, SCALE
from .obstacles import ObstacleSource, ScatterObstacle, StoredObstacle, covered, obstacle_image, read_obstacles
from .on_whole_surface import class_on_surface, headings, mean_footprint
from .pins import Pins, add_pins, read_pins
from .references import Reference
from .result import CLASS_NAMES, OVERLAPPING, find_result, write_result
from .standing import Ground, draw, stand
from .survey import Survey
from .target import check_exists, is_result, members_of
from .targets import Target, Targets, read_targets, stuck_attributes

__all__ = [
    "AltitudeDensity",
    "Amount",
    "AttributeDensity",
    "CameraDensity",
    "ClassDensity",
    "DensityLayer",
    "DensityStack",
    "DistanceDensity",
    "EshError",
    "FacingDensity",
    "ImageDensity",
    "InsideDensity",
    "Line",
    "NoiseDensity",
    "ScatterClass",
    "ScatterJob",
    "ScatterObstacle",
    "ScatterResult",
    "ScatterSettings",
    "ScatterSize",
    "SlopeDensity",
    "Standing",
    "Unsharp",
    "VertexGroupDensity",
    "scatter",
]

# Edges of densities are looked at as the paper looks at them in an image of about this many pixels a side.
EDGE_PIXELS = 256.0
EDGE_SCALES = (RESOLUTION / EDGE_PIXELS, 3.0 * RESOLUTION / EDGE_PIXELS)


def _check_weights(value: object, key: str) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise ProblemError(f"{key} must be numbers by the names of objects; got {show(value)}")
    weights = {str(name): as_float(weight) for name, weight in value.items()}
    for name, weight in weights.items():
        if weight is None or not 0.0 <= weight < math.inf:
            raise ProblemError(f'{key} must be numbers of 0 or more; "{name}" has {show(value[name])}')
    return {name: weight for name, weight in weights.items() if weight is not None}


@described
@dataclass(frozen=True, eq=False)
class ScatterSize(Settings):
    """One size of a class."""

    name: str = field(metadata=same_setting(Size, "name"))
    count: int | None = field(
        default=None, metadata=same_setting(Size, "count", low=1, soft_low=None, check=check_count)
    )
    source: bpy.types.Object | bpy.types.Collection | None = field(
        default=None,
        metadata=setting(
            "What this size places",
            more="An object to instance; or a collection, whose objects are variants: each point gets one of them, by seed",
            check=as_given,
        ),
    )
    area: float | tuple[float, float] | None = field(
        default=None,
        metadata=setting(
            "Ground that one object takes",
            unit="m²",
            more="None measures it from the mesh seen from above (a collection's is the mean of its objects'). A range (smallest, "
            "largest) gives every body a footprint of its own, and scales its instance to it",
            check=as_given,
        ),
    )
    share: float | None = field(default=None, metadata=same_setting(Size, "share"))
    line: bool | Line | None = field(
        default=None,
        metadata=setting(
            "Whether bodies are long, so that they are turned along a direction",
            more="None decides by the outline seen from above (its length over 2.5 times its width), True and False insist, a "
            ":class:`~esh.Line` sets everything itself. Instances are turned so that the long axis of their outline lies along the "
            "body. Bodies that are not long count as discs of their area, also where they must not overlap",
            check=as_given,
        ),
    )
    distribution: str | np.ndarray | Sequence[float] = field(
        default="linear", metadata=same_setting(Size, "distribution")
    )
    as_one: bool = field(
        default=False,
        metadata=setting(
            "Whether a collection is placed as one thing, whose objects keep their places",
            more="A trunk and its leaves, for example; where the collection's offset is, it stands on the ground",
        ),
    )
    weights: Mapping[str, float] | None = field(
        default=None,
        metadata=setting(
            "How often each object of a collection is placed, compared with the others",
            more="Numbers by the objects' names; what is not named has 1",
            check=_check_weights,
        ),
    )

    def _key(self, name: str) -> str:
        return "`name` of a size" if name == "name" else f'`{name}` of size "{self.name}"'


@described
@dataclass(frozen=True, eq=False)
class ScatterClass(ClassSettings):
    """One class of bodies that follows one density."""

    name: str = field(metadata=same_setting(BodyClass, "name"))
    sizes: Sequence[ScatterSize] = field(metadata=setting("At least one :class:`~esh.ScatterSize`", check=as_given))
    density: Density = field(
        default=1.0,
        metadata=setting(
            "Where many objects of this class stand, and where few, per area of surface",
            more="A number (the same everywhere), one of the densities below (:class:`~esh.ImageDensity` and so on), or several as "
            "layers of a :class:`~esh.DensityStack`; an image of Blender or an array ``[height, width]`` by itself is stretched over "
            "the target seen from above",
            check=as_given,
        ),
    )
    color: Sequence[float] | None = field(
        default=None,
        metadata=setting(
            "Color of this class. Its points have it as an attribute",
            more="Red, green, blue and optionally alpha, kept as ``class_color``",
            check=as_given,
        ),
    )
    count: int | str | Amount | None = field(
        default=None,
        metadata=setting(
            "How many to place, all sizes together",
            more="The sizes then have shares instead of counts (a single size has all of it); or an :class:`~esh.Amount`; or "
            '``"cover"``: as many as it takes for the footprints to add up to the density, taken as covered share of the ground',
            check=lambda value, key: value if isinstance(value, Amount) else check_class_count(value, key),
        ),
    )
    standing: Standing | None = field(
        default=None,
        metadata=setting("How objects of this class stand", more="None: as all others do", of=Standing),
    )
    direction: str | float | np.ndarray | bpy.types.Image = field(
        default="density",
        metadata=setting(
            "Where long objects of this class point, seen from above",
            more='``"density"`` (along its edges, of which the target\'s border is none), ``"none"``, ``"slope"`` (where water runs), '
            "an angle [rad], an array of angles or vectors (see :class:`~esh.Line`), or an image of Blender whose red and green are x "
            "and y; images are stretched over the target. A size whose ``line`` is a :class:`~esh.Line` has its own",
            check=as_given,
        ),
    )

    def _key(self, name: str) -> str:
        return "`name` of a class" if name == "name" else f'`{name}` of class "{self.name}"'


class _Source(NamedTuple):
    """What was read of the objects that a size places.

    Attributes:
        key: How sentences name the size.
        area: Ground that one takes, where it was given [m²].
        meshes: The objects' meshes, or why one has none; None where nothing has to be measured.
        weights: How often each of them is placed; None where all are alike.
    """

    key: str
    area: float | tuple[float, float] | None
    meshes: tuple[TriangleMesh | ProblemError | None, ...]
    weights: np.ndarray | None


class _Reading(NamedTuple):
    """What was read from Blender and is still to be worked out.

    Attributes:
        target: The target's mesh.
        sources: By class and size.
        densities: By class.
        directions: By class, as a :class:`Line` takes them.
        obstacles: What objects keep off.
        pins: What stays of the result that is replaced, and which of its size's objects each is.
    """

    target: TriangleMesh
    sources: list[list[_Source]]
    densities: list[Density]
    directions: list[str | float | np.ndarray]
    obstacles: list[StoredObstacle]
    pins: tuple[Pins, np.ndarray] | None


@dataclass(frozen=True)
class _Shape:
    """What a size's bodies and their instances have to do with each other."""

    # Whether footprints are the objects' own outlines, and not a disc or a capsule that somebody asked for.
    own_outlines: bool

    # Per variant: the outline, or None where nothing had to be measured.
    outlines: tuple[Outline | None, ...]
    area: float | tuple[float, float]
    line: Line | None
    # How often each variant is placed; None where all are alike.
    weights: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class ScatterResult:
    """What a run made.

    Attributes:
        object: The result in the scene.
        report: What was reached.
        placement: Where the bodies are in the target's bounding rectangle.
        instances: Where the objects stand in the world, in the placement's order.
        sources: The objects that ``instances.source`` counts.
    """

    object: bpy.types.Object
    report: Report
    placement: Placement
    instances: Instances
    sources: tuple[bpy.types.Object, ...]


class _Asked(NamedTuple):
    """A class on its way to the engine.

    Attributes:
        asked: As the engine is asked for it.
        surface: Its density, per area of surface.
        density: The same, per area of the plan view.
        most: What of the ground its bodies can cover, per area of the plan view, where it is to cover as much as that; else None.
    """

    asked: BodyClass
    surface: PreparedDensity
    density: np.ndarray
    most: np.ndarray | None


class _Placed(NamedTuple):
    """Where objects stand, and what is known of their points.

    ``lift`` is the way from point to origin [m], shape ``[n, 3]``, float32; ``stuck`` are attributes that tell where on the target's
    mesh points are.
    """

    instances: Instances
    ground: Ground
    lift: np.ndarray
    surface: SurfacePoints
    stuck: dict[str, tuple[str, np.ndarray]]


@takes(ScatterSettings)
class ScatterJob:
    """A scatter in phases; see :func:`scatter` for the arguments.

    The constructor reads everything from Blender and changes nothing; :meth:`prepare` and :meth:`solve` may run in any thread; and
    :meth:`write` changes the scene.

    Args:
        prepare: Whether to prepare the problem at once. Otherwise that is left to :meth:`prepare`, which may raise what is wrong.
        survey: Of earlier jobs, to use again what they have worked out.

    Attributes:
        settings: How it is made.
        device: Where it runs, as Warp names it.
        problem: What the sampler is asked, once it is prepared.
        placement: What it answered; None before :meth:`solve`.

    Raises:
        EshError: Something asked for is missing or has no meaning.
    """

    chart: Chart | WholeSurface
    problem: Problem

    def __init__(
        self,
        target: Target,
        classes: Sequence[ScatterClass],
        settings: ScatterSettings | None = None,
        *,
        name: str = "ESH Scatter",
        result: bpy.types.Object | None = None,
        obstacles: Sequence[ObstacleSource] = (),
        pinned: bool | Sequence[int | None] = True,
        prepare: bool = True,
        survey: Survey | None = None,
        **changes: Any,
    ) -> None:
        context = bpy.context
        if settings is not None and not isinstance(settings, ScatterSettings):
            raise ProblemError(f"`settings` must be ScatterSettings, or None; got {show(settings)}")
        self.settings = replace(settings or ScatterSettings(), **changes)
        self.name = check_name(name, "`name`")
        self.device = resolve_device(self.settings.device).alias
        self._scene = Reference(context.scene, "scene")
        self._targets = Targets(target, context)
        replaced = _check_result(result)
        self._result = None if replaced is None else Reference(replaced, "result")
        self.classes = _check_classes(classes)
        # Objects are looked up anew before they are used: a file may change during a run. Per group (class and size): indices
        # into `sources` of its variants.
        self._sources: list[Reference] = []
        self.variants: list[list[int]] = []
        self.shapes: list[_Shape] = []
        self.survey = survey
        self._given_obstacles, self._given_pinned = obstacles, pinned
        self._reading: _Reading | None = self._read(context)
        # Bodies of the sizes before, which number the points.
        self._counted = 0
        self._slopes: dict[float, np.ndarray | None] = {}
        self.placement: Placement | None = None
        self._placed: _Placed | None = None
        if prepare:
            self.prepare()

    def _read(self, context: bpy.types.Context) -> _Reading:
        """Read everything from Blender, as it is now."""
        numbers: dict[int, int] = {}
        targets = self._targets.objects
        # Sizes that place the same objects, and classes that follow the same image, have it looked at once.
        meshes: dict[int, TriangleMesh | ProblemError] = {}
        known: Known = {}
        sources: list[list[_Source]] = []
        for scatter_class in self.classes:
            of_class = []
            for size in scatter_class.sizes:
                key = f'size "{size.name}" of class "{scatter_class.name}"'
                members = _source_objects(size.source, targets, key, as_one=size.as_one)
                of_class.append(_read_size(size, members, context, key, meshes))
                for member in members:
                    if numbers.setdefault(member.session_uid, len(numbers)) == len(self._sources):
                        self._sources.append(Reference(member, "object to place"))
                self.variants.append([numbers[member.session_uid] for member in members])
            sources.append(of_class)
        densities = [read_density(c.density, f'`density` of class "{c.name}"', known) for c in self.classes]
        names: set[str] = set().union(*(attribute_names(density) for density in densities))
        directions = [_direction(c) for c in self.classes]
        own = self.result or find_result(context.scene, self.target, self.name)
        obstacles = read_obstacles(self._given_obstacles, known, [*targets, *([own] if own else [])])
        pins = None if own is None else self._pins(own)
        del self._given_obstacles
        ground = read_targets(targets, context, names, self.settings)
        return _Reading(ground, sources, densities, directions, obstacles, pins)

    def _pins(self, own: bpy.types.Object) -> tuple[Pins, np.ndarray] | None:
        """Return what stays of the result that is replaced, and which of its size's objects each of these is."""
        names, pinned = str(own.get(CLASS_NAMES, "")), self._given_pinned
        if pinned is False or not names:
            return None
        now = [c.name for c in self.classes]
        by_name = [now.index(name) if name in now else None for name in json.loads(names)[0]]
        numbers = by_name if isinstance(pinned, bool) else list(pinned)
        pins = read_pins(own, names, [[size.name for size in c.sizes] for c in self.classes], numbers)
        if pins is None:
            return None
        first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in self.classes])])
        uids = [source.uid for source in self._sources]
        variant = np.zeros(len(pins.identity), np.int64)
        for row, (group, uid) in enumerate(
            zip((first[pins.class_index] + pins.size_index).tolist(), pins.source.tolist(), strict=True)
        ):
            of_size = [uids[number] for number in self.variants[group]]
            variant[row] = of_size.index(uid) if uid in of_size else 0
        return pins, variant

    def prepare(self) -> None:
        """Work out what the sampler is asked; touches nothing of Blender. Nothing happens where that has been done.

        Raises:
            EshError: Something asked for has no meaning.
        """
        reading, survey = self._reading, self.survey or Survey()
        if reading is None:
            return
        self._target_name = reading.target.name
        self.chart = survey.begin(reading.target, self.settings)
        domain = survey.domain(self.chart)
        names = [scatter_class.name for scatter_class in self.classes]
        reader = DensityReader(self.chart.points, dict(zip(names, reading.densities, strict=True)))
        shapes_of_classes, values_of_classes = [], []
        for number, scatter_class in enumerate(self.classes):
            shapes = [
                _shape(size, source, reading.directions[number], survey)
                for size, source in zip(scatter_class.sizes, reading.sources[number], strict=True)
            ]
            self.shapes += shapes
            values_of_classes.append(survey.density(scatter_class.name, reader, self.chart))
            shapes_of_classes.append(shapes)
        obstacle = None
        if reading.obstacles and isinstance(self.chart, Chart):
            obstacle = obstacle_image(reading.obstacles, self.chart, survey)
        elif reading.obstacles:
            free = ~covered(reading.obstacles, self.chart.points.position, survey)
            values_of_classes = [values * free for values in values_of_classes]
        self.problem = Problem(
            domain,
            self._prepare_classes(shapes_of_classes, values_of_classes),
            Balance(**values_of(self.settings, Balance)),
            **values_of(self.settings, SamplingSettings),
            obstacles=() if obstacle is None else (obstacle,),
            fixed=self._fixed(reading),
            include_fixed=True,
        )
        # Pixels and meshes may be large.
        self._reading = None

    def _fixed(self, reading: _Reading) -> Sequence[FixedBodies]:
        """Return the bodies that stay; on a whole surface there are none yet."""
        if reading.pins is None or not isinstance(self.chart, Chart):
            return ()
        pins, variant = reading.pins
        return (pins.fixed_in(self.chart, variant),)

    @property
    def target(self) -> bpy.types.Object | bpy.types.Collection:
        """What is scattered on, of several objects the first; raises ProblemError once it is no longer in the file."""
        return self._targets.owner

    @property
    def result(self) -> bpy.types.Object | None:
        """The result to replace, where one was given that still is in the file."""
        return None if self._result is None else self._result.find()

    @property
    def sources(self) -> list[bpy.types.Object]:
        """What points can be instances of; raises ProblemError once one of them is no longer in the file."""
        return [source.get() for source in self._sources]

    def solve(self, progress: Callable[[Progress], bool | None] | None = None) -> None:
        """Place the bodies; touches nothing of Blender. ``progress`` is the engine's: returning False stops the run."""
        self.prepare()
        self.stand(solve(self.problem, **values_of(self.settings, RunSettings), progress=progress))

    def stand(self, placement: Placement) -> None:
        """Take a placement of :attr:`problem` for the answer, and stand its objects on the surface; touches nothing of Blender."""
        self._placed = self._place(placement)
        self.placement = placement

    def instances(self) -> Instances:
        """Return where the objects stand in the world, once the job is solved; touches nothing of Blender."""
        if self.placement is None:
            raise ProblemError("a scatter must be solved before its objects have a place")
        return self._standing().instances

    def colors_of_bodies(self) -> np.ndarray:
        """Return the colour of every body's class, shape ``[n, 4]``, float32; of :attr:`problem`, in any thread."""
        colors = np.array([_rgba(c.color) for c in self.classes], np.float32)
        return colors[self.problem.body_indices()[0]]

    def places_of_bodies(self, position: np.ndarray, lift: float) -> np.ndarray:
        """Return about where bodies of a run under way are in the world [m], shape ``[n, 3]``; in any thread.

        Args:
            position: As the solver tells it [m].
            lift: How far above the surface, as a share of its extent.
        """
        chart = self.chart
        if isinstance(chart, WholeSurface):
            return position + (0.0, 0.0, lift * float((chart.high - chart.low).max()))
        return np.column_stack([position + chart.origin, chart.height_near(position) + lift * chart.view.extent])

    def _standing(self) -> _Placed:
        """Return where the objects of :attr:`placement` stand."""
        assert self.placement is not None
        if self._placed is None or len(self._placed.lift) != len(self.placement.position):
            self._placed = self._place(self.placement)
        return self._placed

    def write(self, context: bpy.types.Context | None = None) -> ScatterResult:
        """Make the result object, or replace the points of an earlier one; on the main thread only."""
        if self.placement is None or self.placement.report is None:
            raise ProblemError("a scatter must be solved before it is written")
        item, sources = self.show(context)
        return ScatterResult(item, self.placement.report, self.placement, self._standing().instances, tuple(sources))

    def show(self, context: bpy.types.Context | None = None) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
        """Write the result as :meth:`write` does, whether it has a report or not; return it and the objects it shows."""
        if self.placement is None:
            raise ProblemError("a scatter must be solved before it is shown")
        # All of them first: nothing has been changed if one is gone.
        scene = self._scene.get() if context is None else context.scene
        target, sources = self.target, self.sources
        replaced = self.result or find_result(scene, target, self.name)
        placed = self._standing()
        item = write_result(
            scene,
            replaced,
            target,
            self.name,
            sources,
            placed.instances.position,
            self._attributes(self.placement, placed),
            [c.name for c in self.classes],
            followed(self._targets.objects, placed.surface.view.mesh),
        )
        names = [[c.name for c in self.classes], [[size.name for size in c.sizes] for c in self.classes]]
        item[CLASS_NAMES] = json.dumps(names)
        item.data[SEED] = self.settings.seed
        return item, sources

    def _prepare_classes(
        self, shapes: list[list[_Shape]], values: list[np.ndarray]
    ) -> list[PreparedClass] | list[BodyClass]:
        """Return what the engine is to place: densities, ``values`` at the chart's points, and counts as slopes make them."""
        chart = self.chart
        if isinstance(chart, WholeSurface):
            return [
                class_on_surface(
                    chart, c, [_engine_size(*pair) for pair in zip(c.sizes, of_class, strict=True)], density
                )
                for c, of_class, density in zip(self.classes, shapes, values, strict=True)
            ]
        asked = [self._ask(chart, *one) for one in zip(self.classes, shapes, values, strict=True)]
        share = self._share_of_cover([one for one in asked if one.most is not None])
        return [
            self._prepare_from_above(chart, number, one, shapes[number], 1.0 if one.most is None else share)
            for number, one in enumerate(asked)
        ]

    def _ask(self, chart: Chart, c: ScatterClass, shapes: list[_Shape], values: np.ndarray) -> _Asked:
        """Return a class as the engine is asked for it, its density on the surface, and what of it the plan view shows."""
        sizes = [_engine_size(size, shape) for size, shape in zip(c.sizes, shapes, strict=True)]
        key = f'`density` of class "{c.name}"'
        # Sharpened and corrected as it is on the surface; only then slopes, which hold more of it, make it larger.
        count = 1 if isinstance(c.count, Amount) else c.count
        asked = BodyClass(c.name, sizes, values, count, **values_of(c, ClassSettings))
        surface = prepare_density(asked)
        if isinstance(c.count, Amount):
            asked = replace(asked, count=_number(chart, c.count, asked, surface.image))
        density = surface.image * chart.stretch
        if not float(density.mean()) > 0.0:
            raise ProblemError(f"{key} must be above 0 somewhere on {self._target_name}; it is 0 everywhere")
        most = None
        if asked.count == "cover" and self.settings.avoid_overlap:
            standing = self._standing_of(c)
            outlined = [_with_any_outline(size, shape) for size, shape in zip(sizes, shapes, strict=True)]
            most = packable_share(outlined, c.room, c.gap) * _ground_for(chart, standing, outlined)
            density = np.minimum(density, most)
        return _Asked(asked, surface, density, most)

    @staticmethod
    def _share_of_cover(asked: list[_Asked]) -> float:
        """What classes that are to cover the ground, and keep apart on it, can have of what each of them alone could cover."""
        if not asked:
            return 1.0
        return scale_to_fit([one.density / one.most for one in asked if one.most is not None], 1.0)

    def _prepare_from_above(
        self, chart: Chart, number: int, one: _Asked, shapes: list[_Shape], share: float
    ) -> PreparedClass:
        c = self.classes[number]
        area = float(chart.size[0]) * float(chart.size[1])
        sizes = list(count_sizes(one.asked, share * area * float(one.density.mean())))
        if self.settings.avoid_overlap:
            sizes = [self._with_outlines(chart, (number, s), size, shapes[s]) for s, size in enumerate(sizes)]
        # A Line that was given looks at the density as the engine does; ours only at what lies on the surface.
        ours = [i for i, given in enumerate(c.sizes) if not isinstance(given.line, Line)]
        lines = {i: line for i in ours if (line := sizes[i].line) is not None}
        if lines and isinstance(c.direction, str) and c.direction in ("density", SLOPE):
            edges = c.direction == "density"
            direction = _edge_directions(chart, one.surface.image) if edges else _slope_directions(chart)
            for i, line in lines.items():
                sizes[i] = replace(sizes[i], line=replace(line, direction=direction))
        density = check_density(one.density, f'`density` of class "{c.name}"')
        return PreparedClass(
            c.name,
            tuple(sizes),
            density,
            one.surface.notes,
            room=c.room,
            gap=c.gap,
            clustering=c.clustering,
            clump_size=c.clump_size,
        )

    def _standing_of(self, scatter_class: ScatterClass) -> Standing:
        return scatter_class.standing or Standing(**values_of(self.settings, Standing))

    def _with_outlines(self, chart: Chart, where: tuple[int, int], size: Size, shape: _Shape) -> Size:
        """Return a size whose bodies have the outlines of what is placed there, as large and as turned as it will stand.

        Args:
            chart: What it stands on.
            where: Number of its class, and its own.
            size: With its whole count.
            shape: What its bodies look like.
        """
        identity = np.arange(self._counted, self._counted + (size.count or 0))
        self._counted += len(identity)
        if not shape.own_outlines or not len(identity):
            return size
        standing = self._standing_of(self.classes[where[0]])
        long = np.full(len(identity), shape.line is not None)
        factor, turn = draw(standing, identity, long, self.settings.seed)
        variants = _variant_footprints(shape)
        variant = self._variants_of(identity, len(variants), shape.weights)
        if isinstance(shape.area, tuple):
            # What gives each object its area; its jitter comes on top of that.
            area = size.areas([self.settings.seed, 2, *where])
            factor = factor * np.sqrt(area / np.array([outline.area for outline in variants])[variant])
        footprints = Footprints(
            variants, variant=variant, scale=factor, turn=turn, slope=self._slope(chart, standing.align_to_normal)
        )
        return replace(size, footprint=footprints)

    def _slope(self, chart: Chart, align: float) -> np.ndarray | None:
        """Return the slope of the planes that outlines lie in, which lean so far towards the ground; None where all are horizontal."""
        if align not in self._slopes:
            slope = chart.slope(align) if align > 0.0 else None
            self._slopes[align] = slope if slope is not None and np.abs(slope).max() > LEVEL else None
        return self._slopes[align]

    def _variants_of(self, identity: np.ndarray, number: int, weights: np.ndarray | None) -> np.ndarray:
        """Return which of so many variants points have."""
        random = np.random.default_rng([self.settings.seed, 1]).random((int(identity.max(initial=-1)) + 1, 3))
        if weights is None:
            return (random[identity, 0] * number).astype(int)
        ends = np.cumsum(weights) / np.sum(weights)
        # The last one that is placed at all ends at 1, whatever the rounding.
        return np.minimum(np.searchsorted(ends, random[identity, 0], side="right"), np.flatnonzero(weights)[-1])

    def _place(self, placement: Placement) -> _Placed:
        """Choose every point's variant, and stand it on the surface."""
        count = len(placement.position)
        first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in self.classes])])
        outlined_sizes = [size.footprint is not None for c in self.problem.classes for size in c.sizes]
        group = first[placement.class_index] + placement.size_index
        surface = (
            self.chart.lift(placement) if isinstance(self.chart, WholeSurface) else self.chart.lift(placement.position)
        )
        ground = Ground(
            placement.id.astype(np.int32),
            surface.normal,
            _headings(surface, placement),
            np.zeros(count, bool),
            np.ones(count, np.float32),
            np.zeros((count, 2), np.float32),
            np.zeros(count, np.float32),
            np.full(count, isinstance(self.chart, WholeSurface)),
        )
        source = np.empty(count, np.int32)
        chart = self.chart
        for number, (variants, shape) in enumerate(zip(self.variants, self.shapes, strict=True)):
            own = np.flatnonzero(group == number)
            outlined, identity = outlined_sizes[number], placement.id[own]
            variant = placement.variant[own] if outlined else self._variants_of(identity, len(variants), shape.weights)
            source[own] = np.array(variants)[variant]
            outlines = [outline for outline in shape.outlines if outline is not None]
            ground.long[own] = shape.line is not None and bool(outlines)
            standing = self._standing_of(self.classes[int(placement.class_index[own[0]])]) if len(own) else None
            if outlined and standing is not None and isinstance(chart, Chart):
                align = standing.align_to_normal
                if (slope := self._slope(chart, align)) is not None:
                    # The normals that contact knew: between the chart's cells they differ a little from those of the faces.
                    ground.normal[own] = normal_of_slope(
                        slope_at(slope, placement.position[own], self.problem.rectangle.size), align
                    )
                # The turn that was drawn before solving comes with the standing, and so does the scale; not all of them are those
                # that were drawn for this body.
                factor, turn = draw(standing, identity, ground.long[own], self.settings.seed)
                ground.heading[own] -= turn.astype(np.float32)
                ground.fit[own] = placement.scale[own] / factor
            elif isinstance(shape.area, tuple) and outlines:
                ground.fit[own] = np.sqrt(
                    placement.area[own] / np.array([outline.area for outline in outlines])[variant]
                )
            if shape.line is not None and outlines:
                # Of lines, the outline's middle lies on the point.
                ground.axis[own] = np.array([outline.angle for outline in outlines])[variant]
                ground.heading[own] -= ground.axis[own]
                ground.middle[own] = np.array([outline.center for outline in outlines])[variant]
        rotation, lift = np.empty((count, 4), np.float32), np.empty((count, 3), np.float32)
        scale = np.empty(count, np.float32)
        for number, scatter_class in enumerate(self.classes):
            own = np.flatnonzero(placement.class_index == number)
            rotation[own], scale[own], lift[own] = stand(
                self._standing_of(scatter_class), ground.part(own), self.settings.seed
            )
        position = (surface.position + lift).astype(np.float32)
        instances = Instances(position, rotation, scale, source)
        return _Placed(instances, ground, lift, surface, stuck_attributes(surface))

    def _attributes(self, placement: Placement, placed: _Placed) -> dict[str, tuple[str, np.ndarray]]:
        instances, ground = placed.instances, placed.ground
        colors = np.array([_rgba(c.color) for c in self.classes], np.float32)
        align = np.array([self._standing_of(c).align_to_normal for c in self.classes], np.float32)
        return {
            "id": ("INT", ground.identity),
            **({BODY_ANGLE: ("FLOAT", placement.angle)} if placement.angle.any() else {}),
            **({BODY_LENGTH: ("FLOAT", placement.length)} if placement.length.any() else {}),
            "class_index": ("INT", placement.class_index),
            "size_index": ("INT", placement.size_index),
            INSTANCE_INDEX: ("INT", instances.source),
            ROTATION: ("QUATERNION", instances.rotation),
            SCALE: ("FLOAT_VECTOR", np.repeat(instances.scale[:, None], 3, axis=1)),
            "class_color": ("FLOAT_COLOR", colors[placement.class_index]),
            **ground_attributes(ground, placed.lift),
            **follow_attributes(placed.surface, align[placement.class_index]),
            **add_pins(placement.fixed, placed.instances.position),
            **_overlapping(placement),
            **placed.stuck,
        }


@takes(ScatterSettings)
def scatter(
    target: Target,
    classes: Sequence[ScatterClass],
    settings: ScatterSettings | None = None,
    *,
    name: str = "ESH Scatter",
    result: bpy.types.Object | None = None,
    obstacles: Sequence[ObstacleSource] = (),
    pinned: bool | Sequence[int | None] = True,
    progress: Callable[[Progress], bool | None] | None = None,
    **changes: Any,
) -> ScatterResult:
    """Place objects on a mesh, all classes and sizes at once.

    Args:
        target: Mesh object of the current view layer, several of them, or a collection of them, used with their modifiers and as
            they stand in the world. Several are one surface where they touch. Seen from above, the topmost surface counts.
        classes: What to place, how many, following which densities.
        settings: How; None has all of the following settings at their defaults.
        name: Of the result object. A result that this name left on this target in this scene is replaced.
        result: Result to replace instead; None looks for one as said above, and makes a new object if there is none.
        obstacles: What objects keep off, seen from above: objects, collections, results of other scatters, or a
            :class:`~esh.ScatterObstacle` of these, which gives curves a width and keeps a margin free.
        pinned: Whether objects of the replaced result stay where they are that were pinned, or moved by hand; they count. Or, by
            class of that result, the index of the class that it is now, or None. On a whole surface none stays.
        progress: Called after every step; returning False stops the run, and what is there is written.
        changes: Any of the following, by name, in place of that in ``settings``.

    Returns:
        The result object, the report, the placement, and where the objects stand.

    Raises:
        EshError: One sentence that says what is wrong; nothing was changed.
    """
    if progress is not None and not callable(progress):
        raise ProblemError(f"`progress` must be something to call, or None; got {show(progress)}")
    job = ScatterJob(target, classes, settings, name=name, result=result, obstacles=obstacles, pinned=pinned, **changes)
    job.solve(progress)
    return job.write()


def _headings(surface: SurfacePoints, placement: Placement) -> np.ndarray:
    """Return how objects are turned about their own axes [rad], shape ``[n]``, float32."""
    if placement.tangent is None:
        return placement.angle.astype(np.float32)
    return headings(surface.normal.astype(np.float64), placement.tangent).astype(np.float32)


def _slope_directions(chart: Chart) -> str | np.ndarray:
    """Return where water runs on the surface as a :class:`Line` takes it; what is steep weighs more."""
    normal = chart.points.normal
    downhill = np.stack([chart.continued(normal[:, k]) for k in (0, 1)], axis=-1)
    return downhill if downhill.any() else "none"


def _edge_directions(chart: Chart, density: np.ndarray) -> str | np.ndarray:
    """Return the directions of a density's edges on the surface as a :class:`Line` takes them."""
    if density.min() == density.max():
        return "none"
    cell_width, cell_height = (float(length) for length in chart.cell)
    edges = density_directions(density, *EDGE_SCALES, pixel_size=(cell_width, cell_height))
    weight = np.where(chart.area > 0.0, edges.weight, 0.0)
    if not weight.any():
        return "none"
    weight /= weight.max()
    return weight[..., None] * np.stack([np.cos(edges.angle), np.sin(edges.angle)], axis=-1)


def _number(chart: Chart, amount: Amount, asked: BodyClass, density: np.ndarray) -> int:
    """Return how many bodies an amount is on this surface."""
    area = float((np.minimum(density, 1.0) * chart.area).sum())
    return amount.number(area, mean_footprint(asked), f'class "{asked.name}"')


def _ground_for(chart: Chart, standing: Standing, sizes: Sequence[Size]) -> np.ndarray:
    """Area of ground over its area seen from above that there is for the outlines of sizes, shape as the chart's."""
    if not all(isinstance(size.footprint, Footprints) for size in sizes):
        # Discs and capsules lie in the plan.
        return np.ones(chart.shape)
    steep = np.arccos(1.0 / np.maximum(chart.stretch, 1.0))
    return 1.0 / np.cos(standing.align_to_normal * steep)


def _check_result(result: object) -> bpy.types.Object | None:
    if result is None:
        return None
    if not isinstance(result, bpy.types.Object):
        raise ProblemError(f"`result` must be an object that an earlier scatter made, or None; got {show(result)}")
    check_exists(result, "`result`")
    if not is_result(result):
        raise ProblemError(f'`result` must be an object that an earlier scatter made; "{result.name}" is not one')
    return result


def _check_classes(classes: object) -> list[ScatterClass]:
    if not isinstance(classes, Sequence) or not all(isinstance(entry, ScatterClass) for entry in classes):
        raise ProblemError(f"`classes` must be a list of ScatterClass; got {show(classes)}")
    if not classes:
        raise ProblemError("`classes` must hold at least one class; got none")
    for entry in classes:
        key = f'class "{entry.name}"'
        sizes = entry.sizes
        if not isinstance(sizes, Sequence) or not all(isinstance(size, ScatterSize) for size in sizes) or not sizes:
            raise ProblemError(f"`sizes` of {key} must be a list of at least one ScatterSize; got {show(sizes)}")
        check_unique([size.name for size in sizes], f"size names of {key}")
        _direction(entry)
        if entry.color is not None:
            try:
                usable = len(entry.color) in (3, 4) and np.isfinite(np.array(entry.color, np.float64)).all()
            except (TypeError, ValueError):
                usable = False
            if not usable:
                raise ProblemError(f"`color` of {key} must be 3 or 4 finite numbers; got {show(entry.color)}")
    check_unique([entry.name for entry in classes], "class names")
    return list(classes)


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
    for member in members:
        if member in targets:
            raise ProblemError(
                f'`source` of {key} must not hold the target "{member.name}", which would stand on itself'
            )
        if is_result(member):
            raise ProblemError(f'`source` of {key} must not hold the result of a scatter; "{member.name}" is one')
    return [source] if as_one and isinstance(source, bpy.types.Collection) else members


def _read_size(
    size: ScatterSize,
    members: Sequence[bpy.types.Object | bpy.types.Collection],
    context: bpy.types.Context,
    key: str,
    read_before: dict[int, TriangleMesh | ProblemError],
) -> _Source:
    """Read the meshes of what a size places, as far as their outlines are needed."""
    area = None if size.area is None else check_area_or_range(size.area, f"`area` of {key}")
    if size.line is not None and not isinstance(size.line, (bool, Line)):
        raise ProblemError(f"`line` of {key} must be true, false, a Line or None; got {show(size.line)}")
    weights = _weights(size, members, key)
    if not (area is None or isinstance(area, tuple) or size.line is not False):
        return _Source(key, area, (None,) * len(members), weights)
    for member in members:
        if member.session_uid not in read_before:
            try:
                read_before[member.session_uid] = read_source(member, context, f"`area` of {key}")
            except ProblemError as error:
                read_before[member.session_uid] = error
    return _Source(key, area, tuple(read_before[member.session_uid] for member in members), weights)


def _weights(size: ScatterSize, members: Sequence[bpy.types.ID], key: str) -> np.ndarray | None:
    """Return how often each of a size's variants is placed, None where all are alike."""
    if size.weights is None or len(members) < 2:
        return None
    weights = np.array([size.weights.get(member.name, 1.0) for member in members])
    if not weights.any():
        raise ProblemError(f"`weights` of {key} must be above 0 for one of its objects; they are 0 for all of them")
    return None if (weights == weights[0]).all() else weights


def _shape(size: ScatterSize, source: _Source, direction: str | float | np.ndarray, survey: Survey) -> _Shape:
    """Measure the outlines that are needed, and decide whether the bodies are dots or lines."""
    area = source.area
    outlines: tuple[Outline | None, ...] = (None,) * len(source.meshes)
    try:
        outlines = tuple(_outline(mesh, source.key, survey) for mesh in source.meshes)
    except ProblemError:
        # A given area needs no outline; a curve or a light plane on edge is then a dot.
        if area is None or isinstance(area, tuple) or size.line:
            raise
    measured = [outline for outline in outlines if outline is not None]
    if area is None:
        area = float(np.average([outline.area for outline in measured], weights=source.weights))
    line = size.line if isinstance(size.line, Line) else None
    if size.line is True or (size.line is None and measured and all(outline.is_long for outline in measured)):
        line = _line_around(measured, direction, area)
    own = size.line is None and (size.area is None or isinstance(area, tuple)) and len(measured) == len(outlines)
    return _Shape(own, outlines, area, line, source.weights)


def _outline(mesh: TriangleMesh | ProblemError | None, key: str, survey: Survey) -> Outline | None:
    """Return the outline of a mesh, or raise why there is none."""
    if isinstance(mesh, ProblemError):
        raise mesh
    return None if mesh is None else survey.outline(mesh, f"`area` of {key}")


def _line_around(
    outlines: list[Outline], direction: str | float | np.ndarray, area: float | tuple[float, float]
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


def _direction(scatter_class: ScatterClass) -> str | float | np.ndarray:
    """Return where long bodies point as a :class:`Line` takes it; raise ProblemError for what has no meaning."""
    key = f'`direction` of class "{scatter_class.name}"'
    direction = scatter_class.direction
    if isinstance(direction, str) and direction == SLOPE:
        return direction
    if isinstance(direction, bpy.types.Image):
        pixels = image_pixels(direction, key)
        if pixels.shape[2] < 2:
            raise ProblemError(
                f'{key}: image "{direction.name}" must have a red and a green channel; it has one channel'
            )
        direction = direction_from_rg(pixels)
    return check_direction(direction, key)


def _footprint(outline: Outline, long: bool) -> Footprint:
    """Return an object's outline as the solver takes it: around its origin, or along its axis around its middle."""
    corners = np.array(outline.corners)
    if long:
        c, s = math.cos(outline.angle), math.sin(outline.angle)
        corners = (corners - outline.center) @ np.array([[c, -s], [s, c]])
    return Footprint.polygon(corners)


def _variant_footprints(shape: _Shape) -> list[Footprint]:
    """Return the outlines of what a size places."""
    return [_footprint(outline, shape.line is not None) for outline in shape.outlines if outline is not None]


def _with_any_outline(size: Size, shape: _Shape) -> Size:
    """Return a size whose bodies have the outlines of what is placed there, turned and chosen somehow."""
    return replace(size, footprint=Footprints(_variant_footprints(shape), turn=0.0)) if shape.own_outlines else size


def _engine_size(size: ScatterSize, shape: _Shape) -> Size:
    return Size(size.name, shape.area, size.count, size.share, size.distribution, shape.line)


def _overlapping(placement: Placement) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attribute that says of every point whether its object overlaps another; none where no two do."""
    if placement.report is None or not placement.report.overlapping:
        return {}
    overlaps = np.zeros(len(placement.position), bool)
    overlaps[list(placement.report.overlapping)] = True
    return {OVERLAPPING: ("BOOLEAN", overlaps)}


def _rgba(color: Sequence[float] | None) -> tuple[float, ...]:
    return (1.0, 1.0, 1.0, 1.0) if color is None else (*color, 1.0)[:4]
