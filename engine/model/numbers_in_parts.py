"""How many bodies of every group are in each part of the ground that none can leave for another: as near to what is asked as can be.

Along the curve that bodies start on, a part has as many too many or too few as it is entered and left by chance, and an edit leaves in
it who happens to be there. Where nothing lies between parts, forces even that out; over an empty river nobody goes.
"""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.density import move_into_support, sample_density
from ..space.parts_of_ground import PartsOfGround, parts_of_ground
from ..space.space import Space
from .attraction import water_level
from .body_flags import BodyFlags
from .model import Model

__all__ = ["MOST_BODIES", "has_parts", "move_between_parts", "parts_of_classes", "with_whole_numbers"]

# Of more bodies, one too many in a part is less than anything else that is wrong with them.
MOST_BODIES = 200_000
# A body goes to another part if what that lacks, and what its own has too many, come to more than this.
MORE_THAN_ONE = 1.0 + 1e-6
# After an edit only if they come to more than this: whoever comes and goes stirs others, too. Measured on a river that is painted,
# means of six or eight seeds, right after it and after 100 steps more: errors of one class are .0018 and .0017 instead of .0035 and
# .0034; of 500 among 2,100 they are .018 and .0085 instead of .015 and .0100, and within a natural border .031 and .023 instead of
# .033 and .025, where nothing is gained if less than this is worth it.
WORTH_AN_EDIT = 2.0
# It takes the emptiest of so many places, which lie within so many spacings of one that is even along the part.
PLACES, AROUND = 24, 1.0


def parts_of_classes(launcher: Launcher, model: Model) -> list[PartsOfGround | None]:
    """The parts of every class's density; None where it is one, or has so many bodies that parts do not count."""
    if model not in _parts_of:
        space, known = Space.of(model.problem.rectangle), {}
        result: list[PartsOfGround | None] = []
        for body_class in model.problem.classes:
            image, count = body_class.density_image, body_class.body_count
            key = id(image), count
            if key not in known:
                known[key] = parts_of_ground(launcher, image, space, count) if count <= MOST_BODIES else None
            result.append(known[key])
        _parts_of[model] = result
    return _parts_of[model]


_parts_of: WeakKeyDictionary[Model, list[PartsOfGround | None]] = WeakKeyDictionary()


def has_parts(launcher: Launcher, model: Model) -> bool:
    """Whether the density of any class has several parts."""
    return any(ground is not None for ground in parts_of_classes(launcher, model))


def with_whole_numbers(launcher: Launcher, model: Model, pose: wp.array, start: int = 0) -> wp.array:
    """Poses, ``wp.vec4``, in which parts have the numbers that they ask for, of those that are one of several starts."""
    if not has_parts(launcher, model):
        return pose
    values = pose.numpy()
    position = values[:, :2] * np.float64(model.unit)
    moved = move_between_parts(launcher, model, position, start)
    if not len(moved):
        return pose
    values = values.copy()
    values[moved, :2] = position[moved] / model.unit
    return launcher.own_array(values, wp.vec4)


def move_between_parts(
    launcher: Launcher, model: Model, position: np.ndarray, number: int, is_new: np.ndarray | None = None
) -> np.ndarray:
    """Let bodies change parts until these have the numbers that they ask for.

    Args:
        launcher: Where to run.
        model: The bodies.
        position: Where they are [m], shape ``[body_count, 2]``; changed in place.
        number: Of the start or the edit, which are random in other ways.
        is_new: Bodies that are moved rather than others, shape ``[body_count]``, bool; None for any.

    Returns:
        Which bodies were moved.
    """
    rng, size = np.random.default_rng([model.problem.seed, 14, number]), model.problem.rectangle.size
    movable = ~model.fixed & ((model.body.flags & BodyFlags.PINNED) == 0)
    new = np.zeros(len(position), bool) if is_new is None else is_new
    # What groups lack in each part, in areas of bodies, and where parts are the same: who sees them makes up for it.
    lacking: list[tuple[int, bytes, np.ndarray]] = []
    seen = model.groups.matrix
    result: list[np.ndarray] = []
    for group, c in enumerate(model.groups.class_index.tolist()):
        ground = parts_of_classes(launcher, model)[c]
        bodies = np.flatnonzero(model.body.group == group)
        if ground is None or not len(bodies):
            continue
        free, part = movable[bodies], sample_density(ground.part, position[bodies], size)
        there, fixed = (np.bincount(part[own], minlength=ground.count) for own in (free, ~free))
        asked = _asked(ground.share, fixed, int(free.sum()))
        key, area = ground.part.tobytes(), float(model.body.area[bodies].mean())
        lacked = sum(seen[group, other] / seen[group, group] * lack for other, same, lack in lacking if same == key)
        more = _changes(there, asked + lacked / area, MORE_THAN_ONE if is_new is None else WORTH_AN_EDIT)
        lacking.append((group, key, area * (asked - there - more)))
        by_part = bodies[free][np.argsort(part[free], kind="stable")]
        ends = np.cumsum(there)
        leaving = [
            _nearest_of_each(ground.even_places(p, -n, size, rng), by_part[ends[p] - there[p] : ends[p]], position, new)
            for p, n in enumerate(more.tolist())
            if n < 0
        ]
        entering = [ground.even_places(p, n, size, rng) for p, n in enumerate(more.tolist()) if n > 0]
        if leaving:
            result.append(np.concatenate(leaving))
            _settle_down(model, result[-1], ground, np.concatenate(entering), position, rng)
    return np.concatenate(result) if result else np.zeros(0, np.int64)


def _asked(share: np.ndarray, fixed: np.ndarray, free: int) -> np.ndarray:
    """How many free bodies each part asks for, beside those that are fixed there."""
    total = free + float(fixed.sum())
    return np.maximum(water_level(share, fixed, total, total) * share - fixed, 0.0) if fixed.any() else free * share


def _changes(there: np.ndarray, asked: np.ndarray, worth: float = MORE_THAN_ONE) -> np.ndarray:
    """How many bodies each part is to get, less than 0 where it is to lose some; the sum is 0.

    None where what one part has too many, and another one lacks, do not come to more than is ``worth`` it.
    """
    result, off = np.zeros(len(there), np.int64), there - asked
    if not np.ptp(off) > worth:
        return result
    while True:
        may_leave = np.where(there + result > 0, off, -np.inf)
        leaves, enters = int(may_leave.argmax()), int(off.argmin())
        if not may_leave[leaves] - off[enters] > MORE_THAN_ONE:
            return result
        for part, change in ((leaves, -1), (enters, 1)):
            off[part] += change
            result[part] += change


def _nearest_of_each(places: np.ndarray, bodies: np.ndarray, position: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return which of some bodies are near to places [m], a different one for each; new ones as long as there are any."""
    result = []
    for place in places:
        some = bodies[new[bodies]] if new[bodies].any() else bodies
        result.append(int(some[np.square(position[some] - place).sum(axis=1).argmin()]))
        bodies = bodies[bodies != result[-1]]
    return np.array(result, np.int64)


def _settle_down(
    model: Model,
    bodies: np.ndarray,
    ground: PartsOfGround,
    places: np.ndarray,
    position: np.ndarray,
    rng: np.random.Generator,
) -> None:
    """Put bodies of a group near to places [m], where others are farthest, above all those of its class; positions are changed."""
    domain = model.problem.rectangle
    c = int(model.body.class_index[bodies[0]])
    of_class = model.body.class_index == c
    number = sample_density(ground.density, places, domain.size) * (ground.density.size / domain.area)
    spacing = 1.0 / np.sqrt(np.maximum(number, 1e-300) * model.problem.classes[c].body_count)
    spacing = np.minimum(spacing, max(domain.size))
    own = sample_density(ground.part, places, domain.size)
    kept = np.delete(np.arange(len(position)), bodies)
    kept = kept[np.argsort(position[kept, 0], kind="stable")]
    there = position[kept]
    # One of the class counts as nearer than another, as much as it has fewer bodies than all classes.
    nearer = np.where(of_class, math.sqrt(of_class.sum() / len(of_class)), 1.0)
    for k, (body, place) in enumerate(zip(bodies.tolist(), places, strict=True)):
        support = model.supports[model.body.support[body]]
        tried = place + np.concatenate([np.zeros((1, 2)), AROUND * spacing[k] * rng.uniform(-1.0, 1.0, (PLACES, 2))])
        tried = np.clip(tried, 0.0, domain.size)
        fits = sample_density(ground.part, tried, domain.size) == own[k]
        fits &= sample_density(support, tried, domain.size) > 0.0
        tried = tried[fits] if fits.any() else move_into_support(support, tried[:1], domain.size)
        reach = 3.0 * AROUND * spacing[k]
        low, high = np.searchsorted(there[:, 0], [place[0] - reach, place[0] + reach])
        near = np.concatenate([kept[low:high], bodies[:k]])
        near = near[np.abs(position[near, 1] - place[1]) < reach]
        away = np.linalg.norm(tried[:, None] - position[near], axis=2) * nearer[near]
        position[body] = tried[away.min(axis=1, initial=np.inf).argmax()]
