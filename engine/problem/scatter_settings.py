"""Everything that a scatter in Blender can be told, beside what is placed and where.

Plain numbers and words, so that they can be kept apart from any scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from .balance import Balance
from .problem import SamplingSettings
from .settings import Choice, Settings, as_given, belongs_to, described, same_setting, setting
from .validation import LARGEST_ANGLE, LARGEST_LENGTH, Boundary

__all__ = ["BorderSettings", "RunSettings", "ScatterSettings", "Standing", "TargetSettings"]


@described
@dataclass(frozen=True, kw_only=True)
class Standing(Settings):
    """How objects stand on the surface."""

    align_to_normal: float = field(
        default=1.0,
        metadata=setting(
            "0: objects stand upright. 1: objects are perpendicular to the ground",
            label="Align to Ground",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )
    random_turn: float = field(
        default=2.0 * math.pi,
        metadata=setting(
            "Range of random rotation about the object's own axis, half of it to either side. 360° allows any direction: objects that "
            "must not overlap then turn as they fit",
            label="Random Rotation",
            more="Long bodies lie along their direction instead",
            unit="rad",
            low=0.0,
            high=LARGEST_ANGLE,
            soft_high=2.0 * math.pi,
        ),
    )
    tilt: float = field(
        default=0.0,
        metadata=setting(
            "Largest random lean of each object, in any direction",
            unit="rad",
            low=0.0,
            high=math.pi,
            soft_high=0.25 * math.pi,
        ),
    )
    stand_on: str = field(
        default="origin",
        metadata=setting(
            "What of an object touches the ground",
            choices=(
                Choice(
                    "origin",
                    "Origin",
                    "The object's origin: what is below it is in the ground, such as roots",
                    "ORIGIN",
                ),
                Choice(
                    "lowest",
                    "Lowest Point",
                    "The lowest point of its mesh, for objects whose origin is in their middle",
                    "LOWEST",
                ),
            ),
        ),
    )
    offset: float = field(
        default=0.0,
        metadata=setting(
            "How far objects are moved away from the ground, along its normal. Negative values sink them into it",
            unit="m",
            low=-LARGEST_LENGTH,
            high=LARGEST_LENGTH,
            soft_low=-1.0,
            soft_high=1.0,
        ),
    )
    scale: float = field(
        default=1.0,
        metadata=setting(
            "Factor on the size of objects, and so on the ground that each of them takes",
            low=0.001,
            high=1000.0,
            soft_low=0.1,
            soft_high=10.0,
        ),
    )
    scale_jitter: float = field(
        default=0.0,
        metadata=setting(
            "Largest random change of scale. With 0.2, each object is up to 20% smaller or larger",
            label="Random Scale",
            unit="share",
            low=0.0,
            high=0.99,
            soft_high=0.5,
        ),
    )


@described
@dataclass(frozen=True, kw_only=True)
class RunSettings(Settings):
    """Where and how long the solver runs."""

    device: str = field(
        default="auto",
        metadata=setting(
            "Where the placement is computed",
            choices=(
                Choice("auto", "Automatic", "An NVIDIA GPU if there is one, otherwise the CPU", "AUTO"),
                Choice("cpu", "CPU", "The processor", "CPU"),
                Choice("cuda:0", "NVIDIA GPU", "The first NVIDIA GPU (CUDA)", "CUDA"),
            ),
            # Whether there is such a device, the launcher finds out.
            check=as_given,
        ),
    )
    max_steps: int = field(
        default=100,
        metadata=setting(
            "Largest number of steps. More steps make the result more even. Above 100 little is gained",
            label="Max Steps",
            low=1,
            soft_low=20,
            soft_high=500,
        ),
    )


@described
@dataclass(frozen=True, kw_only=True)
class TargetSettings(Settings):
    """Which part of a target objects are placed on."""

    surface: str = field(
        default="above",
        metadata=setting(
            "The part of the target that objects stand on",
            choices=(
                Choice(
                    "above", "From Above", "What is visible from above. Walls get few objects, undersides none", "ABOVE"
                ),
                Choice("whole", "Whole Surface", "All of it: walls, undersides, closed meshes", "WHOLE"),
                Choice(
                    "auto",
                    "Automatic",
                    "From above if nearly all of it is visible from there, otherwise the whole surface",
                    "AUTO",
                ),
            ),
        ),
    )
    both_sides: bool = field(
        default=False,
        metadata=setting(
            "Let objects stand on both sides of every face, and not only on the side that its normal points to",
            more="Requires the whole surface",
        ),
    )
    face_material: str = field(
        default="",
        metadata=setting("Only faces with this material. Empty means all faces", label="Faces of Material", text=True),
    )
    face_group: str = field(
        default="",
        metadata=setting(
            "Only faces with an average weight above 0.5 in this vertex group. Empty means all faces",
            label="Faces of Vertex Group",
            text=True,
        ),
    )
    face_attribute: str = field(
        default="",
        metadata=setting(
            "Only faces where this attribute of the mesh, for example a selection, is true or above 0.5. Empty means all faces",
            label="Faces of Attribute",
            text=True,
        ),
    )


@described
@dataclass(frozen=True, kw_only=True)
class BorderSettings(Settings):
    """What objects do along the edges of a target seen from above."""

    boundary: Boundary = field(
        default="open",
        metadata=setting(
            "How objects stand along the border of what is seen from above. Counts do not change",
            label="Border",
            more="A whole surface goes on around its edges, and has no such border",
            choices=(
                Choice("open", "Lined Up", "Objects line up along the edges of the ground and of densities", "OPEN"),
                Choice(
                    "natural",
                    "Natural",
                    "As if the scatter went on outside and were cut: no rows along edges, holes and shores",
                    "NATURAL",
                ),
                Choice(
                    "mirror",
                    "Mirrored",
                    "As if the edges of a rectangular ground were mirrors: objects keep their distance from them, as from each other",
                    "MIRROR",
                ),
            ),
        ),
    )


@belongs_to("scatter", named=False)
@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ScatterSettings(BorderSettings, TargetSettings, Standing, RunSettings, SamplingSettings, Balance):
    """How a scatter in Blender is made. :func:`~esh.scatter` takes one, or its settings by name.

    Raises:
        ProblemError: A value without meaning.
    """

    avoid_overlap: bool = field(default=True, metadata=same_setting(SamplingSettings, "avoid_overlap"))

    def _key(self, name: str) -> str:
        return f"`{name}`"
