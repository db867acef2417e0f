"""Scattering in Blender, for scripts: works in pip's ``bpy`` and in ``blender -b`` without anything registered.

:func:`scatter` does everything. :class:`ScatterJob` is the same in three phases, so that an operator can run the middle
one, which does not touch Blender, in a thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..engine.checks import check_area, check_count, check_name, check_seed, check_unique, show
from ..engine.device import resolve_device
from ..engine.errors import EshError, ProblemError
from ..engine.placement import Placement
from ..engine.problem import Balance, BodyClass, Domain, Problem, Size
from ..engine.relaxation import Progress, solve
from ..engine.report import Report
from .chart import Chart
from .densities import AttributeDensity, Density, ImageDensity, VertexGroupDensity, density_at
from .footprint import footprint_area
from .node_group import INSTANCE_INDEX, ROTATION, SCALE
from .result import body_rotations, find_result, write_result
from .target import RESULT_TAG, check_target, read_target

__all__ = [
    "AttributeDensity",
    "EshError",
    "ImageDensity",
    "ScatterClass",
    "ScatterJob",
    "ScatterResult",
    "ScatterSize",
    "VertexGroupDensity",
    "scatter",
]

# Objects that have a geometry to instance; lights, cameras and empties in a collection are passed over.
_INSTANCED_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}


@dataclass(frozen=True)
class ScatterSize:
    """One size of a class.

    Attributes:
        name: Unique within its class.
        count: Number of bodies; placed exactly.
        source: The object to instance; or a collection, whose objects are variants: each point gets one of them, by seed.
        area: Footprint of one body [m²]; None measures it from the mesh seen from above (a collection's is the mean of
            its objects').
    """

    name: str
    count: int
    source: bpy.types.Object | bpy.types.Collection
    area: float | None = None


@dataclass(frozen=True, eq=False)
class ScatterClass:
    """One class of bodies that follows one density.

    Attributes:
        name: Unique.
        sizes: At least one.
        density: Per area of surface: a number (the same everywhere), an image, a vertex group or an attribute; an image
            of Blender or an array ``[height, width]`` by itself is stretched over the target seen from above.
        color: Red, green, blue and optionally alpha, kept as the points' attribute ``class_color``.
    """

    name: str
    sizes: Sequence[ScatterSize]
    density: Density = 1.0
    color: Sequence[float] | None = None


@dataclass(frozen=True, eq=False)
class ScatterResult:
    """What a run made.

    Attributes:
        object: The result in the scene.
        report: What was reached.
        placement: Where the bodies are in the target's bounding rectangle.
    """

    object: bpy.types.Object
    report: Report
    placement: Placement


class ScatterJob:
    """A scatter in three phases; see :func:`scatter` for the arguments.

    The constructor reads everything from Blender and changes nothing, :meth:`solve` may run in any thread, and
    :meth:`write` changes the scene.

    Attributes:
        problem: What the sampler is asked.
        placement: What it answered; None before :meth:`solve`.

    Raises:
        EshError: Something asked for is missing or has no meaning.
    """

    def __init__(
        self,
        target: bpy.types.Object,
        classes: Sequence[ScatterClass],
        *,
        class_separation: float = 0.5,
        size_emphasis: float = 2.0,
        seed: int = 0,
        device: str = "auto",
        max_steps: int = 150,
        align_to_normal: float = 1.0,
        random_turn: float = 2.0 * math.pi,
        scale_jitter: float = 0.0,
        name: str = "ESH Scatter",
        result: bpy.types.Object | None = None,
    ) -> None:
        context = bpy.context
        balance = Balance(class_separation, size_emphasis)
        self.seed = check_seed(seed)
        self.max_steps = check_count(max_steps, "`max_steps`")
        self.align_to_normal = _number(align_to_normal, "`align_to_normal`", 0.0, 1.0)
        self.random_turn = _number(random_turn, "`random_turn`", 0.0, math.inf)
        self.scale_jitter = _number(scale_jitter, "`scale_jitter`", 0.0, 0.99)
        self.name = check_name(name, "`name`")
        self.device = device
        resolve_device(device)
        self.target = check_target(target, context)
        self.result = _check_result(result)
        self.classes = _check_classes(classes)
        # Per group (class and size): indices into `sources` of its variants.
        self.sources: list[bpy.types.Object] = []
        self.variants: list[list[int]] = []
        areas = []
        for scatter_class in self.classes:
            for size in scatter_class.sizes:
                key = f'size "{size.name}" of class "{scatter_class.name}"'
                members = _source_objects(size.source, self.target, key)
                areas.append(_area(size.area, members, context, key))
                self.variants.append([self._source_index(member) for member in members])
        names = {
            str(c.density.name) for c in self.classes if isinstance(c.density, VertexGroupDensity | AttributeDensity)
        }
        self.chart = Chart(read_target(self.target, context, names))
        area = iter(areas)
        self.problem = Problem(
            Domain((float(self.chart.size[0]), float(self.chart.size[1]))),
            [
                BodyClass(c.name, [Size(s.name, next(area), s.count) for s in c.sizes], density=self._density(c))
                for c in self.classes
            ],
            balance,
            self.seed,
        )
        self.placement: Placement | None = None

    def solve(self, progress: Callable[[Progress], bool | None] | None = None) -> None:
        """Place the bodies; touches nothing of Blender. ``progress`` is the engine's: returning False stops the run."""
        self.placement = solve(self.problem, device=self.device, max_steps=self.max_steps, progress=progress)

    def write(self, context: bpy.types.Context | None = None) -> ScatterResult:
        """Make the result object, or replace the points of an earlier one; on the main thread only."""
        if self.placement is None:
            raise ProblemError("a scatter must be solved before it is written")
        scene = (context or bpy.context).scene
        surface = self.chart.lift(self.placement.position)
        replaced = self.result or find_result(scene, self.target, self.name)
        item = write_result(
            scene, replaced, self.target, self.name, self.sources, surface.position, self._attributes(surface.normal)
        )
        return ScatterResult(item, self.placement.report, self.placement)

    def _source_index(self, member: bpy.types.Object) -> int:
        if member not in self.sources:
            self.sources.append(member)
        return self.sources.index(member)

    def _density(self, scatter_class: ScatterClass) -> np.ndarray:
        key = f'`density` of class "{scatter_class.name}"'
        image = self.chart.image(density_at(scatter_class.density, self.chart.points, key))
        if not image.any():
            raise ProblemError(f'{key} must be above 0 somewhere on target "{self.target.name}"; it is 0 everywhere')
        return image

    def _attributes(self, normal: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
        placement = self.placement
        count = len(placement.position)
        # Three numbers for each point, in the points' order: a longer list of bodies leaves the earlier ones as they are.
        random = np.random.default_rng([self.seed, 1]).random((count, 3))
        first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in self.classes])])
        group = first[placement.class_index] + placement.size_index
        instance = np.empty(count, np.int32)
        for number, variants in enumerate(self.variants):
            chosen = group == number
            instance[chosen] = np.array(variants)[(random[chosen, 0] * len(variants)).astype(int)]
        turn = placement.angle + self.random_turn * random[:, 1]
        scale = 1.0 + self.scale_jitter * (2.0 * random[:, 2] - 1.0)
        colors = np.array([_rgba(c.color) for c in self.classes])
        return {
            "id": ("INT", np.arange(count)),
            "class_index": ("INT", placement.class_index),
            "size_index": ("INT", placement.size_index),
            INSTANCE_INDEX: ("INT", instance),
            ROTATION: ("QUATERNION", body_rotations(normal, self.align_to_normal, turn)),
            SCALE: ("FLOAT_VECTOR", np.repeat(scale[:, None], 3, axis=1)),
            "class_color": ("FLOAT_COLOR", colors[placement.class_index]),
        }


def scatter(
    target: bpy.types.Object,
    classes: Sequence[ScatterClass],
    *,
    class_separation: float = 0.5,
    size_emphasis: float = 2.0,
    seed: int = 0,
    device: str = "auto",
    max_steps: int = 150,
    align_to_normal: float = 1.0,
    random_turn: float = 2.0 * math.pi,
    scale_jitter: float = 0.0,
    name: str = "ESH Scatter",
    result: bpy.types.Object | None = None,
    progress: Callable[[Progress], bool | None] | None = None,
) -> ScatterResult:
    """Place objects on a mesh, all classes and sizes at once.

    Args:
        target: Mesh object of the current view layer, used with its modifiers and as it stands in the world. It is seen
            from above: where it overhangs itself, the topmost surface counts.
        classes: What to place, how many, following which densities.
        class_separation: 0 places every class as if it were alone, 1 spreads only the union.
        size_emphasis: 1 or more: how much more the larger sizes are spread evenly among themselves.
        seed: The same arguments, seed and device give the same result.
        device: ``"auto"``, ``"cpu"`` or ``"cuda:0"``.
        max_steps: Steps of the relaxation at most.
        align_to_normal: 0 leaves bodies upright, 1 sets them along the surface's normal.
        random_turn: Bodies are turned about their own axis by a random angle from 0 to this [rad].
        scale_jitter: Bodies are scaled by a random factor within 1 ± this, below 1.
        name: Of the result object. A result that this name left on this target in this scene is replaced.
        result: Result to replace instead; None looks for one as said above, and makes a new object if there is none.
        progress: Called after every step; returning False stops the run, and what is there is written.

    Returns:
        The result object, the report and the placement.

    Raises:
        EshError: One sentence that says what is wrong; nothing was changed.
    """
    job = ScatterJob(
        target,
        classes,
        class_separation=class_separation,
        size_emphasis=size_emphasis,
        seed=seed,
        device=device,
        max_steps=max_steps,
        align_to_normal=align_to_normal,
        random_turn=random_turn,
        scale_jitter=scale_jitter,
        name=name,
        result=result,
    )
    job.solve(progress)
    return job.write()


def _number(value: object, key: str, low: float, high: float) -> float:
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        number = float(value)
        if math.isfinite(number) and low <= number <= high:
            return number
    span = f"between {low:g} and {high:g}" if math.isfinite(high) else f"of {low:g} or more, and finite"
    raise ProblemError(f"{key} must be a number {span}; got {show(value)}")


def _check_result(result: object) -> bpy.types.Object | None:
    if result is None:
        return None
    if not isinstance(result, bpy.types.Object):
        raise ProblemError(f"`result` must be an object that an earlier scatter made, or None; got {show(result)}")
    if not result.get(RESULT_TAG) or result.type != "MESH":
        raise ProblemError(f'`result` must be an object that an earlier scatter made; "{result.name}" is not one')
    return result


def _check_classes(classes: object) -> list[ScatterClass]:
    if not isinstance(classes, Sequence) or not all(isinstance(entry, ScatterClass) for entry in classes):
        raise ProblemError(f"`classes` must be a list of ScatterClass; got {show(classes)}")
    if not classes:
        raise ProblemError("`classes` must hold at least one class; got none")
    for entry in classes:
        key = f'class "{check_name(entry.name, "`name` of a class")}"'
        sizes = entry.sizes
        if not isinstance(sizes, Sequence) or not all(isinstance(size, ScatterSize) for size in sizes) or not sizes:
            raise ProblemError(f"`sizes` of {key} must be a list of at least one ScatterSize; got {show(sizes)}")
        for size in sizes:
            check_name(size.name, f"`name` of a size of {key}")
            check_count(size.count, f'`count` of size "{size.name}" of {key}')
        check_unique([size.name for size in sizes], f"size names of {key}")
        if entry.color is not None:
            try:
                usable = len(entry.color) in (3, 4) and np.isfinite(np.array(entry.color, np.float64)).all()
            except (TypeError, ValueError):
                usable = False
            if not usable:
                raise ProblemError(f"`color` of {key} must be 3 or 4 finite numbers; got {show(entry.color)}")
    check_unique([entry.name for entry in classes], "class names")
    return list(classes)


def _source_objects(source: object, target: bpy.types.Object, key: str) -> list[bpy.types.Object]:
    """Return the objects that a size instances: the source itself, or the variants in a collection, by name."""
    if isinstance(source, bpy.types.Collection):
        where = f'collection "{source.name}"'
        members = [item for item in source.all_objects if item.type in _INSTANCED_TYPES]
        if not members:
            raise ProblemError(f"`source` of {key} must hold objects with geometry; {where} has none")
    elif isinstance(source, bpy.types.Object):
        where, members = f'object "{source.name}"', [source]
        if source.type not in _INSTANCED_TYPES:
            raise ProblemError(f"`source` of {key} must have geometry; {where} is of type {source.type}")
    else:
        raise ProblemError(f"`source` of {key} must be an object or a collection; got {show(source)}")
    for member in members:
        if member == target:
            raise ProblemError(
                f'`source` of {key} must not hold the target "{target.name}", which would stand on itself'
            )
        if member.get(RESULT_TAG):
            raise ProblemError(f'`source` of {key} must not hold the result of a scatter; "{member.name}" is one')
    return sorted(members, key=lambda member: member.name_full)


def _area(area: object, members: list[bpy.types.Object], context: bpy.types.Context, key: str) -> float:
    if area is None:
        return float(np.mean([footprint_area(member, context, f"`area` of {key}") for member in members]))
    return check_area(area, f"`area` of {key}")


def _rgba(color: Sequence[float] | None) -> tuple[float, ...]:
    return (1.0, 1.0, 1.0, 1.0) if color is None else (*color, 1.0)[:4]
