"""From one problem to another: which bodies stay, which go, and where new ones come down.

Most of a state is still right after an edit. Where a density fell its surplus is taken out, and set down where it rose; what is left
to the descent is the small scale. Both happen at points that are spread by a small descent of their own, so that no place loses or
gets two while another has none.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp

from ..problem.image_filters import gaussian_blur
from ..problem.of_bodies import is_same
from ..problem.problem import Problem
from ..space.density import box_integrals, move_into_support, sample_density
from .attraction import BLUR_OF_FIXED, vacancy
from .body_flags import BodyFlags
from .carried_over import CarriedOver
from .line_rules import length_blocks
from .model import Model
from .state import State

__all__ = ["carry_lines", "carry_over", "in_support"]

# Cells per body in which densities are compared; powers of two along either side.
CELLS_PER_BODY = 2
SMALLEST_ORDER, LARGEST_ORDER = 3, 10
# Densities that differ by less have not changed: images are read and blurred in float32.
UNCHANGED = 1e-4
# Where fewer stay than this share, it is those that are spread evenly; elsewhere those that go are.
FEW = 0.6
# Bodies of a row of cells among which the nearest to a point is looked for.
IN_ROW = 16


@dataclass(eq=False)
class _Change:
    """What an edit does to the bodies of one size of a class, fixed ones aside.

    Attributes:
        rows: Their indices in the new model.
        pool: Indices of those that there are, in the old one.
        wanted: How many of them each cell is to have; row 0 at the bottom.
        there: How many each cell has.
        stays: Whether each of ``pool`` stays; at first, whether it has a place at all.
        too_many: Places in ``pool`` of those where some are to go, but most stay.
        thinned: Of those where most are to go.
        surplus: How many are to go where most stay.
        survivors: How many are to stay where most go.
        placed: Old indices of those of them that are to be at the points that were spread for them, in their order.
    """

    rows: np.ndarray
    pool: np.ndarray
    wanted: np.ndarray
    there: np.ndarray
    stays: np.ndarray
    too_many: np.ndarray
    thinned: np.ndarray
    surplus: int
    survivors: int
    placed: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    @property
    def counts(self) -> list[int]:
        """How many points are spread: for those that go, that survive where most go, and that come."""
        staying = int(np.count_nonzero(self.stays)) - len(self.thinned) - self.surplus + self.survivors
        return [self.surplus, self.survivors, len(self.rows) - staying]

    @property
    def densities(self) -> list[np.ndarray]:
        """Over what they are spread; any density for none."""
        goes, survives, comes = (count > 0 for count in self.counts)
        most_go = self.wanted < FEW * self.there
        loss = survival = gain = self.wanted
        if goes:
            loss = _somewhere(np.where(most_go, 0.0, np.maximum(self.there - self.wanted, 0.0)), self.wanted)
        if survives:
            survival = _somewhere(np.where(most_go, self.wanted, 0.0), self.wanted)
        if comes:
            gain = _somewhere(np.maximum(self.wanted - self.there, 0.0), self.wanted)
        return [loss, survival, gain]

    def thin_out(self, points: list[np.ndarray], position: np.ndarray, problem: Problem) -> None:
        """Decide who stays, by the points that were spread over the first two densities."""
        cells = max(1, int(math.sqrt(len(self.pool))))
        candidates = self.too_many
        if self.surplus > len(candidates):
            candidates = np.flatnonzero(self.stays)
            candidates = np.setdiff1d(candidates, self.thinned, assume_unique=True)
        going = _nearest(points[0], position[self.pool[candidates]], problem, cells)
        self.stays[candidates[going]] = False
        self.stays[self.thinned] = False
        chosen = self.thinned[_nearest(points[1], position[self.pool[self.thinned]], problem, cells)]
        self.stays[chosen] = True
        if len(chosen) < len(self.thinned):
            self.placed = self.pool[chosen]


# Gets densities, row 0 at the bottom, and counts; returns as many points [m] for each.
Spread = Callable[[list[np.ndarray], list[int]], list[np.ndarray]]


def carry_over(old: Model, position: np.ndarray, model: Model, first_identity: int, spread: Spread) -> CarriedOver:
    """Bring the bodies of one model over to another.

    Args:
        old: The model before the edit.
        position: Where its bodies are [m], shape ``[old count, 2]``, float64.
        model: The model after it, in the same domain.
        first_identity: Identity of the first body that is new; later ones follow.
        spread: Spreads points over densities.
    """
    body, before = model.body, old.body
    source = np.full(model.body_count, -1, np.int64)
    result = np.zeros((model.body_count, 2))
    fixed = np.flatnonzero(model.fixed)
    # What is fixed now has its place from the problem; it may have been one of the old bodies.
    index_of = {identity: index for index, identity in enumerate(before.identity.tolist())} if len(fixed) else {}
    for row in fixed.tolist():
        source[row] = index_of.get(int(body.identity[row]), -1)
    result[fixed] = model.problem.fixed.position
    used = (before.flags & BodyFlags.GHOST) != 0
    used[source[fixed][source[fixed] >= 0]] = True
    taken = used.copy()
    changes = _changes(old, position, model, used)
    points = spread(
        [density for change in changes for density in change.densities],
        [count for change in changes for count in change.counts],
    )
    there = fixed[source[fixed] >= 0]
    elsewhere = [there[(result[there] != position[source[there]]).any(axis=1)]]
    for number, change in enumerate(changes):
        change.thin_out(points[3 * number : 3 * number + 2], position, model.problem)
        at = points[3 * number + 2]
        staying = change.pool[change.stays]
        old_rows, new_rows = _seats(change.rows, len(staying), body.area)
        if not is_same(before.area) and len(staying) and np.ptp(before.area[staying]) > 0.0:
            # Bodies of a range keep their ranks.
            staying = staying[np.argsort(before.area[staying], kind="stable")]
        source[_run(old_rows)] = staying
        result[_run(old_rows)] = position.take(staying, axis=0)
        if len(change.placed):
            # Where few are left of many they are as even as points are, not as those that they were among.
            row_of = np.zeros(old.body_count, np.int64)
            row_of[source[old_rows]] = old_rows
            result[row_of[change.placed]] = points[3 * number + 1]
            elsewhere.append(row_of[change.placed])
        result[_run(new_rows)] = at
    is_new = source < 0
    gone = ~taken
    gone[source[~is_new]] = False
    # Of new ones it is anything for now.
    identity = np.where(model.fixed, body.identity, before.identity.take(source, mode="clip")).astype(np.int64)
    fresh = np.flatnonzero(is_new & ~model.fixed)
    identity[fresh] = first_identity + np.arange(len(fresh))
    result = in_support(model, result)
    away = np.concatenate(elsewhere)
    moved = np.concatenate([result[away], position[source[away]]])
    return CarriedOver(result, source, identity, position[gone], moved)


def _changes(old: Model, position: np.ndarray, model: Model, used: np.ndarray) -> list[_Change]:
    """What is to happen to every size; marks the old bodies that belong to one as ``used``."""
    body, before = model.body, old.body
    old_classes = {c.name: index for index, c in enumerate(old.problem.classes)}
    pinned_now = used.copy()
    changes = []
    for c, body_class in enumerate(model.problem.classes):
        k = old_classes.get(body_class.name, -1)
        old_sizes = {} if k < 0 else {s.name: i for i, s in enumerate(old.problem.classes[k].sizes)}
        order = _order(body_class.body_count)
        asked = _asked(model, c, order)
        asked_before = np.zeros_like(asked)
        if k >= 0:
            asked_before = asked if _ask_alike(model, c, old, k) else _asked(old, k, order)
        for s, size in enumerate(body_class.sizes):
            rows = np.flatnonzero((body.class_index == c) & (body.size_index == s) & ~model.fixed)
            of_size = (before.class_index == k) & (before.size_index == old_sizes.get(size.name, -1))
            pool = np.flatnonzero(of_size & ~used)
            used[pool] = True
            there = float(np.count_nonzero(of_size & ~old.fixed)) * asked_before
            # Who is pinned now no longer counts, who was let go does.
            for sign, group in ((-1.0, of_size & ~old.fixed & pinned_now), (1.0, of_size & old.fixed & ~pinned_now)):
                if group.any():
                    there = np.maximum(
                        there + sign * _blurred(position[group], model, body_class.body_count, order), 0.0
                    )
            total = float(there.sum())
            if len(pool) and total > 0.0 and total != len(pool):
                there = there * (len(pool) / total)
            wanted = len(rows) * asked
            changes.append(_change(rows, pool, wanted, there, position, model.problem))
    return changes


def _ask_alike(one: Model, class_index: int, other: Model, other_index: int) -> bool:
    """Whether two classes of two models are to be placed alike, but for their numbers, and nobody is fixed in either."""
    if one.has_fixed or other.has_fixed:
        return False
    images = one.problem.classes[class_index].density_image, other.problem.classes[other_index].density_image
    return images[0] is images[1] or np.array_equal(*images)


def _somewhere(density: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    return density if density.any() else otherwise


def _blurred(position: np.ndarray, model: Model, count: int, order: int) -> np.ndarray:
    """Bodies per cell, blurred as fixed ones are where they take the place of others."""
    cells = 1 << order
    column, row = _cells_of(position, cells, model.problem)
    there = np.bincount(row * cells + column, minlength=cells * cells).reshape(cells, cells)
    return gaussian_blur(there, BLUR_OF_FIXED * cells / math.sqrt(count))


def _change(
    rows: np.ndarray, pool: np.ndarray, wanted: np.ndarray, there: np.ndarray, position: np.ndarray, problem: Problem
) -> _Change:
    """See :class:`_Change`; ``position`` are those of all bodies before [m]."""
    cells = len(wanted)
    column, row = _cells_of(position[_run(pool)], cells, problem)
    ratio = (wanted / np.maximum(there, 1e-300)).ravel().take(row * cells + column)
    # Where nothing has changed, and where more are to come, all stay.
    fewer = np.flatnonzero(ratio <= 1.0 - UNCHANGED)
    ratio = ratio[fewer]
    stays = np.ones(len(pool), bool)
    stays[fewer[ratio <= 0.0]] = False
    thinned, too_many = (ratio > 0.0) & (ratio < FEW), ratio >= FEW
    survivors = min(round(float(ratio[thinned].sum())), len(rows))
    surplus = round(float((1.0 - ratio[too_many]).sum()))
    thinned, too_many = fewer[thinned], fewer[too_many]
    has_place = int(np.count_nonzero(stays))
    most_stay = has_place - len(thinned)
    # As many come as the densities say; how many stay for that is decided where most go, or else where most stay. There is never one
    # more than is asked for.
    coming = round(float(np.maximum(wanted - there, 0.0).sum()))
    staying = min(max(len(rows) - coming, 0), has_place)
    of_thinned = survivors if surplus > survivors else staying - (most_stay - surplus)
    survivors = min(max(of_thinned, 0), len(thinned), staying)
    surplus = min(max(most_stay - (staying - survivors), 0), most_stay)
    return _Change(rows, pool, wanted, there, stays, too_many, thinned, surplus, survivors)


def _run(indices: np.ndarray) -> np.ndarray | slice:
    """Indices as a slice where each follows the one before: NumPy copies a run ten times as fast."""
    count = len(indices)
    if count and indices[-1] - indices[0] + 1 == count and (indices[1:] > indices[:-1]).all():
        return slice(int(indices[0]), int(indices[-1]) + 1)
    return indices


def _nearest(points: np.ndarray, position: np.ndarray, problem: Problem, cells: int) -> np.ndarray:
    """Indices of bodies, a different one for each point: the nearest that is left of those in the cells around it.

    There are so many ``cells`` along either side of the domain.
    """
    count = len(points)
    if count == 0:
        return np.zeros(0, np.int64)
    if count >= len(position):
        return np.arange(len(position))
    column, row = _cells_of(position, cells, problem)
    key = row * cells + column
    by_cell = np.argsort(key, kind="stable")
    key = key[by_cell]
    column, row = _cells_of(points, cells, problem)
    candidates = []
    for step in (-1, 0, 1):
        line = (row + step) * cells
        first = np.searchsorted(key, line + np.maximum(column - 1, 0))
        last = np.searchsorted(key, line + np.minimum(column + 1, cells - 1), side="right")
        last = np.where((row + step >= 0) & (row + step < cells), last, first)
        # In a crowd, those in the middle of the range.
        first = np.maximum(first, (first + last - IN_ROW) // 2)
        entry = first[:, None] + np.arange(IN_ROW)
        candidates.append(np.where(entry < last[:, None], by_cell[np.minimum(entry, len(key) - 1)], -1))
    found = np.concatenate(candidates, axis=1)
    # Axis by axis: along rows of two numbers NumPy is several times slower.
    away = sum((position[:, axis].take(found, mode="clip") - points[:, axis, None]) ** 2 for axis in (0, 1))
    away[found < 0] = np.inf
    # Each row by distance; couples of equal distance as they were found.
    ranked = np.take_along_axis(found, np.argsort(away, axis=1, kind="stable"), axis=1)
    chosen = _first_come(ranked, len(position))
    missed = np.flatnonzero(chosen < 0)
    if len(missed):
        # Points far from all bodies.
        free = np.ones(len(position), bool)
        free[chosen[chosen >= 0]] = False
        left = np.flatnonzero(free)
        chosen = np.concatenate(
            [chosen[chosen >= 0], left[np.linspace(0, len(left) - 1, len(missed)).astype(np.int64)]]
        )
    return chosen


def _first_come(ranked: np.ndarray, count: int) -> np.ndarray:
    """What every row gets of its candidates, the best first, where each goes to the first row that wants it; -1 where nothing is left.

    Args:
        ranked: Candidates of every row, shape ``[n, k]``, below ``count``; those below 0 are none.
        count: How many candidates there are.
    """
    rows = len(ranked)
    result, next_one = np.full(rows, -1, np.int64), np.zeros(rows, np.int64)
    # All ask at once, and who is turned away asks for the next: whoever comes first gets it in the end, in whatever order they ask.
    holder = np.full(count, rows, np.int64)
    asking = np.arange(rows)
    while len(asking):
        wanted = ranked[asking, next_one[asking]]
        next_one[asking] += 1
        real = wanted >= 0
        candidate, row = wanted[real], asking[real]
        before = holder[candidate]
        np.minimum.at(holder, candidate, row)
        won = holder[candidate] == row
        displaced = before[won]
        result[displaced[displaced < rows]] = -1
        result[row[won]] = candidate[won]
        again = np.concatenate([asking[~real], row[~won], displaced[displaced < rows]])
        asking = again[next_one[again] < ranked.shape[1]]
    return result


def carry_lines(old: Model, state: State, model: Model, new_state: State, carried: CarriedOver) -> None:
    """Bring what lines have beside their poses over to the state of another model: bends, and the factors of their lengths."""
    carry_bends(old, state.bend, model, new_state.bend, carried.source)
    if old.kinds and len(old.kinds) == len(model.kinds):
        new_state.length_factor.assign(_length_factors(old, state.length_factor.numpy(), model))


def carry_bends(old: Model, bent: wp.array, model: Model, bent_now: wp.array, source: np.ndarray) -> None:
    """Bring the bends of lines over to those of another model; ``source`` is every body's number before, -1 for new ones."""
    if not old.kinds or not model.kinds:
        return
    count, count_before = np.diff(model.charge.first), np.diff(old.charge.first)
    same = np.flatnonzero((source >= 0) & (count == count_before[source]) & ~model.fixed)
    bend, bend_before = bent_now.numpy(), bent.numpy()
    for charges in np.unique(count[same]).tolist():
        rows = same[count[same] == charges]
        number = np.arange(charges)
        before = old.charge.first[source[rows]][:, None] + number
        bend[model.charge.first[rows][:, None] + number] = bend_before[before] * (old.unit / model.unit)
    bent_now.assign(bend)


def _length_factors(old: Model, factor: np.ndarray, model: Model) -> np.ndarray:
    """Factors on lengths for the blocks of another model with as many kinds: every block has that of the one at its place."""
    kinds = len(model.kinds)
    before, start = length_blocks(old), kinds
    result = [factor[:kinds]]
    for kind, (rows, columns) in enumerate(length_blocks(model)):
        height, width = before[kind]
        stored = factor[start : start + height * width].reshape(height, width)
        start += height * width
        if not height:
            stored = factor[kind : kind + 1, None]
            height = width = 1
        at = np.ix_(np.arange(rows) * height // max(rows, 1), np.arange(columns) * width // max(columns, 1))
        result.append(stored[at].reshape(-1))
    return np.concatenate(result)


def _seats(rows: np.ndarray, staying: int, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which rows of a size stay with those that are there, and which are new ones': evenly among its areas, smallest first."""
    if is_same(area):
        return rows[:staying], rows[staying:]
    by_area = rows[np.argsort(area[rows], kind="stable")]
    new = len(rows) - staying
    if area[by_area[0]] == area[by_area[-1]] if len(rows) else True:
        return rows[:staying], rows[staying:]
    chosen = np.zeros(len(rows), bool)
    chosen[np.floor((np.arange(new) + 0.5) * len(rows) / max(new, 1)).astype(int)] = True
    return by_area[~chosen], by_area[chosen]


def _order(count: int) -> int:
    """How finely densities are compared: in 2^order cells along either side."""
    return min(max(math.ceil(0.5 * math.log2(CELLS_PER_BODY * count + 1.0)), SMALLEST_ORDER), LARGEST_ORDER)


def _asked(model: Model, class_index: int, order: int) -> np.ndarray:
    """Share of a class's bodies that are to be placed in every cell, shape ``[rows, columns]``, row 0 at the bottom, sum 1."""
    of_model = _asked_of.setdefault(model, {})
    key = class_index, order
    if key not in of_model:
        cells = 1 << order
        share = box_integrals(model.problem.classes[class_index].density_image, (cells, cells))
        left = vacancy(model, class_index, cells)
        if left is not None and (share * left).any():
            share = share * left
            share /= share.sum()
        of_model[key] = share
    return of_model[key]


# Of a model that is edited to, the next edit asks again.
_asked_of: WeakKeyDictionary[Model, dict[tuple[int, int], np.ndarray]] = WeakKeyDictionary()


def _cells_of(position: np.ndarray, cells: int, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    column, row = (
        np.clip((position[:, a] * (cells / problem.rectangle.size[a])).astype(np.int32), 0, cells - 1) for a in (0, 1)
    )
    return column, row


def in_support(model: Model, position: np.ndarray) -> np.ndarray:
    """Bodies that are not fixed, brought to where they may be."""
    for axis, length in enumerate(model.problem.rectangle.size):
        np.clip(position[:, axis], 0.0, length, out=position[:, axis])
    for k, support in enumerate(model.supports):
        if (support > 0.0).all():
            continue
        own = np.flatnonzero((model.body.support == k) & ~model.fixed)
        outside = own[sample_density(support, position[own], model.problem.rectangle.size) <= 0.0]
        if len(outside):
            position[outside] = move_into_support(support, position[outside], model.problem.rectangle.size)
    return position
