"""What stands beyond a natural border of a window: others, placed as if the scatter went on there, who are let go of at last.

Densities go on beyond the edges of the domain, and where they end within it, as the nearest place is that has any. As many more bodies
as that density says stand there while a window settles. Of every group those that lie deepest within the border are kept, as many as
the window had: so counts stay what they are, wherever bodies have gone. See :mod:`~esh.engine.model.natural_border` for one solve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..device.launcher import Launcher
from ..problem.random_numbers import random_shares
from ..space.density import sample_density
from ..space.support import depth_in_support, vectors_to_support
from .bodies import PartBodies
from .demand import Demand
from .density_windows import Axis
from .layout import Box
from .plan import Plan
from .window_problem import MARGIN, density_of_class, pixels_of

__all__ = ["Beyond", "beyond_of", "kept_within"]

# How far densities go on beyond borders inside the domain, in spacings of the window.
REACH = 2.0 * MARGIN
# Where densities are even, bodies start in rows along the axes, and what is cut out along these has a row at its border or has not. So
# places are sheared first, in waves of this length and height, in spacings: that leaves densities as they are.
WAVE, HEIGHT = 30.0, 1.2


@dataclass(frozen=True, eq=False)
class Beyond:
    """A window that goes on beyond natural borders.

    Attributes:
        box: It, larger along the edges of the domain, which are cuts there.
        margin: How far from its cuts bodies are pinned [m].
        images: Density of every class there, as it goes on.
        added: Of which of it the bodies beyond are placed.
        depth: How deep pixels lie within borders that lie inside the domain [m], below 0 beyond these; of classes that have such.
    """

    box: Box
    margin: float
    images: dict[int, np.ndarray]
    added: dict[int, np.ndarray]
    depth: dict[int, np.ndarray]

    def numbers(self, plan: Plan, demand: Demand, seed: list[int]) -> np.ndarray:
        """Numbers of bodies to place beyond, int64, shape ``[k]``, ascending: of others, whose sizes and outlines these have."""
        groups = plan.groups
        result = [np.zeros(0, np.int64)]
        for g in range(groups.number):
            c, free = int(groups.class_index[g]), int(groups.free_count[g])
            total = float(demand.totals[c])
            if not free or total <= 0.0:
                continue
            image = self.added[c]
            pixel = self.box.size[0] * self.box.size[1] / image.size
            many = float(groups.count[g] * demand.level[g]) * float(image.sum(dtype=np.float64)) * pixel / total
            share = random_shares(np.arange(1 + math.ceil(many)), [*seed, g])
            number = math.floor(many + share[-1])
            result.append(groups.first[g] + np.sort((share[:number] * free).astype(np.int64)))
        return np.concatenate(result)

    def sheared(self, plan: Plan, position: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Places [m] with which waves go through rows along borders, less towards cuts."""
        result = position.copy()
        for axis in (0, 1):
            fade = self.box.fade(result[:, 0], result[:, 1], 2.0 * self.margin)
            wave = np.sin(2.0 * math.pi / (WAVE * plan.fine) * result[:, 1 - axis])
            result[:, axis] += np.where(free, HEIGHT * plan.fine * fade * wave, 0.0)
        return result

    def within(self, box: Box, class_index: np.ndarray, position: np.ndarray) -> np.ndarray:
        """How deep bodies lie within the borders of a window [m], below 0 beyond them; infinite where there are none."""
        result = np.full(len(position), np.inf)
        for axis in (0, 1):
            if not box.cut[2 * axis]:
                np.minimum(result, position[:, axis] - box.low[axis], out=result)
            if not box.cut[2 * axis + 1]:
                np.minimum(result, box.high[axis] - position[:, axis], out=result)
        for c, depth in self.depth.items():
            own = np.flatnonzero(class_index == c)
            inner = sample_density(depth, position[own] - self.box.low, self.box.size)
            result[own] = np.minimum(result[own], inner)
        return result


def beyond_of(plan: Plan, box: Box, count: int, margin: float, launcher: Launcher) -> Beyond | None:
    """Return how a window goes on beyond its borders; None where it has none.

    Args:
        plan: The plan.
        box: The window.
        count: Its bodies.
        margin: How far from its cuts bodies are pinned [m].
        launcher: Where to run.
    """
    inner = [density_of_class(plan, c, box) for c in range(len(plan.problem.classes))]
    if all(box.cut) and all((image > 0.0).all() or not image.any() for image in inner):
        return None
    covered = max(float((image > 0.0).mean()) for image in inner)
    spacing = max(plan.fine, math.sqrt(box.size[0] * box.size[1] * covered / count))
    # Beyond the edges of the domain others are free as far as it takes for what is pinned there not to be seen.
    larger = _larger(plan, box, margin + MARGIN * spacing)
    images, added, depth = {}, {}, {}
    shape = pixels_of(plan, larger)
    for c, image in enumerate(inner):
        if not image.any():
            images[c] = added[c] = np.zeros((1, 1), np.float32)
            continue
        row, column, inside = _pixels_of_inner(larger, box, image.shape, shape)
        there = image[row[:, None], column]
        here = inside & (there > 0.0)
        if not (there > 0.0).all():
            there, depth[c] = _filled(launcher, np.where(inside, there, np.float32(0.0)), REACH * spacing, larger.size)
        images[c], added[c] = there, np.where(here, np.float32(0.0), there)
    return Beyond(larger, margin, images, added, depth)


def kept_within(
    plan: Plan, box: Box, bodies: PartBodies, settled: PartBodies, order: np.ndarray, free: np.ndarray, beyond: Beyond
) -> PartBodies:
    """Return the bodies of a window, those that are deepest within its borders, of which each that came in is one that went out.

    Args:
        plan: The plan.
        box: The window.
        bodies: As they were.
        settled: Those, and those beyond, as they settled together.
        order: Which of both each of these is: those beyond come after all others, shape ``[len(settled)]``.
        free: Which of these are not pinned.
        beyond: How the window goes on.
    """
    groups = plan.groups
    group = groups.group_of(settled.identity)
    depth = beyond.within(box, groups.class_index[group], settled.position)
    added = order >= len(bodies)
    source = np.arange(len(settled))
    area = groups.areas(settled.identity)
    for g in np.unique(group[added]).tolist():
        own = np.flatnonzero((group == g) & free)
        deepest = own[np.argsort(-depth[own], kind="stable")]
        count = int((~added[own]).sum())
        come = deepest[:count][added[deepest[:count]]]
        gone = deepest[count:][~added[deepest[count:]]]
        # The largest are the largest.
        source[gone[np.argsort(area[gone], kind="stable")]] = come[np.argsort(area[come], kind="stable")]
    asked = np.flatnonzero(~added)
    asked = asked[np.argsort(order[asked], kind="stable")]
    kept = settled.chosen(source[asked])
    place = np.where(free[asked, None], _mirrored(box, kept.position), bodies.position)
    # Outlines that do not turn have turns of their own.
    return replace(kept, identity=bodies.identity, position=place)


def _mirrored(box: Box, position: np.ndarray) -> np.ndarray:
    """Positions of which those beyond an edge of the domain come in by as much: where too few had gone within."""
    low, high = np.array(box.low), np.array(box.high)
    position = np.where(position < low, 2.0 * low - position, position)
    return box.confine(np.where(position > high, 2.0 * high - position, position))


def _larger(plan: Plan, box: Box, reach: float) -> Box:
    axes, low, high = [], list(box.low), list(box.high)
    for axis, along in enumerate((box.across, box.up)):
        unit = plan.layout.size[axis] / along.units
        more = math.ceil(reach / unit)
        before, after = (0 if box.cut[2 * axis + k] else more for k in (0, 1))
        axes.append(Axis(along.begin - before, along.end + after, along.units))
        low[axis] -= before * unit
        high[axis] += after * unit
    return Box(axes[0], axes[1], (low[0], low[1]), (high[0], high[1]), (True,) * 4, None, box.rim)


def _pixels_of_inner(
    larger: Box, box: Box, pixels: tuple[int, ...], shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns of a window's pixels nearest to those of a larger one, and which of these lie inside it."""
    found, inside = [], []
    for axis, count in ((1, pixels[0]), (0, pixels[1])):
        middle = larger.low[axis] + (np.arange(shape[1 - axis]) + 0.5) / shape[1 - axis] * larger.size[axis]
        at = np.floor((middle - box.low[axis]) / box.size[axis] * count)
        at = count - 1 - at[::-1] if axis == 1 else at
        inside.append((at >= 0) & (at < count))
        found.append(np.clip(at, 0, count - 1).astype(np.int64))
    return found[0], found[1], inside[0][:, None] & inside[1][None]


def _filled(
    launcher: Launcher, image: np.ndarray, reach: float, size: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """A density that goes on as the nearest place, as far as ``reach`` [m], and how deep its pixels lie within where it was."""
    rows, columns = image.shape
    way = vectors_to_support(launcher, image, size).numpy().reshape(rows, columns, 2)
    away = np.hypot(way[..., 0], way[..., 1])
    row, column = np.indices(image.shape)
    row = np.clip(row - np.rint(way[..., 1] / size[1] * rows).astype(int), 0, rows - 1)
    column = np.clip(column + np.rint(way[..., 0] / size[0] * columns).astype(int), 0, columns - 1)
    filled = np.where(away <= reach, image[row, column], np.float32(0.0))
    deep = depth_in_support(launcher, image, size)
    return filled.astype(np.float32), np.where(image > 0.0, deep, -away)
