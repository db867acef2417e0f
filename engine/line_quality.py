"""How good lines are: crossings, directions and lengths. Measured on the placement alone, independent of the solver."""

from __future__ import annotations

import math

import numpy as np

from .problem import Domain

__all__ = ["angle_errors", "crossing_lines", "crossing_pairs"]

# Candidate pairs that are compared at once; bounds the memory.
PAIRS_AT_ONCE = 2_000_000


def crossing_pairs(position: np.ndarray, angle: np.ndarray, length: np.ndarray, domain: Domain) -> np.ndarray:
    """Return the pairs of lines whose axes cross, shape ``[pairs, 2]``, the smaller index first.

    Args:
        position: Middles of the lines [m], shape ``[n, 2]``.
        angle: Their directions [rad], shape ``[n]``.
        length: Their lengths [m], shape ``[n]``; lines of length 0 cross nothing.
        domain: The domain; in a periodic one lines cross each other's copies too.
    """
    half = 0.5 * length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = [np.empty((0, 2), dtype=np.int64)]
    for first, second in _neighbours(position, float(length.max(initial=0.0)), domain):
        between = position[second] - position[first]
        if domain.periodic:
            between -= np.array(domain.size) * np.round(between / domain.size)
        a, b = half[first], half[second]
        # Each line's ends lie on different sides of the other.
        apart = _cross(a, between)
        turn = _cross(a, b)
        back = _cross(b, -between)
        crosses = ((apart - turn) * (apart + turn) < 0.0) & ((back + turn) * (back - turn) < 0.0)
        found.append(np.stack([first[crosses], second[crosses]], axis=1))
    pairs = np.sort(np.concatenate(found), axis=1)
    return np.unique(pairs, axis=0)


def crossing_lines(position: np.ndarray, angle: np.ndarray, length: np.ndarray, domain: Domain) -> int:
    """Number of lines that cross at least one other; see :func:`crossing_pairs`."""
    return len(np.unique(crossing_pairs(position, angle, length, domain)))


def angle_errors(angle: np.ndarray, desired: np.ndarray) -> np.ndarray:
    """Differences of directions [rad], 0 to pi/2: a line has no front."""
    difference = np.mod(np.asarray(angle) - desired, np.pi)
    return np.minimum(difference, np.pi - difference)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _neighbours(position: np.ndarray, reach: float, domain: Domain):  # type: ignore[no-untyped-def]
    """Yield index arrays of pairs that may be within ``reach`` of each other, each pair at least once."""
    n = len(position)
    if n < 2 or reach <= 0.0:
        return
    side = max(reach, math.sqrt(domain.area / n))
    counts = np.maximum((np.array(domain.size) / side).astype(int), 1)
    cell = np.minimum((position / np.array(domain.size) * counts).astype(int), counts - 1)
    key = cell[:, 1] * counts[0] + cell[:, 0]
    order = np.argsort(key, kind="stable")
    start = np.searchsorted(key[order], np.arange(counts.prod() + 1))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            there = cell + [right, down]
            inside = np.ones(n, dtype=bool)
            if domain.periodic:
                there = np.mod(there, counts)
            else:
                inside = ((there >= 0) & (there < counts)).all(axis=1)
            own = np.flatnonzero(inside)
            other = there[own, 1] * counts[0] + there[own, 0]
            begin, many = start[other], start[other + 1] - start[other]
            chunks = np.array_split(np.arange(len(own)), max(1, math.ceil(many.sum() / PAIRS_AT_ONCE)))
            for chunk in chunks:
                first = np.repeat(own[chunk], many[chunk])
                step = np.arange(len(first)) - np.repeat(np.cumsum(many[chunk]) - many[chunk], many[chunk])
                second = order[np.repeat(begin[chunk], many[chunk]) + step]
                once = first < second
                yield first[once], second[once]
