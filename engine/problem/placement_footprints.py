"""What the bodies of a placement take of the ground."""

from __future__ import annotations

from .body_footprints import BodyFootprints, footprints_of
from .placement import Placement

__all__ = ["footprints_of_placement"]


def footprints_of_placement(placement: Placement) -> BodyFootprints:
    """Return the outlines of the bodies of a placement: those that it says, which edits may have brought along."""
    asked = footprints_of(placement.problem)
    if len(placement.position) != len(asked.shape):
        # Ghosts are no part of it.
        raise ValueError("a placement without its ghosts has no outlines of its problem")
    return asked.with_outlines(placement.variant, placement.scale) if asked.has_outlines else asked
