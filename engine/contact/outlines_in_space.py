"""Outlines of bodies in any space: which pairs are near each other, and one round of pushing them apart.

Pairs are listed with a skin: a pair that is not listed cannot touch until one of the two has moved beyond its skin. When too many
bodies have, pairs are listed anew. What depends on where bodies are is left to derived classes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher, Recording
from ..model.body_flags import BodyFlags
from ..model.model import Model
from ..problem.packing import is_long
from ..space.cell_sort import CellSort
from . import kernels_pairs
from .crowd_outlines import crowd_outlines
from .footprint_tables import FootprintTables
from .guidance import Guidance

__all__ = ["SKIN", "TOLERANCE", "OutlinesInSpace", "ProposedPlaces"]

# Depth of an overlap that counts, in widths of the narrower outline.
TOLERANCE = 1e-3
# Pairs are listed up to this distance, in roots of the bodies' areas.
SKIN = 0.08
# Share of the bodies that may be beyond their skins before pairs are listed anew.
STRAY_SHARE = 2e-3
# Most pairs of a body: footprints many times larger than the space would have n² pairs.
MOST_PAIRS_PER_BODY = 200
LEAST_PAIRS_PER_BODY = 32
MOST_PAIRS = 20_000_000
# Arrays have room for this many times as many pairs as there are, so that they are not made anew for a few more.
SPARE = 1.2


class ProposedPlaces(NamedTuple):
    """Other places for some bodies.

    Attributes:
        place: Where they are, in units, shape ``[k, 2]`` or ``[k, 3]``.
        left: Squared overlaps there, shape ``[k]``.
        land: Moves some of the bodies to their places; it gets their indices among these k.
    """

    place: np.ndarray
    left: np.ndarray
    land: Callable[[np.ndarray], None]


class OutlinesInSpace(ABC):
    """Outlines of a model's bodies, and of what stands among these and does not move.

    Abstract methods are what a space knows. In these, bodies are numbered as they lie in it.

    Args:
        model: What was placed.
        launcher: Where to run.
        tables: The bodies' outlines, and behind them those of what stands among them.
        order: In which order bodies lie in space: their numbers in the model, shape ``[n]``. What stands among them follows.
        length: Lengths of the axes of lines [m], shape ``[n]``.
        offset: How outlines are turned from these axes [rad], shape ``[n]``.
    """

    # Whether every body needs room for the corners of others as it sees them, and not only for its own in trials of other turns.
    SEES_COPIES: ClassVar[bool] = False

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        tables: FootprintTables,
        order: np.ndarray,
        length: np.ndarray,
        offset: np.ndarray,
    ) -> None:
        self.launcher = launcher
        self._model = model
        standing = len(tables.shape) - len(order)
        self._count = n = len(tables.shape)
        self._order = order

        def behind(values: np.ndarray, value: float) -> np.ndarray:
            """Values of the bodies, and behind them that of all that stands among them."""
            return np.concatenate([values, np.full(standing, value, values.dtype)]) if standing else values

        self._is_line = model.body.kind >= 0
        unit = model.unit
        free = behind(model.footprints.free | self._is_line, False)
        pinned = behind((model.body.flags & BodyFlags.PINNED) != 0, True)
        self._pinned = bool(pinned.any())
        mass = tables.area / tables.area.mean()
        is_round = tables.is_round
        lightness = np.where(pinned, 0.0, 1.0 / mass)
        ease = np.where(
            pinned | ~free | is_round, 0.0, tables.area * unit**2 / (mass * np.maximum(tables.inertia, 1e-300))
        )
        everything = np.concatenate([order, np.arange(len(order), n)])
        self._outlines, self._corner_count, self._trial_corners, self._rooms = crowd_outlines(
            launcher,
            tables,
            everything,
            unit,
            sees_copies=self.SEES_COPIES,
            skin=behind(SKIN * np.sqrt(tables.area[: len(order)]) / unit, 0.0),
            lightness=lightness,
            ease=ease,
            length=behind(length / unit, 0.0),
            offset=behind(offset, 0.0),
        )
        self._free = bool((free & ~is_round & ~pinned & ~behind(self._is_line, False)).any())
        self._fixed = bool((~free & ~is_round & ~pinned).any())
        kept = np.array([is_long(shape) for shape in model.footprints.shapes] + [False])[model.footprints.shape]
        kept = behind(kept, False) & ((lightness == 0.0) | (ease == 0.0))
        self._rows = self._fixed and np.count_nonzero(kept) > 1
        self._kept = launcher.array(kept[everything].astype(np.int32), wp.int32)
        self._in_row = launcher.zeros(n, wp.int32)
        self._settings = wp.zeros(6, dtype=float, device=launcher.device)
        self._deep, self._touching = launcher.zeros(n, wp.int32), launcher.zeros(n, wp.int32)
        self._cost = launcher.zeros(n, float)
        pairs = kernels_pairs.Pairs()
        pairs.start = launcher.zeros(n + 1, wp.int32)
        pairs.count = launcher.zeros(n, wp.int32)
        self._pairs = pairs
        self._moves: Any = None
        self._one_round: tuple[Recording, Recording] | None = None
        self._slots = 0

    @abstractmethod
    def _places(self) -> Sequence[wp.array]:
        """Return the arrays that hold positions and turns."""

    @abstractmethod
    def _begin_list(self) -> None:
        """Note where bodies are, from where their moves count from now on, and sort them into cells."""

    @abstractmethod
    def _sort(self) -> None:
        """Sort bodies into cells where they are now."""

    @abstractmethod
    def _list_pairs(self, most: int, *, fill: bool) -> None:
        """Count the pairs of every body, up to ``most``; or, with ``fill``, write them."""

    @abstractmethod
    def _turn_corners(self) -> None:
        """Turn corners as their bodies are turned."""

    @abstractmethod
    def _launch_find(self) -> None:
        """Launch the kernels that find the correction that every pair's contact asks for."""

    @abstractmethod
    def _launch_move(self) -> None:
        """Launch the kernels that move every body by the corrections of its contacts."""

    @abstractmethod
    def _measure(self) -> None:
        """Measure the overlaps of every body."""

    @abstractmethod
    def _go_home(self) -> None:
        """Put bodies, and the places that they are pulled to, back to where they were at first."""

    @abstractmethod
    def _cells(self, size: float) -> np.ndarray:
        """Numbers of the cells of at least this size, in units, that bodies lie in, shape ``[n]``."""

    @abstractmethod
    def _trade(self, one: np.ndarray, other: np.ndarray) -> None:
        """Exchange the places of bodies, and the places that they are pulled to."""

    @abstractmethod
    def _propose_swaps(self, stuck: wp.array, inputs: Sequence[Any], outputs: Sequence[wp.array]) -> None:
        """Find the best partner for every stuck body to trade places with; see :func:`.kernels_trials.propose_swaps`."""

    @abstractmethod
    def _find_costs(self, cost: wp.array) -> None:
        """Sum up the squared overlaps of every body."""

    @abstractmethod
    def _propose_turns(
        self, trials: int, keep: float, seed: int, cost: wp.array, angle: wp.array, gain: wp.array
    ) -> None:
        """Find the best turn of every body; see :func:`.kernels_trials.propose_turns`."""

    @abstractmethod
    def _accept_turns(self, angle: wp.array, gain: wp.array, turned: wp.array) -> None:
        """Turn the bodies that gain the most; see :func:`.kernels_trials.accept_turns`."""

    @abstractmethod
    def _write_back(self) -> None:
        """Write positions and turns into the state."""

    def _lead(self, guidance: Guidance) -> None:
        """Set the places that bodies are pulled to by guidance, which there is in the plane only: nobody asks on a surface."""
        raise NotImplementedError

    def _find_rows(self) -> None:  # noqa: B027
        """Find out which of the bodies that are ``_kept`` lie in rows of parallel ones. Spaces may leave this out."""

    @abstractmethod
    def _propose_places(self, stuck: np.ndarray, candidates: int, seed: int) -> ProposedPlaces:
        """Try so many other places for every stuck body, and return the one with the least overlap."""

    def _come_in(self) -> None:  # noqa: B027
        """Move bodies out of obstacles: none finds the way out of a gap between two by itself."""

    def _make_room(self, slots: int) -> None:  # noqa: B027
        """Make arrays for what else a space keeps of so many pairs."""

    def _forget(self) -> None:
        """Release the recorded launches, if there are any."""
        for recording in self._one_round or ():
            self.launcher.release(recording)
        self._one_round = None

    def _recall(self, places: Sequence[wp.array]) -> None:
        """Put bodies back to noted places; they stay if none are given."""
        for array, values in zip(self._places() if places else (), places, strict=True):
            array.assign(values)

    def _rebuild(self) -> None:
        """List the pairs that are near."""
        launcher, n, pairs = self.launcher, self._count, self._pairs
        self._begin_list()
        most = max(LEAST_PAIRS_PER_BODY, min(MOST_PAIRS_PER_BODY, MOST_PAIRS // n))
        self._list_pairs(most, fill=False)
        start = np.zeros(n + 1, np.int64)
        np.cumsum(pairs.count.numpy(), out=start[1:])
        slots = max(int(start[-1]), 1)
        if slots > self._slots:
            self._slots = min(int(SPARE * slots) + 64, 2**31 - 1)
            pairs.second, pairs.note = (launcher.empty(self._slots, wp.int32) for _ in range(2))
            pairs.push = launcher.empty(self._slots, wp.vec4)
            pairs.depth = launcher.empty(self._slots, float)
            self._seconds = CellSort(launcher, self._slots, n + 1)
            pairs.second_start, pairs.second_slot = self._seconds.cell_start, self._seconds.order
            self._make_room(self._slots)
            self._forget()
        pairs.start.assign(start.astype(np.int32))
        self._list_pairs(most, fill=True)
        self._seconds.sort(kernels_pairs.second_keys, [pairs.start, pairs, n])
        if self._rows:
            self._find_rows()
        if self._one_round is None:
            self._one_round = launcher.record(self._launch_find), launcher.record(self._launch_move)

    def _find(self) -> None:
        """Find the corrections of all contacts; pairs are listed anew first if that is due."""
        if self._strayed > STRAY_SHARE * len(self._order):
            self._rebuild()
        assert self._one_round is not None
        self._one_round[0].play()

    @property
    def _strayed(self) -> int:
        """Number of bodies that are farther than their skins from where they were when pairs were listed."""
        return int(self._moves.moved_far.numpy().sum())

    def _move(self) -> None:
        assert self._one_round is not None
        self._one_round[1].play()

    def _left(self) -> tuple[int, int, float]:
        """Return the number of overlaps that count, that of all overlaps, and the sum of their squares; every pair counts twice."""
        self._measure()
        deep, touching = (int(array.numpy().sum(dtype=np.int64)) for array in (self._deep, self._touching))
        return deep, touching, float(self._cost.numpy().sum(dtype=np.float64))
