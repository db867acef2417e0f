"""The problem: which bodies, how many, how large, following which density, in which domain.

Conventions used in the whole engine: metres, square metres and radians; x to the right, y up; the domain is the
rectangle ``[0, size[0]] x [0, size[1]]``. A density image has shape ``[height, width]``, row 0 is its top (largest y),
and it is stretched over the whole domain whatever its resolution or aspect.

Sections, equations and symbols are those of the paper: Schmaltz, Gwosdek and Weickert, Multi-Class (Anisotropic) Electrostatic
Halftoning, 2012.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from ..errors import ProblemError
from . import validation
from .fixed_bodies import FixedBodies, FixedBody, FixedTable, fixed_table
from .footprint import DrawnFootprints, Footprint, Footprints, checked_footprints
from .obstacles import Obstacle
from .packing import packable_share, scale_to_fit
from .prepared_class import PreparedClass, cut_out, prepare, prepare_density
from .settings import Choice, Settings, as_given, described, setting, settle
from .surface import Surface
from .surface_density import SurfaceDensity, check_density
from .validation import Boundary, show

__all__ = [
    "Balance",
    "BodyClass",
    "ClassSettings",
    "Domain",
    "Line",
    "Problem",
    "SamplingSettings",
    "Size",
    "Unsharp",
]

# Outlines of one size whose areas differ by no more than this factor count as alike: one group is enough for them.
ALIKE = 2.0


@described
@dataclass(frozen=True)
class Domain(Settings):
    """The rectangle in which bodies are placed.

    Raises:
        ProblemError: A size that is not positive and finite, an unknown boundary, or an inset of a periodic domain.
    """

    size: tuple[float, float] = field(
        metadata=setting("Extent along x and y", unit="m", check=validation.check_domain_size)
    )
    boundary: Boundary = field(
        default="open",
        metadata=setting(
            "What is beyond the edges",
            choices=(
                Choice("open", "Open", "bodies stay inside, nothing lies beyond", "OPEN"),
                Choice("mirror", "Mirror", "the edges are mirrors: bodies neither crowd nor shun them", "MIRROR"),
                Choice("periodic", "Periodic", "opposite edges are joined, so the result can be tiled", "PERIODIC"),
            ),
            check=validation.check_boundary,
        ),
    )
    inset: bool = field(
        default=False,
        metadata=setting(
            "Keep footprints inside an open domain as a whole, and not only their positions",
            more="It takes ``avoid_overlap``: contact sees the edges as walls",
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.check_period(self.size, self.boundary)
        if self.inset and self.periodic:
            raise ProblemError("`domain.inset` must be false where the `boundary` is periodic, which has no edges")

    def _key(self, name: str) -> str:
        return f"`domain.{name}`"

    @property
    def area(self) -> float:
        """Area of the rectangle [m²]."""
        return self.size[0] * self.size[1]

    @property
    def periodic(self) -> bool:
        """Whether opposite edges are joined."""
        return self.boundary == "periodic"

    @property
    def mirrored(self) -> bool:
        """Whether the edges are mirrors."""
        return self.boundary == "mirror"


# Times that a class counts as rarer than the largest, at most: few bodies need no more to be even.
MOST_RARE = 100.0


@described
@dataclass(frozen=True, eq=False)
class Balance(Settings):
    """How the aims of the sampler are weighed against each other.

    Raises:
        ProblemError: A value outside these ranges, or factors with a negative eigenvalue.
    """

    class_separation: float = field(
        default=0.5,
        metadata=setting(
            "How far classes keep apart. 0: each class is even by itself. 1: only all classes together are even",
            more="The paper's alpha",
            label="Separation",
            unit="share",
            low=0.0,
            high=1.0,
            check=validation.check_class_separation,
        ),
    )
    size_emphasis: float | Sequence[float] = field(
        default=2.0,
        metadata=setting(
            "How evenly the larger sizes are spread among themselves. 1 treats all sizes alike",
            more="The paper's C >= 1, with C_i = C^i for size rank i; or the list C_1, C_2, ... itself, one for each larger size. For "
            "sizes that are a range, it is the square of C that every doubling of the area adds as a factor: C = 2 is the paper's "
            "min(A_j², A_k²)",
            low=1.0,
            high=1e6,
            soft_high=8.0,
            check=validation.check_size_emphasis,
        ),
    )
    non_overlap: np.ndarray | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "Which classes keep apart: 1 where two must, 0 where they may overlap. None keeps all apart",
            more="One row and column per class, symmetric, 1 on the diagonal (section 5 of the paper). The classes' factors are "
            "(1 - alpha) identity + alpha non_overlap",
            check=validation.check_non_overlap,
        ),
    )

    rare_emphasis: float = field(
        default=1.0,
        metadata=setting(
            "How evenly classes of few bodies are spread among themselves, beside others of many. 0 treats all classes alike",
            more="The power of the largest class's count over a class's own by which its own factor is raised; 0 is the paper's",
            label="Rare Classes",
            low=0.0,
            high=2.0,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.non_overlap is not None:
            validation.check_class_matrix(np.asarray(self.non_overlap), self.class_separation, self._key("non_overlap"))

    def _key(self, name: str) -> str:
        return f"`balance.{name}`"

    def class_factors(self, counts: Sequence[int]) -> np.ndarray:
        """Factors between classes of so many bodies, shape ``[class_count, class_count]``, float64.

        (1 - alpha) identity + alpha non_overlap, where the identity of a class that is rarer than the largest is raised.
        """
        count = np.asarray(counts, np.float64)
        apart = np.ones((len(count), len(count))) if self.non_overlap is None else np.asarray(self.non_overlap)
        rarity = np.minimum(count.max() / count, MOST_RARE) ** self.rare_emphasis
        return (1.0 - self.class_separation) * np.diag(rarity) + self.class_separation * apart


@described
@dataclass(frozen=True)
class Unsharp(Settings):
    """Unsharp masking of a density: ``image + amount * (image - blurred)``, clipped at 0."""

    amount: float = field(
        default=1.0,
        metadata=setting("Strength of the sharpening", low=0.0, soft_high=5.0, check=validation.check_at_least_zero),
    )
    radius: float = field(
        default=2.0,
        metadata=setting(
            "How far the sharpening reaches: standard deviation of the blur, in pixels of the density image",
            more="Above 0",
            check=validation.check_positive,
        ),
    )

    def _key(self, name: str) -> str:
        return f"`unsharp.{name}`"


@described
@dataclass(frozen=True, eq=False)
class Line(Settings):
    """Makes bodies long: a straight row of charges with a direction and a length (hatching; section 6 of the paper).

    The body is a capsule: an axis from the first to the last charge, with round caps of half the width.

    Raises:
        ProblemError: A value outside these ranges.
    """

    length: float | np.ndarray = field(
        metadata=setting(
            "Preferred length of the axis",
            unit="m",
            more="A number, or an image of numbers stretched over the domain",
            check=validation.check_line_length,
        )
    )
    direction: str | float | np.ndarray = field(
        default="density",
        metadata=setting(
            "Preferred direction",
            more='``"density"`` (along the edges of the class\'s density, by its structure tensor, equation 8 of the paper), '
            '``"none"``, an angle [rad], an image of angles, or an image ``[height, width, 2]`` of vectors (x to the right, y up) '
            "whose lengths 0..1 weigh them. A line has no front: angles count modulo pi",
            check=validation.check_direction,
        ),
    )
    width: float | None = field(
        default=None,
        metadata=setting(
            "Thickness",
            unit="m",
            more="None makes it the area over the mean length reached, so that the average grey is kept",
            check=validation.check_length,
        ),
    )
    charges: int = field(
        default=3,
        metadata=setting(
            "Charges along the axis", low=2, high=validation.MOST_CHARGES_ON_A_LINE, check=validation.check_charges
        ),
    )
    middle_charge: float = field(
        default=6.0,
        metadata=setting(
            "Charge of the middle one over that of an end, where their number is odd",
            check=validation.check_middle_charge,
        ),
    )
    turn_weights: tuple[float, float] = field(
        default=(0.4, 0.4),
        metadata=setting(
            "Weights of the forces and of the preferred direction in a turn", check=validation.check_weights
        ),
    )
    stretch_weights: tuple[float, float] = field(
        default=(0.2, 0.1),
        metadata=setting(
            "Weights of the forces and of the preferred length in a change of length", check=validation.check_weights
        ),
    )
    straightness: float | None = field(
        default=None,
        metadata=setting(
            "None keeps lines straight; 0 to 1 lets them bend, and takes back this share of the bend at each step",
            check=validation.check_fraction,
        ),
    )
    tensor_scales: tuple[float, float] = field(
        default=(1.0, 3.0),
        metadata=setting(
            "Standard deviations of the structure tensor's inner and outer Gaussian, in pixels of the density",
            check=validation.check_scales,
        ),
    )

    def _key(self, name: str) -> str:
        return f"`line.{name}`"

    @property
    def longest(self) -> float:
        """The largest preferred length [m]."""
        return float(np.max(self.length))

    @property
    def shortest(self) -> float:
        """The smallest preferred length [m]."""
        return float(np.min(self.length))

    def charge_shares(self) -> np.ndarray:
        """Share of the body's charge at every place along the axis, shape ``[charges]``, float64, sum 1."""
        weight = np.ones(self.charges)
        if self.charges % 2 == 1:
            weight[self.charges // 2] = self.middle_charge
        return weight / weight.sum()


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
            "The part of the class's summed footprints that this size gets",
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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.footprint is not None:
            where = f'of size "{self.name}"'
            settle(self, footprint=checked_footprints(self.footprint, where, self.count, self.line is not None))
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
    def is_range(self) -> bool:
        """Whether areas differ so much that the large ones are to be even among themselves."""
        if self.area is None:
            low, high = self._footprints.area_span
            return high > ALIKE * low
        return isinstance(self.area, tuple)

    @property
    def area_span(self) -> tuple[float, float]:
        """Smallest and largest area that a body may have [m²]."""
        if self.area is None:
            return self._footprints.area_span
        return self.area if isinstance(self.area, tuple) else (self.area, self.area)

    @property
    def widest(self) -> float:
        """Smallest width of the widest body that there may be [m]."""
        if self.footprint is not None:
            given = self._footprints
            return max(outline.width for outline in given.outlines) * self._largest_scale * given.room + given.gap
        if self.line is not None:
            return self.line.width or 0.0
        return 2.0 * math.sqrt(self.area_span[1] / math.pi)

    @property
    def outlines(self) -> tuple[Footprint, ...]:
        """The outlines that bodies may have; none where they are discs or capsules."""
        return () if self.footprint is None else self._footprints.outlines

    @property
    def longest_reach(self) -> float:
        """Farthest that an outline reaches from a body's position, with the room that it keeps [m]."""
        given = self._footprints
        longest = max(outline.circumradius for outline in given.outlines)
        return longest * self._largest_scale * given.room + 0.5 * given.gap

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
    def mean_ground(self) -> float:
        """Mean ground that a body covers [m²]: its outline, the capsule of a line with a width of its own, or else its area."""
        if self.footprint is not None and not isinstance(self.area, tuple):
            return self._footprints.mean_area
        if self.line is None or self.line.width is None:
            return self.mean_area
        return self.line.width * (float(np.mean(self.line.length)) + 0.25 * math.pi * self.line.width)

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
        return self._footprints.draw(self.count or 0, seed, areas, self.line is not None)


def with_count(size: Size, count: int) -> Size:
    """A size of so many bodies, which may be none or more than areas are listed for."""
    result = object.__new__(Size)
    result.__dict__.update(size.__dict__, count=count, share=None)
    return result


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ClassSettings(Settings):
    """What the engine and Blender understand alike of a class, beside its name, sizes, density and count."""

    density_correction: bool = field(
        default=False,
        metadata=setting(
            "Take the density as the share of the ground to cover. Where discs must overlap to cover it, more are placed",
            more="The density is then 0..1, and raised above 0.907 (section 3 of the paper)",
            label="Cover Dark Areas",
        ),
    )
    unsharp: Unsharp | None = field(
        default=None,
        metadata=setting(
            "Make the edges of the density stronger", more="Before everything else", label="Sharpen", of=Unsharp
        ),
    )


@described
@dataclass(frozen=True, eq=False)
class BodyClass(ClassSettings):
    """One class of bodies (pines; mushrooms) that follows one density, as it is asked for.

    Raises:
        ProblemError: A density that is negative, not finite, zero everywhere or not a two-dimensional image; no size;
            two sizes of one name; counts and shares that do not add up.
    """

    name: str = field(
        metadata=setting("Name of this class. No two classes have the same name", check=validation.check_name)
    )
    sizes: Sequence[Size] = field(
        metadata=setting("At least one :class:`Size`", check=lambda value, key: validation.as_tuple(value, Size, key))
    )
    density: np.ndarray | float | SurfaceDensity = field(
        default=1.0,
        metadata=setting(
            "Where many bodies of this class stand, and where few; only its proportions matter",
            more="An image of shape ``[height, width]``, values >= 0, any scale, any real or boolean dtype; or a number > 0 for a "
            "uniform density. Where it is zero, no body of the class is placed. Kept as a float32 copy. On a surface a number, or a "
            "function of :class:`PointsOnSurface`, such as :class:`SurfaceAttribute`, :class:`SurfaceImage` or "
            ":class:`SurfaceTriplanar`",
            check=check_density,
        ),
    )
    count: int | str | None = field(
        default=None,
        metadata=setting(
            "How many to place, all sizes together",
            more='The sizes then have shares instead of counts (a single size has all of it); or ``"cover"``: as many as it takes '
            "for the footprints to add up to the density, taken as covered share of the ground; where the problem avoids overlap, no "
            "more than can lie there so",
            low=1,
            soft_high=100_000,
            check=validation.check_class_count,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        where = f'class "{self.name}"'
        sizes = tuple(self.sizes)
        if not sizes:
            raise ProblemError(f"{where} must have at least one size; got none")
        validation.check_unique([size.name for size in sizes], f"size names of {where}")
        settle(self, sizes=self._with_shares(sizes, where))
        self._check_covered_share(where)

    def _key(self, name: str) -> str:
        return "`name` of a class" if name == "name" else f'`{name}` of class "{self.name}"'

    def _with_shares(self, sizes: tuple[Size, ...], where: str) -> tuple[Size, ...]:
        """Check that either every size has a count, or the class has one and every size a share."""
        if self.count is None:
            for size in sizes:
                if size.count is None:
                    reason = "shares need a `count` of the class" if size.share is not None else "it is missing"
                    raise ProblemError(
                        f'`count` of size "{size.name}" of {where} must be a whole number of at least 1; {reason}'
                    )
            return sizes
        if len(sizes) == 1 and sizes[0].count is None and sizes[0].share is None:
            return (replace(sizes[0], share=1.0),)
        for size in sizes:
            if size.share is None:
                raise ProblemError(
                    f'`share` of size "{size.name}" of {where} must be given, because the class has a `count`; '
                    + ("it has a `count` of its own instead" if size.count is not None else "it is missing")
                )
        total = sum(size.share or 0.0 for size in sizes)
        if abs(total - 1.0) > validation.SHARE_TOLERANCE:
            raise ProblemError(f"`share` of the sizes of {where} must add up to 1; they add up to {total:.4g}")
        return sizes

    def _check_covered_share(self, where: str) -> None:
        """Where the density is a covered share, it must not be above 1; what is sharpened is cut off there."""
        if callable(self.density):
            if self.unsharp is not None:
                raise ProblemError(f"`unsharp` of {where} needs a density that is an image; it is a function of points")
            return
        largest = float(np.max(self.density))
        if (self.density_correction or self.count == "cover") and largest > 1.0 and self.unsharp is None:
            why = "`density_correction`" if self.density_correction else '`count = "cover"`'
            raise ProblemError(
                f"`density` of {where} must be a covered share between 0 and 1 for {why}; its largest value is {largest:g}"
            )


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class SamplingSettings(Settings):
    """What the engine and Blender understand alike of a whole problem, beside its classes and their balance."""

    seed: int = field(
        default=0,
        metadata=setting(
            "The same settings, seed and device give the same result. Another seed gives another result",
            low=0,
            check=validation.check_seed,
        ),
    )
    avoid_overlap: bool = field(
        default=False,
        metadata=setting(
            "Push footprints apart that touch. Counts stay as they are. The report says how many still overlap"
        ),
    )
    regularity: float = field(
        default=0.6,
        metadata=setting(
            "How regular the pattern is. 1: as near to a lattice as bodies come. 0: organic, with rows in no direction. Counts and "
            "densities are kept",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )


@dataclass(frozen=True, eq=False, init=False)
class Problem(SamplingSettings):
    """Everything that :func:`~esh.engine.solve.solve` needs to know.

    Args:
        domain: Where: a rectangle, or a :class:`~.surface.Surface`, on which there are no fixed bodies, obstacles or lines yet.
        classes: What; at least one :class:`BodyClass`. Kept as :class:`PreparedClass`: with the density that bodies follow, and
            with a whole count for every size.
        balance: How the aims are weighed.
        seed: The same problem, seed and device give the same bytes.
        avoid_overlap: Let footprints push each other apart on contact, so that none overlap where the space can hold them.
        regularity: How regular the pattern is, 1 to 0: from as near to a lattice as bodies come to organic; counts and densities
            are kept.
        fixed: Bodies that are there already: they take part in everything, and do not move. The rest of their class makes room:
            where they already are what the density asks for, no more are placed. Kept as a :class:`FixedTable`, in class, then
            size order. A size may have a ``count`` of 0 if there are such bodies of it.
        include_fixed: Whether counts include them. By default counts are those of new bodies, beside them.
        obstacles: What bodies keep off. Counts stay as they are, less ground is left to follow the density on.

    Raises:
        ProblemError: No class, two classes of one name, a seed that is not a whole number >= 0, a balance made for another
            number of classes, a line longer than the domain, fixed bodies that do not belong to it, nothing to place, or
            obstacles that leave a class no place.
    """

    domain: Domain | Surface
    classes: tuple[PreparedClass, ...]
    balance: Balance
    fixed: FixedTable
    obstacles: tuple[Obstacle, ...]
    include_fixed: bool

    def __init__(
        self,
        domain: Domain | Surface,
        classes: Sequence[BodyClass | PreparedClass],
        balance: Balance | None = None,
        seed: int = 0,
        avoid_overlap: bool = False,
        *,
        regularity: float = 0.6,
        fixed: FixedBodies | Sequence[FixedBody | FixedBodies] = (),
        include_fixed: bool = False,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        balance = Balance() if balance is None else balance
        if not isinstance(domain, Domain | Surface):
            raise ProblemError(f"`domain` must be a Domain or a Surface; got {show(domain)}")
        if not isinstance(balance, Balance):
            raise ProblemError(f"`balance` must be a Balance; got {show(balance)}")
        classes = validation.as_tuple(classes, (BodyClass, PreparedClass), "`classes`")
        if not classes:
            raise ProblemError("a problem must have at least one class; got none")
        validation.check_unique([body_class.name for body_class in classes], "class names")
        include_fixed = validation.check_switch(include_fixed, "`include_fixed`")
        avoid_overlap = validation.check_switch(avoid_overlap, "`avoid_overlap`")
        obstacles = validation.as_tuple(obstacles, Obstacle, "`obstacles`")
        share = _share_of_cover(classes) if avoid_overlap else 1.0
        # A class of another problem may have been cut and counted before.
        bases = tuple(
            (c.base or c) if isinstance(c, PreparedClass) else prepare(c, domain, apart=avoid_overlap, share=share)
            for c in classes
        )
        prepared = bases
        if isinstance(domain, Surface):
            self._check_surface(bases, fixed, obstacles)
        elif obstacles:
            prepared = tuple(cut_out(c, domain, obstacles) for c in bases)
        prepared = _sharing_images(prepared)
        settle(self, domain=domain, classes=prepared, balance=balance, seed=seed, avoid_overlap=avoid_overlap)
        settle(self, include_fixed=include_fixed, obstacles=obstacles, regularity=regularity)
        super().__post_init__()
        settle(self, fixed=fixed_table(fixed, prepared, cast(Domain, domain)))
        counted = [self._with_fixed(index, c) for index, c in enumerate(prepared)]
        settle(self, classes=tuple(c if c is b else replace(c, base=b) for c, b in zip(counted, bases, strict=True)))
        if self.body_count == len(self.fixed.id):
            raise ProblemError("a problem must have at least one body to place; all of them are fixed")
        self._check_balance()
        self._check_lines()
        self._check_areas()
        self._check_emphasis()
        self._check_extents()
        self._check_footprints()

    def _with_fixed(self, index: int, body_class: PreparedClass) -> PreparedClass:
        """A class whose sizes count all of their bodies, fixed ones among them."""
        sizes = []
        for number, size in enumerate(body_class.sizes):
            fixed = self.fixed.number_of(index, number)
            key = f'`count` of size "{size.name}" of class "{body_class.name}"'
            count = size.count or 0
            if self.include_fixed and count < fixed:
                raise ProblemError(f"{key} must include its {fixed} fixed bodies; got {show(count)}")
            if fixed and self.include_fixed and isinstance(size.distribution, np.ndarray):
                raise ProblemError(
                    f"{key} must not include fixed bodies where areas are listed; set `include_fixed` to false"
                )
            total = count if self.include_fixed else count + fixed
            if total < 1:
                raise ProblemError(
                    f"{key} must be a whole number of at least 1, or bodies of it be fixed; got {show(count)}"
                )
            sizes.append(size if total == count else with_count(size, total))
        return body_class if sizes == list(body_class.sizes) else replace(body_class, sizes=tuple(sizes))

    @staticmethod
    def _check_surface(classes: Sequence[PreparedClass], fixed: object, obstacles: Sequence[Obstacle]) -> None:
        """Refuse what is not known on surfaces."""
        if obstacles:
            raise ProblemError(
                "`obstacles` must lie in a rectangle; on a surface set densities to 0 where nothing is to be"
            )
        if fixed != () and fixed != []:
            raise ProblemError("`fixed` bodies must lie in a rectangle; on a surface there are none")
        for c in classes:
            for size in c.sizes:
                if size.line is not None:
                    raise ProblemError(
                        f'`line` of size "{size.name}" of class "{c.name}" must lie in a rectangle; on a surface bodies are dots'
                    )
                if size.footprint is not None:
                    raise ProblemError(
                        f'`footprint` of size "{size.name}" of class "{c.name}" must lie in a rectangle; on a surface footprints are '
                        "discs"
                    )

    @property
    def rectangle(self) -> Domain:
        """The domain, of a problem that lies in a rectangle.

        Raises:
            ProblemError: It lies on a surface.
        """
        if not isinstance(self.domain, Domain):
            raise ProblemError("`domain` must be a rectangle for this; it is a surface")
        return self.domain

    def _check_balance(self) -> None:
        matrix = self.balance.non_overlap
        if matrix is not None and len(matrix) != len(self.classes):
            raise ProblemError(
                f"`balance.non_overlap` must have one row per class, {len(self.classes)}; got {len(matrix)} rows"
            )
        emphasis = self.balance.size_emphasis
        if isinstance(emphasis, tuple):
            for c in self.classes:
                if any(size.is_range for size in c.sizes):
                    raise ProblemError(
                        f'`balance.size_emphasis` must be one number, because areas of class "{c.name}" are a range; got a list'
                    )
                ranks = len({size.mean_area for size in c.sizes})
                if ranks - 1 > len(emphasis):
                    raise ProblemError(
                        f'`balance.size_emphasis` must have a value for each of the {ranks - 1} larger sizes of class "{c.name}"; '
                        f"got {len(emphasis)}"
                    )

    def _check_lines(self) -> None:
        most = max(self.domain.size)
        for c in self.classes:
            for size in c.sizes:
                if size.line is not None and size.line.longest > most:
                    raise ProblemError(
                        f'`line.length` of size "{size.name}" of class "{c.name}" must not be longer than the domain, {most:g} m; '
                        f"got {size.line.longest:g}"
                    )
                if size.line is not None and size.line.shortest < validation.SHORTEST_LINE * most:
                    raise ProblemError(
                        f'`line.length` of size "{size.name}" of class "{c.name}" must not be shorter than '
                        f"{validation.SHORTEST_LINE:g} of the domain, {most:g} m; got {size.line.shortest:g}"
                    )

    def _check_areas(self) -> None:
        sizes = [(c, size) for c in self.classes for size in c.sizes]
        small = min(sizes, key=lambda pair: pair[1].area_span[0])
        large = max(sizes, key=lambda pair: pair[1].area_span[1])
        low, high = small[1].area_span[0], large[1].area_span[1]
        if high > validation.MOST_AREA_RATIO * low:
            raise ProblemError(
                f'`area` of size "{large[1].name}" of class "{large[0].name}" must not be more than '
                f'{validation.MOST_AREA_RATIO:g} times that of size "{small[1].name}" of class "{small[0].name}"; got {high:g} and '
                f"{low:g} m²"
            )
        # Counts may be larger than any float.
        covered = sum(float(min(size.count or 0, 10**18)) * (size.mean_ground / self.domain.area) for _, size in sizes)
        if self.avoid_overlap and covered > validation.MOST_COVERED:
            raise ProblemError(
                f"`avoid_overlap` cannot keep footprints apart that add up to {covered:.3g} times the domain; lower the counts or "
                "the areas, or let them overlap"
            )

    def _check_emphasis(self) -> None:
        emphasis = self.balance.size_emphasis
        for c in self.classes:
            areas = [area for size in c.sizes for area in (size.area_span if size.is_range else (size.mean_area,))]
            if not isinstance(emphasis, float):
                powers = math.log(max((1.0, *emphasis[: len(set(areas)) - 1])))
            elif any(size.is_range for size in c.sizes):
                powers = 2.0 * math.log2(emphasis) * math.log(max(areas) / min(areas))
            else:
                powers = (len(set(areas)) - 1) * math.log(emphasis)
            if powers > math.log(validation.MOST_EMPHASIS):
                raise ProblemError(
                    f'`balance.size_emphasis` must not give the largest bodies of class "{c.name}" more than '
                    f"{validation.MOST_EMPHASIS:g} times the weight of its smallest; {show(emphasis)} gives them "
                    f"1e{powers / math.log(10.0):.0f} times as much"
                )

    def _check_extents(self) -> None:
        side, most, which = max(self.domain.size), validation.MOST_EXTENT, "longer side of the domain"
        if isinstance(self.domain, Domain) and self.domain.periodic:
            side, most, which = min(self.domain.size), validation.MOST_PERIODS, "shorter side of the periodic domain"
        for c in self.classes:
            for size in c.sizes:
                disc = 2.0 * math.sqrt(size.area_span[1] / math.pi)
                key, extent = "area", disc
                if size.line is not None:
                    key, extent = "line", size.line.longest + (size.line.width or disc)
                if size.footprint is not None:
                    key, extent = "footprint", max(extent, size.longest_reach * 2.0)
                if extent > most * side:
                    raise ProblemError(
                        f'`{key}` of size "{size.name}" of class "{c.name}" must not make bodies longer than {most:,} times the '
                        f"{which}, {side:g} m; they are {extent:g} m long"
                    )

    def _check_footprints(self) -> None:
        """Refuse what contact can do nothing about: bodies wider than the walls are apart."""
        if not isinstance(self.domain, Domain) or not self.domain.inset:
            return
        if not self.avoid_overlap:
            raise ProblemError(
                "`domain.inset` must be false without `avoid_overlap`: it is contact that keeps footprints inside"
            )
        most = min(self.domain.size)
        for c in self.classes:
            for size in c.sizes:
                if size.widest > most * (1.0 + 1e-9):
                    raise ProblemError(
                        f'bodies of size "{size.name}" of class "{c.name}" must not be wider than the domain that they are to lie in, '
                        f"{most:g} m; got {size.widest:.4g}"
                    )

    @property
    def body_count(self) -> int:
        """Number of bodies of all classes and sizes."""
        return sum(body_class.body_count for body_class in self.classes)

    @property
    def charge_count(self) -> int:
        """Number of charges on all bodies: one on a dot, several on a line."""
        sizes = [size for body_class in self.classes for size in body_class.sizes]
        return sum((size.count or 0) * (size.line.charges if size.line else 1) for size in sizes)

    def body_indices(self) -> tuple[np.ndarray, np.ndarray]:
        """Class and size index of every body, shapes ``[body_count]``, int32, in class, then size order."""
        groups = [(c, s, size.count) for c, k in enumerate(self.classes) for s, size in enumerate(k.sizes)]
        class_index, size_index, count = np.array(groups, dtype=np.int64).T
        return np.repeat(class_index, count).astype(np.int32), np.repeat(size_index, count).astype(np.int32)

    def body_areas(self) -> np.ndarray:
        """Footprint of every body [m²], shape ``[body_count]``, float64, in the same order."""
        areas = []
        for c, k in enumerate(self.classes):
            for s, size in enumerate(k.sizes):
                if not len(self.fixed.id):
                    areas.append(size.areas([self.seed, 2, c, s]))
                    continue
                own = (self.fixed.class_index == c) & (self.fixed.size_index == s)
                new = with_count(size, (size.count or 0) - int(own.sum()))
                areas += [new.areas([self.seed, 2, c, s]), self.fixed.area[own]]
        return np.concatenate(areas)

    def body_is_fixed(self) -> np.ndarray:
        """Whether each body is fixed, shape ``[body_count]``: of every size the new ones come first."""
        if not len(self.fixed.id):
            return np.zeros(self.body_count, bool)
        result = []
        for c, k in enumerate(self.classes):
            for s, size in enumerate(k.sizes):
                fixed = self.fixed.number_of(c, s)
                result.append(np.arange(size.count or 0) >= (size.count or 0) - fixed)
        return np.concatenate(result)

    def body_ids(self) -> np.ndarray:
        """Identity of every body, shape ``[body_count]``, int64: fixed ones have their own, all others free ones in their order."""
        taken = self.fixed.id
        first = int(taken.max(initial=-1)) + 1
        unnamed = np.flatnonzero(taken < 0)
        named = taken.copy()
        named[unnamed] = first + np.arange(len(unnamed))
        fixed = self.body_is_fixed()
        result = np.empty(self.body_count, np.int64)
        result[fixed] = named
        result[~fixed] = first + len(unnamed) + np.arange(int((~fixed).sum()))
        return result


def _share_of_cover(classes: Sequence[BodyClass | PreparedClass]) -> float:
    """What classes that are to cover the ground, and keep apart on it, can have of what each of them alone could cover."""
    covering = [c for c in classes if isinstance(c, BodyClass) and c.count == "cover"]
    if not covering:
        return 1.0
    fits = [packable_share(c.sizes) for c in covering]
    images = [np.minimum(prepare_density(c).image, np.float32(f)) for c, f in zip(covering, fits, strict=True)]
    return scale_to_fit(images, max(fits))


def _sharing_images(classes: Sequence[PreparedClass]) -> tuple[PreparedClass, ...]:
    """Let classes whose densities are equal share one image, so that whatever is made of an image is made once."""
    result: list[PreparedClass] = []
    seen: dict[tuple[tuple[int, ...], int], list[np.ndarray]] = {}
    for body_class in classes:
        image = body_class.density_image
        alike = seen.setdefault((image.shape, zlib.crc32(np.ascontiguousarray(image).data)), [])
        shared = next((other for other in alike if other is image or np.array_equal(other, image)), None)
        if shared is None:
            alike.append(image)
        elif shared is not image:
            body_class = replace(body_class, density_image=shared)
        result.append(body_class)
    return tuple(result)
