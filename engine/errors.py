"""What the engine raises when it is asked for something that cannot be done.

Every message is one sentence for the person who made the input: it names the key and the value, and says what would
be accepted. Front ends print it as it is, or have words of their own for a :class:`Refusal`: Blender's sidebar does.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

__all__ = ["DeviceError", "EshError", "InputFileError", "ProblemError", "Reason", "Refusal"]


class Reason(Enum):
    """Why settings that each have a meaning may have none together: what somebody can ask for who has set each of them well.

    Each stands with what ``given`` and ``limit`` of its :class:`Refusal` are.
    """

    # Length of the longest body, and of the longer side of the domain [m].
    LINE_TOO_LONG = auto()
    # Length of the shortest axis, and of the longer side of the domain [m].
    LINE_TOO_SHORT = auto()
    # Length of the longest body, and of the side of the domain beside which it is too long [m].
    BODY_TOO_LONG = auto()
    # Largest area, and smallest area of the other size [m²].
    AREAS_TOO_DIFFERENT = auto()
    # All footprints over the domain, and the most that they may be.
    TOO_MUCH_GROUND = auto()
    # The largest weight over the smallest, as its decimal logarithm, and the most that it may be.
    TOO_MUCH_EMPHASIS = auto()
    # Area of a fixed body, and smallest area of all others [m²].
    FIXED_AREA = auto()
    # Length of the longest fixed body, and of the side of the domain beside which it is too long [m].
    FIXED_LENGTH = auto()
    # Diameter of clumps, and the least that it may be [m].
    CLUMPS_TOO_SMALL = auto()
    # Longer side of the domain, and shorter side [m].
    DOMAIN_TOO_NARROW = auto()
    # Side of the domain, or extent of the surface, and the nearest that it may be [m].
    DOMAIN_OUT_OF_RANGE = auto()
    # Area of the surface, and what it must be above [m²].
    SURFACE_WITHOUT_AREA = auto()
    # How many sides of what is seen from above are too short, and how many may be.
    NOT_SEEN_FROM_ABOVE = auto()
    # Bodies in all, and about how many of them the machine has memory for; of the largest count.
    MEMORY_FOR_BODIES = auto()
    # Bodies in all, or of the class, and the most that can be numbered; of the largest count.
    TOO_MANY_BODIES = auto()
    # What the meshes of groups take, and what the machine has [bytes].
    MEMORY_FOR_GROUPS = auto()
    # What densities take, and what the machine has [bytes]; of the largest.
    MEMORY_FOR_DENSITIES = auto()
    # What a density with clumps takes, and what the machine has [bytes].
    MEMORY_FOR_CLUMPS = auto()
    # How strongly bodies gather, and the most that they may.
    CLUMPS_ON_SURFACE = auto()
    # How strongly a density is sharpened that is no image, and the most that it may be.
    SHARPENED_ON_SURFACE = auto()
    # Largest density, and what it must be above.
    NO_DENSITY = auto()
    # Largest value, and the most that a share of the ground may be.
    DENSITY_ABOVE_ONE = auto()
    # Largest value of what was sharpened, and what it must be above; neither where it is not finite.
    SHARPENED_TOO_MUCH = auto()
    # What a density with a count of "cover" adds up to, and the mean area of a body [m²].
    COVER_BELOW_ONE_BODY = auto()
    # What fixed bodies take, and what the class can cover [m²].
    COVER_BESIDE_FIXED = auto()
    # What other classes take, and what fits [m²].
    COVER_BESIDE_COUNTED = auto()
    # Bodies of the class, and the share of them that is none.
    SHARE_BELOW_ONE_BODY = auto()
    # Obstacles, and how many of them leave the class some ground.
    OBSTACLES_EVERYWHERE = auto()
    # How far bodies keep away from obstacles [m], and how far they could.
    OBSTACLES_TOO_NEAR = auto()
    # Fixed bodies, and how many of them there may be.
    ALL_FIXED = auto()
    # The count, and how many are fixed.
    FEWER_THAN_FIXED = auto()
    # How far a fixed body is away from the surface at least, and the most that it may be [m].
    FIXED_OFF_SURFACE = auto()
    # How far classes are mixed of which some may overlap, and how far they may be.
    MIXED_TOO_MUCH = auto()
    # Numbers that are not finite, and how many may be so.
    FORCES_NOT_FINITE = auto()
    # GPUs that were asked for, and that there are.
    NO_SUCH_DEVICE = auto()


class Refusal(NamedTuple):
    """What an error is about, for front ends that say it in words of their own.

    Attributes:
        reason: Why it was raised.
        given: What was given; see :class:`Reason`.
        limit: What it is compared with.
        who: Names of the class and the size that it is about; the size's is empty where the class has one only, both where it is
            about none.
        other: Of the size that it is compared with.
    """

    reason: Reason
    given: float
    limit: float
    who: tuple[str, str] = ("", "")
    other: tuple[str, str] = ("", "")


class EshError(ValueError):
    """Base of every error that a user's input can cause.

    Attributes:
        refusal: The same as data, so that an interface can say it in its own words; None where there is only the sentence.
    """

    def __init__(self, message: str = "", refusal: Refusal | None = None) -> None:
        super().__init__(message)
        self.refusal = refusal


class ProblemError(EshError):
    """A problem, or an argument, that is not valid: a count of 0 or a density of zeros, for example."""


class DeviceError(EshError):
    """A device that does not exist, or that this machine does not have."""


class InputFileError(EshError):
    """A file that cannot be read: it is missing, of another format, or holds invalid values."""
