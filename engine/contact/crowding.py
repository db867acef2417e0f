"""How crowded outlines are that are to be parted, and how long it is worth trying."""

from __future__ import annotations

from functools import cached_property

from ..problem.cover import Cover, cover_of
from ..problem.problem import Problem

__all__ = ["ROUNDS_OF_THE_JAMMED", "ROUNDS_OF_THE_TOO_CROWDED", "Crowding"]

# Rounds at most.
MOST_ROUNDS = 2500
# Where the squared overlaps are this large on average beside obstacles, so many rounds without progress are enough, and no second try
# follows: measured on pebbles among others, of which a second try leaves as many.
JAMMED = 0.02
ROUNDS_OF_THE_JAMMED = 200
# More bodies than this are taken for jammed from the first where they cover this share of what fits beside obstacles. Measured on
# 10,000 discs among 1,000 trees: at .91 of it 46 pairs are left after 700 rounds and 44 after 4,300, at .97 they are 691 and 672; at
# .84 two, of which the second try parts one.
MANY_BODIES, NEARLY_FULL = 2000, 0.9
# Above this cover hardly anything can be parted to the last: so many rounds at most, and no second try.
TOO_CROWDED = 0.86
ROUNDS_OF_THE_TOO_CROWDED = 500
# The same where gaps between what stands there are too narrow for what is to go into them, which no cover tells: after those rounds
# the squared overlaps are still this large on average. Measured: 2.8 of 557 pebbles and planks among 236 trees and logs that leave no
# room for them, .006 of 1,900 that nearly fit, and .0004 of a jam that a second try does part.
HOPELESS = 0.5
# Where footprints cover more than the ground, or those of many bodies this many times what fits beside obstacles, none of this helps:
# so many rounds, of many bodies as many as this has of all bodies. Measured on 10,000 discs and twigs among 1,000 trees, at 1.2 to 3.4
# times what fits: 15 rounds leave as many pairs as 240 to 470, but for 2 in 100.
BEYOND_WHAT_FITS = 1.15
ROUNDS_OF_THE_HOPELESS = 150
FEWEST_ROUNDS = 15
BODIES_OF_THE_HOPELESS = 200_000


class Crowding:
    """How crowded the bodies of a problem are.

    Args:
        problem: What is placed.
        body_count: How many bodies it has.
        covered: Share of the domain's area that their outlines take, with the room that they keep; above 1 they cannot fit.
    """

    def __init__(self, problem: Problem, body_count: int, covered: float) -> None:
        self._problem, self._body_count, self.covered = problem, body_count, covered

    @property
    def most_rounds(self) -> int:
        """Rounds in which they are parted at most."""
        if self.is_hopeless:
            return min(ROUNDS_OF_THE_HOPELESS, max(FEWEST_ROUNDS, BODIES_OF_THE_HOPELESS // self._body_count))
        return MOST_ROUNDS

    @property
    def is_too_crowded(self) -> bool:
        """Whether there is hardly a way to part them, by the ground where bodies may be."""
        return self._cover.covered > TOO_CROWDED

    @cached_property
    def is_hopeless(self) -> bool:
        """Whether they cannot be parted at all."""
        return self.covered > 1.0 or self._fills_gaps(BEYOND_WHAT_FITS)

    def leaves_no_room(self, squares: float) -> bool:
        """Whether there is hardly a way to part them, or it shows in the sum of their squared overlaps."""
        return self.is_too_crowded or squares > HOPELESS * self._body_count

    def is_jam(self, squares: float) -> bool:
        """Whether squared overlaps are so large that they hardly come apart; where nothing stands in the way they do for long."""
        limit = JAMMED if self._problem.obstacles else HOPELESS
        return squares > limit * self._body_count or self._fills_gaps(NEARLY_FULL)

    @cached_property
    def _cover(self) -> Cover:
        return cover_of(self._problem)

    def _fills_gaps(self, share: float) -> bool:
        """Whether many bodies cover more than a share of what fits between obstacles, which takes a moment to find out."""
        many = self._body_count > MANY_BODIES and bool(self._problem.obstacles)
        return many and self._cover.covered > share * self._cover.fits
