"""Which outline every body of a huge problem has, how large and how turned: from its number, without a list of all."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..problem.footprints import DrawnFootprints, Footprints
from ..problem.random_numbers import random_shares
from ..problem.size import Size

__all__ = ["outline_areas", "outlines_of_size"]


def outlines_of_size(size: Size, rank: np.ndarray, seed: tuple[int, ...], area: np.ndarray | None) -> DrawnFootprints:
    """Return what bodies of a size have by their ranks among those of their size.

    Where the outlines themselves are the areas and differ, ranks are in the order of the areas, as those of a range are.

    Args:
        size: The size; it has a footprint.
        rank: From 0, shape ``[n]``.
        seed: Of what is drawn.
        area: Areas that outlines are to have [m²], shape ``[n]``; None leaves them as large as they are.
    """
    given = size.footprint
    assert isinstance(given, Footprints)
    by_area = size.area is None and size.is_range
    if by_area and given.body_count is not None:
        return _drawn(given, _in_order(given, size.count or 0, seed)[rank], seed, None, size.kind.has_axis)
    if not by_area:
        return _drawn(given, rank, seed, area, size.kind.has_axis)
    outline_area = np.array([outline.area for outline in given.outlines])
    order = np.argsort(outline_area, kind="stable")
    weight = np.ones(len(order)) if given.weights is None else np.array(given.weights, np.float64)
    order = order[weight[order] > 0.0]
    end = np.cumsum(weight[order]) / weight[order].sum()
    share = (rank + 0.5) / (size.count or 1)
    place = np.minimum(np.searchsorted(end, share, side="right"), len(end) - 1)
    begin = np.concatenate([[0.0], end[:-1]])
    within = np.clip((share - begin[place]) / (end - begin)[place], 0.0, 1.0)
    drawn = _drawn(given, rank, seed, None, size.kind.has_axis)
    scale = (1.0 + given.scale_jitter * (2.0 * within - 1.0)) * (1.0 if given.scale is None else given.scale)
    return DrawnFootprints(order[place].astype(np.int32), scale, drawn.turn)


def outline_areas(size: Size, drawn: DrawnFootprints) -> np.ndarray:
    """Areas of drawn outlines [m²], shape ``[n]``."""
    return np.array([outline.area for outline in size.outlines])[drawn.variant] * drawn.scale**2


def _drawn(
    given: Footprints, number: np.ndarray, seed: tuple[int, ...], area: np.ndarray | None, long: bool
) -> DrawnFootprints:
    """What bodies have by their numbers, each from what is given for it or drawn for it alone; see :meth:`.Footprints.draw`."""
    which, jitter, turned = (random_shares(number, [*seed, k]) for k in range(3))
    many = len(given.outlines)
    if given.variant is not None:
        variant = np.asarray(given.variant)[number]
    elif given.weights is None:
        variant = np.minimum((which * many).astype(np.int32), many - 1)
    else:
        weight = np.array(given.weights, np.float64)
        last = int(np.flatnonzero(weight > 0.0)[-1])
        variant = np.minimum(np.searchsorted(np.cumsum(weight) / weight.sum(), which, side="right"), last)
    scale = 1.0 + given.scale_jitter * (2.0 * jitter - 1.0)
    if given.scale is not None:
        scale = scale * (given.scale[number] if isinstance(given.scale, np.ndarray) else np.float64(given.scale))  # type: ignore[arg-type]
    elif area is not None:
        scale = scale * np.sqrt(area / np.array([outline.area for outline in given.outlines])[variant])
    if isinstance(given.turn, str):
        turn = 2.0 * math.pi * turned
        if long:
            turn = np.where((turned < 0.5) | (given.turn == "free"), 0.0, math.pi)
    elif np.ndim(given.turn):
        turn = np.asarray(given.turn, np.float64)[number]
    else:
        turn = np.full(len(number), float(given.turn))  # type: ignore[arg-type]
    return DrawnFootprints(variant.astype(np.int32), scale, turn)


@lru_cache(maxsize=8)
def _in_order(given: Footprints, count: int, seed: tuple[int, ...]) -> np.ndarray:
    """Numbers of bodies of which some values are listed, smallest areas first."""
    drawn = _drawn(given, np.arange(count), seed, None, False)
    area = np.array([outline.area for outline in given.outlines])[drawn.variant] * drawn.scale**2
    return np.argsort(area, kind="stable")
