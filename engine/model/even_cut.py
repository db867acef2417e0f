"""Which bodies along a cut are kept, so that each stretch of it has as many as its ground asks for.

If a border simply keeps those that lie deepest, its stretches have some bodies too many or too few, as it happens to cut through
their order. Along a long border that adds up, and nothing makes up for it where ground is narrow: two halves that an isthmus joins
have several bodies too many and too few for good. So bodies near the border are exchanged, one within it for one beyond, as long as
that lowers the energy of what is kept beside what is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..problem.wave_filter import fast_length
from ..space.density import box_integrals

__all__ = ["Ground", "evened"]

# Charges and target are blurred by so many spacings. With 1.0 letters are evened out as well, with 1.4 letters "SB" are not.
BLUR = 1.2
# Cells of the mesh on which they are compared, and ground around it, in spacings.
CELL, AROUND = 0.7, 4.0
# Who lies so near to the border may be exchanged, in spacings there. And what it costs to keep one that lies a spacing farther out,
# and any exchange, over the energy of a body: without both, smallest spacings in a square are .61 instead of .72. Measured on 2,048
# bodies on 14 grounds, means of five seeds: errors at k = 1 and 2 are .00165 and .00027, and .00188 and .00031 as cut. Across an
# isthmus they are .0039 and .0004, and .0069 and .0010; the largest number at any distance from a square's border is 1.8 times even,
# and 2.3.
NEAR, FARTHER_OUT, ANY = 0.5, 0.1, 0.1
# The same of one of several groups, whose order with the others every exchange breaks. Measured on two classes on a letter and in a
# square, and on two of unlike areas, ten seeds: errors of a class are .0089, .0104 and .0060, and .0114, .0108 and .0060 as cut. Those
# of all are .0023, .0047 and .0196, and .0025, .0046 and .0191; with 0.1 they are .0023, .0049 and .0205.
ANY_AMONG_OTHERS = 1.0
# Of more bodies, a few too many somewhere are less than anything else that is wrong with them.
MOST_BODIES = 200_000
# Nor on small spots far from each other, where the mesh would have more nodes than this.
MOST_NODES = 4_000_000
# Exchanges times bodies near the border at most: that takes about a second.
MOST_LOOKS = 10_000_000


class Ground(NamedTuple):
    """What is asked for.

    Attributes:
        density: Shape ``[height, width]``.
        size: Of its rectangle [m].
        spacing: Of bodies on the ground that has a density [m].
        is_alone: Whether these are all bodies that there are.
    """

    density: np.ndarray
    size: tuple[float, float]
    spacing: float
    is_alone: bool


def evened(
    kept: np.ndarray, ground: Ground, position: np.ndarray, depth: np.ndarray, part: np.ndarray | None
) -> np.ndarray:
    """Return which bodies are kept, as many as before, shape ``[their number]``.

    Args:
        kept: Which were to be kept.
        ground: What they are to be as dense as.
        position: Of all bodies in its rectangle, or beyond [m], shape ``[n, 2]``.
        depth: How deep they lie within the border, in spacings where they are, shape ``[n]``.
        part: The part of the ground that each is in, all of which keep their numbers; None where it is one.
    """
    near = np.flatnonzero(np.abs(depth) < NEAR)
    is_kept = np.zeros(len(depth), bool)
    is_kept[kept] = True
    if len(kept) > MOST_BODIES or is_kept[near].all() or not is_kept[near].any():
        return kept
    if math.prod(ground.size) > MOST_NODES * (CELL * ground.spacing) ** 2:
        return kept
    mesh = _Mesh(ground)
    place = mesh.place(position)
    potential = mesh.at(mesh.potential(place[kept]), place[near])
    own = mesh.of_one[0, 0]
    is_kept[near] = _exchanged(
        is_kept[near],
        potential / own - FARTHER_OUT * depth[near],
        lambda one: mesh.at(mesh.of_one, place[near] - place[near[one]]) / own,
        np.zeros(len(near), np.int64) if part is None else part[near],
        ANY if ground.is_alone else ANY_AMONG_OTHERS,
    )
    return np.flatnonzero(is_kept)


def _exchanged(
    kept: np.ndarray, cost: np.ndarray, of_one: Callable[[int], np.ndarray], part: np.ndarray, worth: float
) -> np.ndarray:
    """Exchange one at a time, the costliest that is kept for the cheapest that is not, or for the best of the same part.

    Args:
        kept: Who is kept, shape ``[n]``, bool.
        cost: What it costs to keep each, beside all others that are, in energies of a body, shape ``[n]``.
        of_one: Called with one of them: what it adds to these costs, shape ``[n]``.
        part: The part of the ground that each is in, shape ``[n]``.
        worth: What an exchange has to gain, in energies of a body.
    """
    kept, cost = kept.copy(), cost.copy()
    for _ in range(min(len(kept), MOST_LOOKS // len(kept))):
        leaves, comes = int(np.where(kept, cost, -np.inf).argmax()), int(np.where(kept, np.inf, cost).argmin())
        of_its_part = int(np.where(kept | (part != part[leaves]), np.inf, cost).argmin())
        of_that_part = int(np.where(kept & (part == part[comes]), cost, -np.inf).argmax())
        best = None
        for out, into in {(leaves, of_its_part), (of_that_part, comes)}:
            if kept[out] and not kept[into] and part[out] == part[into]:
                gone = of_one(out)
                gain = cost[out] - cost[into] - 1.0 + float(gone[into])
                if best is None or gain > best[0]:
                    best = gain, out, into, gone
        if best is None or best[0] <= worth:
            break
        _, out, into, gone = best
        kept[out], kept[into] = False, True
        cost += of_one(into) - gone
    return kept


class _Mesh:
    """The mesh on which charges and target are compared, with empty ground around it.

    Attributes:
        of_one: Potential of a charge at the first node, blurred, shape ``[rows, columns]``.
    """

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        size = np.array(ground.size)
        self._inner = np.maximum(np.ceil(size / (CELL * ground.spacing)), 1.0).astype(int)
        self._cell = size / self._inner
        self._margin = np.ceil(AROUND * ground.spacing / self._cell).astype(int)
        self._columns, self._rows = (fast_length(int(many)) for many in self._inner + 2 * self._margin)
        along_y, along_x = np.fft.fftfreq(self._rows, self._cell[1]), np.fft.rfftfreq(self._columns, self._cell[0])
        squared = along_y[:, None] ** 2 + along_x[None, :] ** 2
        squared[0, 0] = np.inf
        self._kernel = np.exp(-((2.0 * math.pi * BLUR * ground.spacing) ** 2) * np.minimum(squared, 1e300)) / squared
        self.of_one = np.fft.irfft2(self._kernel, (self._rows, self._columns))

    def place(self, position: np.ndarray) -> np.ndarray:
        """Where positions [m] are between nodes: columns and rows."""
        at = position / self._cell - 0.5 + self._margin
        return np.clip(at, 0.0, [self._columns - 1.0, self._rows - 1.0])

    def at(self, values: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Values of nodes between these, shape ``[n]``."""
        return np.sum([share * values[row, column] for row, column, share in self._corners(place)], axis=0)

    def potential(self, place: np.ndarray) -> np.ndarray:
        """Potential of charges beside the target of as much, shape ``[rows, columns]``."""
        number = self._rows * self._columns
        charge = sum(
            np.bincount(row * self._columns + column, share, number) for row, column, share in self._corners(place)
        )
        charge = np.reshape(charge, (self._rows, self._columns))
        low, high = self._margin, self._margin + self._inner
        asked = box_integrals(self._ground.density, (int(self._inner[1]), int(self._inner[0])))
        charge[low[1] : high[1], low[0] : high[0]] -= len(place) * asked
        result: np.ndarray = np.fft.irfft2(np.fft.rfft2(charge) * self._kernel, charge.shape)
        return result

    def _corners(self, place: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """The four nodes around every place: their rows and columns, and their shares."""
        low = np.floor(place).astype(np.int64)
        x, y = (place - low).T
        column, row = low.T
        return [
            ((row + up) % self._rows, (column + right) % self._columns, np.abs(1.0 - right - x) * np.abs(1.0 - up - y))
            for up in (0, 1)
            for right in (0, 1)
        ]
