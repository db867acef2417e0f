"""What a kind of body is asked: where its charges are, how long and wide it is, how much ground it covers.

A kind is a class with the members of :class:`BodyKind`. There are two: :class:`Dot` and :class:`~.line.Line`. Which of them the bodies
of a size are says :attr:`.size.Size.kind`. What prepares, checks and draws bodies asks these members, and not which kind it is.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

__all__ = ["DOT", "BodyKind", "Dot", "disc_radius", "radius_of"]


def disc_radius(area: np.ndarray | float) -> Any:
    """Radius [m] of discs of these areas [m²]: the footprints of dots."""
    return np.sqrt(np.asarray(area) / np.pi)


def radius_of(width: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Half the thickness of capsules of these widths [m], or the radius of discs of these areas [m²] where it is 0, shape ``[n]``."""
    return np.where(width > 0.0, 0.5 * width, disc_radius(area))


class BodyKind(Protocol):
    """A kind of body; areas are those of its footprint [m²], lengths those of its axis [m], 0 where it has none."""

    @property
    def charges(self) -> int:
        """Number of its charges."""

    @property
    def has_axis(self) -> bool:
        """Whether it has an axis, with a direction and a length that the forces turn and stretch; its footprint is a capsule then."""

    @property
    def longest(self) -> float:
        """The largest preferred length [m]."""

    @property
    def mean_length(self) -> float:
        """The mean preferred length [m]."""

    def charge_places(self) -> np.ndarray:
        """Coordinate of every charge along the axis, -1 at one end to 1 at the other, shape ``[charges]``."""

    def charge_shares(self) -> np.ndarray:
        """Share of the body's charge at every place, shape ``[charges]``, float64, sum 1."""

    def thickness(self, area: np.ndarray, mean_length: float) -> np.ndarray:
        """Thickness [m] of the capsules around axes of a mean length, shape ``[n]``; 0 where there is no axis."""

    def reach_across(self, area: np.ndarray) -> np.ndarray:
        """How far the footprint reaches from the nearest charge or place on the axis [m], shape ``[n]``."""

    def ground(self, area: float) -> float:
        """Ground that a body of the mean area covers [m²]."""

    def narrowest(self, area: float) -> float:
        """Smallest width of the footprint [m]; 0 where it is not known before the run."""

    def extent(self, area: float) -> float:
        """From one end of the footprint to the other [m], at most."""


class Dot:
    """A body with one charge. Its footprint is a disc of its area."""

    charges = 1
    has_axis = False
    longest = 0.0
    mean_length = 0.0

    def charge_places(self) -> np.ndarray:
        """See :class:`BodyKind`."""
        return np.zeros(1)

    def charge_shares(self) -> np.ndarray:
        """See :class:`BodyKind`."""
        return np.ones(1)

    def thickness(self, area: np.ndarray, mean_length: float) -> np.ndarray:
        """See :class:`BodyKind`."""
        return np.zeros(len(area))

    def reach_across(self, area: np.ndarray) -> np.ndarray:
        """See :class:`BodyKind`."""
        return disc_radius(area)

    def ground(self, area: float) -> float:
        """See :class:`BodyKind`."""
        return area

    def narrowest(self, area: float) -> float:
        """See :class:`BodyKind`."""
        return 2.0 * float(disc_radius(area))

    def extent(self, area: float) -> float:
        """See :class:`BodyKind`."""
        return 2.0 * float(disc_radius(area))


DOT = Dot()
