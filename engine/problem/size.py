"""A size of a class: so many bodies, their areas and their outlines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from . import validation
from .body_kind import DOT, BodyKind
from .footprint import Footprint
from .footprints import DrawnFootprints, Footprints, checked_footprints
from .given_values import show
from .line import Line
from .settings import Choice, Settings, as_given, belongs_to, described, setting, settle

__all__ = ["ALIKE", "Size", "with_count"]


# Outlines of one size whose areas differ by no more than this factor count as alike: one group is enough for them.
ALIKE = 4.0


@belongs_to("problem")
@described
@dataclass(frozen=True, eq=False)
class Size(Settings):
    """One size of a class: so many bodies of this footprint.

    Raises:
        ProblemError: A value that is none, both a count and a share, or a list of areas that does not fit count or range.
    """

    name: str = field(
        metadata=setting("Name of this size. No two sizes of a class have the same name", check=validation.check_name)
    )
    area: float | tuple[float, float] | None = field(
        default=None,
        metadata=setting(
            "Ground that one body takes",
            unit="m²",
            more="It is also the body's charge. Or a range, smallest first, from which every body gets its own. None takes the areas "
            "of the outlines in ``footprint``",
            check=validation.check_area_or_range,
        ),
    )
    count: int | None = field(
        default=None,
        metadata=setting(
            "How many to place. This count is always reached exactly",
            more="None where the class has the count and this size a share; 0 only where bodies of this size are fixed",
            low=0,
            soft_low=1,
            soft_high=100_000,
            check=validation.check_size_count,
        ),
    )
    share: float | None = field(
        default=None,
        metadata=setting(
            "The part of the class's total footprint area that this size gets",
            more="Above 0; the shares of a class add up to 1",
            check=validation.check_share,
        ),
    )
    distribution: str | np.ndarray | Sequence[float] = field(
        default="linear",
        metadata=setting(
            "How a range of areas is filled",
            choices=(
                Choice("linear", "Even Steps", "in even steps from the smallest to the largest", "LINEAR"),
                Choice("uniform", "Random", "drawn at random, by the seed", "UNIFORM"),
            ),
            more="Or a list of one area per body",
            check=validation.check_distribution,
        ),
    )
    line: Line | None = field(
        default=None, metadata=setting("Makes the bodies long", more="None leaves them dots", of=Line)
    )
    footprint: Footprint | Sequence[Footprint] | Footprints | None = field(
        default=None,
        metadata=setting(
            "Outlines of the bodies, which contact keeps apart",
            more="A :class:`Footprint`, several variants of which every body has one, or :class:`Footprints`, which say more. Where "
            "the area is a range they are scaled to it. None: discs of the area, and capsules around the axes of lines",
            check=as_given,
        ),
    )

    usual_area: float | None = field(
        default=None,
        metadata=setting(
            "Area that says which sizes of a class are larger than which",
            unit="m²",
            more="Where outlines were drawn elsewhere, chance is not to rank those that are alike. None: the mean of the areas",
            check=validation.check_area,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.footprint is not None:
            where = f'of size "{self.name}"'
            settle(self, footprint=checked_footprints(self.footprint, where, self.count, self.kind.has_axis))
        elif self.area is None:
            validation.check_area_or_range(self.area, self._key("area"))
        if self.count is not None and self.share is not None:
            raise ProblemError(f"{self._key('share')} cannot be combined with a `count`; got {show(self.share)}")
        if isinstance(self.distribution, np.ndarray):
            self._check_listed_areas(self.distribution, self._key("distribution"))

    def _key(self, name: str) -> str:
        return "`name` of a size" if name == "name" else f'`{name}` of size "{self.name}"'

    def _check_listed_areas(self, areas: np.ndarray, key: str) -> None:
        if not isinstance(self.area, tuple):
            raise ProblemError(f"{key} is a list, which needs a range as `area`; got {show(self.area)}")
        if self.count is not None and len(areas) != self.count:
            raise ProblemError(f"{key} must hold one area per body, {self.count}; got {len(areas)}")
        low, high = self.area
        if not low <= areas.min() <= areas.max() <= high:
            raise ProblemError(
                f"{key} must lie within the `area`, {low:g} to {high:g}; got {areas.min():g} to {areas.max():g}"
            )

    @property
    def kind(self) -> BodyKind:
        """What kind of bodies they are."""
        return self.line or DOT

    @property
    def is_range(self) -> bool:
        """Whether areas differ so much that the large ones are to be even among themselves."""
        if self.area is None:
            low, high = self._footprints.area_span
            return high > ALIKE * low
        return isinstance(self.area, tuple)

    @property
    def has_one_area(self) -> bool:
        """Whether all bodies have the area that was asked for."""
        return self.area is not None and not isinstance(self.area, tuple)

    @property
    def area_span(self) -> tuple[float, float]:
        """Smallest and largest area that a body may have [m²]."""
        if self.area is None:
            return self._footprints.area_span
        return self.area if isinstance(self.area, tuple) else (self.area, self.area)

    @property
    def widest(self) -> float:
        """Smallest width of the widest body that there may be, without the room that it keeps [m]."""
        if self.footprint is not None:
            given = self._footprints
            return max(outline.width for outline in given.outlines) * self._largest_scale
        return self.kind.narrowest(self.area_span[1])

    @property
    def room(self) -> float:
        """Factor on the outlines for keeping apart."""
        return 1.0 if self.footprint is None else self._footprints.room

    @property
    def gap(self) -> float:
        """Distance that outlines keep from each other [m]."""
        return 0.0 if self.footprint is None else self._footprints.gap

    @property
    def outlines(self) -> tuple[Footprint, ...]:
        """The outlines that bodies may have; none where they are discs or capsules."""
        return () if self.footprint is None else self._footprints.outlines

    @property
    def longest_reach(self) -> float:
        """Farthest that an outline reaches from a body's position [m]."""
        longest = max(outline.circumradius for outline in self._footprints.outlines)
        return longest * self._largest_scale

    @property
    def _largest_scale(self) -> float:
        given = self._footprints
        scale = float(np.max(1.0 if given.scale is None else given.scale)) * (1.0 + given.scale_jitter)
        if given.scale is None and isinstance(self.area, tuple):
            scale *= max(math.sqrt(self.area[1] / outline.area) for outline in given.outlines)
        return scale

    @property
    def _footprints(self) -> Footprints:
        assert isinstance(self.footprint, Footprints)
        return self.footprint

    @property
    def mean_area(self) -> float:
        """Mean footprint [m²] that the distribution aims at."""
        if isinstance(self.distribution, np.ndarray):
            return float(self.distribution.mean())
        return self._footprints.mean_area if self.area is None else float(np.mean(self.area))

    @property
    def ranked_area(self) -> float:
        """Area [m²] that says which sizes are larger than which."""
        return self.mean_area if self.usual_area is None else self.usual_area

    @property
    def mean_ground(self) -> float:
        """Mean ground that a body covers [m²]: its outline, the capsule of a line with a width of its own, or else its area."""
        if self.footprint is not None and not isinstance(self.area, tuple):
            return self._footprints.mean_area
        return self.kind.ground(self.mean_area)

    def areas(self, seed: Sequence[int]) -> np.ndarray:
        """Footprint of every body [m²], shape ``[count]``, float64; ``seed`` draws those of a uniform range."""
        count = self.count or 0
        if isinstance(self.distribution, np.ndarray):
            return self.distribution.copy()
        if self.area is None:
            drawn = self.footprints([seed[0], 5, *seed[2:]])
            outline_area = np.array([outline.area for outline in self._footprints.outlines])
            return outline_area[drawn.variant] * drawn.scale**2
        if not isinstance(self.area, tuple):
            return np.full(count, self.area)
        if self.distribution == "linear":
            return np.linspace(*self.area, count) if count > 1 else np.full(count, self.mean_area)
        return np.random.default_rng(seed).uniform(*self.area, count)

    def footprints(self, seed: Sequence[int]) -> DrawnFootprints:
        """Which outline every body has, how large and how turned; ``seed`` draws what is not given."""
        areas = self.areas([seed[0], 2, *seed[2:]]) if isinstance(self.area, tuple) else None
        return self._footprints.draw(self.count or 0, seed, areas, self.kind.has_axis)


def with_count(size: Size, count: int) -> Size:
    """A size of so many bodies, which may be none or more than areas are listed for."""
    result = object.__new__(Size)
    result.__dict__.update(size.__dict__, count=count, share=None)
    return result
