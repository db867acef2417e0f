"""How good lines are: crossings and directions. Measured on the placement alone, independent of the solver."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..problem.domain import Domain

__all__ = ["angle_errors", "crossing_lines", "crossing_pairs"]

# Candidate pairs that are compared at once; bounds the memory.
PAIRS_AT_ONCE = 2_000_000
# Pieces of lines reach this share of a cell beyond themselves: rounding must not put a crossing on a cell's border into neither.
ROUNDING = 1e-6


def crossing_pairs(position: np.ndarray, angle: np.ndarray, length: np.ndarray, domain: Domain) -> np.ndarray:
    """Return the pairs of lines whose axes cross, shape ``[pairs, 2]``, the smaller index first.

    Args:
        position: Middles of the lines [m], shape ``[n, 2]``.
        angle: Their directions [rad], shape ``[n]``.
        length: Their lengths [m], shape ``[n]``; lines of length 0 cross nothing.
        domain: The domain; in a periodic one lines cross each other's copies too, however long they are.

    Limitations:
        Lines that only touch, and lines that lie on each other, do not cross. Bent lines count as straight ones.
    """
    position, angle, length = (np.asarray(values, dtype=np.float64) for values in (position, angle, length))
    half = 0.5 * length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = [np.empty((0, 2), dtype=np.int64)]
    for first, second, shift in _candidates(position, half, domain):
        between = position[second] - position[first] + shift
        a, b = half[first], half[second]
        # Each line's ends lie on different sides of the other.
        apart = _cross(a, between)
        turn = _cross(a, b)
        back = _cross(b, -between)
        crosses = ((apart - turn) * (apart + turn) < 0.0) & ((back + turn) * (back - turn) < 0.0)
        found.append(np.stack([first[crosses], second[crosses]], axis=1))
    # Lines that share several cells, or cross several copies of each other, are one pair.
    return np.unique(np.concatenate(found), axis=0)


def crossing_lines(position: np.ndarray, angle: np.ndarray, length: np.ndarray, domain: Domain) -> int:
    """Number of lines that cross at least one other; arguments as for :func:`crossing_pairs`."""
    return len(np.unique(crossing_pairs(position, angle, length, domain)))


def angle_errors(angle: np.ndarray, preferred: np.ndarray) -> np.ndarray:
    """Differences of directions [rad], shape ``[n]``, 0 to pi/2: a line has no front."""
    difference = np.mod(np.asarray(angle) - preferred, np.pi)
    return np.minimum(difference, np.pi - difference)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _candidates(
    position: np.ndarray, half: np.ndarray, domain: Domain
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield all pairs of lines that run through the same cell of a grid, some of them repeatedly.

    Lines are cut into pieces no longer than a cell, so that a few long ones do not make the cells of all others large.

    Yields:
        Smaller and larger index, and what is added to the position of the second [m], shape ``[pairs, 2]``.
    """
    line_length = 2.0 * np.hypot(half[:, 0], half[:, 1])
    lines = np.flatnonzero(line_length > 0.0)
    if len(lines) < 2:
        return
    size = np.array(domain.size)
    # Cells smaller than the mean distance of lines would only be more of them for the same pairs.
    side = max(float(np.median(line_length[lines])), math.sqrt(domain.area / len(lines)))
    counts = np.maximum((size / side).astype(np.int64), 1)
    cell_size = size / counts if domain.periodic else np.array([side, side])
    line, cell = _cells(position[lines], half[lines], cell_size)
    line = lines[line]
    turns = cell // counts if domain.periodic else np.zeros_like(cell)
    cell = cell - turns * counts
    cell -= cell.min(axis=0)
    key = cell[:, 1] * (cell[:, 0].max() + 1) + cell[:, 0]
    order = np.argsort(key, kind="stable")
    line, turns, key = line[order], turns[order], key[order]
    # Every entry meets those behind it in its cell.
    many = np.searchsorted(key, key, side="right") - np.arange(len(key)) - 1
    behind = np.cumsum(many)
    begin = 0
    while begin < len(many):
        done = behind[begin - 1] if begin else 0
        end = max(int(np.searchsorted(behind, done + PAIRS_AT_ONCE, side="right")), begin + 1)
        own = np.repeat(np.arange(begin, end), many[begin:end])
        other = own + 1 + np.arange(len(own)) - np.repeat(behind[begin:end] - many[begin:end] - done, many[begin:end])
        # Always seen from the same line of the two, so that rounding is the same in every cell.
        swapped = line[own] > line[other]
        own, other = np.where(swapped, other, own), np.where(swapped, own, other)
        differ = line[own] != line[other]
        own, other = own[differ], other[differ]
        # A line that has left the domain n times is met there by the other's copy n domains further.
        yield line[own], line[other], (turns[own] - turns[other]) * size
        begin = end


def _cells(position: np.ndarray, half: np.ndarray, cell_size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of lines, shape ``[entries]``, and columns and rows of cells that they run through, shape ``[entries, 2]``."""
    pieces = np.ceil(2.0 * np.hypot(half[:, 0], half[:, 1]) / (0.9 * cell_size.min())).astype(np.int64)
    line = np.repeat(np.arange(len(pieces)), pieces)
    piece = np.arange(len(line)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    # Both ends of every piece, along its line from -1 to 1.
    along = [2.0 * (piece + end) / pieces[line] - 1.0 for end in (0, 1)]
    ends = [(position[line] + where[:, None] * half[line]) / cell_size for where in along]
    low = np.floor(np.minimum(*ends) - ROUNDING).astype(np.int64)
    high = np.floor(np.maximum(*ends) + ROUNDING).astype(np.int64)
    # A piece is shorter than a cell, so its cells are these and at most the next ones.
    entries = []
    for right in (0, 1):
        for up in (0, 1):
            there = (high - low >= [right, up]).all(axis=1)
            entries.append(np.column_stack([line, low + [right, up]])[there])
    # Pieces of one line that share a cell stand there once.
    entry = np.unique(np.concatenate(entries), axis=0)
    return entry[:, 0], entry[:, 1:]
