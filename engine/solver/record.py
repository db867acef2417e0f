"""What a solver has done, as the report says it: steps, seconds, and whether bodies have come to rest."""

from __future__ import annotations

import time
from collections import deque

from ..descent.convergence import TOLERANCE, is_settled, last_steps
from ..model.model import Model

__all__ = ["Record"]


class Record:
    """What was done to bodies since they were first placed, or since the last edit. A ``with`` block of it counts its seconds.

    Attributes:
        steps: Steps taken.
        rests: Whether bodies have come to rest, as a run that has ended knows; None where the last steps tell.
        parted: Whether it was tried to part outlines after the last step.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.rests: bool | None = None
        self.parted = False
        self._residuals: deque[float] = deque(maxlen=last_steps(1))
        # Blocks may lie in each other: an edit parts outlines.
        self._seconds, self._depth, self._begun = 0.0, 0, 0.0

    @property
    def seconds(self) -> float:
        """Seconds that all blocks have taken until now."""
        return self._seconds + (time.perf_counter() - self._begun if self._depth else 0.0)

    def stepped(self, count: int, residual: float) -> None:
        """Count steps, after which bodies would still move by ``residual`` of their spacing."""
        self.steps += count
        self.rests = None
        self.parted = False
        self._residuals.append(residual)

    def has_settled(self, model: Model) -> bool:
        """Whether bodies of a model have come to rest."""
        if self.rests is not None:
            return self.rests
        # One step does not tell: only a second one shows that what moved is at rest.
        if self.steps < 2:
            return False
        return self._residuals[-1] < TOLERANCE or is_settled(model, list(self._residuals))

    def __enter__(self) -> None:
        if not self._depth:
            self._begun = time.perf_counter()
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if not self._depth:
            self._seconds += time.perf_counter() - self._begun
