"""Bodies that change places while outlines are parted: who may trade them, which couples may at once, and which places are taken."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.body_flags import BodyFlags
from ..model.model import Model
from . import kernels_trials
from .footprint_tables import FootprintTables, numbered

__all__ = ["Traders", "alone", "best_of_lanes", "compatible", "find_traders", "trials_for"]

# Bodies trade places whose areas differ by up to this factor.
ALIKE = 1.15


class Traders(NamedTuple):
    """Bodies that may trade places. They are numbered as they lie in space.

    Attributes:
        bins: For kernels: who may trade with whom.
        may_trade: Which bodies may, shape ``[n]``.
        reach: How far two of them reach together at most, in units.
    """

    bins: kernels_trials.Bins
    may_trade: np.ndarray
    reach: float


def find_traders(model: Model, launcher: Launcher, tables: FootprintTables, order: np.ndarray) -> Traders:
    """Find bodies that may trade places: of one class and size, of like areas, and not all the same disc.

    Args:
        model: What was placed.
        launcher: Where to run.
        tables: The bodies' outlines; what stands behind these among the bodies trades with nobody.
        order: In which order bodies lie in space: their numbers in the model, shape ``[n]``.
    """
    body, area, is_round = model.body, tables.area[: len(order)], tables.is_round[: len(order)]
    may = ((body.flags & BodyFlags.PINNED) == 0) & (body.kind < 0)
    if not (may & ~is_round).any():
        bin_of, members, start = np.zeros(len(may), np.int64), np.zeros(0, np.int64), np.zeros(2, np.int64)
        may_trade = np.zeros(len(may), bool)
    else:
        step = np.floor(np.log(area) / math.log(ALIKE)).astype(np.int64)
        bin_of = numbered(np.where(may, body.class_index, -1), body.size_index, body.support, step)[order]
        count = int(bin_of.max()) + 1
        useful = np.zeros(count, bool)
        useful[bin_of[(may & ~is_round)[order]]] = True
        may_trade = may[order] & useful[bin_of]
        members = np.flatnonzero(may_trade)
        # Few bins are sorted by radix.
        narrow = bin_of.astype(np.uint16 if count < 1 << 16 else np.int64)
        members = members[np.argsort(narrow[members], kind="stable")]
        start = np.concatenate([[0], np.cumsum(np.bincount(bin_of[members], minlength=count))])
    bins = kernels_trials.Bins()
    bins.bin = wp.array(bin_of.astype(np.int32), dtype=wp.int32, device=launcher.device)
    bins.start = wp.array(start.astype(np.int32), dtype=wp.int32, device=launcher.device)
    bins.member = wp.array(
        (members if len(members) else np.zeros(1)).astype(np.int32), dtype=wp.int32, device=launcher.device
    )
    return Traders(bins, may_trade, 2.0 * float(tables.reach[order][members].max(initial=0.0)) / model.unit)


def compatible(cell: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Which couples do not disturb each other: the best ones first, none of whose cells another one's body leaves or enters.

    Args:
        cell: In which cell every body lies, shape ``[n]``.
        one: One body of every couple, the best couple first, shape ``[k]``.
        other: The other one, shape ``[k]``.

    Returns:
        Whether they may trade at once with all others that may, shape ``[k]``.
    """
    first, second = cell[one], cell[other]
    rank = np.arange(len(one))
    claims = np.full(int(cell.max()) + 1, len(one))
    np.minimum.at(claims, first, rank)
    np.minimum.at(claims, second, rank)
    return (claims[first] == rank) & (claims[second] == rank)


def trials_for(launcher: Launcher, stuck: np.ndarray, lanes: int, candidates: int, seed: int) -> kernels_trials.Trials:
    """Return what kernels take that try other places for stuck bodies: see :class:`.kernels_trials.Trials`."""
    trials = kernels_trials.Trials()
    trials.stuck = wp.array(stuck.astype(np.int32), dtype=wp.int32, device=launcher.device)
    trials.lanes, trials.candidates, trials.seed = lanes, candidates, seed
    return trials


def best_of_lanes(cost: np.ndarray, distance: np.ndarray, lanes: int) -> np.ndarray:
    """Return which lane's place is the best of every body: of those without overlap the nearest, or else that of least overlap.

    Args:
        cost: Squared overlaps at the best place of every lane, those of a body side by side.
        distance: How far these places are.
        lanes: How many lanes there are for each body.
    """
    cost, distance = cost.reshape(-1, lanes), distance.reshape(-1, lanes)
    is_free = cost < kernels_trials.TOLERABLE**2
    order = np.where(is_free, distance, np.inf)
    lane = np.where(is_free.any(axis=1), order.argmin(axis=1), cost.argmin(axis=1))
    return lanes * np.arange(len(lane)) + lane


def alone(place: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Which of some places to take, the first ones first, so that no two bodies of these reaches meet there; ascending.

    Args:
        place: The places, shape ``[k, 2]`` or ``[k, 3]``.
        reach: How far a body reaches that would be there, in the same unit, shape ``[k]``.
    """
    taken = np.zeros(len(place), bool)
    for k in range(len(place)):
        apart = np.linalg.norm(place[:k] - place[k], axis=1) >= reach[:k] + reach[k]
        taken[k] = (apart | ~taken[:k]).all()
    return np.flatnonzero(taken)
