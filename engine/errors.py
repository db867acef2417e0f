"""What the engine raises when it is asked for something that cannot be done.

Every message is one sentence for the person who made the input: it names the key and the value, and says what would
be accepted. Front ends print it as it is, or have words of their own for a :class:`Refusal`: Blender's sidebar does.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

__all__ = ["DeviceError", "EshError", "InputFileError", "ProblemError", "Reason", "Refusal"]


class EshError(ValueError):
    """Base of every error that a user's input can cause."""


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
    # Side of the domain, and the nearest that it may be [m].
    DOMAIN_OUT_OF_RANGE = auto()


class Refusal(NamedTuple):
    """What a :class:`ProblemError` is about, for front ends that say it in words of their own.

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


class ProblemError(EshError):
    """A :class:`~esh.engine.problem.problem.Problem` that has no meaning: a count of 0, a density of zeros, ...

    Attributes:
        refusal: What it is about; None where its sentence is all that is known.
    """

    def __init__(self, message: str = "", refusal: Refusal | None = None) -> None:
        super().__init__(message)
        self.refusal = refusal


class DeviceError(EshError):
    """A device that does not exist or that this machine lacks."""


class InputFileError(EshError):
    """A file that cannot be read: missing, of another format, holding values that have no meaning."""
