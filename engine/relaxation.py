"""solve(): from a problem to a placement.

The bodies descend the energy 1/2 sum M[g, h] <rho_g - u_g, K (rho_h - u_h)>. Where the density is low the energy is flat, so
every body's step is the inverse of its local curvature, 2 pi sum_h M[g, h] u_h, and Nesterov's momentum, restarted whenever
it points uphill (O'Donoghue and Candes, 2015, the gradient scheme), speeds up the slow modes that span the domain.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from . import kernels_update
from .density import settle_on_full_pixels, spline_deposit
from .device import Launcher, resolve_device
from .errors import ProblemError
from .field import Field, FieldTarget
from .initial_placement import initial_placement
from .interaction import interaction_matrix
from .measurement import measure, survey
from .memory import check_memory
from .placement import Placement
from .problem import Problem

__all__ = ["Progress", "solve"]

# Step over inverse curvature (measured: 0.25 to 0.7 end within 5 % of each other, the larger the better).
RELAXATION = 0.5
# No body moves further in a step than this share of the local spacing.
STEP_LIMIT = 0.5
# Curvature and spacing are taken where the density is at least this share of its mean, so that steps stay finite.
SMALLEST_DENSITY = 2e-3
# RMS displacement over local spacing at which a run has converged: later steps change no figure of the report.
TOLERANCE = 1e-3
# What counts as converged where the steps run out: bodies move by a few hundredths of their spacing, the coverage error by
# less than a tenth of its value.
SETTLED = 0.03


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
        progress: Called after every step with a :class:`Progress`; returning False stops the run, which then returns what
            is there, with ``report.converged`` False.

    Returns:
        The placement, with exact counts and its report. ``report.converged`` is True when the last steps were small: an RMS
        displacement below 0.03 of the local spacing.

    Raises:
        ProblemError: The problem does not fit into memory, or ``max_steps`` is below 1.
        DeviceError: An unknown device, or CUDA asked for and absent.
    """
    start_time = time.perf_counter()
    if isinstance(max_steps, bool) or not isinstance(max_steps, int) or max_steps < 1:
        raise ProblemError(f"`max_steps` must be a whole number of at least 1; got {max_steps!r}")
    launcher = Launcher(resolve_device(device))
    try:
        check_memory(problem)
        relaxation = _Relaxation(problem, launcher)
        steps, converged = relaxation.run(max_steps, progress)
        position = _settled(problem, relaxation.position_in_metres())
        report = measure(problem, position, launcher)
        seconds = time.perf_counter() - start_time
        report = replace(report, steps=steps, converged=converged, seconds=seconds)
        class_index, size_index = problem.body_indices()
        dots = np.zeros(len(position))
        return Placement(problem, position, class_index, size_index, dots, dots.copy(), report)
    finally:
        launcher.close()


class _Relaxation:
    """State of one run, in the solver's units (see :mod:`.field`)."""

    def __init__(self, problem: Problem, launcher: Launcher) -> None:
        self.problem = problem
        self.launcher = launcher
        domain = problem.domain
        n = problem.body_count
        self.unit = math.sqrt(domain.area / n)
        self.size = (domain.size[0] / self.unit, domain.size[1] / self.unit)
        class_index, size_index = problem.body_indices()
        first_group = np.concatenate([[0], np.cumsum([len(c.sizes) for c in problem.classes])])
        group = first_group[class_index] + size_index
        area = np.array([s.area for c in problem.classes for s in c.sizes])
        count = np.array([s.count for c in problem.classes for s in c.sizes])
        charge = area / (area * count).sum() * n
        group_image = [c.density_image for c in problem.classes for _ in c.sizes]
        self.field = Field(
            launcher,
            size=self.size,
            periodic=domain.periodic,
            interaction=interaction_matrix(problem),
            targets=[FieldTarget(image, q * c) for image, q, c in zip(group_image, charge, count, strict=True)],
            spacing=_typical_spacing(problem) / self.unit,
            charge=charge[group],
            charge_group=group,
        )
        device = launcher.device
        start = np.minimum(initial_placement(problem) / self.unit, np.array(self.size)).astype(np.float32)
        start = np.minimum(start, np.nextafter(np.array(self.size, np.float32), np.float32(0)))
        self.position = wp.array(start, dtype=wp.vec2, device=device)
        self.ahead = wp.clone(self.position)
        self.field_at_body = wp.zeros(n, dtype=wp.vec2, device=device)
        self.displacement = wp.zeros(n, dtype=wp.vec2, device=device)
        self.uphill = wp.zeros(n, dtype=float, device=device)
        self.moved = wp.zeros(n, dtype=float, device=device)
        self.body_group = wp.array(group, dtype=wp.int32, device=device)
        self.body_class = wp.array(class_index, dtype=wp.int32, device=device)
        self.body_charge = wp.array(charge[group], dtype=float, device=device)
        self._prepare_steps(count, group_image)
        self.images = _images_on_device(problem, device)

    def _prepare_steps(self, count: np.ndarray, group_image: list[np.ndarray]) -> None:
        field = self.field
        node_area = field.mesh_spacing[0] * field.mesh_spacing[1]
        attraction = field.attraction / node_area
        floor = SMALLEST_DENSITY * attraction.mean(axis=(1, 2), keepdims=True)
        step_length = 1.0 / (2.0 * np.pi * np.maximum(attraction, floor))
        number = sum(
            c * spline_deposit(image, self.size, field.shape, field.mesh_spacing, field.margin, field.periodic)
            for c, image in zip(count, group_image, strict=True)
        )
        spacing = 1.0 / np.sqrt(np.maximum(number / node_area, SMALLEST_DENSITY))
        device = self.launcher.device
        self.step_length = wp.array(step_length.astype(np.float32).ravel(), dtype=float, device=device)
        self.step_limit = wp.array((STEP_LIMIT * spacing).astype(np.float32).ravel(), dtype=float, device=device)

    def run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None) -> tuple[int, bool]:
        """Relax; return the steps taken and whether they converged."""
        n = self.problem.body_count
        domain = wp.vec2(*self.size)
        t = 1.0
        residual = math.inf
        for step in range(1, max_steps + 1):
            self.field.evaluate(self.ahead, self.field_at_body)
            self.launcher.launch(
                kernels_update.take_step,
                n,
                [
                    self.ahead,
                    self.field_at_body,
                    self.body_group,
                    self.body_class,
                    self.body_charge,
                    self.step_length,
                    self.step_limit,
                    RELAXATION,
                    self.field.mesh,
                    self.images,
                    domain,
                ],
                [self.position, self.displacement, self.uphill, self.moved],
            )
            residual = math.sqrt(_total(self.moved) / n)
            if _total(self.uphill) > 0.0:
                t = 1.0
            following = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * t * t))
            momentum = (t - 1.0) / following
            t = following
            self.launcher.launch(
                kernels_update.look_ahead,
                n,
                [self.position, self.displacement, momentum, domain, int(self.problem.domain.periodic)],
                [self.ahead],
            )
            if progress is not None:
                state = Progress(step, max_steps, residual, self.position_in_metres())
                if progress(state) is False:
                    return step, False
            if residual < TOLERANCE:
                return step, True
        return max_steps, residual < SETTLED

    def position_in_metres(self) -> np.ndarray:
        """Body positions [m], shape ``[n, 2]``, float64, inside the domain."""
        position = self.position.numpy().astype(np.float64) * self.unit
        return np.clip(position, 0.0, self.problem.domain.size)


def _settled(problem: Problem, position: np.ndarray) -> np.ndarray:
    """Undo what rounding to float32 did to bodies on the very edge of a full pixel."""
    class_index, _ = problem.body_indices()
    for k, body_class in enumerate(problem.classes):
        own = class_index == k
        position[own] = settle_on_full_pixels(body_class.density_image, position[own], problem.domain.size)
    return position


def _total(values: wp.array) -> float:
    return float(values.numpy().sum(dtype=np.float64))


def _typical_spacing(problem: Problem) -> float:
    """Spacing [m] at the number density that the average body sees."""
    number = survey(problem)
    cell_area = problem.domain.area / number.size
    return math.sqrt(cell_area * number.sum() / (number**2).sum())


def _images_on_device(problem: Problem, device: wp.Device) -> kernels_update.Images:
    images = [c.density_image for c in problem.classes]
    starts = np.concatenate([[0], np.cumsum([image.size for image in images])[:-1]])
    result = kernels_update.Images()
    result.pixel = wp.array(np.concatenate([image.ravel() for image in images]), dtype=float, device=device)
    result.start = wp.array(starts, dtype=wp.int32, device=device)
    result.height = wp.array([image.shape[0] for image in images], dtype=wp.int32, device=device)
    result.width = wp.array([image.shape[1] for image in images], dtype=wp.int32, device=device)
    return result
