"""What a scatter is asked for: classes and their sizes, and whether what they say has a meaning."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.body_class import BodyClass, ClassSettings
from ...engine.problem.direction_field import direction_from_rg
from ...engine.problem.given_values import as_float, check_unique, show
from ...engine.problem.line import Line
from ...engine.problem.look_at import LookAt
from ...engine.problem.scatter_settings import ScatterSettings, Standing
from ...engine.problem.settings import Settings, as_given, belongs_to, described, same_setting, setting, values_of
from ...engine.problem.size import Size
from ...engine.problem.surface_directions import SLOPE
from ...engine.problem.validation import check_class_count, check_count, check_direction
from ..densities.density_source import Density
from ..densities.image_pixels import image_pixels
from ..targets.target import check_exists
from .amount import Amount
from .directions import DirectionSource
from .standing import turns_any_way

__all__ = [
    "ScatterClass",
    "ScatterSize",
    "check_classes",
    "color_of",
    "direction_of",
    "point_of",
    "standing_of",
    "turns_freely",
]


def _check_weights(value: object, key: str) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise ProblemError(f"{key} must be numbers by the names of objects; got {show(value)}")
    weights = {str(name): as_float(weight) for name, weight in value.items()}
    for name, weight in weights.items():
        if weight is None or not 0.0 <= weight < math.inf:
            raise ProblemError(f'{key} must be numbers of 0 or more; "{name}" has {show(value[name])}')
    return {name: weight for name, weight in weights.items() if weight is not None}


def _check_look_at(value: object, key: str) -> LookAt:
    if isinstance(value, LookAt):
        return value
    if not isinstance(value, bpy.types.Object):
        raise ProblemError(f"{key} must be a LookAt, an object or None; got {show(value)}")
    check_exists(value, key)
    return LookAt(point_of(value))


def point_of(item: bpy.types.Object) -> tuple[float, float, float]:
    """Return where an object's origin is in the world [m]: what is looked at."""
    x, y, z = item.matrix_world.translation
    return float(x), float(y), float(z)


@belongs_to("scatter")
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
            "body. Where objects must not overlap, True and a Line make them capsules, and one `area` for all makes those discs of it "
            "that are not long; all others keep their own outlines apart",
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


@belongs_to("scatter")
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
    direction: str | float | np.ndarray | bpy.types.Image | DirectionSource = field(
        default="density",
        metadata=setting(
            "Where long objects of this class point, seen from above",
            more='``"density"`` (along its edges, of which the target\'s border is none), ``"none"``, ``"slope"`` (where water runs), '
            "an angle [rad], an array of angles or vectors (see :class:`~esh.Line`), or an image of Blender whose red and green are x "
            "and y; images are stretched over the target. Or a :class:`~esh.CurveDirection` or an :class:`~esh.AttributeDirection`, "
            "which point along the surface. A size whose ``line`` is a :class:`~esh.Line` has its own",
            check=as_given,
        ),
    )

    look_at: LookAt | bpy.types.Object | None = field(
        default=None,
        kw_only=True,
        metadata=same_setting(
            ClassSettings,
            "look_at",
            more="A :class:`~esh.LookAt`, or an object, whose origin in the world counts. Long objects lie along their direction "
            "instead",
            check=_check_look_at,
        ),
    )

    def _key(self, name: str) -> str:
        return "`name` of a class" if name == "name" else f'`{name}` of class "{self.name}"'


def check_classes(classes: object) -> list[ScatterClass]:
    """Return the classes of a scatter.

    Raises:
        ProblemError: They are no list of classes with sizes, or something in one of them has no meaning.
    """
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
        direction_of(entry)
        if entry.color is not None:
            try:
                with np.errstate(over="ignore"):
                    usable = len(entry.color) in (3, 4) and np.isfinite(np.array(entry.color, np.float32)).all()
            except (OverflowError, TypeError, ValueError):
                usable = False
            if not usable:
                raise ProblemError(
                    f"`color` of {key} must be 3 or 4 numbers that are finite in 32 bits; got {show(entry.color)}"
                )
    check_unique([entry.name for entry in classes], "class names")
    return list(classes)


def direction_of(scatter_class: ScatterClass) -> str | float | np.ndarray | DirectionSource:
    """Return where long bodies point as a :class:`Line` takes it, or what it is read from; raise ProblemError for anything else."""
    key = f'`direction` of class "{scatter_class.name}"'
    direction = scatter_class.direction
    if isinstance(direction, DirectionSource) or (isinstance(direction, str) and direction == SLOPE):
        return direction
    if isinstance(direction, bpy.types.Image):
        pixels = image_pixels(direction, key)
        if pixels.shape[2] < 2:
            raise ProblemError(
                f'{key}: image "{direction.name}" must have a red and a green channel; it has one channel'
            )
        direction = direction_from_rg(pixels)
    return check_direction(direction, key)


def standing_of(scatter_class: ScatterClass, settings: ScatterSettings) -> Standing:
    """Return how objects of a class stand: as it says, or as all do."""
    return scatter_class.standing or Standing(**values_of(settings, Standing))


def turns_freely(scatter_class: ScatterClass, settings: ScatterSettings) -> bool:
    """Tell whether objects of a class may be turned in any direction, so that they may turn on from what was drawn for them."""
    return scatter_class.look_at is None and turns_any_way(standing_of(scatter_class, settings))


def color_of(scatter_class: ScatterClass) -> tuple[float, ...]:
    """Return the color of a class's points: red, green, blue, alpha; white where it has none."""
    return (1.0, 1.0, 1.0, 1.0) if scatter_class.color is None else (*scatter_class.color, 1.0)[:4]
