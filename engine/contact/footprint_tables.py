"""The outlines of a model's bodies as contact takes them: flat tables, with the room that bodies keep for themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.footprint import Footprint

__all__ = ["FootprintTables", "footprint_tables", "numbered", "ranked"]

# Where combinations have so many times as many numbers as there are of them, they are sorted instead of looked up in a table.
SORTED = 16


@dataclass(frozen=True, eq=False)
class FootprintTables:
    """Outlines as contact takes them; lengths in meters, arrays of shape ``[n]`` unless said otherwise.

    Attributes:
        corners: Corners of every shape, one after the other, with the outward normals of their edges, shape ``[m, 4]``.
        start: Where those of a shape begin, and at the end their number, shape ``[shapes + 1]``.
        shape: Which shape a body has.
        factor: How many times as large its core is.
        rounding: Radius around its core.
        reach: Distance of its farthest point from its position.
        width: Its smallest width.
        area: Its area.
        inertia: Integral of the squared distance from its position over its inside [m⁴].
    """

    corners: np.ndarray
    start: np.ndarray
    shape: np.ndarray
    factor: np.ndarray
    rounding: np.ndarray
    reach: np.ndarray
    width: np.ndarray
    area: np.ndarray
    inertia: np.ndarray

    @property
    def is_round(self) -> np.ndarray:
        """Which bodies look the same however they are turned about their positions, shape ``[n]``."""
        of_shapes = (np.diff(self.start) == 1) & (np.hypot(*self.corners[self.start[:-1], :2].T) == 0.0)
        return of_shapes[self.shape]

    def followed_by(
        self,
        outlines: Sequence[Footprint],
        seen_from: np.ndarray,
        shape: np.ndarray,
        scale: np.ndarray,
        margin: np.ndarray,
    ) -> FootprintTables:
        """The same with what stands among the bodies behind them, as it is. Nothing turns it: its inertia is 1.

        Args:
            outlines: The outlines that there are.
            seen_from: Where of each the position of what stands there is [m], shape ``[outlines, 2]``.
            shape: Which of them each has that stands there, shape ``[m]``.
            scale: Factor on it, shape ``[m]``.
            margin: What lies around it then [m], shape ``[m]``.
        """
        if not len(shape):
            return self
        first = self.start[-1] + np.cumsum([len(outline.corners) for outline in outlines])
        cores = [outline.corners - place for outline, place in zip(outlines, seen_from, strict=True)]
        own = [
            (o.rounding, o.width, np.hypot(*c.T).max() + o.rounding, o.area)
            for c, o in zip(cores, outlines, strict=True)
        ]
        rounding, width, reach, area = np.array(own).T[:, shape] * scale
        around = np.pi * margin**2 + 2.0 * margin * reach

        def behind(values: np.ndarray, others: Sequence[float] | np.ndarray) -> np.ndarray:
            return np.concatenate([values, others])

        return replace(
            self,
            corners=np.concatenate([self.corners, *(np.hstack([core, _normals(core)]) for core in cores)]),
            start=behind(self.start, first).astype(np.int32),
            shape=behind(self.shape, len(self.start) - 1 + shape.astype(np.int32)),
            factor=behind(self.factor, scale),
            rounding=behind(self.rounding, rounding + margin),
            reach=behind(self.reach, reach + margin),
            width=behind(self.width, width + 2.0 * margin),
            area=behind(self.area, area * scale + around),
            inertia=behind(self.inertia, np.ones(len(shape))),
        )


def footprint_tables(footprints: BodyFootprints, length: np.ndarray, width: np.ndarray) -> FootprintTables:
    """Outlines with the room that they keep for themselves.

    Args:
        footprints: The outlines.
        length: Length of every line's axis [m].
        width: Thickness of every line [m].
    """
    is_line = footprints.shape == CAPSULE
    own_shape, own_room = footprints.shape[~is_line], footprints.room[~is_line]
    kind = numbered(own_shape, ranked(own_room))
    # One body of each kind.
    example = np.zeros(int(kind.max(initial=-1)) + 1, np.int64)
    example[kind] = np.arange(len(kind))
    outlines = [footprints.shapes[int(own_shape[body])].with_room(float(own_room[body])) for body in example]
    cores = [outline.corners for outline in outlines]
    # The axis of a line, of half length 1.
    cores.append(np.array([[-1.0, 0.0], [1.0, 0.0]]))
    capsule = len(cores) - 1
    start = np.concatenate([[0], np.cumsum([len(core) for core in cores])]).astype(np.int32)
    shape = np.full(len(is_line), capsule, np.int32)
    shape[~is_line] = kind
    room, around = footprints.room, 0.5 * footprints.gap
    half = 0.5 * length * room
    factor = np.where(is_line, half, footprints.factor)
    own = [(o.rounding, o.width, o.circumradius - o.rounding, o.moment / o.area) for o in outlines]
    rounding, narrow, reach, square = np.array([*own, (0.0, 0.0, 1.0, 0.0)]).T[:, shape]
    rounding = np.where(is_line, 0.5 * width * room, rounding * factor) + around
    area = footprints.areas(length, width, apart=True)
    # Of a capsule, as of a rod of its length; the room around others makes them a little larger.
    inertia = np.where(is_line, (half + rounding) ** 2 / 3.0, square * factor**2 + around**2) * area
    return FootprintTables(
        np.concatenate([np.hstack([core, _normals(core)]) for core in cores]),
        start,
        shape,
        factor,
        rounding,
        np.where(is_line, half, reach * factor) + rounding,
        np.where(is_line, 2.0 * rounding, narrow * factor + 2.0 * around),
        area,
        inertia,
    )


def _normals(core: np.ndarray) -> np.ndarray:
    if len(core) == 1:
        return np.zeros((1, 2))
    edge = np.roll(core, -1, axis=0) - core
    return np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.hypot(*edge.T)[:, None]


def ranked(values: np.ndarray) -> np.ndarray:
    """Which of the different values that there are, from the smallest one on, every one is, shape ``[n]``."""
    if not len(values) or (values == values[0]).all():
        # As a rule: there is nothing to sort.
        return np.zeros(len(values), np.int64)
    return np.unique(values, return_inverse=True)[1].ravel()


def numbered(*keys: np.ndarray) -> np.ndarray:
    """Number of every combination of whole numbers among the different ones that there are, in their order, shape ``[n]``."""
    number = np.zeros(len(keys[0]), np.int64)
    for key in keys if len(number) else ():
        low, high = int(key.min()), int(key.max())
        number = number * (high - low + 1) + (key - low)
        # After every key only as many as there are, so that the numbers stay small.
        most = int(number.max()) + 1
        if most > SORTED * len(number):
            number = ranked(number)
            continue
        there = np.zeros(most, bool)
        there[number] = True
        number = (np.cumsum(there) - 1)[number]
    return number
