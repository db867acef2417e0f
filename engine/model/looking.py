"""Bodies that look at the point of their class: which these are, and how they would be turned."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..problem.look_at import LookAt, facing
from .model import Model

__all__ = ["LOOKS_AWAY", "angle_within", "facing_turns", "looking_bodies", "looks_at_point", "somebody_looks"]

# Outlines may look past the point by this much [rad], 2 degrees, before they are turned and parted again.
LOOKS_AWAY = 0.035


def facing_turns(model: Model, position: np.ndarray) -> np.ndarray:
    """Turns with which bodies look where their class does [rad], shape ``[n]``; 0 of those that look nowhere."""
    turn = np.zeros(model.body_count)
    for look, own in looking_bodies(model):
        facing_there = facing(look, position[own], model.body.identity[own], model.problem.seed)
        turn[own] = angle_within(facing_there, 2.0 * math.pi)
    return turn


def looking_bodies(model: Model) -> Iterator[tuple[LookAt, np.ndarray]]:
    """Yield what bodies look at and which bodies these are, class after class."""
    looking = looks_at_point(model)
    for number, c in enumerate(model.problem.classes):
        if c.look_at is not None:
            yield c.look_at, np.flatnonzero(looking & (model.body.class_index == number))


def somebody_looks(model: Model) -> bool:
    """Whether bodies of any class look at a point."""
    return any(c.look_at is not None for c in model.problem.classes)


def looks_at_point(model: Model) -> np.ndarray:
    """Which bodies look at a point, shape ``[n]``: those of its class that are no lines, and that nobody has put there."""
    classes = np.array([c.look_at is not None for c in model.problem.classes])
    return classes[model.body.class_index] & (model.body.kind < 0) & ~model.fixed


def angle_within(angle: np.ndarray, period: float) -> np.ndarray:
    """Angles [rad] between minus and plus half of a period."""
    return np.mod(angle + 0.5 * period, period) - 0.5 * period
