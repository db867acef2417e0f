"""Flags of single bodies: pinned bodies and ghosts."""

from __future__ import annotations

import enum

import numpy as np

from ..errors import ProblemError
from ..problem.given_values import FOREIGN_ERRORS, show

__all__ = ["BodyFlags", "checked_flags"]


class BodyFlags(enum.IntFlag):
    """Flags of a body, combined with ``|``; 0 for an ordinary one.

    Attributes:
        PINNED: The body acts on others, and does not move.
        GHOST: The body acts on others, and is left out of the placement.
    """

    PINNED = 1
    GHOST = 2


def checked_flags(flags: object, body_count: int) -> np.ndarray:
    """Return flags of bodies, shape ``[body_count]``, int32; raise ProblemError for anything else."""
    try:
        given = np.asarray(flags)
        usable = (
            given.shape == (body_count,) and given.dtype.kind in "biu" and bool((given == given.astype(np.int32)).all())
        )
    except FOREIGN_ERRORS:
        usable = False
    if not usable:
        raise ProblemError(f"`flags` must be whole numbers, one for each of {body_count} bodies; got {show(flags)}")
    return given.astype(np.int32)
