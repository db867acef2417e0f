"""A scatter as a job of three phases: everything is read from Blender, then worked out and solved, then written."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...engine.device.devices import resolve_device
from ...engine.device.launcher import Launcher
from ...engine.errors import ProblemError
from ...engine.problem.given_values import as_whole, show
from ...engine.problem.placement import Placement
from ...engine.problem.problem import Problem
from ...engine.problem.report import Report
from ...engine.problem.scatter_settings import ScatterSettings
from ...engine.problem.settings import takes, with_changes
from ...engine.problem.validation import check_name
from ...engine.solve import moved, solve_on
from ...engine.solver.progress import Progress
from ...engine.surface.chart import Chart
from ...engine.surface.instances import Instances
from ...engine.surface.whole_surface import WholeSurface
from ..classes.directions import DirectionSource
from ..classes.lent_survey import lent_survey
from ..classes.scatter_class import ScatterClass, check_classes, color_of, direction_of, standing_of
from ..classes.sources import SizeShape, SizeSource, SourceReader
from ..classes.standing import STEEPEST
from ..classes.survey import Survey
from ..densities.density_source import Known, attribute_names
from ..densities.image_density import stored_density
from ..result.following import followed
from ..result.kept_ground import LOWEST_POINTS, ON_WHOLE, SEED, UNREAD_STANDING, KeptPlaces
from ..result.kept_variants import VARIANTS, lowest_told, variants_told
from ..result.leaning import SizeHulls, with_leaning
from ..result.leaning_now import COMPARED, LEANING_OF, compared_told, number_of_shown, number_told
from ..result.pinned_bodies import Pins, lost_with_target, read_pins
from ..result.result import CLASS_NAMES, find_result, mark_points, write_result
from ..result.result_points import ResultPoints, overlap_attributes, point_attributes, result_points
from ..targets import checksums
from ..targets.references import Reference
from ..targets.subdivision import read_subdivision
from ..targets.target import RESULT_TARGET, check_exists, is_result, world_matrix
from ..targets.targets import Target, Targets, read_targets
from .obstacles import ObstacleSource, read_obstacles
from .preparation import Preparation, Reading, scales_of, size_numbers

__all__ = ["ScatterJob", "ScatterResult"]

# Largest rounding error of positions that nothing is said of, over the root of the smallest footprint's area: where overlaps count,
# less than the report sees of them; elsewhere, less than anybody sees.
UNREPORTED, UNSEEN = 1e-3, 0.05
# Seconds for parting outlines after a run was stopped, so that its result can be kept. The report says how many overlap all the same.
PARTING = 1.0
ROUNDED = (
    "so far from the world's origin Blender rounds positions to {:.2g} m; the report tells of objects where it puts them; move the "
    "scene nearer to the origin"
)
LOST = "{:,} moved or pinned object{} lost: the new target is elsewhere"
# Arguments of a scatter by name, beside its settings.
ASKED_BESIDE = ("name", "result", "obstacles", "pinned", "progress")
# Of a surface that hides more than the other side of a solid, from above; steeper ground than 53 degrees all over does.
LEAST_SEEN = 0.6
# On a wall outlines lie along the wall. They say nothing of an object that does not stand out from it but upright. A note names
# classes that are aligned to the ground by less than UPRIGHT and have more than a share of LEAST_ON_WALLS of their objects on walls.
UPRIGHT, LEAST_ON_WALLS = 0.5, 0.02
ON_WALLS = (
    "{} stands upright on walls, along which outlines keep apart: the objects above these may still reach into each other, unless "
    "they are aligned to the ground"
)
SEEN = 'seen from above, {} is {} as large as its surface; choose "Whole Surface" to cover all of it'


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


@takes(ScatterSettings)
class ScatterJob:
    """A scatter in phases; see :func:`scatter` for the arguments.

    The constructor reads everything from Blender and changes nothing; :meth:`prepare` and :meth:`solve` may run in any thread; and
    :meth:`write` changes the scene.

    Args:
        prepare: Whether to prepare the problem at once. Otherwise that is left to :meth:`prepare`, which may raise what is wrong.
        survey: What earlier jobs have worked out, to be used again; None for that of the last run.

    Attributes:
        settings: How it is made.
        device: Where it runs, as Warp names it.
        problem: What the sampler is asked, once it is prepared.
        placement: What it answered; None before :meth:`solve`.
        made_with: What identifies the settings and contents that it was read with, for whoever compares jobs.

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
        self.settings = with_changes(settings or ScatterSettings(), changes, ASKED_BESIDE, "scatter")
        self.name = check_name(name, "`name`")
        self.device = resolve_device(self.settings.device).alias
        self._scene = Reference(context.scene, "scene")
        self._targets = Targets(target, context)
        replaced = _check_result(result)
        self._result = None if replaced is None else Reference(replaced, "result")
        self.classes = check_classes(classes)
        self._given_pinned = _check_pinned(pinned, len(self.classes))
        # Objects that the classes place; then, of every size, what its bodies look like and what its objects are in space; and, by
        # class, how much of how objects stand has no influence on where they are.
        self._sources: list[Reference] = []
        self._shapes: list[SizeShape] = []
        self._hulls: list[SizeHulls | None] = []
        # By class and size the room that objects have which are compared in space, None for others; and what all sources look like.
        self._rooms: list[list[float | None]] = []
        self._looks_of_sources: list[int] = []
        self._unread: list[int] = []
        self.survey = survey
        self._given_obstacles = obstacles
        # A note on objects that were placed by hand and do not stay, if there are any.
        self._lost = ""
        self._reading: Reading | None = self._read(context)
        self.placement: Placement | None = None
        self.made_with = ""
        self._points: ResultPoints | None = None
        # The attributes of these points, worked out in the solver's thread so that the window need not wait.
        self._attributes: tuple[ResultPoints, dict[str, tuple[str, np.ndarray]]] | None = None
        if prepare:
            self.prepare()

    def _read(self, context: bpy.types.Context) -> Reading:
        """Read everything from Blender, as it is now."""
        targets = self._targets.objects
        # Images that several classes follow are read once.
        known: Known = {}
        reader = SourceReader(targets, context)
        self._sources = reader.objects
        sources = [
            [reader.read(size, f'size "{size.name}" of class "{c.name}"') for size in c.sizes] for c in self.classes
        ]
        if self.settings.avoid_overlap:
            with checksums.now():
                self._looks_of_sources = [number_of_shown(source.find()) for source in self._sources]
        densities = [stored_density(c.density, f'`density` of class "{c.name}"', known) for c in self.classes]
        names: set[str] = set().union(*(attribute_names(density) for density in densities))
        directions = [
            one.read(f'`direction` of class "{c.name}"', known) if isinstance(one, DirectionSource) else one
            for c, one in ((c, direction_of(c)) for c in self.classes)
        ]
        vectors: set[str] = set().union(*(one.vector_names() for one in directions if isinstance(one, DirectionSource)))
        own = _check_mode(self.result or find_result(context.scene, self.target, self.name))
        obstacles = read_obstacles(self._given_obstacles, known, [*targets, *([own] if own else [])])
        pins = None if own is None else self._pins(own, sources)
        del self._given_obstacles
        ground = read_targets(targets, context, names, self.settings, vectors)
        self._stood = [world_matrix(item, context) for item in targets]
        self._divided = [read_subdivision(item, context) for item in targets]
        return Reading(ground, sources, densities, directions, obstacles, pins)

    def _pins(self, own: bpy.types.Object, sources: Sequence[Sequence[SizeSource]]) -> tuple[Pins, np.ndarray] | None:
        """Return what stays of the result that is replaced, and which of its size's objects each of these is."""
        names, pinned = str(own.get(CLASS_NAMES, "")), self._given_pinned
        if pinned is False or not names:
            return None
        now = [c.name for c in self.classes]
        by_name = [now.index(name) if name in now else None for name in json.loads(names)[0]]
        numbers = by_name if isinstance(pinned, bool) else pinned
        # Where that can be asked, somebody has been asked.
        others = () if own.get(RESULT_TARGET) == self.target else self._targets.objects
        if total := lost_with_target(own, others):
            self._lost = LOST.format(total, "s were" if total > 1 else " was")
        pins = read_pins(own, names, [[size.name for size in c.sizes] for c in self.classes], numbers, others)
        if pins is None:
            return None
        objects = [source.objects for of_class in sources for source in of_class]
        variant = _variants(objects, self._sources, size_numbers(self.classes, pins), pins.source)
        return pins, variant

    def prepare(self) -> None:
        """Work out what the sampler is asked; touches nothing of Blender. Nothing happens where that has been done.

        Raises:
            EshError: Something asked for has no meaning.
        """
        if self._reading is None:
            return
        with nullcontext(self.survey) if self.survey is not None else lent_survey() as survey:
            self._work_out(self._reading, survey)
        # Pixels and meshes may be large.
        self._reading = None

    def _work_out(self, reading: Reading, survey: Survey) -> None:
        """Set the problem, and what objects are from above or along the surface, by what was read."""
        # At once: also of a problem that cannot be worked out it is told whether objects stand on the whole surface.
        self.chart = survey.begin(reading.target, self.settings)
        done = Preparation(reading, self.chart, self.classes, self.settings, survey)
        self.problem = done.problem
        self._shapes, self._rooms, self._hulls, self._unread = done.shapes, done.rooms, done.hulls, done.unread

    @property
    def stands_on_whole(self) -> bool | None:
        """Whether objects stand on the whole surface, and not on what is seen from above; None before that is worked out."""
        chart = getattr(self, "chart", None)
        return None if chart is None else isinstance(chart, WholeSurface)

    @property
    def ground(self) -> list[bpy.types.Object]:
        """The mesh objects that the target stands for."""
        return list(self._targets.objects)

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

    def solve(
        self,
        progress: Callable[[Progress], bool | None] | None = None,
        ask: Callable[[], None] | None = None,
    ) -> None:
        """Place the bodies; touches nothing of Blender.

        Args:
            progress: The engine's: returning False stops the run, which takes a moment more to part outlines that are to keep apart.
            ask: Called before everything that the engine does; what it raises ends the run at once.
        """
        self.prepare()
        with closing(Launcher(resolve_device(self.settings.device))) as launcher, launcher.interruptible(ask):
            placement = solve_on(launcher, self.problem, self.settings.max_steps, progress, PARTING)
        self.stand(placement)

    def stand(self, placement: Placement) -> None:
        """Take a placement of :attr:`problem` for the answer, and stand its objects on the surface; touches nothing of Blender."""
        points = self._result_points(placement)
        stored = points.instances.position
        if placement.report is not None and _is_rounded(placement, stored):
            # The report is of what is there; what each object stands like has been drawn, and stays.
            error = stored - (points.surface.position + points.to_origin)
            placement = moved(
                placement, placement.position + error[:, : placement.position.shape[1]], self.settings.device
            )
            assert placement.report is not None
            placement = _with_note(placement, ROUNDED.format(np.spacing(np.abs(stored).max())))
        if isinstance(self.chart, Chart) and self.chart.share_of_facing < LEAST_SEEN:
            share = f"{self.chart.share_seen:.0%}"
            placement = _with_note(placement, SEEN.format(self.chart.view.mesh.name, share))
        if upright := self._upright_on_walls(placement):
            placement = _with_note(placement, ON_WALLS.format(upright))
        if self._lost:
            placement = _with_note(placement, self._lost)
        self._points = points
        self.placement = placement = self.with_leaning(placement)
        self._attributes = points, self._point_attributes(placement, points)

    def with_leaning(self, placement: Placement) -> Placement:
        """Return the placement that objects stand on; its report then also says which of them lean into each other. In any thread."""
        points = self._points
        assert points is not None
        return with_leaning(placement, points, size_numbers(self.classes, placement), self._hulls)

    def _upright_on_walls(self, placement: Placement) -> str:
        """Return the names of classes that keep apart on walls and stand upright there, in quotes."""
        if placement.normal is None or not placement.problem.avoid_overlap:
            return ""
        on_wall = np.abs(placement.normal[:, 2]) < STEEPEST
        found = []
        for number, scatter_class in enumerate(self.classes):
            own = on_wall[placement.class_index == number]
            upright = standing_of(scatter_class, self.settings).align_to_normal < UPRIGHT
            if upright and own.sum() > LEAST_ON_WALLS * len(own):
                found.append(f'"{scatter_class.name}"')
        return ", ".join(found)

    def start_of(self, places: KeptPlaces) -> dict[str, Any]:
        """Return where the bodies of a result are, as :meth:`~esh.engine.solver.solver.Solver.start_at` takes them; in any thread.

        They have the outlines that they have, whatever would be drawn for them in a run that begins anew.
        """
        chart = self.chart
        group = size_numbers(self.classes, places)
        start = {
            "angle": places.angle,
            "length": places.length,
            "identity": places.identity,
            "variant": _variants([shape.objects for shape in self._shapes], self._sources, group, places.source),
            "scale": places.scale / scales_of(self.classes, self.settings)[places.class_index],
        }
        if isinstance(chart, Chart):
            return {"position": places.position[:, :2] - chart.origin, **start}
        if places.corners is None:
            triangle, weight = chart.nearest(places.position, places.normal)
        else:
            vertex = places.corners + chart.mesh.first_vertex[places.target][:, None]
            triangle, weight = chart.found_again(vertex, places.weight, places.position, places.normal)
        return {"position": places.position, "triangle": triangle, "barycentric": weight, **start}

    def instances(self) -> Instances:
        """Return where the objects stand in the world, once the job is solved; touches nothing of Blender."""
        if self.placement is None:
            raise ProblemError("a scatter must be solved before its objects have a place")
        return self._points_of_placement().instances

    def colors_of_bodies(self) -> np.ndarray:
        """Return the color of every body's class, shape ``[n, 4]``, float32; of :attr:`problem`, in any thread."""
        colors = np.array([color_of(c) for c in self.classes], np.float32)
        return colors[self.problem.body_indices()[0]]

    def positions_in_world(self, position: np.ndarray, height: float) -> np.ndarray:
        """Return about where bodies of a run under way are in the world [m], shape ``[n, 3]``; in any thread.

        Args:
            position: As the solver tells it [m].
            height: How far above the surface, as a share of its extent.
        """
        chart = self.chart
        if isinstance(chart, WholeSurface):
            return position + (0.0, 0.0, height * float((chart.high - chart.low).max()))
        return np.column_stack([position + chart.origin, chart.height_near(position) + height * chart.view.extent])

    def _points_of_placement(self) -> ResultPoints:
        """Return the points of :attr:`placement`."""
        assert self.placement is not None
        if self._points is None or len(self._points.to_origin) != len(self.placement.position):
            self._points = self._result_points(self.placement)
        return self._points

    def _attributes_of(self, placement: Placement, points: ResultPoints) -> dict[str, tuple[str, np.ndarray]]:
        """Return the attributes of :attr:`placement`'s points."""
        if self._attributes is None or self._attributes[0] is not points:
            self._attributes = points, self._point_attributes(placement, points)
        return {**self._attributes[1], **overlap_attributes(placement)}

    def _point_attributes(self, placement: Placement, points: ResultPoints) -> dict[str, tuple[str, np.ndarray]]:
        return point_attributes(placement, points, self.classes, self.settings, self._divided)

    def keep_report(self, item: bpy.types.Object, placement: Placement) -> None:
        """Have a result that shows a placement already say what the report says that has come since; nothing in Edit Mode."""
        mesh = item.data
        if not mesh.is_editmode:
            mark_points(mesh, overlap_attributes(placement))
            mesh.update()
            self._keep_compared(mesh, placement, self._points_of_placement())

    def _keep_compared(self, mesh: bpy.types.Mesh, placement: Placement, points: ResultPoints) -> None:
        """Have a result keep which of its objects are compared in space, and how they stood then, if they have been."""
        if not any(room is not None for of_class in self._rooms for room in of_class):
            for name in (COMPARED, LEANING_OF):
                mesh.pop(name, None)
            return
        mesh[COMPARED] = compared_told(self._rooms, placement.problem.balance.classes_apart)
        instances = points.instances
        standing = checksums.standing_number(instances.position, instances.rotation, instances.scale, instances.source)
        # What is shown before its report is measured has still that of before.
        mesh[LEANING_OF] = "" if placement.report is None else number_told(standing, self._looks_of_sources)

    def _result_points(self, placement: Placement) -> ResultPoints:
        return result_points(placement, self.problem, self.chart, self.classes, self._shapes, self.settings)

    def write(self, context: bpy.types.Context | None = None) -> ScatterResult:
        """Make the result object, or replace the points of an earlier one; on the main thread only."""
        if self.placement is None or self.placement.report is None:
            raise ProblemError("a scatter must be solved before it is written")
        item, sources = self.show(context)
        return ScatterResult(
            item, self.placement.report, self.placement, self._points_of_placement().instances, tuple(sources)
        )

    def show(self, context: bpy.types.Context | None = None) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
        """Write the result as :meth:`write` does, whether it has a report or not; return it and the objects it shows."""
        if self.placement is None:
            raise ProblemError("a scatter must be solved before it is shown")
        # Looked up before anything is written: if one is gone, nothing has been changed.
        scene = self._scene.get() if context is None else context.scene
        target, sources = self.target, self.sources
        replaced = _check_mode(self.result or find_result(scene, target, self.name))
        points = self._points_of_placement()
        item = write_result(
            scene,
            replaced,
            target,
            self.name,
            sources,
            points.instances.position,
            self._attributes_of(self.placement, points),
            [c.name for c in self.classes],
            followed(self._targets.objects, points.surface.view.mesh, self._stood, self._divided),
        )
        names = [[c.name for c in self.classes], [[size.name for size in c.sizes] for c in self.classes]]
        item[CLASS_NAMES] = json.dumps(names)
        # Whole numbers of a file's properties have 32 bits.
        seed = self.settings.seed
        item.data[SEED] = seed if seed < 2**31 else str(seed)
        item.data[VARIANTS] = variants_told(self._shapes)
        scales = np.repeat(scales_of(self.classes, self.settings), [len(c.sizes) for c in self.classes]).tolist()
        item.data[LOWEST_POINTS] = lowest_told(self._shapes, scales)
        item.data[UNREAD_STANDING] = self._unread
        self._keep_compared(item.data, self.placement, points)
        item.data[ON_WHOLE] = isinstance(self.chart, WholeSurface)
        return item, sources


def _variants(
    objects: Sequence[Sequence[int]], sources: Sequence[Reference], group: np.ndarray, source: np.ndarray
) -> np.ndarray:
    """Return which of their sizes' objects points show, 0 for those that show another one; shape ``[n]``.

    Args:
        objects: Of every size, its objects by their numbers among ``sources``.
        sources: All objects.
        group: Number of every point's size, shape ``[n]``.
        source: The session's number of what it shows, shape ``[n]``.
    """
    uids = np.array([one.uid for one in sources], np.int64)
    variant = np.zeros(len(group), np.int64)
    for number, own in enumerate(objects):
        for place, which in enumerate(own):
            variant[(group == number) & (source == uids[which])] = place
    return variant


def _with_note(placement: Placement, note: str) -> Placement:
    """Return a placement whose report, if it has one, also says this."""
    report = placement.report
    return placement if report is None else replace(placement, report=replace(report, notes=(*report.notes, note)))


def _is_rounded(placement: Placement, position: np.ndarray) -> bool:
    """Tell whether Blender, which holds positions in the world as float32, rounds them by more than the report sees of an overlap."""
    if not len(position):
        return False
    allowed = (UNREPORTED if placement.problem.avoid_overlap else UNSEEN) * math.sqrt(float(placement.area.min()))
    return float(np.spacing(np.abs(position).max())) > allowed


def _check_pinned(pinned: object, class_count: int) -> bool | list[int | None]:
    """Return whether what is pinned stays, or by class of the result which of so many it is now."""
    if isinstance(pinned, bool | np.bool_):
        return bool(pinned)
    entries = pinned.tolist() if isinstance(pinned, np.ndarray) else pinned
    if isinstance(entries, list | tuple):
        whole = [n if n is None else as_whole(n, 0, class_count - 1) for n in entries]
        if all((new is None) == (given is None) for new, given in zip(whole, entries, strict=True)):
            return whole
    raise ProblemError(
        f"`pinned` must be true, false, or for every class of the result a number from 0 to {class_count - 1} or None; got "
        f"{show(pinned)}"
    )


def _check_mode(replaced: bpy.types.Object | None) -> bpy.types.Object | None:
    """Refuse a result in Edit Mode: Blender neither says how its points were moved so far, nor gives it others."""
    if replaced is not None and replaced.mode == "EDIT":
        raise ProblemError(
            f'result "{replaced.name}" is in Edit Mode, where it cannot be replaced; switch to Object Mode'
        )
    return replaced


def _check_result(result: object) -> bpy.types.Object | None:
    if result is None:
        return None
    if not isinstance(result, bpy.types.Object):
        raise ProblemError(f"`result` must be an object that an earlier scatter made, or None; got {show(result)}")
    check_exists(result, "`result`")
    if not is_result(result):
        raise ProblemError(f'`result` must be an object that an earlier scatter made; "{result.name}" is not one')
    if not result.is_editable:
        # What is written onto it would be gone when the file is opened again.
        raise ProblemError(f'`result` must belong to this file; "{result.name}" is linked from another one')
    return result
