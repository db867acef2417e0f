"""Where every ingredient is wanted on each pizza: densities and directions as arrays, made by formulas.

An array covers a square of ``2 * half`` meters around the pizza's middle; row 0 is its top, x runs to the right, y up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

__all__ = ["MENU", "Pizza", "Topping", "draw"]

PIXELS = 240
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Topping:
    """One ingredient of one pizza.

    Attributes:
        counts: Number of pieces of each size, largest first.
        density: Of x and y, each -1..1 across the flat part of the pizza.
        direction: Of long pieces: a keyword of ``ScatterClass``, or an angle [rad] of x and y.
    """

    counts: tuple[int, ...]
    density: Field
    direction: str | Field = "density"


@dataclass(frozen=True)
class Pizza:
    """What is on a pizza: toppings by ingredient."""

    name: str
    toppings: dict[str, Topping] = field(default_factory=dict)


def draw(function: Field, half: float, unit: float) -> np.ndarray:
    """Evaluate a function of -1..1 on the pixels of a square of ``2 * half`` [m]; ``unit`` is the length of 1 [m]."""
    step = (np.arange(PIXELS) + 0.5) / PIXELS * 2.0 - 1.0
    x, y = np.meshgrid(step * half / unit, -step * half / unit)
    return np.broadcast_to(np.asarray(function(x, y), float), x.shape)


def _soft(value: np.ndarray, width: float) -> np.ndarray:
    """0 below -width, 1 above width, smooth between."""
    t = np.clip(0.5 + 0.5 * value / width, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _quarter(number: int) -> Field:
    """One of four quarters, counter-clockwise from the upper right."""
    sign = ((1, 1), (-1, 1), (-1, -1), (1, -1))[number]
    return lambda x, y: _soft(sign[0] * x - 0.05, 0.04) * _soft(sign[1] * y - 0.05, 0.04)


def _ring(radius: float, width: float) -> Field:
    return lambda x, y: np.exp(-(((np.hypot(x, y) - radius) / width) ** 2))


def _tangent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.arctan2(x, -y)


def _radial(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.arctan2(y, x)


def _arms(number: int, twist: float, sharpness: float) -> Field:
    """A spiral of some arms that turn by ``twist`` [rad] from the middle to the rim."""

    def density(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        angle = number * (np.arctan2(y, x) - twist * np.hypot(x, y))
        return np.exp(sharpness * (np.cos(angle) - 1.0)) * _soft(np.hypot(x, y) - 0.12, 0.1)

    return density


def _spiral_direction(twist: float) -> Field:
    """Angle along the arms of such a spiral."""
    return lambda x, y: np.arctan2(y, x) + np.arctan(twist * np.hypot(x, y))


def _arms_and_between() -> tuple[Field, Field]:
    arms = _arms(3, 2.6, 7.0)
    return arms, lambda x, y: np.clip(1.0 - 1.6 * arms(x, y), 0.0, 1.0)


_ARMS, _BETWEEN = _arms_and_between()

MENU = (
    Pizza(
        "Four quarters",
        {
            "ham": Topping((2, 2, 3), _quarter(0)),
            "mushroom": Topping((2, 4, 5), _quarter(1)),
            "salami": Topping((3, 3, 6), _quarter(2)),
            "chilli": Topping((2, 2), _quarter(3), 0.75 * np.pi),
            "anchovy": Topping((2, 2), _quarter(3), 0.75 * np.pi),
        },
    ),
    Pizza(
        "Rings",
        {
            "salami": Topping((7, 9, 12), _ring(0.78, 0.12)),
            "chilli": Topping((3, 3), _ring(0.48, 0.07), _tangent),
            "mushroom": Topping((2, 3, 4), _ring(0.0, 0.26)),
        },
    ),
    Pizza(
        "From left to right",
        {
            "ham": Topping((3, 4, 6), lambda x, y: np.clip(0.5 - 0.8 * x, 0.0, 1.0) ** 2.2),
            "salami": Topping((4, 7, 10), lambda x, y: np.clip(0.5 + 0.8 * x, 0.0, 1.0) ** 2.2),
            "anchovy": Topping((4, 4), lambda x, y: 1.0 - 0.5 * np.hypot(x, y), _radial),
        },
    ),
    Pizza(
        "Spiral",
        {
            "chilli": Topping((4, 4), _ARMS, _spiral_direction(2.6)),
            "mushroom": Topping((4, 7, 9), _BETWEEN),
            "ham": Topping((3, 4, 5), _BETWEEN),
        },
    ),
)
