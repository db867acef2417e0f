"""From one problem to another: which bodies stay, which go, and where new ones come down.

Most of a state is still right after an edit. Where a density fell its surplus is taken out, and set down where it rose; what is left
to the descent is the small scale. Both happen at points that are spread by a small descent of their own, so that no place loses or
gets two while another has none.

Bodies stay on the device. What comes to the host is what follows from all of them: sums, and who came and went.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.marked import numbers_of_marked
from ..model.body_flags import BodyFlags
from ..model.carried_over import CarriedInPlane
from ..model.model import Model
from ..model.numbers_in_parts import has_parts, move_between_parts
from ..problem.of_bodies import is_same
from ..space.part import Part, part_of
from . import kernels_edit
from .kernels_edit import Fate
from .places_in_support import move_poses_into_support
from .size_edit import Rows, SizeEdit, around, compare_size, list_bodies, read_numbers
from .spread import MANY

__all__ = ["EditInPlane", "in_order"]

# How far bodies are put where others go, at most, in mean spacings.
FARTHEST = 3.0

# Gets densities over the domain or a part of it, row 0 at the bottom, and counts, and begins to spread as many points over each; what
# it returns returns these [m], each ``wp.vec2d``.
Spread = Callable[[list[np.ndarray], list[int], Part | None], Callable[[], list[wp.array]]]


class EditInPlane:
    """An edit that is being made: who has come from where so far. Points are being spread until it is finished.

    Args:
        launcher: Where to run.
        old: The model before the edit.
        pose: Where its bodies are, in its unit, ``wp.vec4``, shape ``[old count]``.
        model: The model after it, in the same domain.
        spread: Spreads points over densities.

    Attributes:
        pose: Where bodies of the new model are, in its unit, once the edit is finished, ``wp.vec4``, shape ``[n]``.
    """

    def __init__(self, launcher: Launcher, old: Model, pose: wp.array, model: Model, spread: Spread) -> None:
        self._launcher, self._old, self._model, self._pose_before = launcher, old, model, pose
        self.pose = launcher.zeros(model.body_count, wp.vec4)
        self._source, self._row_of = (launcher.empty(count, wp.int32) for count in (model.body_count, old.body_count))
        self._source.fill_(-1)
        self._row_of.fill_(-1)
        self._fate = launcher.zeros(old.body_count, wp.int32)
        self._new: list[np.ndarray] = []
        self._changes: list[wp.array] = []
        # Who acts on others only is not there to be chosen.
        self._used = (old.body.flags & BodyFlags.GHOST) != 0 if old.body.flagged else np.zeros(0, bool)
        if model.has_fixed:
            self._place_fixed()
        if self._used.any():
            used = launcher.array(np.flatnonzero(self._used).astype(np.int32), wp.int32)
            launcher.launch(kernels_edit.decide_fates, len(used), [used, int(Fate.USED)], [self._fate])
        self._part = self._part_of_both()
        self._sizes = self._compare()
        self._points = spread(
            [density for size in self._sizes for density in size.densities(launcher)],
            [count for size in self._sizes for count in size.counts],
            self._part,
        )

    def finish(self, first_identity: int) -> CarriedInPlane:
        """Settle who stays, and set the new ones down; those that are not fixed have ``first_identity`` and the following ones."""
        points = self._points()
        for number, size in enumerate(self._sizes):
            self._settle(size, points[3 * number : 3 * number + 3])
        return self._result(first_identity)

    def _part_of_both(self) -> Part | None:
        """The part of the domain that holds all densities before and after, where nobody is fixed."""
        if self._model.has_fixed or self._old.has_fixed:
            return None
        return part_of(c.density_image for model in (self._model, self._old) for c in model.problem.classes)

    def _place_fixed(self) -> None:
        """What is fixed now has its place from the problem; it may have been one of the old bodies, as its identity says."""
        launcher, old, model = self._launcher, self._old, self._model
        fixed = np.flatnonzero(model.fixed)
        by_identity = np.argsort(old.body.identity, kind="stable")
        sorted_before = old.body.identity[by_identity]
        at = np.minimum(np.searchsorted(sorted_before, model.body.identity[fixed]), old.body_count - 1)
        known = sorted_before[at] == model.body.identity[fixed]
        source, place = by_identity[at[known]], model.problem.fixed.position / model.unit
        if not len(self._used):
            self._used = np.zeros(old.body_count, bool)
        self._used[source] = True
        before = self._places(launcher.array(source.astype(np.int32), wp.int32)).numpy().reshape(-1, 2)
        self._seat(source.astype(np.int32), fixed[known])
        self._put_down(
            fixed, launcher.array(np.clip(place, 0.0, model.size).astype(np.float32).reshape(-1, 2), wp.vec2)
        )
        self._new.append(fixed[~known])
        moved = (np.abs(before - place[known]) > 1e-6 * max(model.size)).any(axis=1)
        changed = np.concatenate([place[~known], place[known][moved], before[moved]])
        self._changes.append(launcher.array(changed.astype(np.float32), wp.vec2))

    def _compare(self) -> list[SizeEdit]:
        """Look at every size of the new model: how many of its bodies are to go, and how many come."""
        old, model = self._old, self._model
        begin_before = {name: rows for name, *rows in _ranges(old)}
        sizes = []
        for (class_name, size_name), c, begin, end in _ranges(model):
            rows: Rows = range(begin, end)
            if model.has_fixed:
                rows = begin + np.flatnonzero(~model.fixed[begin:end]).astype(np.int32)
            k, first, last = begin_before.get((class_name, size_name), (-1, 0, 0))
            in_size = compare_size(
                self._launcher,
                model,
                c,
                rows,
                old,
                k,
                slice(first, last),
                self._used,
                self._pose_before,
                self._part,
                self._fate,
            )
            sizes.append(in_size)
        return sizes

    def _settle(self, size: SizeEdit, points: list[wp.array]) -> None:
        """Decide who of a size stays, give all of its bodies rows, and put the new ones to their points [m]."""
        launcher, old, model = self._launcher, self._old, self._model
        before = [self._in_unit_of(old, at) for at in points[:2]]
        placed = size.thin_out(launcher, before, self._pose_before, around(self._part, old), self._fate)
        staying = list_bodies(launcher, self._fate, size.pool, Fate.STAYS, Fate.TOO_MANY)
        old_rows, new_rows = _seats(size.rows, len(staying), model.body.area)
        area = old.body.area
        if not is_same(area) and len(staying):
            number = staying.numpy()
            if np.ptp(area[number]) > 0.0:
                # Bodies of a range keep their ranks.
                staying = launcher.array(number[np.argsort(area[number], kind="stable")], wp.int32)
        self._seat(staying, old_rows)
        if len(placed):
            # Where few are left of many they are as even as points are, not as those that they were among.
            row = read_numbers(launcher, placed, self._row_of)
            place, point = self._places(placed), self._in_unit_of(model, points[1])
            self._changes += [place, self._put_down(row, point)]
            if len(placed) < MANY:
                self._replace_far(placed, row, np.linalg.norm(point.numpy() - place.numpy(), axis=1))
        self._changes.append(self._put_down(new_rows, self._in_unit_of(model, points[2])))
        self._new.append(_listed(new_rows))

    def _replace_far(self, body: wp.array, row: wp.array, way: np.ndarray) -> None:
        """Have others come instead of bodies that would go a long ``way`` within the new model's unit: those would seem to jump."""
        area = math.prod(self._model.size) / self._model.body_count
        far = np.flatnonzero(way > FARTHEST * math.sqrt(area))
        if not len(far):
            return
        launcher, rows = self._launcher, row.numpy()[far]
        gone, come = (launcher.array(values.astype(np.int32), wp.int32) for values in (body.numpy()[far], rows))
        launcher.launch(kernels_edit.part_with, len(far), [gone, come], [self._source, self._row_of])
        self._new.append(rows)

    def _result(self, first_identity: int) -> CarriedInPlane:
        """What has come of it."""
        launcher, old, model = self._launcher, self._old, self._model
        move_poses_into_support(launcher, model, self.pose)
        self._keep_whole_numbers(first_identity)
        marked = launcher.empty(old.body_count, wp.int32)
        launcher.launch(kernels_edit.mark_gone, old.body_count, [self._row_of], [marked])
        gone = numbers_of_marked(launcher, marked)
        before = old.body.identities_on(launcher)
        went = read_numbers(launcher, gone, before)
        new = in_order(np.concatenate(self._new))
        came = np.arange(first_identity, first_identity + len(new), dtype=np.int32)
        if model.has_fixed:
            is_fixed = model.fixed[new]
            came[~is_fixed] = came[: len(new) - int(is_fixed.sum())]
            came[is_fixed] = model.body.identity[new[is_fixed]]
        # Who stays keeps its own, be it fixed now or not.
        identity = launcher.empty(model.body_count, wp.int32)
        launcher.launch(kernels_edit.carry_identities, model.body_count, [self._source, before], [identity])
        given = [*self._rows_for_kernels(_as_range(new)), *self._rows_for_kernels(_as_range(came))]
        launcher.launch(kernels_edit.give_identities, len(new), given, [identity])
        changes = [*self._changes, self._places(gone)]
        return CarriedInPlane(self._source, identity, self.pose, new, came, went.numpy(), changes)

    def _keep_whole_numbers(self, number: int) -> None:
        """Let parts of the ground that nobody can leave have the numbers that they ask for: others may have been there by chance."""
        launcher, model = self._launcher, self._model
        if not has_parts(launcher, model):
            return
        before = self.pose.numpy()[:, :2]
        position = before * np.float64(model.unit)
        moved = move_between_parts(launcher, model, position, number, self._source.numpy() < 0)
        if len(moved):
            to = launcher.own_array((position[moved] / model.unit).astype(np.float32), wp.vec2)
            self._changes += [launcher.own_array(before[moved], wp.vec2), to]
            self._put_down(moved, to)

    def _places(self, body: wp.array) -> wp.array:
        """Where some old bodies were, in the new model's unit, ``wp.vec2``."""
        point = self._launcher.empty(len(body), wp.vec2)
        scale = self._old.unit / self._model.unit
        self._launcher.launch(kernels_edit.read_places, len(body), [body, self._pose_before, scale], [point])
        return point

    def _seat(self, body: wp.array | np.ndarray, rows: Rows) -> None:
        """Let old bodies have these rows, and be where they were."""
        launcher = self._launcher
        if isinstance(body, np.ndarray):
            body = launcher.array(body, wp.int32)
        ratio, size = self._old.unit / self._model.unit, wp.vec2(*self._model.size)
        launcher.launch(
            kernels_edit.take_seats,
            len(rows),
            [body, *self._rows_for_kernels(rows), self._pose_before, ratio, size],
            [self.pose, self._source, self._row_of],
        )

    def _in_unit_of(self, model: Model, points: wp.array) -> wp.array:
        """Points [m] in the unit of a model, ``wp.vec2``."""
        launcher = self._launcher
        place = launcher.empty(len(points), wp.vec2)
        where = [points, model.unit, wp.vec2d(*model.size)]
        launcher.launch(kernels_edit.bring_to_unit, len(points), where, [place])
        return place

    def _put_down(self, rows: wp.array | Rows, points: wp.array) -> wp.array:
        """Put the bodies of rows to points in the new model's unit, ``wp.vec2``; return these."""
        launcher = self._launcher
        launcher.launch(kernels_edit.put_down, len(rows), [*self._rows_for_kernels(rows), points], [self.pose])
        return points

    def _rows_for_kernels(self, rows: wp.array | Rows) -> tuple[int, wp.array]:
        """The first of rows that follow each other, or all of them."""
        if isinstance(rows, range):
            return rows.start, self._launcher.empty(0, wp.int32)
        if isinstance(rows, np.ndarray):
            rows = self._launcher.array(rows.astype(np.int32, copy=False), wp.int32)
        return 0, rows


def _ranges(model: Model) -> list[tuple[tuple[str, str], int, int, int]]:
    """Of every size its names, its class, its first body and the one behind its last: bodies are in class, then size order."""
    result = []
    end = 0
    for c, body_class in enumerate(model.problem.classes):
        for size in body_class.sizes:
            begin, end = end, end + (size.count or 0)
            result.append(((body_class.name, size.name), c, begin, end))
    return result


def in_order(numbers: np.ndarray) -> np.ndarray:
    """Numbers from the smallest on; it is soon seen that they are, as they mostly do come."""
    return numbers if (numbers[1:] >= numbers[:-1]).all() else np.sort(numbers)


def _as_range(rows: np.ndarray) -> Rows:
    """Rows that need not be listed where they follow each other."""
    follow = len(rows) > 0 and rows[-1] - rows[0] == len(rows) - 1 and bool((rows[1:] > rows[:-1]).all())
    return range(int(rows[0]), int(rows[-1]) + 1) if follow else rows


def _listed(rows: Rows) -> np.ndarray:
    """Rows one by one, int32; NumPy alone would ask a range for one after the other."""
    return (
        np.arange(rows.start, rows.stop, dtype=np.int32)
        if isinstance(rows, range)
        else rows.astype(np.int32, copy=False)
    )


def _seats(rows: Rows, staying: int, area: np.ndarray) -> tuple[Rows, Rows]:
    """Which rows of a size stay with those that are there, and which are new ones': evenly among its areas, smallest first."""
    if is_same(area):
        return rows[:staying], rows[staying:]
    listed = _listed(rows)
    by_area = listed[np.argsort(area[listed], kind="stable")]
    new = len(rows) - staying
    if area[by_area[0]] == area[by_area[-1]] if len(rows) else True:
        return rows[:staying], rows[staying:]
    chosen = np.zeros(len(rows), bool)
    chosen[np.floor((np.arange(new) + 0.5) * len(rows) / max(new, 1)).astype(int)] = True
    return by_area[~chosen], by_area[chosen]
