"""Steps after an edit: all bodies settle for a while; then those that have moved least are held near where they were.

Wherever bodies came or went, their neighbors have to make room, or to close a gap. The flow that makes up for one body falls with the
distance from it, so that most others need less than a tenth of a spacing: held there, they lose little, and an edit leaves alone what
it does not need to change. Who needs more is seen from how far bodies have moved, after every step anew; what is far from all changes
never does.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import warp as wp

from ..descent.descent import STEP_LIMIT
from ..device.launcher import Launcher, Recording
from . import kernels_settling

__all__ = ["Held", "Schedule", "most_free", "reach", "settle"]

# Bodies settle for so many steps, the fewer the more of them there are.
FEWEST_SETTLING, MOST_SETTLING = 6, 12
BODIES_TO_SETTLE = 800_000
# How far bodies that are held are from where they were, at most, in mean spacings, or in as many times the local spacing as the second
# number where that is less: nobody sees a tenth of a spacing.
HELD_WITHIN, LOCALLY = 0.098, 1.5


class Schedule(NamedTuple):
    """How bodies settle after an edit.

    Attributes:
        settling: Steps in which all are free.
        held: Steps more, in which most are held, before those that an edit is asked for.
        free: Share of all bodies that may move far, unless more than a tenth of all came or went.
    """

    settling: int
    held: int
    free: float

    @classmethod
    def usual(cls, body_count: int, held: int = 2, free: float = 0.2) -> Schedule:
        """That of many bodies, which have little time."""
        return cls(min(max(BODIES_TO_SETTLE // body_count, FEWEST_SETTLING), MOST_SETTLING), held, free)


def reach(area: float, body_count: int) -> tuple[float, float]:
    """Return how far bodies that are held on an area may go, and how many step limits where these are less."""
    return HELD_WITHIN * math.sqrt(area / body_count), HELD_WITHIN * LOCALLY / STEP_LIMIT


def most_free(share: float, body_count: int, changed: int, for_each: float) -> float:
    """Return how many bodies may go farther: a share, or where so many came or went so many others for each."""
    return max(share * body_count, for_each * changed)


class Held(Protocol):
    """Bodies that an edit holds near where they were when it began.

    Attributes:
        body_count: How many there are.
        schedule: How they settle.
        most_free: How many may move farther than the others.
    """

    body_count: int
    schedule: Schedule
    most_free: float

    def take_steps(self, step: Recording, count: int) -> None:
        """Take so many steps of all bodies."""
        step.play(count)

    def count_moved(self, moved: wp.array) -> None:
        """Count how many that are near a change have moved how far; see :mod:`.kernels_settling`."""

    def bring_back(self, free_from: wp.array) -> None:
        """Bring those back that went too far, but not from ways in a bin, ``wp.int32``, or longer ones near a change."""


def settle(launcher: Launcher, step: Recording, held: Held, steps: int) -> None:
    """Take the steps after an edit that has changed where bodies are.

    Args:
        launcher: Where to run.
        step: A step of all bodies.
        held: Who is to be held.
        steps: How many to take behind those in which bodies settle.
    """
    moved = launcher.zeros((launcher.thread_count, kernels_settling.BINS), wp.int32)
    free_from = launcher.empty(1, wp.int32)
    held.take_steps(step, held.schedule.settling)
    for _ in range(held.schedule.held + steps):
        held.take_steps(step, 1)
        held.count_moved(moved)
        # On the device: a GPU that is waited for after every step stands still in between.
        launcher.launch(
            kernels_settling.decide_free, 1, [launcher.thread_count, held.most_free], [moved, free_from], grain=1
        )
        held.bring_back(free_from)
