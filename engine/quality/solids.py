"""Which convex bodies meet in space, and how deep they lie in each other; NumPy only.

Pairs are dismissed by what is cheapest first: boxes along the axes of space, spheres, boxes along the bodies' own axes, and then the
bodies themselves. Where these meet, their difference holds the origin: the point of it that is nearest to the origin is looked for as
Gilbert, Johnson and Keerthi (1988) do, for many pairs at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.unit_vectors import spread_directions, tangent_frame, unit_vectors
from .close_boxes import close_boxes
from .nearest_to_origin import nearest_to_origin

__all__ = ["TOLERANCE", "Solids", "depths", "meeting", "meeting_pairs"]

# Bodies that touch do not meet: each is taken to be smaller by this share.
TOLERANCE = 1e-3
# Steps of the search; a pair that is not told apart by then touches.
MOST_STEPS = 32
# What is nearer to the origin than this share of two bodies' extent is there.
ON_ORIGIN = 1e-9
# Edges are parallel where the sine between them is less; then a face tells what they would.
LEAST_SINE = 1e-6
# Pairs that are compared together.
AT_ONCE = 1 << 15
# Directions in which the shortest way out is looked for, beside the boxes' axes; how often around the best one of them; and of how
# many pairs, the deepest ones. So many times others are taken that seem deeper then.
CLOSER_LOOKS = ((32, 0, 2_000), (512, 12, 50))
MOST_LOOKS = 4
# How far around that is [rad], and by how much less each time.
FIRST_ANGLE, CLOSER = 0.15, 0.6


@dataclass(frozen=True, eq=False)
class Solids:
    """Convex bodies in space.

    Attributes:
        shapes: Corners of what bodies are copies of, each from its origin [m], shape ``[k, 3]``.
        shape: Which of them every body is, shape ``[n]``.
        position: Where the origins of bodies are [m], shape ``[n, 3]``.
        axes: The x, y and z axes of bodies as columns, at right angles and as long as bodies are scaled, shape ``[n, 3, 3]``.
    """

    shapes: Sequence[np.ndarray]
    shape: np.ndarray
    position: np.ndarray
    axes: np.ndarray

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Middles of the boxes around bodies along their own axes, and half of these boxes' sides [m], ``[n, 3]`` each."""
        low = np.array([corners.min(axis=0) for corners in self.shapes])
        high = np.array([corners.max(axis=0) for corners in self.shapes])
        middle = self.position + _turned(self.axes, (0.5 * (low + high))[self.shape])
        return middle, (0.5 * (high - low))[self.shape] * np.linalg.norm(self.axes, axis=1)

    def smaller(self, share: float) -> Solids:
        """The same bodies, smaller by a share about the middles of their boxes."""
        shapes = [share * 0.5 * (one.min(axis=0) + one.max(axis=0)) + (1.0 - share) * one for one in self.shapes]
        return Solids(shapes, self.shape, self.position, self.axes)

    def farthest(self, body: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The corners of some bodies that are farthest in a direction each, from their origins [m], shape ``[m, 3]``."""
        axes, shape = self.axes[body], self.shape[body]
        own = np.einsum("nij,ni->nj", axes, direction)
        found = np.empty_like(own)
        for number in np.unique(shape):
            rows, corners = np.flatnonzero(shape == number), self.shapes[number]
            found[rows] = corners[(own[rows] @ corners.T).argmax(axis=1)]
        return _turned(axes, found)

    def reach(self, body: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From where to where some bodies reach along a direction of length 1 each [m], shape ``[m]`` each."""
        shape, own = self.shape[body], np.einsum("nij,ni->nj", self.axes[body], direction)
        low, high = np.empty(len(body)), np.empty(len(body))
        for number in np.unique(shape):
            rows = np.flatnonzero(shape == number)
            along = own[rows] @ self.shapes[number].T
            low[rows], high[rows] = along.min(axis=1), along.max(axis=1)
        place = np.einsum("nk,nk->n", self.position[body], direction)
        return low + place, high + place


def meeting_pairs(
    solids: Solids,
    wanted: np.ndarray,
    apart: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    ask: Callable[[], None] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of bodies that meet and of which at least one is wanted, as two lists of numbers, in order.

    Args:
        solids: The bodies.
        wanted: Which are, shape ``[n]``, bool.
        apart: Which kinds of bodies may not meet each other, shape ``[kinds, kinds]``, bool; others are not looked at. None for all.
        kind: Of every body, shape ``[n]``.
        ask: Called now and then; what it raises ends the search.
    """
    middle, half = solids.boxes()
    unit = solids.axes / np.linalg.norm(solids.axes, axis=1)[:, None, :]
    around = np.einsum("nij,nj->ni", np.abs(unit), half)
    radius = np.linalg.norm(half, axis=1)
    smaller = solids.smaller(TOLERANCE)
    found = [(np.empty(0, np.int64),) * 2]
    for first, second in _gathered(close_boxes(middle, around, wanted)):
        if apart is not None and kind is not None:
            count = apart[kind[first], kind[second]]
            first, second = first[count], second[count]
        near = ((middle[first] - middle[second]) ** 2).sum(axis=1) < (radius[first] + radius[second]) ** 2
        first, second = first[near], second[near]
        for start in range(0, len(first), AT_ONCE):
            if ask is not None:
                ask()
            pair = first[start : start + AT_ONCE], second[start : start + AT_ONCE]
            crossing = _boxes_meet(middle, half, unit, *pair)
            pair = pair[0][crossing], pair[1][crossing]
            meets = meeting(smaller, *pair)
            found.append((pair[0][meets], pair[1][meets]))
    first, second = (np.concatenate(parts) for parts in zip(*found, strict=True))
    first, second = np.minimum(first, second), np.maximum(first, second)
    order = np.lexsort((second, first))
    return first[order], second[order]


def _gathered(parts: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give parts of lists of pairs as fewer longer ones."""
    waiting: list[tuple[np.ndarray, np.ndarray]] = []
    for part in parts:
        waiting.append(part)
        if sum(len(first) for first, _ in waiting) >= AT_ONCE:
            yield _joined(waiting)
            waiting = []
    if waiting:
        yield _joined(waiting)


def _joined(parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    first, second = zip(*parts, strict=True)
    return np.concatenate(first), np.concatenate(second)


def _boxes_meet(
    middle: np.ndarray, half: np.ndarray, unit: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Tell whether boxes of pairs overlap, by the axes of both and those at right angles to one of either, shape ``[m]``.

    Args:
        middle: Of all boxes [m], shape ``[n, 3]``.
        half: Half of their sides [m], shape ``[n, 3]``.
        unit: Their axes as columns, of length 1, shape ``[n, 3, 3]``.
        first: One of every pair, shape ``[m]``.
        second: The other one, shape ``[m]``.
    """
    way = middle[second] - middle[first]
    one, two = half[first], half[second]
    cosine = np.einsum("nki,nkj->nij", unit[first], unit[second])
    size = np.abs(cosine)
    along, across = np.einsum("nki,nk->ni", unit[first], way), np.einsum("nki,nk->ni", unit[second], way)
    meets = (np.abs(along) < one + np.einsum("nij,nj->ni", size, two)).all(axis=1)
    meets &= (np.abs(across) < two + np.einsum("nij,ni->nj", size, one)).all(axis=1)
    rows = np.flatnonzero(meets)
    cosine, size, along, one, two = (values[rows] for values in (cosine, size, along, one, two))
    clear = np.ones(len(rows), bool)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            p, q = (m + 1) % 3, (m + 2) % 3
            distance = np.abs(along[:, k] * cosine[:, j, m] - along[:, j] * cosine[:, k, m])
            reach = one[:, j] * size[:, k, m] + one[:, k] * size[:, j, m]
            reach += two[:, p] * size[:, i, q] + two[:, q] * size[:, i, p]
            # Of parallel edges both sides are what rounding makes.
            clear &= (distance <= reach) | (size[:, i, m] > 1.0 - LEAST_SINE)
    meets[rows] = clear
    return meets


def meeting(solids: Solids, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Tell of pairs of bodies whether these have a point in common, shape ``[m]``, bool.

    Args:
        solids: The bodies.
        first: One of every pair, shape ``[m]``.
        second: The other one, shape ``[m]``.
    """
    meets = np.zeros(len(first), bool)
    left = np.arange(len(first))
    way = solids.position[first] - solids.position[second]
    nearest = np.where(way.any(axis=1)[:, None], way, [1.0, 0.0, 0.0])
    # Of each pair the difference of its bodies: corners of it that are known, and which of them count; and how far it reaches.
    corners, used = np.zeros((len(first), 4, 3)), np.zeros((len(first), 4), bool)
    extent = np.zeros(len(first))
    for _ in range(MOST_STEPS):
        one, two = first[left], second[left]
        corner = way[left] + solids.farthest(one, -nearest[left]) - solids.farthest(two, nearest[left])
        # Otherwise all of the difference is on the other side of a plane than the origin.
        may = np.einsum("nk,nk->n", corner, nearest[left]) <= 0.0
        left, corner = left[may], corner[may]
        if not len(left):
            break
        # Corners that do not count are copies of one that does.
        corners[left] = np.where(used[left][:, :, None], corners[left], corner[:, None])
        nearest[left], used[left] = nearest_to_origin(corners[left])
        extent[left] = np.maximum(extent[left], (corner**2).sum(axis=1))
        meets[left] = (nearest[left] ** 2).sum(axis=1) <= ON_ORIGIN**2 * extent[left]
        left = left[~meets[left]]
    return meets


def depths(solids: Solids, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return how deep bodies of pairs lie in each other [m], shape ``[m]``: about the shortest way that parts them, or a longer one.

    The deepest ones are looked at more closely than the others.

    Args:
        solids: The bodies.
        first: One of every pair, shape ``[m]``.
        second: The other one, shape ``[m]``.
    """
    if not len(first):
        return np.zeros(0)
    best, depth = np.zeros((len(first), 3)), np.full(len(first), np.inf)
    middle, _ = solids.boxes()
    way = middle[first] - middle[second]
    for direction in (way, way * [1.0, 1.0, 0.0], np.broadcast_to([0.0, 0.0, 1.0], way.shape)):
        _take_shorter(solids, first, second, direction, best, depth)
    for directions, rounds, count in CLOSER_LOOKS:
        rough = np.ones(len(first), bool)
        for _ in range(MOST_LOOKS):
            if rough[depth.argmax()]:
                deepest = np.argsort(np.where(rough, -depth, 0.0), kind="stable")[:count]
                depth[deepest] = _shortest_ways(solids, first[deepest], second[deepest], directions, rounds)
                rough[deepest] = False
        # What was not looked at is told to be no deeper than what was.
        depth[rough] = np.minimum(depth[rough], depth[~rough].max())
    return depth


def _shortest_ways(solids: Solids, first: np.ndarray, second: np.ndarray, directions: int, rounds: int) -> np.ndarray:
    """Lengths of the shortest ways that part bodies [m], of those along the axes of their boxes and so many more directions.

    So often shorter ones are looked for around the shortest one that is known.
    """
    unit = unit_vectors(solids.axes[np.concatenate([first, second])].transpose(0, 2, 1))
    one, two = unit[: len(first)], unit[len(first) :]
    crossed = np.cross(one[:, :, None], two[:, None]).reshape(-1, 9, 3)
    best, depth = np.zeros((len(first), 3)), np.full(len(first), np.inf)
    for direction in np.concatenate([one, two, crossed], axis=1).transpose(1, 0, 2):
        _take_shorter(solids, first, second, direction, best, depth)
    for way in spread_directions(2 * directions)[:directions]:
        _take_shorter(solids, first, second, np.broadcast_to(way, best.shape), best, depth)
    angle = FIRST_ANGLE
    for _ in range(rounds):
        beside = np.stack(tangent_frame(best), axis=0)
        for way in np.concatenate([beside, -beside]):
            _take_shorter(solids, first, second, best + angle * way, best, depth)
        angle *= CLOSER
    return depth


def _take_shorter(
    solids: Solids, first: np.ndarray, second: np.ndarray, direction: np.ndarray, best: np.ndarray, depth: np.ndarray
) -> None:
    """Take the ways along a direction of each pair, of any length, and against it, where these are the shortest so far."""
    length = np.linalg.norm(direction, axis=1)
    known = length > LEAST_SINE
    direction = direction / np.where(known, length, 1.0)[:, None]
    low, high = solids.reach(first, direction)
    from_low, to_high = solids.reach(second, direction)
    for way, sign in ((high - from_low, 1.0), (to_high - low, -1.0)):
        shorter = known & (way < depth)
        depth[shorter], best[shorter] = way[shorter], sign * direction[shorter]


def _turned(axes: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors that are told along axes, shape ``[n, 3]``, as space has them."""
    turned: np.ndarray = np.einsum("nij,nj->ni", axes, vector)
    return turned
