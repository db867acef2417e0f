"""Separation: the end of a run in which convex outlines that overlap are parted, in any space.

Pairs that are near are listed, with a skin, and listed anew when a body has moved beyond its skin. In every round all contacts are
resolved at once, each by half as many as there are, with momentum that grows, while a pull that fades keeps bodies near where the
descent put them. What stays stuck trades places with others of its kind; where that does not help either, there is another try from
the start, with more momentum and no pull. What depends on where bodies are is left to those who know: in a rectangle
:mod:`.plane_separation`, on a surface :mod:`.surface_separation`.
"""

from __future__ import annotations

import math
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
from . import kernels_pairs, kernels_trials
from .changes_of_place import alone, compatible, find_traders
from .crowd_outlines import crowd_outlines
from .crowding import ROUNDS_OF_THE_JAMMED, ROUNDS_OF_THE_TOO_CROWDED, Crowding
from .footprint_tables import FootprintTables
from .guidance import Guidance

__all__ = ["ProposedPlaces", "Separation"]

# Depth of an overlap that counts, and how far apart outlines are put, in widths of the narrower one.
TOLERANCE = 1e-3
SLACK = 2e-3
# A pair is listed from this distance on, in roots of the bodies' areas.
SKIN = 0.08
# Share of the bodies that may be beyond their skins before pairs are listed anew.
STRAY_SHARE = 2e-3
# How much the shorter way out counts for more in rows of parallel bodies that keep their turns, while they are guided and later.
# Measured on 38 scenes of parallel planks: 3 or 4 from the first leave one jammed, 2 none; but what meets others of nearly its
# direction does not come to rest with 2.
SHARPNESS, SHARPNESS_OF_GUIDANCE = 4.0, 2.0
# Values without a derivation are choices; what others of them do is measured by benchmarks/constants.py, here on the scenes of
# benchmarks/contact.py that are covered to 80 % and more (--scenes 8 --bodies 150), eight runs of each value.
# Momentum at first, how much nearer to 1 it comes after so many rounds, and how far; and that of a second try. Measured: none overlap
# whatever they are, but with 0 or 0.6 at first coverage errors are 6 and 3 % larger, and 3 % where it never comes above 0.9.
FIRST_MOMENTUM = 0.9
RISE = 0.7
ROUNDS_PER_RISE = 60
LARGEST_MOMENTUM = 0.985
# Measured on 300 planks at random turns that cover 60 % of a periodic domain: 3 of 12 runs stay jammed with 0.98, none with 0.99. On
# planks, boxes and discs that may turn and cover 80 % of one, 1 of 12 runs stays jammed without that try, none with it.
HOT_MOMENTUM = 0.99
# Share of what contacts ask for that is made in a round. Measured: with 0.6 coverage errors are 2 % larger, with 1.2 6 % smaller; none
# overlap with either.
DAMPING = 0.9
# Momentum of bodies that nothing touches.
COASTING = 0.5
# Share of the way back to its start that a body is pulled in a round, and rounds until the pull has faded: of loose bodies and of
# discs, and of others where they are crowded.
PULL = 0.01
ROUNDS_OF_PULL = (100, 300)
# Where they are guided: the pull at first, rounds until it has faded, of many bodies as many as this has of all bodies, and rounds
# between two looks at where they are to go.
PULL_OF_GUIDANCE = 0.02
ROUNDS_OF_GUIDANCE = 800
# The same where the domain has no edges. Measured on planks, boxes and discs that cover 80 % of a periodic domain, six seeds: coverage
# errors grow by .022 to .031 in 800 rounds, by .019 to .026 in these, in 1.3 times the time.
ROUNDS_OF_GUIDANCE_WITHOUT_EDGES = 1600
FEWEST_ROUNDS_OF_GUIDANCE = 100
BODIES_TO_GUIDE = 10_000_000
ROUNDS_PER_GUIDANCE = 10
# Rounds between two looks at what is left, and without progress before it is given up; progress is to have at most this share of the
# squared overlaps left.
ROUNDS_AT_ONCE = 5
ROUNDS_WITHOUT_PROGRESS = 500
PROGRESS = 0.97
# Rounds after the last overlap that counts until those below the tolerance may stay.
LAST_ROUNDS = 100
# Trading places: passes before the first round, rounds between two later passes and how many there are; candidates for each body,
# places that are tried in a pass at most, and the share of bodies, the most stuck ones, that later passes look at.
FIRST_SWAPS = 30
ROUNDS_PER_SWAP = 50
MOST_SWAPS = 20
HOT_SWAPS = 60
CANDIDATES = 60
PLACES_TO_TRY = 300_000
STUCK_SHARE = 0.2
FIRST_KEEP = 1.0
# Bodies that stand wedged between pinned ones, or too many in one gap between obstacles, jump to another place: rounds without
# guidance before the first pass, and passes.
ROUNDS_BEFORE_JUMPS = 150
MOST_JUMPS = 10
# Places that a body tries at most which is wedged between pinned ones, or caught in a gap between obstacles with others that overlap
# it. Measured on 120 planks among 146 others, which leave few: 1,000 do not find them.
PLACES_OF_JUMP = 20_000
# Of many bodies each tries fewer, so that all of them try as many as this, but no fewer than these.
PLACES_IN_ALL = 400_000
FEWEST_PLACES = 200
# Squared overlaps that a place may leave of those that a body had. Measured on 500 pebbles among trees and logs: where a place had to
# be free of all, 7 pairs were left.
KEEP_PLACES = 0.5
# And that it may leave where the last pass helped nobody: those that are pressed there give way. Measured on quads between triangles
# at 42 %: one is caught at the border, and of 200,000 places none is free, but many press by a fifth of a width.
PRESSED_PLACES = 0.1
# Where a pass leaves more than this share of those who are caught, and they are more than this share of all bodies, there is no room
# for them: no other follows.
STILL_CAUGHT, MANY_CAUGHT = 0.8, 0.2
# On a GPU so many threads try the places of a body at most.
MOST_LANES = 256
# Of those who are caught so many look for a place at once.
MOST_AT_ONCE = 2000
# Turning before the first round: passes, turns that each body tries in one, passes times bodies at most, and what may be left of a
# body's squared overlaps.
FIRST_TURNS = 30
TRIALS = 24
TURNS_TO_TRY = 300_000
KEEP_TURNS = 0.9
KEEP = 0.8
# Of many bodies fewer passes, as many as this has of all bodies.
FEWEST_SWAPS = 6
BODIES_TO_SWAP = 600_000
# Passes end when a smaller share of the bodies trades places.
LEAST_SWAPS = 1e-3
# Cover from which on bodies count as crowded.
CROWDED = 0.66
# Pairs of a body at most: footprints many times larger than the space would have n² of them.
MOST_PAIRS_PER_BODY = 200
LEAST_PAIRS_PER_BODY = 32
MOST_PAIRS = 20_000_000
# Room for more pairs than there are, so that arrays are not made anew whenever there are a few more.
SPARE = 1.2


class ProposedPlaces(NamedTuple):
    """Other places for some bodies.

    Attributes:
        place: Where they are, in units, shape ``[k, 2]`` or ``[k, 3]``.
        left: Squared overlaps there, shape ``[k]``.
        land: Puts those of these bodies there whose numbers among them it gets.
    """

    place: np.ndarray
    left: np.ndarray
    land: Callable[[np.ndarray], None]


class Separation(ABC):
    """Parts the outlines of a model's bodies.

    Args:
        model: What was placed.
        launcher: Where to run.
        tables: The bodies' outlines, and behind them those of what stands among them and does not move.
        order: In which order bodies lie in space: their numbers in the model, shape ``[n]``. What stands among them follows.
        length: Lengths of the axes of lines [m], shape ``[n]``.
        offset: How outlines are turned from these axes [rad], shape ``[n]``.
    """

    # Whether every body needs room for corners of the others that it sees, and not only those for trials of how they may be turned.
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
        # Bodies that were caught in gaps at the last pass; 0 where no other follows.
        self._caught = 0.0
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
        covered = float(tables.area[: len(order)].sum() / model.problem.domain.area)
        self.crowding = Crowding(model.problem, len(order), covered)
        self._free = bool((free & ~is_round & ~pinned & ~behind(self._is_line, False)).any())
        self._fixed = bool((~free & ~is_round & ~pinned).any())
        kept = np.array([is_long(shape) for shape in model.footprints.shapes] + [False])[model.footprints.shape]
        kept = behind(kept, False) & ((lightness == 0.0) | (ease == 0.0))
        self._rows = self._fixed and np.count_nonzero(kept) > 1
        self._kept = launcher.array(kept[everything].astype(np.int32), wp.int32)
        self._in_row = launcher.zeros(n, wp.int32)
        self._traders = find_traders(model, launcher, tables, order)
        self._settings = wp.zeros(6, dtype=float, device=launcher.device)
        self._deep, self._touching = launcher.zeros(n, wp.int32), launcher.zeros(n, wp.int32)
        self._cost = launcher.zeros(n, float)
        pairs = kernels_pairs.Pairs()
        pairs.start = launcher.zeros(n + 1, wp.int32)
        pairs.count = launcher.zeros(n, wp.int32)
        self._pairs = pairs
        self._moves: Any = None
        self._swaps_left = self._jumps_left = 0
        # Places of the bodies once they have traded them before the first round; nothing before that.
        self._begun: list[wp.array] = []
        self._one_round: tuple[Recording, Recording] | None = None
        self._slots = 0

    # What a space knows. Bodies are numbered as they lie in it.

    @abstractmethod
    def _places(self) -> Sequence[wp.array]:
        """The arrays that say where bodies are and how they are turned."""

    @abstractmethod
    def _begin_list(self) -> None:
        """Note where bodies are when pairs are listed, that none has moved far, and sort them into cells."""

    @abstractmethod
    def _sort(self) -> None:
        """Sort bodies into cells where they are now."""

    @abstractmethod
    def _list_pairs(self, most: int, *, fill: bool) -> None:
        """Count the pairs of every body, ``most`` at most, or note them."""

    @abstractmethod
    def _turn_corners(self) -> None:
        """Turn corners as their bodies are turned."""

    @abstractmethod
    def _launch_find(self) -> None:
        """Launch what finds out what every pair's contact asks for."""

    @abstractmethod
    def _launch_move(self) -> None:
        """Launch what moves every body as its contacts ask for."""

    @abstractmethod
    def _measure(self) -> None:
        """Measure the overlaps of every body."""

    @abstractmethod
    def _go_home(self) -> None:
        """Put bodies back to where they were at first, and let them be drawn there again."""

    @abstractmethod
    def _cells(self, size: float) -> np.ndarray:
        """Numbers of the cells of at least this size, in units, that bodies lie in, shape ``[n]``."""

    @abstractmethod
    def _trade(self, one: np.ndarray, other: np.ndarray) -> None:
        """Let bodies have each other's places, and be drawn there."""

    @abstractmethod
    def _propose_swaps(self, stuck: wp.array, inputs: Sequence[Any], outputs: Sequence[wp.array]) -> None:
        """Find whom stuck bodies had best trade places with; see :func:`.kernels_trials.propose_swaps`."""

    @abstractmethod
    def _find_costs(self, cost: wp.array) -> None:
        """Sum up the squared overlaps of every body."""

    @abstractmethod
    def _propose_turns(
        self, trials: int, keep: float, seed: int, cost: wp.array, angle: wp.array, gain: wp.array
    ) -> None:
        """Find how bodies had best be turned; see :func:`.kernels_trials.propose_turns`."""

    @abstractmethod
    def _accept_turns(self, angle: wp.array, gain: wp.array, turned: wp.array) -> None:
        """Turn those that gain the most; see :func:`.kernels_trials.accept_turns`."""

    @abstractmethod
    def _write_back(self) -> None:
        """Put bodies into the state as they are now."""

    def _lead(self, guidance: Guidance) -> None:
        """Say where bodies are to go."""
        raise NotImplementedError

    def _find_rows(self) -> None:  # noqa: B027
        """Find out which of the bodies that are ``_kept`` lie in rows, where something is made of that."""

    @abstractmethod
    def _propose_places(self, stuck: np.ndarray, candidates: int, seed: int) -> ProposedPlaces:
        """Find for bodies that do not get out where they stand another place, of so many, in which they overlap the least."""

    def _lanes(self, stuck: int) -> int:
        """How many threads share the places that a stuck body tries: on a GPU one would take seconds for thousands."""
        return max(1, min(MOST_LANES, self._rooms // stuck)) if self.launcher.device.is_cuda else 1

    def _leave_wedges(self, number: int) -> int:
        """Have bodies that overlap pinned ones, which do not give way, or have no way out of a gap, jump; returns how many do.

        Args:
            number: Of the pass.
        """
        cost = self.launcher.zeros(self._count, float)
        self._sort()
        self._find_costs(cost)
        movable, before = self._outlines.lightness.numpy() > 0.0, cost.numpy()
        wedged = before >= kernels_trials.PINNED_COST
        caught = movable & (before > TOLERANCE**2)
        count = int(caught.sum())
        keep = PRESSED_PLACES if count >= self._caught else TOLERANCE**2
        if not self._caught or count > max(STILL_CAUGHT * self._caught, MANY_CAUGHT * len(self._order)):
            count, caught = 0, np.zeros_like(caught)
        self._caught = count
        some = np.flatnonzero(caught & ~wedged)
        stuck = np.concatenate([np.flatnonzero(movable & wedged), some[:: -(-max(len(some), 1) // MOST_AT_ONCE)]])
        if not len(stuck):
            return 0
        # Who is caught among bodies that give way goes where it is better by far.
        enough = np.maximum(keep, KEEP_PLACES * before[stuck])
        return self._jump(stuck, number, np.where(wedged[stuck], kernels_trials.PINNED_COST, enough))

    def _jump(self, stuck: np.ndarray, number: int, enough: float | np.ndarray) -> int:
        """Have bodies jump to other places around them, where these leave fewer squared overlaps than ``enough``; returns how many do.

        Args:
            stuck: Their numbers.
            number: Of the pass.
            enough: One for all, or one for each.
        """
        seed = (self._model.problem.seed * 7919 + (1 << 21) + number) % (1 << 31)
        candidates = min(PLACES_OF_JUMP, max(FEWEST_PLACES, PLACES_IN_ALL // len(stuck)))
        found = self._propose_places(stuck, candidates, seed)
        landing = np.flatnonzero(found.left < enough)
        landing = landing[alone(found.place[landing], self._outlines.reach.numpy()[stuck[landing]])]
        found.land(landing)
        self._rebuild()
        return len(landing)

    def _come_in(self) -> None:  # noqa: B027
        """Put bodies that lie partly in obstacles where they may be: out of a gap between two none finds the way by itself."""

    def _make_room(self, slots: int) -> None:  # noqa: B027
        """Make room for what else is known of so many pairs; nothing, as a rule."""

    def run(
        self, go_on: Callable[[], bool] | None = None, *, again: bool = False, guidance: Guidance | None = None
    ) -> bool:
        """Part the outlines; returns whether none overlap by more than the tolerance.

        Args:
            go_on: Called now and then; returning False ends it.
            again: Whether bodies have been parted before, and stand and lie nearly as well as they can.
            guidance: What says where bodies are pulled; None for back to where they come from.
        """
        self._again, self._guidance, self._jammed = again, guidance, False
        self._come_in()
        parted = self._try(go_on, hot=False)
        if (
            parted is False
            and self._swappable
            and not (self.crowding.is_too_crowded or self.crowding.is_hopeless or self._jammed)
        ):
            self._go_home()
            self._recall(self._begun)
            self._come_in()
            parted = self._try(go_on, hot=True)
        self._write_back()
        self._forget()
        return bool(parted)

    def _forget(self) -> None:
        """Let go of what was recorded, where there is something."""
        for recording in self._one_round or ():
            self.launcher.release(recording)
        self._one_round = None

    @property
    def _swappable(self) -> bool:
        # Who was parted before keeps its place.
        return not self._again and bool(self._traders.may_trade.any())

    def _try(self, go_on: Callable[[], bool] | None, hot: bool) -> bool | None:
        """One try; None where it was stopped."""
        self._moves.last.zero_()
        self._rebuild()
        if self._swappable and self._fixed and not (self.crowding.is_hopeless or self._begun):
            self._swap_first()
            self._begun = [wp.clone(array) for array in self._places()]
        if self._free and not (hot or self.crowding.is_hopeless or self._again):
            self._turn_first()
        momentum = HOT_MOMENTUM if hot else FIRST_MOMENTUM
        most = self.crowding.most_rounds
        self._swaps_left, self._jumps_left = HOT_SWAPS if hot else MOST_SWAPS, MOST_JUMPS
        self._caught = math.inf if self._model.problem.obstacles else 0.0
        guidance = None if hot else self._guidance
        guided, strongest = 0, PULL
        pull_rounds = ROUNDS_OF_PULL[int(self.crowding.covered > CROWDED and (self._free or self._fixed))]
        if guidance is not None:
            longest = ROUNDS_OF_GUIDANCE if self._model.space.has_edges else ROUNDS_OF_GUIDANCE_WITHOUT_EDGES
            guided = min(longest, max(FEWEST_ROUNDS_OF_GUIDANCE, BODIES_TO_GUIDE // len(self._order)))
            pull_rounds, strongest = guided, PULL_OF_GUIDANCE
        least, since, clean = math.inf, 0, 0
        best, stopped = math.inf, False
        best_places: list[wp.array] = []
        for number in range(guided + most + 1):
            if number % ROUNDS_PER_RISE == 0 and number and not hot:
                momentum = min(LARGEST_MOMENTUM, 1.0 - RISE * (1.0 - momentum))
            if number % ROUNDS_AT_ONCE == 0:
                # What the pull presses together is a little deep, so it ends with the last overlap that counts.
                pull = 0.0 if hot or clean else strongest * max(0.0, 1.0 - number / pull_rounds)
                sharpness = float(self._rows) * (SHARPNESS_OF_GUIDANCE if number < guided else SHARPNESS)
                self._settings.assign(np.array([DAMPING, momentum, COASTING, pull, SLACK, sharpness], np.float32))
            if number < guided and number % ROUNDS_PER_GUIDANCE == 0 and guidance is not None:
                self._lead(guidance)
            self._find()
            if number % ROUNDS_AT_ONCE == 0 and number < guided:
                if go_on is not None and not go_on():
                    stopped = True
                    break
            elif number % ROUNDS_AT_ONCE == 0:
                deep, touching, squares = self._left()
                if deep == 0 and self._strayed:
                    # Only a list without strays tells that nothing overlaps.
                    self._rebuild()
                    self._find()
                    deep, touching, squares = self._left()
                if touching == 0:
                    return True
                clean = clean + ROUNDS_AT_ONCE if deep == 0 else 0
                if clean >= LAST_ROUNDS:
                    return True
                if squares < best:
                    best, best_places = squares, [wp.clone(array) for array in self._places()]
                self._jammed = self.crowding.is_jam(squares)
                patience = ROUNDS_OF_THE_JAMMED if self._jammed else ROUNDS_WITHOUT_PROGRESS
                since = 0 if squares < PROGRESS * least else since + ROUNDS_AT_ONCE
                least = squares if since == 0 else least
                if number == guided + most or (since >= patience and deep > 0):
                    break
                no_room = self.crowding.leaves_no_room(squares)
                if number - guided >= ROUNDS_OF_THE_TOO_CROWDED and deep > 0 and no_room:
                    break
                if go_on is not None and not go_on():
                    stopped = True
                    break
                if number and number % ROUNDS_PER_SWAP == 0 and deep and self._change_places(number, number - guided):
                    since = since if self._jammed else 0
                    self._find()
            self._move()
        self._recall(best_places)
        return None if stopped else False

    def _change_places(self, number: int, unguided: int) -> int:
        """Give bodies that stay stuck other places: those of others of their kind, and free ones; returns how many have one.

        Args:
            number: Of the round.
            unguided: Rounds since bodies were guided.
        """
        changed = 0
        if self._swaps_left and self._swappable:
            self._swaps_left -= 1
            changed = self._swap(FIRST_SWAPS + number, STUCK_SHARE, KEEP)
        if self._jumps_left and (self._pinned or self._caught) and unguided >= ROUNDS_BEFORE_JUMPS:
            self._jumps_left -= 1
            changed += self._leave_wedges(number)
        return changed

    def _recall(self, places: Sequence[wp.array]) -> None:
        """Put bodies where they were; nowhere else, if nothing is given."""
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
        """What contacts there are, with the pairs listed anew where that is due."""
        if self._strayed > STRAY_SHARE * len(self._order):
            self._rebuild()
        assert self._one_round is not None
        self._one_round[0].play()

    @property
    def _strayed(self) -> int:
        """Bodies that are farther than their skins from where they were when pairs were listed."""
        return int(self._moves.moved_far.numpy().sum())

    def _move(self) -> None:
        assert self._one_round is not None
        self._one_round[1].play()

    def _left(self) -> tuple[int, int, float]:
        """Overlaps that count, all overlaps, and the sum of their squares, each twice."""
        self._measure()
        deep, touching = (int(array.numpy().sum(dtype=np.int64)) for array in (self._deep, self._touching))
        return deep, touching, float(self._cost.numpy().sum(dtype=np.float64))

    def _swap(self, number: int, share: float, keep: float) -> int:
        """Let the most stuck bodies trade places with others of their kind where both fit better; returns how many do."""
        self._left()
        cost = self._cost.numpy()[: len(self._order)]
        stuck = np.flatnonzero(self._traders.may_trade & (cost > TOLERANCE**2))
        if not len(stuck):
            return 0
        stuck = stuck[np.argsort(-cost[stuck], kind="stable")]
        if share < 1.0:
            stuck = stuck[: max(1, int(share * len(self._order)))]
        candidates = max(1, min(CANDIDATES, PLACES_TO_TRY // len(stuck)))
        stuck = stuck[:PLACES_TO_TRY]
        self._sort()
        partner, gain = self.launcher.zeros(len(stuck), wp.int32), self.launcher.zeros(len(stuck), float)
        seed = (self._model.problem.seed * 7919 + number) % (1 << 31)
        on_device = wp.array(stuck.astype(np.int32), dtype=wp.int32, device=self.launcher.device)
        self._propose_swaps(on_device, [self._traders.bins, candidates, keep, seed], [partner, gain])
        found, gained = partner.numpy(), gain.numpy()
        proposed = np.flatnonzero(found >= 0)
        proposed = proposed[np.argsort(-gained[proposed], kind="stable")]
        one, other = stuck[proposed], found[proposed]
        if not len(one):
            return 0
        chosen = compatible(self._cells(self._traders.reach), one, other)
        self._trade(one[chosen], other[chosen])
        self._rebuild()
        return int(chosen.sum())

    def _swap_first(self) -> None:
        """Let bodies trade places before the first round: the more that fit where they are, the less they need to move."""
        for number in range(min(FIRST_SWAPS, max(FEWEST_SWAPS, BODIES_TO_SWAP // len(self._order)))):
            self._find()
            swapped = self._swap(number, 1.0, FIRST_KEEP)
            if swapped < LEAST_SWAPS * len(self._order):
                break

    def _turn_first(self) -> None:
        """Turn bodies that may turn, where they are, so that they overlap less."""
        launcher, n = self.launcher, self._count
        angle, gain, cost = (launcher.zeros(n, float) for _ in range(3))
        turned = launcher.zeros(n, wp.int32)
        self._sort()
        most = FIRST_TURNS if n * FIRST_TURNS <= TURNS_TO_TRY else max(2, TURNS_TO_TRY // n)
        for number in range(most):
            self._find_costs(cost)
            seed = (self._model.problem.seed * 7919 + (1 << 20) + number) % (1 << 31)
            self._propose_turns(TRIALS, KEEP_TURNS, seed, cost, angle, gain)
            self._accept_turns(angle, gain, turned)
            self._turn_corners()
            if int(turned.numpy().sum()) < LEAST_SWAPS * n:
                break
        self._rebuild()
