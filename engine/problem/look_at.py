"""Bodies that look at a point: how each of them is turned, from where it is.

NumPy only, so that Blender can ask without a solver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .random_numbers import random_shares
from .settings import Choice, Settings, belongs_to, described, setting
from .validation import LARGEST_LENGTH

__all__ = ["FRONTS", "LookAt", "aside", "facing", "facing_on_surface"]

# Where a body's front is before it is turned: the angle of that axis [rad].
FRONTS = {"-y": -0.5 * math.pi, "y": 0.5 * math.pi, "x": 0.0, "-x": math.pi}


@belongs_to("problem", "scatter")
@described
@dataclass(frozen=True)
class LookAt(Settings):
    """Where bodies look, and how closely."""

    point: tuple[float, float, float] = field(
        default=(0.0, 0.0, 0.0),
        metadata=setting(
            "The point that objects look at",
            more="x, y and z; in a rectangle z is ignored, in Blender they are coordinates of the world",
            unit="m",
            low=-LARGEST_LENGTH,
            high=LARGEST_LENGTH,
        ),
    )
    spread: float = field(
        default=0.0,
        metadata=setting(
            "Largest random angle by which objects look past the point, to either side",
            unit="rad",
            low=0.0,
            high=math.pi,
        ),
    )
    front: str = field(
        default="-y",
        metadata=setting(
            "The side of the object that faces the point",
            choices=(
                Choice("-y", "-Y", "What the front view shows", "NEGATIVE_Y"),
                Choice("y", "Y", "What the back view shows", "POSITIVE_Y"),
                Choice("x", "X", "What the right view shows", "POSITIVE_X"),
                Choice("-x", "-X", "What the left view shows", "NEGATIVE_X"),
            ),
        ),
    )

    def _key(self, name: str) -> str:
        return f"`look_at.{name}`"

    @property
    def turn(self) -> float:
        """Turn of a body that looks along the x axis [rad]."""
        return -FRONTS[self.front]


def aside(look: LookAt, identity: np.ndarray, seed: int) -> np.ndarray:
    """Return how far bodies look past the point [rad], shape ``[n]``; other bodies leave each of them as it is.

    Args:
        look: Where they look.
        identity: Their numbers, shape ``[n]``.
        seed: Of the run.
    """
    if look.spread == 0.0:
        return np.zeros(len(identity))
    return look.spread * (2.0 * random_shares(identity, [seed, 9]) - 1.0)


def facing(look: LookAt, position: np.ndarray, identity: np.ndarray, seed: int) -> np.ndarray:
    """Return the turns with which bodies in a rectangle look at the point [rad], shape ``[n]``.

    Args:
        look: Where they look.
        position: Where they are [m], shape ``[n, 2]``.
        identity: Their numbers, shape ``[n]``.
        seed: Of the run.
    """
    way = np.array(look.point[:2]) - position
    return np.arctan2(way[:, 1], way[:, 0]) + look.turn + aside(look, identity, seed)


def facing_on_surface(
    look: LookAt, position: np.ndarray, along: np.ndarray, beside: np.ndarray, identity: np.ndarray, seed: int
) -> np.ndarray:
    """Return the turns about their own axes with which bodies on a surface look at the point [rad], shape ``[n]``.

    Args:
        look: Where they look.
        position: Where they are [m], shape ``[n, 3]``.
        along: Their x axes if they are not turned, of length 1, shape ``[n, 3]``.
        beside: Their y axes then.
        identity: Their numbers, shape ``[n]``.
        seed: Of the run.
    """
    way = np.array(look.point) - position
    turn = np.arctan2((way * beside).sum(axis=1), (way * along).sum(axis=1))
    return turn + look.turn + aside(look, identity, seed)
