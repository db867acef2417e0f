"""The paper's own scheme: direct summation over all pairs, as a Warp kernel on all cores (or on a GPU).

What everything else here is measured against: in float64 as the reference for quality, in float32 for speed. Repulsion is equation 1
with the interaction matrix; the attractive force is precomputed on the grid of the density and interpolated bilinearly, as the paper
does it. Open domains and dots only. The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp
from esh.engine.descent.initial_placement import initial_placement
from esh.engine.device.launcher import Launcher
from esh.engine.problem.interaction import group_bodies
from esh.engine.problem.problem import Problem
from esh.engine.space.density import box_integrals

__all__ = ["DirectSummation", "direct_solve"]

# The paper's step, tau k = 0.1, in units in which a pixel of a black image holds one mean charge.
PAPER_STEP = 0.1
# Nodes per mean spacing at least, on which the attractive force is precomputed.
NODES_PER_SPACING = 2.0

# Charges come weighted with the matrix, one row for each group, so that the loop reads in order and needs neither a look-up nor a
# mask: clang makes vectors of it, 3.6 times as fast as with both. On the diagonal, and where bodies coincide, the offset is
# zero and so is the term; the tiny summand, far below the square of float32's smallest distance, only keeps it finite.
_SUM_ALL = """
    const {real}* __restrict__ xs = body_x.data;
    const {real}* __restrict__ ys = body_y.data;
    const {real}* __restrict__ ws = weight.data + row;
    const {real} tiny = ({real})1e-30;
    {real} sum_x = 0;
    {real} sum_y = 0;
#if !defined(__CUDA_ARCH__)
#pragma clang loop vectorize(enable) interleave_count(4)
#endif
    for (int j = 0; j < count; ++j)
    {{
#if !defined(__CUDA_ARCH__)
        #pragma clang fp reassociate(on) contract(fast)
#endif
        const {real} dx = x - xs[j];
        const {real} dy = y - ys[j];
        const {real} strength = ws[j] / (dx * dx + dy * dy + tiny);
        sum_x += strength * dx;
        sum_y += strength * dy;
    }}
    return wp::vec_t<2, {real}>(sum_x, sum_y);
"""


@cache
def _kernel(double: bool):  # type: ignore[no-untyped-def]
    real = wp.float64 if double else wp.float32
    vector = wp.vec2d if double else wp.vec2

    @wp.func_native(_SUM_ALL.format(real="double" if double else "float"))
    def sum_all(
        x: real,
        y: real,
        count: int,
        row: wp.int64,
        weight: wp.array(dtype=real),
        body_x: wp.array(dtype=real),
        body_y: wp.array(dtype=real),
    ) -> vector: ...

    @wp.kernel(enable_backward=False)
    def repel(
        first: int,
        count: int,
        weight: wp.array(dtype=real),
        body_x: wp.array(dtype=real),
        body_y: wp.array(dtype=real),
        group: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vector),
    ):
        i = first + wp.tid()
        force[i] = sum_all(body_x[i], body_y[i], count, wp.int64(group[i]) * wp.int64(count), weight, body_x, body_y)

    return repel


@dataclass(eq=False)
class DirectSummation:
    """Forces on the bodies of a problem of dots, in units of mean number density and mean charge 1.

    Args:
        problem: Open, without lines.
        launcher: Where to run.
        double: float64, else float32.
        levels: Levels of ranges of areas; so many that every body has its own, by default.
    """

    problem: Problem
    launcher: Launcher
    double: bool = True
    levels: int = 10**6

    def __post_init__(self) -> None:
        problem = self.problem
        if problem.domain.periodic or any(s.line is not None for c in problem.classes for s in c.sizes):
            raise ValueError("direct summation is for dots in open domains")
        n = problem.body_count
        self.count = n
        self.unit = np.sqrt(problem.domain.area / n)
        self.size = np.array(problem.domain.size) / self.unit
        groups = group_bodies(problem, self.levels)
        area = problem.body_areas()
        self.charge = area / area.mean()
        self.group = groups.body_group
        self.class_index = problem.body_indices()[0]
        self.groups = groups
        self._real = wp.float64 if self.double else wp.float32
        device = self.launcher.device
        # Memory: a number per group and body, so n² where areas are a range and every body is its own group.
        weight = groups.matrix[:, self.group] * self.charge
        self._weight = wp.array(weight.ravel(), dtype=self._real, device=device)
        self._group = wp.array(groups.body_group, dtype=wp.int32, device=device)
        self._force = wp.zeros(n, dtype=wp.vec2d if self.double else wp.vec2, device=device)
        self._prepare_attraction()

    def _prepare_attraction(self) -> None:
        """Force of every class's density on the nodes of a grid, and the density itself there."""
        images = [c.density_image for c in self.problem.classes]
        rows = max(image.shape[0] for image in images)
        columns = max(image.shape[1] for image in images)
        rows *= max(1, int(np.ceil(NODES_PER_SPACING * self.size[1] / rows)))
        columns *= max(1, int(np.ceil(NODES_PER_SPACING * self.size[0] / columns)))
        self.grid = (rows, columns)
        step_x, step_y = self.size[0] / columns, self.size[1] / rows
        y = np.fft.fftfreq(2 * rows, 1.0 / (2 * rows))[:, None] * step_y
        x = np.fft.fftfreq(2 * columns, 1.0 / (2 * columns))[None, :] * step_x
        r2 = x**2 + y**2
        r2[0, 0] = 1.0
        kernels = [np.fft.rfft2(offset / r2) for offset in (x + 0.0 * y, y + 0.0 * x)]
        # Charge of every class by group of target: M takes the groups of a class together.
        group_charge = np.bincount(self.group, weights=self.charge, minlength=self.groups.count)
        by_class = np.zeros((self.groups.count, len(images)))
        for c in range(len(images)):
            own = self.groups.class_index == c
            by_class[:, c] = self.groups.matrix[:, own] @ group_charge[own]
        self.pull_of_class = by_class
        self.node_force, self.node_density = [], []
        for image in images:
            charge = box_integrals(image, self.grid)
            spectrum = np.fft.rfft2(charge, (2 * rows, 2 * columns))
            force = [np.fft.irfft2(spectrum * k, (2 * rows, 2 * columns))[:rows, :columns] for k in kernels]
            self.node_force.append(np.stack(force, axis=-1))
            self.node_density.append(charge / (step_x * step_y))

    def repulsion(self, position: np.ndarray) -> np.ndarray:
        """Force per unit charge by all other bodies, shape ``[n, 2]``."""
        device = self.launcher.device
        x, y = (wp.array(np.ascontiguousarray(position[:, k]), dtype=self._real, device=device) for k in (0, 1))
        self.launcher.launch(
            _kernel(self.double),
            self.count,
            [self.count, self._weight, x, y, self._group],
            [self._force],
        )
        return self._force.numpy()

    def attraction(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force per unit charge by all densities, shape ``[n, 2]``, and their sum with M, shape ``[n]``."""
        rows, columns = self.grid
        u = np.clip(position[:, 0] / self.size[0] * columns - 0.5, 0.0, columns - 1.0)
        v = np.clip(position[:, 1] / self.size[1] * rows - 0.5, 0.0, rows - 1.0)
        left, low = np.minimum(u.astype(int), columns - 2), np.minimum(v.astype(int), rows - 2)
        fu, fv = u - left, v - low
        force, density = np.zeros((self.count, 2)), np.zeros(self.count)
        corners = ((0, 0, (1 - fv) * (1 - fu)), (0, 1, (1 - fv) * fu), (1, 0, fv * (1 - fu)), (1, 1, fv * fu))
        for c, (nodes, densities) in enumerate(zip(self.node_force, self.node_density, strict=True)):
            pull = self.pull_of_class[self.group, c]
            for down, right, weight in corners:
                share = weight * pull
                force -= share[:, None] * nodes[low + down, left + right]
                density += share * densities[low + down, left + right]
        return force, density


def direct_solve(
    problem: Problem,
    launcher: Launcher,
    *,
    steps: int = 300,
    double: bool = True,
    paper_step: bool = False,
    levels: int = 10**6,
) -> np.ndarray:
    """Relax ``problem`` by gradient descent on direct sums; return positions [m], shape ``[n, 2]``.

    Args:
        problem: Open, dots.
        launcher: Where to run.
        steps: Steps.
        double: float64 sums.
        paper_step: The paper's constant step of 0.1; otherwise 0.7 of the inverse local curvature, which reaches the same in a third
            of the steps.
        levels: See :class:`DirectSummation`.
    """
    sums = DirectSummation(problem, launcher, double, levels)
    position = initial_placement(problem) / sums.unit
    for _ in range(steps):
        pull, density = sums.attraction(position)
        force = sums.repulsion(position) + pull
        if paper_step:
            move = PAPER_STEP * force
        else:
            move = force * (0.7 / (2.0 * np.pi * np.maximum(density, 2e-3 * density.mean())))[:, None]
        length = np.hypot(move[:, 0], move[:, 1])
        move *= np.minimum(1.0, 0.5 / np.maximum(length, 1e-12))[:, None]
        position = np.clip(position + move, 0.0, sums.size)
    return position * sums.unit
