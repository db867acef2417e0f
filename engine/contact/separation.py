"""Separation: convex outlines that overlap at the end of a run are parted, in any space.

This is an iteration in rounds. A round computes the corrections of all contacts at once. Every body makes the sum of its own, divided
by half the number of its contacts if there are more than two, with a momentum that grows. A pull that fades keeps bodies near where
the descent put them. Bodies that stay stuck trade places with others of their kind, or jump to free places. If that does not help
either, there is another try from the start, with more momentum and without the pull.

Lists of pairs and single rounds are in :mod:`.outlines_in_space`. What depends on the space is in :mod:`.plane_separation` for a
rectangle, and in :mod:`.surface_separation` for a surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.model import Model
from . import kernels_trials
from .changes_of_place import alone, compatible, find_traders
from .crowding import ROUNDS_OF_THE_JAMMED, ROUNDS_OF_THE_TOO_CROWDED, Crowding
from .footprint_tables import FootprintTables
from .guidance import Guidance
from .outlines_in_space import TOLERANCE, OutlinesInSpace

__all__ = ["MOST_JUMPS", "PLACES_OF_JUMP", "Separation"]

# How far apart outlines are put, in widths of the narrower one: more than an overlap that counts.
SLACK = 2e-3

# In rows of parallel bodies that keep their turns, the shorter way out of an overlap counts for this much more: later, and while
# bodies are guided. Measured on 38 scenes of parallel planks: 3 or 4 from the first leave one jammed, 2 none; but bodies that meet
# others of nearly their direction do not come to rest with 2.
SHARPNESS, SHARPNESS_OF_GUIDANCE = 4.0, 2.0
# Values without a derivation are choices; what others of them do is measured by benchmarks/constants.py, here on the scenes of
# benchmarks/contact.py that are covered to 80 % and more (--scenes 8 --bodies 150), eight runs of each value.
# Momentum of the first rounds; by which factor its distance from 1 shrinks, and after how many rounds each time; and its largest
# value. Measured: none overlap whatever they are, but with 0 or 0.6 at first coverage errors are 6 and 3 % larger, and 3 % where it
# never comes above 0.9.
FIRST_MOMENTUM = 0.9
RISE = 0.7
ROUNDS_PER_RISE = 60
LARGEST_MOMENTUM = 0.985
# Momentum of a second try. Measured on 300 planks at random turns that cover 60 % of a periodic domain: 3 of 12 runs stay jammed with
# 0.98, none with 0.99. On planks, boxes and discs that may turn and cover 80 % of one, 1 of 12 runs stays jammed without that try,
# none with it.
HOT_MOMENTUM = 0.99
# Share of the corrections that a round applies. Measured: with 0.6 coverage errors are 2 % larger, with 1.2 6 % smaller; none
# overlap with either.
DAMPING = 0.9
# Momentum of bodies that nothing touches.
COASTING = 0.5
# Share of the way back to its start that a body is pulled in a round at first, and rounds until the pull has faded: of loose bodies
# and of discs, and of other bodies that are crowded.
PULL = 0.01
ROUNDS_OF_PULL = (100, 300)
# The same for bodies that are guided. Of many bodies there are fewer rounds: rounds times bodies are at most BODIES_TO_GUIDE, but no
# fewer rounds than FEWEST_ROUNDS_OF_GUIDANCE. Guidance is computed anew every ROUNDS_PER_GUIDANCE rounds.
PULL_OF_GUIDANCE = 0.02
ROUNDS_OF_GUIDANCE = 800
# The same where the domain has no edges. Measured on planks, boxes and discs that cover 80 % of a periodic domain, six seeds: coverage
# errors grow by .022 to .031 in 800 rounds, by .019 to .026 in these, in 1.3 times the time.
ROUNDS_OF_GUIDANCE_WITHOUT_EDGES = 1600
FEWEST_ROUNDS_OF_GUIDANCE = 100
BODIES_TO_GUIDE = 10_000_000
ROUNDS_PER_GUIDANCE = 10
# Overlaps are measured every ROUNDS_AT_ONCE rounds. It is given up after so many rounds without progress, which is to reduce the sum
# of squared overlaps to at most this share of the least one so far.
ROUNDS_AT_ONCE = 5
ROUNDS_WITHOUT_PROGRESS = 500
PROGRESS = 0.97
# Rounds after the last overlap that counts, after which smaller ones may stay.
LAST_ROUNDS = 100
# Trading places: most passes before the first round; rounds between two later passes; how many of these there are in the first and in
# the second try; candidates for each body; most places that are tried in a pass; and the share of bodies, the most stuck ones, that
# later passes look at.
FIRST_SWAPS = 30
ROUNDS_PER_SWAP = 50
MOST_SWAPS = 20
HOT_SWAPS = 60
CANDIDATES = 60
PLACES_TO_TRY = 300_000
STUCK_SHARE = 0.2
FIRST_KEEP = 1.0
# Bodies that are wedged between pinned ones, or caught in one gap between obstacles with too many others, jump to another place:
# rounds without guidance before the first pass, and most passes. They do so only where overlaps have come to a stand: the sum of their
# squares is more than STALLED of what it was ROUNDS_PER_SWAP rounds before. What is pressed together in one place and has room beside
# it comes apart by itself; if half of it jumped away, it would leave holes. Measured: bodies that are caught among obstacles have .97
# to 1.03 of the squares before; up to 99,000 pebbles in two sizes, asked to cover .89 to 1.08 of the ground between 18 boulders, come
# apart with .3 to .95. With .887 of it asked for, coverage errors grow from .031 to .042; to .22 if they may jump.
ROUNDS_BEFORE_JUMPS = 150
MOST_JUMPS = 10
STALLED = 0.95
# Most places that such a body tries. Measured on 120 planks among 146 others, which leave few places: 1,000 do not find them.
PLACES_OF_JUMP = 20_000
# Of many bodies each tries fewer: all of them together as many as this, but each no fewer than FEWEST_PLACES.
PLACES_IN_ALL = 400_000
FEWEST_PLACES = 200
# A place may leave this share of the squared overlaps that a body had. Measured on 500 pebbles among trees and logs: if places had to
# be free of overlaps, 7 pairs were left.
KEEP_PLACES = 0.5
# Squared overlaps that a place may leave if the last pass helped nobody: the bodies that are overlapped there give way. Measured on
# quads between triangles at 42 %: one is caught at the border, and of 200,000 places none is free, but many overlap by a fifth of a
# width.
PRESSED_PLACES = 0.1
# If a pass leaves more than STILL_CAUGHT of the caught bodies, and they are more than MANY_CAUGHT of all bodies, there is no room for
# them: no other pass follows.
STILL_CAUGHT, MANY_CAUGHT = 0.8, 0.2
# Most threads of a GPU that share the places of a body.
MOST_LANES = 256
# Most caught bodies that look for a place in one pass.
MOST_AT_ONCE = 2000
# Turning before the first round: most passes; turns that each body tries in one; passes times bodies at most; and the share of a
# body's squared overlaps that a turn may leave. KEEP is that share for later trades.
FIRST_TURNS = 30
TRIALS = 24
TURNS_TO_TRY = 300_000
KEEP_TURNS = 0.9
KEEP = 0.8
# Of many bodies there are fewer passes of trades before the first round: passes times bodies are at most BODIES_TO_SWAP, but no fewer
# passes than FEWEST_SWAPS.
FEWEST_SWAPS = 6
BODIES_TO_SWAP = 600_000
# Passes end when a smaller share of the bodies trades places.
LEAST_SWAPS = 1e-3
# Bodies are crowded if they cover more than this share of the domain.
CROWDED = 0.66


class Separation(OutlinesInSpace):
    """Parts the outlines of a model's bodies; for the arguments see :class:`.OutlinesInSpace`.

    Attributes:
        crowding: How crowded the bodies are.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        tables: FootprintTables,
        order: np.ndarray,
        length: np.ndarray,
        offset: np.ndarray,
    ) -> None:
        super().__init__(model, launcher, tables, order, length, offset)
        covered = float(tables.area[: len(order)].sum() / model.problem.domain.area)
        self.crowding = Crowding(model.problem, len(order), covered)
        self._traders = find_traders(model, launcher, tables, order)
        # Bodies that were caught in gaps at the last pass of jumps; 0 if no other pass follows.
        self._caught = 0.0
        self._swaps_left = self._jumps_left = 0
        # Sum of squared overlaps when bodies were last given other places.
        self._squares = math.inf
        # Places of the bodies once they have traded them before the first round; nothing before that.
        self._begun: list[wp.array] = []

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

    @property
    def _swappable(self) -> bool:
        # Who was parted before keeps its place.
        return not self._again and bool(self._traders.may_trade.any())

    def _try(self, go_on: Callable[[], bool] | None, hot: bool) -> bool | None:
        """One try; None where it was stopped."""
        self._begin(hot=hot)
        momentum = HOT_MOMENTUM if hot else FIRST_MOMENTUM
        most = self.crowding.most_rounds
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
                if (
                    number
                    and number % ROUNDS_PER_SWAP == 0
                    and deep
                    and self._change_places(number, number - guided, squares)
                ):
                    since = since if self._jammed else 0
                    self._find()
            self._move()
        self._recall(best_places)
        return None if stopped else False

    def _begin(self, hot: bool) -> None:
        """Trade places and turn before the first round, and see to it that others can be traded later."""
        self._moves.last.zero_()
        self._rebuild()
        if self._swappable and self._fixed and not (self.crowding.is_hopeless or self._begun):
            self._swap_first()
            self._begun = [wp.clone(array) for array in self._places()]
        if self._free and not (hot or self.crowding.is_hopeless or self._again):
            self._turn_first()
        self._swaps_left, self._jumps_left = HOT_SWAPS if hot else MOST_SWAPS, MOST_JUMPS
        self._caught = math.inf if self._model.problem.obstacles else 0.0
        self._squares = math.inf

    def _change_places(self, number: int, unguided: int, squares: float) -> int:
        """Give bodies that stay stuck other places: those of others of their kind, and free ones; returns how many have one.

        Args:
            number: Of the round.
            unguided: Rounds since bodies were guided.
            squares: Sum of squared overlaps.
        """
        changed = 0
        stalled, self._squares = squares > STALLED * self._squares, squares
        if self._swaps_left and self._swappable:
            self._swaps_left -= 1
            changed = self._swap(FIRST_SWAPS + number, STUCK_SHARE, KEEP)
        if stalled and self._jumps_left and (self._pinned or self._caught) and unguided >= ROUNDS_BEFORE_JUMPS:
            self._jumps_left -= 1
            changed += self._leave_wedges(number)
        return changed

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
