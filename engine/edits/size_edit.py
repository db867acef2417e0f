"""What an edit does to the bodies of one size of a class, fixed ones aside: how many of them go and come, and which of them go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.marked import numbers_of_marked
from ..model.asked_shares import are_asked_alike, asked_share, cells_for
from ..model.attraction import BLUR_OF_FIXED
from ..model.model import Model
from ..model.numbers_in_parts import parts_of_classes
from ..problem.domain import Domain
from ..problem.image_filters import gaussian_blur
from ..problem.problem import Problem
from ..space.density import sample_density
from ..space.part import Part
from ..space.parts_of_ground import PartsOfGround
from . import kernels_edit
from .kernels_edit import Density, Fate, Total
from .nearest_free import nearest_free

__all__ = ["Rows", "SizeEdit", "compare_size", "list_bodies", "read_numbers"]

# Bodies of a size that may be too many or too few in a part of the ground for no more to be done about it than to move some.
MOST_OFF = 2.0
# Indices of bodies: int32, or a range where they follow each other, which need not be listed.
Rows = np.ndarray | range


@dataclass(frozen=True, eq=False)
class SizeEdit:
    """What is to happen to the bodies of a size.

    Attributes:
        rows: Their indices in the new model.
        pool: Which bodies of the old one are of this size, among others that are of no use here.
        pool_count: How many of them are there to stay or go.
        asked: How many each cell is to have, and has.
        totals: Sums over cells and bodies, by :class:`~.kernels_edit.Total`.
        surplus: How many are to go where most stay.
        survivors: How many are to stay where most go.
    """

    rows: Rows
    pool: slice
    pool_count: int
    asked: kernels_edit.Asked
    totals: list[float]
    surplus: int
    survivors: int

    @property
    def thinned(self) -> int:
        """How many there are where most go."""
        return round(self.totals[Total.THINNED])

    @property
    def counts(self) -> list[int]:
        """How many points are spread: for those that go, that survive where most go, and that come."""
        has_place = self.pool_count - round(self.totals[Total.WITHOUT_PLACE])
        staying = has_place - self.thinned - self.surplus + self.survivors
        return [self.surplus, self.survivors, len(self.rows) - staying]

    def densities(self, launcher: Launcher) -> list[np.ndarray]:
        """Over what they are spread, row 0 at the bottom; any density for none."""
        cells = self.asked.cells
        sums = [self.totals[kind] for kind in (Total.LOST, Total.SURVIVING, Total.COMING)]
        result = []
        for count, total, kind in zip(self.counts, sums, (Density.LOSS, Density.SURVIVAL, Density.GAIN), strict=True):
            density = np.ones((1, 1), np.float32)
            if count > 0:
                found = launcher.empty(cells * cells, float)
                shown = int(kind if total > 0.0 else Density.WANTED)
                launcher.launch(kernels_edit.find_density, cells * cells, [self.asked, shown], [found])
                density = found.numpy().reshape(cells, cells)
            result.append(density)
        return result

    def thin_out(
        self, launcher: Launcher, points: list[wp.array], pose: wp.array, around: kernels_edit.Around, fate: wp.array
    ) -> wp.array:
        """Decide who stays, by the points that were spread over the first two densities.

        Args:
            launcher: Where to run.
            points: These, in the unit of the poses, ``wp.vec2``.
            pose: Of all old bodies.
            around: A rectangle that holds all of these, in that unit.
            fate: What becomes of every old body; in the end all of this size either stay, or are too many of which none has to go,
                or do not stay.

        Returns:
            Of those who survive where most go, the ones that are to be at their points, in the order of these; ``wp.int32``.
        """
        cells = max(1, int(math.sqrt(self.pool_count)))
        if self.surplus:
            enough = self.surplus <= self.totals[Total.TOO_MANY]
            among = list_bodies(launcher, fate, self.pool, Fate.TOO_MANY if enough else Fate.STAYS, Fate.TOO_MANY)
            place = nearest_free(launcher, points[0], among, pose, around, cells)
            _decide(launcher, read_numbers(launcher, place, among), Fate.GOES, fate)
        if not self.survivors:
            return launcher.empty(0, wp.int32)
        among = list_bodies(launcher, fate, self.pool, Fate.THINNED, Fate.THINNED)
        place = nearest_free(launcher, points[1], among, pose, around, cells)
        chosen = read_numbers(launcher, place, among)
        _decide(launcher, chosen, Fate.STAYS, fate)
        return chosen if len(chosen) < self.thinned else launcher.empty(0, wp.int32)


def compare_size(
    launcher: Launcher,
    model: Model,
    class_index: int,
    rows: Rows,
    old: Model,
    old_index: int,
    pool: slice,
    used: np.ndarray,
    pose: wp.array,
    part: Part | None,
    fate: wp.array,
) -> SizeEdit:
    """See what is to happen to the bodies of a size.

    Args:
        launcher: Where to run.
        model: The model after the edit.
        class_index: The size's class there.
        rows: Its bodies there, fixed ones aside.
        old: The model before.
        old_index: The class there; -1 for none.
        pool: Its bodies there.
        used: Which old bodies are not there to be chosen, shape ``[old count]``, or ``[0]`` if all are.
        pose: Poses of the old bodies.
        part: The part of the domain that holds all densities of either; None where that is no small one.
        fate: What becomes of them; written for those of this size.
    """
    cells = _cells(model, class_index, old, old_index, part)
    asked = kernels_edit.Asked()
    asked.cells, asked.share, asked.wanted = (
        cells,
        asked_share(launcher, model, class_index, cells, part),
        float(len(rows)),
    )
    in_pool = pool.stop - pool.start
    pool_count = in_pool - int(np.count_nonzero(used[pool]))
    asked.share_before, asked.there = asked.share, 0.0
    if pool_count:
        if not are_asked_alike(model, class_index, old, old_index):
            asked.share_before = asked_share(launcher, old, old_index, cells, part)
        asked.there = float(pool_count)
        if len(used) or old.has_fixed:
            asked.share_before = _without_pinned(launcher, model, class_index, old, pool, used, pose, asked)
        ground = parts_of_classes(launcher, model)[class_index]
        if ground is not None:
            free = np.flatnonzero(~used[pool]) if len(used) else np.arange(in_pool)
            position = pose.numpy()[pool, :2][free] * np.float64(old.unit)
            asked.share_before = _as_they_are(launcher, ground, model.problem.rectangle, position, asked, part)
    ratio = launcher.empty(cells * cells, float)
    sums = launcher.zeros((launcher.thread_count, len(Total), kernels_edit.SLOTS), wp.int64)
    launcher.launch(kernels_edit.compare_cells, cells * cells, [asked], [ratio, sums], per_thread=True)
    where = [pose, around(part, old), cells, ratio]
    launcher.launch(kernels_edit.judge_bodies, in_pool, where, [fate, sums], first=pool.start, per_thread=True)
    totals = (sums.numpy().sum(axis=(0, 2)) / kernels_edit.SUM_SCALE).tolist()
    return SizeEdit(rows, pool, pool_count, asked, totals, *_numbers_of(totals, len(rows), pool_count))


def around(part: Part | None, model: Model) -> kernels_edit.Around:
    """A part of the domain, or all of it, in the unit of a model."""
    whole, result = part or Part(), kernels_edit.Around()
    result.origin, result.size = wp.vec2(*whole.origin(model.size)), wp.vec2(*whole.extent(model.size))
    return result


def _cells(model: Model, class_index: int, old: Model, old_index: int, part: Part | None) -> int:
    """In how many cells along either side the densities of a class are compared."""
    body_class = model.problem.classes[class_index]
    if model.has_fixed or old.has_fixed:
        # What fixed bodies leave of a density, or have left, is finer than its pixels.
        return cells_for(body_class.body_count)
    before = [old.problem.classes[old_index].density_image] if old_index >= 0 else []
    return cells_for(body_class.body_count, body_class.density_image, *before, part=part)


def list_bodies(launcher: Launcher, fate: wp.array, pool: slice, least: Fate, most: Fate) -> wp.array:
    """Return which bodies of a pool have one of these fates, from the first on, ``wp.int32``."""
    marked = launcher.empty(pool.stop - pool.start, wp.int32)
    launcher.launch(kernels_edit.mark_fates, len(marked), [fate, pool.start, int(least), int(most)], [marked])
    return numbers_of_marked(launcher, marked, pool.start)


def read_numbers(launcher: Launcher, body: wp.array, number: wp.array) -> wp.array:
    """Return of some bodies a number that every body has, ``wp.int32``."""
    read = launcher.empty(len(body), wp.int32)
    launcher.launch(kernels_edit.read_numbers, len(body), [body, number], [read])
    return read


def _decide(launcher: Launcher, body: wp.array, decided: Fate, fate: wp.array) -> None:
    launcher.launch(kernels_edit.decide_fates, len(body), [body, int(decided)], [fate])


def _numbers_of(totals: list[float], wanted: int, there: int) -> tuple[int, int]:
    """How many go where most stay, and stay where most go; of so many that are wanted, and there."""
    thinned, too_many = round(totals[Total.THINNED]), round(totals[Total.TOO_MANY])
    survivors = min(round(totals[Total.SURVIVORS]), wanted)
    surplus = round(totals[Total.SURPLUS]) if too_many else 0
    has_place = there - round(totals[Total.WITHOUT_PLACE])
    most_stay = has_place - thinned
    # As many come as the densities say; how many stay for that is decided where most go, or else where most stay. There is never one
    # more than is asked for.
    staying = min(max(wanted - round(totals[Total.COMING]), 0), has_place)
    of_thinned = survivors if surplus > survivors else staying - (most_stay - surplus)
    survivors = min(max(of_thinned, 0), thinned, staying)
    surplus = min(max(most_stay - (staying - survivors), 0), most_stay)
    return surplus, survivors


def _without_pinned(
    launcher: Launcher,
    model: Model,
    class_index: int,
    old: Model,
    pool: slice,
    used: np.ndarray,
    pose: wp.array,
    asked: kernels_edit.Asked,
) -> wp.array:
    """Shares of those that were there: who is pinned now no longer counts, who was let go does; see :func:`compare_size`."""
    cells, fixed_before = asked.cells, old.fixed[pool]
    pinned_now = used[pool] if len(used) else np.zeros(len(fixed_before), bool)
    share = asked.share_before.numpy().reshape(cells, cells)
    there = float(np.count_nonzero(~fixed_before)) * share.astype(np.float64)
    for sign, group in ((-1.0, ~fixed_before & pinned_now), (1.0, fixed_before & ~pinned_now)):
        body = (pool.start + np.flatnonzero(group)).astype(np.int32)
        if len(body):
            point = launcher.empty(len(body), wp.vec2)
            launcher.launch(kernels_edit.read_places, len(body), [launcher.array(body, wp.int32), pose, 1.0], [point])
            count = model.problem.classes[class_index].body_count
            blurred = _blurred(point.numpy() * np.float64(old.unit), model.problem, count, cells)
            there = np.maximum(there + sign * blurred, 0.0)
    total = there.sum()
    return asked.share_before if total <= 0.0 else launcher.array((there / total).ravel().astype(np.float32), float)


def _as_they_are(
    launcher: Launcher,
    ground: PartsOfGround,
    domain: Domain,
    position: np.ndarray,
    asked: kernels_edit.Asked,
    part: Part | None,
) -> wp.array:
    """Shares of those that were there, of which each part of the ground now has as many as there are; see :func:`compare_size`.

    Along a river that is new there may be more or fewer by chance, who cannot cross it any more.

    Args:
        launcher: Where to run.
        ground: The parts of the class's density after the edit.
        domain: The domain.
        position: Where those that may be chosen are [m], shape ``[m, 2]``.
        asked: What is asked for in cells, and was.
        part: What these are cells of.
    """
    cells, whole = asked.cells, part or Part()
    before = asked.share_before.numpy().astype(np.float64)
    origin, extent = np.array(whole.origin(domain.size)), np.array(whole.extent(domain.size))
    row, column = np.divmod(np.arange(cells * cells), cells)
    label = sample_density(ground.part, origin + (np.stack([column, row], axis=1) + 0.5) * extent / cells, domain.size)
    # Where nobody is asked for, nobody stays.
    label = np.where(asked.share.numpy() > 0.0, label, ground.count)
    at = np.clip(((position - origin) / extent * cells).astype(np.int64), 0, cells - 1)
    there = np.bincount(label[at[:, 1] * cells + at[:, 0]], minlength=ground.count + 1)
    expected = np.bincount(label, before, ground.count + 1) * asked.there
    # One or two more or less are not worth that all over the part some come and go.
    off = (np.abs(there - expected) > MOST_OFF) & (expected > 0.0)
    if not off[: ground.count].any():
        return asked.share_before
    factor = np.where(off, there / np.maximum(expected, 1e-300), 1.0)
    return launcher.own_array((before * factor[label]).astype(np.float32), float)


def _blurred(position: np.ndarray, problem: Problem, count: int, cells: int) -> np.ndarray:
    """Bodies per cell, blurred as fixed ones are where they take the place of others; row 0 at the bottom."""
    column, row = (
        np.clip((position[:, a] * (cells / problem.rectangle.size[a])).astype(np.int32), 0, cells - 1) for a in (0, 1)
    )
    there = np.bincount(row * cells + column, minlength=cells * cells).reshape(cells, cells)
    return gaussian_blur(there, BLUR_OF_FIXED * cells / math.sqrt(count))
