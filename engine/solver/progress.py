"""How a run goes, as whoever watches it is told, and how they end it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["Progress", "is_stop"]


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a run has come, as passed to its progress callback.

    Attributes:
        step: Steps taken; 0 while a start is being chosen.
        steps: Steps that the run takes at most.
        residual: RMS of the moves that the forces ask for, over the local spacing; falls as the run converges.
    """

    step: int
    steps: int
    residual: float
    _read_position: Callable[[], np.ndarray]

    @property
    def position(self) -> np.ndarray:
        """Current body positions [m], shape ``[n, 2]``, in the placement's order; a copy, made when it is asked for."""
        return self._read_position()


def is_stop(answer: object) -> bool:
    """Tell whether a progress callback asks for the end of a run: by False, NumPy's too; None goes on."""
    if isinstance(answer, np.ndarray) and answer.shape == ():
        answer = answer[()]
    return isinstance(answer, (bool, np.bool_)) and not answer
