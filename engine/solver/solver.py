"""A run, step by step: compile the problem, take or make a state, step until settled, read the placement."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from ..device.launcher import Launcher, resolve_device
from ..device.profile import Profile
from ..errors import ProblemError
from ..problem.placement import Placement
from ..problem.problem import Problem
from .descent import Descent
from .final_placement import placement_of, position_in_metres
from .memory import check_memory
from .model import Model
from .state import State

__all__ = ["Progress", "Solver"]

# RMS move over local spacing at which a run has converged: later steps change no figure of the report.
TOLERANCE = 2e-4
# What counts as converged where the steps run out: bodies want to move by less than a hundredth of their spacing.
SETTLED = 5e-3
# What is said where numbers leave the range of float32 all the same.
OVERFLOW = (
    "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart; bring them "
    "nearer to each other"
)
# Steps on a GPU between two looks at how far bodies still move, where nobody wants to hear of each.
STEPS_UNWATCHED = 10


@dataclass(frozen=True, eq=False)
class Progress:
    """Where a run stands, as its progress callback gets it.

    Attributes:
        step: Steps taken.
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


class Solver:
    """Places the bodies of a problem, step by step; :func:`~esh.engine.solve.solve` does all of it at once.

    Use it in a ``with`` block, or call :meth:`close`: it has threads of its own.

    Args:
        problem: What to place where.
        device: ``"auto"`` (an NVIDIA GPU where there is one), ``"cpu"`` or ``"cuda:0"``.
        state: Where to go on from, of a solver of the same problem; by default bodies start on a Hilbert curve.
        profile: Gets the seconds that every phase takes.
        flags: :class:`~.body_flags.BodyFlags` of every body, shape ``[body_count]``; by default none is special.

    Attributes:
        model: The compiled problem.
        launcher: Where it runs.
        descent: What its steps consist of.

    Raises:
        ProblemError: The problem does not fit into memory.
        DeviceError: An unknown device, or CUDA asked for and absent.

    Example:
        >>> with Solver(problem) as solver:
        ...     while solver.step() > 0.005:
        ...         print(solver.placement().position)
    """

    def __init__(
        self,
        problem: Problem,
        *,
        device: str = "auto",
        state: State | None = None,
        profile: Profile | None = None,
        flags: np.ndarray | None = None,
    ) -> None:
        self.launcher = Launcher(resolve_device(device), profile)
        try:
            check_memory(problem)
            with self.launcher.phase("set-up"):
                self.model = Model(problem, flags)
                self.descent = Descent(self.model, self.launcher)
                if state is not None:
                    self.start_from(state)
        except BaseException:
            self.close()
            raise

    @property
    def state(self) -> State:
        """Where the bodies are now; it changes with every step, so copy it to keep it."""
        return self.descent.state

    def start_from(self, state: State) -> None:
        """Go on from another state of the same problem."""
        self.state.assign(state)
        self.descent.place_charges()

    def step(self, count: int = 1) -> float:
        """Take steps; return the residual, see :class:`Progress`.

        Raises:
            ProblemError: A force is no finite number.
        """
        for _ in range(count):
            self.descent.step.play()
        self.state.steps += count
        with self.launcher.phase("readback"):
            residual = self.descent.residual()
        if math.isnan(residual):
            raise ProblemError(OVERFLOW)
        return residual

    def run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None = None) -> tuple[int, bool]:
        """Step until bodies have settled, ``max_steps`` are taken or ``progress`` returns False.

        Returns:
            The steps taken, and whether bodies have settled.
        """
        residual = math.inf
        step = 0
        while step < max_steps:
            # With nobody watching, a GPU need not be asked how it goes after every step.
            watched = progress is not None or not self.launcher.device.is_cuda or self.launcher.profiled or step == 0
            many = 1 if watched else min(STEPS_UNWATCHED, max_steps - step)
            residual = self.step(many)
            step += many
            if progress is not None:
                with self.launcher.phase("progress"):
                    go_on = progress(Progress(step, max_steps, residual, self._position))
                # NumPy's False counts, too; None goes on.
                if isinstance(go_on, (bool, np.bool_)) and not go_on:
                    return step, False
            # Before the second step nothing has shown yet whether contact lets bodies move.
            if residual < TOLERANCE and step > 1:
                return step, True
        return max_steps, residual < SETTLED

    def separate(self) -> None:
        """Push footprints that still overlap apart, where they are to keep apart at all."""
        contact = self.descent.contact
        if contact is not None and self.model.problem.avoid_overlap:
            with self.launcher.phase("contact"):
                contact.separate(self.state.pose, self.state.bend)
            self.descent.place_charges()

    def placement(self) -> Placement:
        """The bodies where they are now; its report is empty.

        Raises:
            ProblemError: A position is no finite number.
        """
        placement = placement_of(self.model, self.state)
        if not np.isfinite(placement.position).all():
            raise ProblemError(OVERFLOW)
        return placement

    def close(self) -> None:
        """Give the threads back; nothing can be stepped after that."""
        self.launcher.close()

    def __enter__(self) -> Solver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _position(self) -> np.ndarray:
        return position_in_metres(self.model, self.state)
