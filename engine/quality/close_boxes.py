"""Which boxes along the axes of space overlap, of many boxes of any size; NumPy only."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..space.size_levels import levels_of

__all__ = ["close_boxes"]

# Pairs that are looked at together: what is known of them then takes some tens of MB.
AT_ONCE = 1 << 19
# Smallest half side of a box, over the largest one.
SMALLEST = 1e-6


class _Cells(NamedTuple):
    """Some boxes in cells of space.

    Attributes:
        member: The boxes by cell, shape ``[n]``.
        key: Numbers of their cells, in order, shape ``[n]``.
        low: The corner of the first cell [m], ``[3]``.
        side: Of a cell [m], ``[3]``.
        number: Cells along x, y and z, ``[3]``.
        order: Axes from the one whose cells follow each other last to the one where they do at once.
    """

    member: np.ndarray
    key: np.ndarray
    low: np.ndarray
    side: np.ndarray
    number: np.ndarray
    order: np.ndarray


def close_boxes(center: np.ndarray, half: np.ndarray, wanted: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give the pairs of boxes that overlap and of which at least one is wanted, part by part: each once, as two lists of numbers.

    Args:
        center: Middles of the boxes [m], shape ``[n, 3]``.
        half: Half of their sides [m], shape ``[n, 3]``.
        wanted: Which are, shape ``[n]``, bool.
    """
    if len(center) < 2 or not wanted.any():
        return
    reach = half.max(axis=1)
    level, reaches = levels_of(np.maximum(reach, SMALLEST * max(float(reach.max()), 1e-300)))
    for coarse in range(len(reaches)):
        # Small boxes look for large ones, in cells as large as these: what is wanted for all of them, the others for what is wanted.
        there, widest = level == coarse, half[level >= coarse].max(axis=0)
        looking = np.flatnonzero(wanted & (level >= coarse))
        yield from _found(looking, np.flatnonzero(there), center, half, widest, there & wanted)
        # Of their own level, what is wanted has found the others.
        looking = np.flatnonzero(~wanted & (level > coarse))
        yield from _found(looking, np.flatnonzero(there & wanted), center, half, widest, there & wanted)


def _found(
    looking: np.ndarray,
    member: np.ndarray,
    center: np.ndarray,
    half: np.ndarray,
    widest: np.ndarray,
    twice: np.ndarray,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give the pairs of some boxes that look around and of others that they overlap, part by part; themselves are left out.

    Of those that find each other ``twice``, shape ``[n]``, each pair is given once. No half side is longer than ``widest``, ``[3]``.
    """
    if not len(looking) or not len(member):
        return
    for first, second in _neighbors(looking, _cells(member, center, half, widest), center, half):
        keep = (first < second) | ~(twice[first] & twice[second])
        yield first[keep], second[keep]


def _cells(member: np.ndarray, center: np.ndarray, half: np.ndarray, widest: np.ndarray) -> _Cells:
    """Sort boxes into cells: what looks for them, with half sides of ``widest`` at most, finds them in its own and those around."""
    place, side = center[member], half[member].max(axis=0) + widest
    low = place.min(axis=0)
    extent = place.max(axis=0) - low
    # Flat ones have a thickness here, and no more cells than can be numbered.
    side = np.maximum(side, np.maximum(1e-5 * extent, 1e-300))
    count = (extent / side).astype(np.int64) + 1
    order = np.argsort(count, kind="stable")
    cells = _Cells(member, member, low, side, count, order)
    key = _key(_cell_of(place, cells), cells)
    sorting = np.argsort(key, kind="stable")
    return cells._replace(member=member[sorting], key=key[sorting])


def _cell_of(place: np.ndarray, cells: _Cells) -> np.ndarray:
    return np.floor((place - cells.low) / cells.side).astype(np.int64)


def _key(cell: np.ndarray, cells: _Cells) -> np.ndarray:
    """Numbers of cells; along every axis there is an empty one at either end."""
    slow, middle, fast = cells.order
    number = cell[:, slow] + 1
    for axis in (middle, fast):
        number = number * (cells.number[axis] + 2) + cell[:, axis] + 1
    return number


def _neighbors(
    looking: np.ndarray, cells: _Cells, center: np.ndarray, half: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give pairs of boxes that look around and those in cells that these overlap, part by part."""
    cell = _cell_of(center[looking], cells)
    # What is beyond the outermost cells by more than one overlaps nothing there.
    inside = ((cell >= -1) & (cell <= cells.number)).all(axis=1)
    looking, cell = looking[inside], cell[inside]
    sorting = np.argsort(_key(cell, cells), kind="stable")
    looking, cell = looking[sorting], cell[sorting]
    slow, middle, fast = cells.order
    most = cells.number - 1
    for aside, beside in itertools.product((-1, 0, 1), repeat=2):
        if (aside and not most[slow]) or (beside and not most[middle]):
            # There is one layer of cells, which those right above and below it look for as well.
            continue
        first = cell.copy()
        first[:, slow] += aside
        first[:, middle] += beside
        for axis in (slow, middle):
            if not most[axis]:
                first[:, axis] = 0
        there = np.flatnonzero(((first >= 0) & (first <= most))[:, [slow, middle]].all(axis=1))
        first, last = first[there], first[there]
        first[:, fast] = np.clip(first[:, fast] - 1, 0, None)
        last = first.copy()
        last[:, fast] = np.minimum(cell[there, fast] + 1, most[fast])
        start = np.searchsorted(cells.key, _key(first, cells), side="left")
        end = np.searchsorted(cells.key, _key(last, cells), side="right")
        for own, number in _ranges(start, end):
            one, other = looking[there[own]], cells.member[number]
            yield _overlapping(one, other, center, half)


def _ranges(start: np.ndarray, end: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give all numbers of some ranges, and which range each is of, part by part."""
    count = np.maximum(end - start, 0)
    before = np.cumsum(count)
    begin = 0
    while begin < len(count):
        done = before[begin - 1] if begin else 0
        stop = max(int(np.searchsorted(before, done + AT_ONCE, side="right")), begin + 1)
        part = count[begin:stop]
        own = np.repeat(np.arange(begin, stop), part)
        skipped = np.repeat(start[begin:stop] - (before[begin:stop] - part - done), part)
        yield own, np.arange(len(own)) + skipped
        begin = stop


def _overlapping(
    one: np.ndarray, other: np.ndarray, center: np.ndarray, half: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return those of some pairs whose boxes overlap."""
    for axis in range(3):
        middle, side = center[:, axis], half[:, axis]
        meets = np.abs(middle[one] - middle[other]) < side[one] + side[other]
        one, other = one[meets], other[meets]
    return one, other
