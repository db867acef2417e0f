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

import numpy as np

from ..errors import ProblemError
from . import validation
from .apportionment import apportion
from .density_correction import correct_density
from .image_filters import unsharp_mask
from .validation import Boundary, show

__all__ = ["Balance", "BodyClass", "Domain", "Line", "Problem", "Size", "Unsharp"]


@dataclass(frozen=True)
class Domain:
    """The rectangle in which bodies are placed.

    Args:
        size: Extent along x and y [m].
        boundary: ``"open"`` (bodies stay inside, nothing lies beyond) or ``"periodic"`` (the result can be tiled).

    Raises:
        ProblemError: A size that is not positive and finite, or an unknown boundary.
    """

    size: tuple[float, float]
    boundary: Boundary = "open"

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", validation.check_domain_size(self.size))
        object.__setattr__(self, "boundary", validation.check_boundary(self.boundary))
        validation.check_period(self.size, self.boundary)

    @property
    def area(self) -> float:
        """Area of the rectangle [m²]."""
        return self.size[0] * self.size[1]

    @property
    def periodic(self) -> bool:
        """Whether opposite edges are joined."""
        return self.boundary == "periodic"


@dataclass(frozen=True, eq=False)
class Balance:
    """How the aims of the sampler are weighed against each other.

    Args:
        class_separation: The paper's alpha, 0..1: 0 places every class as if it were alone, 1 spreads only the union.
        size_emphasis: The paper's C >= 1, with C_i = C^i for size rank i; or the list C_1, C_2, ... itself: how much more the
            larger sizes are spread evenly among themselves. For sizes that are a range, it is the square of C that every
            doubling of the area adds as a factor: C = 2 is the paper's min(A_j², A_k²).
        non_overlap: One row and column per class, symmetric, 1 on the diagonal: 1 where two classes must keep apart, 0 where
            they may overlap (section 5 of the paper). The classes' factors are (1 - alpha) identity + alpha non_overlap; None
            means that all keep apart.

    Raises:
        ProblemError: A value outside these ranges, or factors with a negative eigenvalue.
    """

    class_separation: float = 0.5
    size_emphasis: float | Sequence[float] = 2.0
    non_overlap: np.ndarray | Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "class_separation", validation.check_class_separation(self.class_separation))
        object.__setattr__(self, "size_emphasis", validation.check_size_emphasis(self.size_emphasis))
        object.__setattr__(self, "non_overlap", validation.check_non_overlap(self.non_overlap))
        if self.non_overlap is not None:
            validation.check_class_matrix(np.asarray(self.non_overlap), self.class_separation)

    def class_factors(self, class_count: int) -> np.ndarray:
        """Factors between classes, shape ``[class_count, class_count]``, float64."""
        apart = np.ones((class_count, class_count)) if self.non_overlap is None else np.asarray(self.non_overlap)
        return (1.0 - self.class_separation) * np.eye(class_count) + self.class_separation * apart


@dataclass(frozen=True)
class Unsharp:
    """Unsharp masking of a density: ``image + amount * (image - blurred)``, clipped at 0.

    Args:
        amount: Strength, >= 0.
        radius: Standard deviation of the blur [pixels of the density image], > 0.
    """

    amount: float = 1.0
    radius: float = 2.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "amount", validation.check_at_least_zero(self.amount, "`unsharp.amount`"))
        object.__setattr__(self, "radius", validation.check_positive(self.radius, "`unsharp.radius`"))


@dataclass(frozen=True, eq=False)
class Line:
    """Makes bodies long: a straight row of charges with a direction and a length (hatching; section 6 of the paper).

    The body is a capsule: an axis from the first to the last charge, with round caps of half the width.

    Args:
        length: Desired length of the axis [m]; a number, or an image of numbers stretched over the domain.
        direction: Desired direction: ``"density"`` (along the edges of the class's density, by its structure tensor,
            equation 8 of the paper), ``"none"``, an angle [rad], an image of angles, or an image ``[height, width, 2]`` of
            vectors (x to the right, y up) whose lengths 0..1 weigh them. A line has no front: angles count modulo pi.
        width: Thickness [m]; None makes it the area over the mean length reached, so that the average grey is kept.
        charges: Charges along the axis, 2 or more.
        middle_charge: Charge of the middle one over that of an end, where their number is odd.
        turn_weights: Weights of the forces and of the desired direction in a turn.
        stretch_weights: Weights of the forces and of the desired length in a change of length.
        straightness: None keeps lines straight; 0..1 lets them bend, and takes back this share of the bend at each step.
        tensor_scales: Standard deviations of the structure tensor's inner and outer Gaussian [pixels of the density].

    Raises:
        ProblemError: A value outside these ranges.
    """

    length: float | np.ndarray
    direction: str | float | np.ndarray = "density"
    width: float | None = None
    charges: int = 3
    middle_charge: float = 6.0
    turn_weights: tuple[float, float] = (0.4, 0.4)
    stretch_weights: tuple[float, float] = (0.2, 0.1)
    straightness: float | None = None
    tensor_scales: tuple[float, float] = (1.0, 3.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "length", validation.check_line_length(self.length, "`line.length`"))
        object.__setattr__(self, "direction", validation.check_direction(self.direction, "`line.direction`"))
        if self.width is not None:
            object.__setattr__(self, "width", validation.check_length(self.width, "`line.width`"))
        object.__setattr__(self, "charges", validation.check_charges(self.charges, "`line.charges`"))
        object.__setattr__(
            self, "middle_charge", validation.check_middle_charge(self.middle_charge, "`line.middle_charge`")
        )
        object.__setattr__(self, "turn_weights", validation.check_weights(self.turn_weights, "`line.turn_weights`"))
        object.__setattr__(
            self, "stretch_weights", validation.check_weights(self.stretch_weights, "`line.stretch_weights`")
        )
        if self.straightness is not None:
            object.__setattr__(
                self, "straightness", validation.check_fraction(self.straightness, "`line.straightness`")
            )
        object.__setattr__(self, "tensor_scales", validation.check_scales(self.tensor_scales, "`line.tensor_scales`"))

    @property
    def longest(self) -> float:
        """The largest desired length [m]."""
        return float(np.max(self.length))

    @property
    def shortest(self) -> float:
        """The smallest desired length [m]."""
        return float(np.min(self.length))

    def charge_shares(self) -> np.ndarray:
        """Share of the body's charge at every place along the axis, shape ``[charges]``, float64, sum 1."""
        weight = np.ones(self.charges)
        if self.charges % 2 == 1:
            weight[self.charges // 2] = self.middle_charge
        return weight / weight.sum()


@dataclass(frozen=True, eq=False)
class Size:
    """One size of a class: so many bodies of this footprint.

    Args:
        name: Unique within its class.
        area: Footprint of one body [m²], its charge; or a range of them, smallest first, from which every body gets its own.
        count: Number of bodies; placed exactly. None where the class has the count and this size a share.
        share: Share of the class's charge that these bodies carry, above 0; the shares of a class sum to 1.
        distribution: How a range is filled: ``"linear"`` (evenly stepped), ``"uniform"`` (drawn, by the problem's seed), or one
            area per body.
        line: Makes the bodies long; None leaves them dots.

    Raises:
        ProblemError: A value that is none, both a count and a share, or a list of areas that does not fit count or range.
    """

    name: str
    area: float | tuple[float, float]
    count: int | None = None
    share: float | None = None
    distribution: str | np.ndarray | Sequence[float] = "linear"
    line: Line | None = None

    def __post_init__(self) -> None:
        name = validation.check_name(self.name, "`name` of a size")
        where = f'of size "{name}"'
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "area", validation.check_area_or_range(self.area, f"`area` {where}"))
        distribution = validation.check_distribution(self.distribution, f"`distribution` {where}")
        object.__setattr__(self, "distribution", distribution)
        if self.count is not None:
            object.__setattr__(self, "count", validation.check_count(self.count, f"`count` {where}"))
            if self.share is not None:
                raise ProblemError(f"`share` {where} cannot be combined with a `count`; got {show(self.share)}")
        if self.share is not None:
            object.__setattr__(self, "share", validation.check_share(self.share, f"`share` {where}"))
        if self.line is not None and not isinstance(self.line, Line):
            raise ProblemError(f"`line` {where} must be a Line, or None; got {show(self.line)}")
        if isinstance(distribution, np.ndarray):
            self._check_listed_areas(distribution, f"`distribution` {where}")

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
        """Whether every body has an area of its own."""
        return isinstance(self.area, tuple)

    @property
    def mean_area(self) -> float:
        """Mean footprint [m²] that the distribution aims at."""
        if isinstance(self.distribution, np.ndarray):
            return float(self.distribution.mean())
        return float(np.mean(self.area))

    @property
    def footprint(self) -> float:
        """Mean ground that a body takes [m²]: its area, or that of the capsule where a line has a width of its own."""
        if self.line is None or self.line.width is None:
            return self.mean_area
        return self.line.width * (float(np.mean(self.line.length)) + 0.25 * math.pi * self.line.width)

    def areas(self, seed: Sequence[int]) -> np.ndarray:
        """Footprint of every body [m²], shape ``[count]``, float64; ``seed`` draws those of a uniform range."""
        count = self.count or 0
        if isinstance(self.distribution, np.ndarray):
            return self.distribution.copy()
        if not isinstance(self.area, tuple):
            return np.full(count, self.area)
        if self.distribution == "linear":
            return np.linspace(*self.area, count) if count > 1 else np.full(count, self.mean_area)
        return np.random.default_rng(seed).uniform(*self.area, count)


@dataclass(frozen=True, eq=False)
class BodyClass:
    """One class of bodies (pines; mushrooms) that follows one density.

    Args:
        name: Unique within the problem.
        sizes: At least one :class:`Size`.
        density: Image of shape ``[height, width]``, values >= 0, any scale, any real or boolean dtype; or a number > 0
            for a uniform density. Where it is zero, no body of the class is placed. Kept as a float32 copy.
        count: Number of bodies in all sizes, which then have shares instead of counts (a single size has all of it); or
            ``"cover"``: as many as it takes for the footprints to add up to the density, taken as covered share of the ground.
        density_correction: Raise densities above 0.907 so that overlapping discs cover what is asked for (section 3 of the paper);
            the density is then a covered share, 0..1.
        unsharp: Unsharp masking of the density, before everything else.

    Raises:
        ProblemError: A density that is negative, not finite, zero everywhere or not a two-dimensional image; no size;
            two sizes of one name; counts and shares that do not add up.
    """

    name: str
    sizes: Sequence[Size]
    density: np.ndarray | float = 1.0
    count: int | str | None = None
    density_correction: bool = False
    unsharp: Unsharp | None = None
    # What happened to the density on the way, for the report.
    notes: tuple[str, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        name = validation.check_name(self.name, "`name` of a class")
        where = f'class "{name}"'
        sizes = validation.as_tuple(self.sizes, Size, f"`sizes` of {where}")
        if not sizes:
            raise ProblemError(f"{where} must have at least one size; got none")
        validation.check_unique([size.name for size in sizes], f"size names of {where}")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "density", validation.check_density(self.density, f"`density` of {where}"))
        object.__setattr__(self, "count", validation.check_class_count(self.count, f"`count` of {where}"))
        correction = validation.check_switch(self.density_correction, f"`density_correction` of {where}")
        object.__setattr__(self, "density_correction", correction)
        if self.unsharp is not None and not isinstance(self.unsharp, Unsharp):
            raise ProblemError(f"`unsharp` of {where} must be an Unsharp, or None; got {show(self.unsharp)}")
        object.__setattr__(self, "sizes", self._with_shares(sizes, where))
        object.__setattr__(self, "_density_image", self._prepare_density(where))

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

    def _prepare_density(self, where: str) -> np.ndarray:
        image = np.asarray(self.density)
        key = f"`density` of {where}"
        if self.unsharp is not None:
            sharpened, clipped = unsharp_mask(image, self.unsharp.amount, self.unsharp.radius)
            with np.errstate(over="ignore"):
                image = sharpened.astype(np.float32)
            if not np.isfinite(image).all():
                raise ProblemError(f"`unsharp` of {where} must leave a finite density; lower its amount")
            if not image.any():
                raise ProblemError(f"`unsharp` of {where} must leave a density above 0 somewhere; lower its amount")
            if clipped > 0.0:
                share = f"{clipped:.1%}" if clipped >= 5e-4 else "less than 0.1%"
                note = f"`unsharp` of {where} made {share} of its density negative, which counts as 0"
                object.__setattr__(self, "notes", (note,))
        if self.density_correction or self.count == "cover":
            largest = float(image.max())
            if largest > 1.0 and self.unsharp is None:
                why = "`density_correction`" if self.density_correction else '`count = "cover"`'
                raise ProblemError(
                    f"{key} must be a covered share between 0 and 1 for {why}; its largest value is {largest:g}"
                )
            image = np.minimum(image, np.float32(1.0))
        if self.density_correction:
            image = correct_density(image, key).astype(np.float32)
        return image

    def _with_counts(self, count: int) -> tuple[Size, ...]:
        if count > validation.MOST_BODIES:
            raise ProblemError(
                f'`count` of class "{self.name}" is too large ({show(count)}): at most {validation.MOST_BODIES} bodies can be placed'
            )
        shares = np.array([size.share for size in self.sizes], dtype=np.float64)
        counts = apportion(count, shares / np.array([size.mean_area for size in self.sizes]))
        for size, number in zip(self.sizes, counts.tolist(), strict=True):
            if number < 1:
                raise ProblemError(
                    f'`share` of size "{size.name}" of class "{self.name}" must be larger: {size.share:g} of {count} bodies '
                    "leaves none of it"
                )
        return tuple(
            replace(size, count=number, share=None) for size, number in zip(self.sizes, counts.tolist(), strict=True)
        )

    def resolved(self, domain_area: float) -> BodyClass:
        """Return this class with a whole count for every size, in a domain of this area [m²]."""
        if self.count is None:
            return self
        if isinstance(self.count, int):
            sizes = self._with_counts(self.count)
        else:
            ink = float(self.density_image.mean(dtype=np.float64)) * domain_area
            number = sum(ink * (size.share or 0.0) / size.mean_area for size in self.sizes)
            if number < 0.5:
                raise ProblemError(
                    f'`count` of class "{self.name}" is "cover", but its density covers {ink:.3g} m², less than half a body'
                )
            if number > validation.MOST_BODIES:
                raise ProblemError(
                    f'`count` of class "{self.name}" is "cover", which takes about {number:.3g} bodies of these areas; at most '
                    f"{validation.MOST_BODIES} can be placed"
                )
            sizes = self._with_counts(max(round(number), 1))
        return self._with(sizes=sizes, count=None)

    def _following(self, image: np.ndarray) -> BodyClass:
        """Return this class with another array of the same density."""
        return self._with(_density_image=image)

    def _with(self, **changed: object) -> BodyClass:
        """Return a copy whose values need no check."""
        result = object.__new__(BodyClass)
        result.__dict__.update(self.__dict__, **changed)
        return result

    @property
    def density_image(self) -> np.ndarray:
        """The density that bodies follow, shape ``[height, width]``, float32 (``[1, 1]`` when it is uniform)."""
        return self.__dict__["_density_image"]

    @property
    def body_count(self) -> int:
        """Number of bodies in all sizes."""
        return sum(size.count or 0 for size in self.sizes)


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that :func:`~esh.engine.solve.solve` needs to know.

    Args:
        domain: Where.
        classes: What; at least one :class:`BodyClass`. Afterwards every size has its whole count.
        balance: How the aims are weighed.
        seed: The same problem, seed and device give the same bytes.
        avoid_overlap: Let footprints push each other apart on contact, so that none overlap where the space can hold them.

    Raises:
        ProblemError: No class, two classes of one name, a seed that is not a whole number >= 0, a balance made for another
            number of classes, or a line longer than the domain.
    """

    domain: Domain
    classes: Sequence[BodyClass]
    balance: Balance = field(default_factory=Balance)
    seed: int = 0
    avoid_overlap: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.domain, Domain):
            raise ProblemError(f"`domain` must be a Domain; got {show(self.domain)}")
        if not isinstance(self.balance, Balance):
            raise ProblemError(f"`balance` must be a Balance; got {show(self.balance)}")
        classes = validation.as_tuple(self.classes, BodyClass, "`classes`")
        if not classes:
            raise ProblemError("a problem must have at least one class; got none")
        validation.check_unique([body_class.name for body_class in classes], "class names")
        object.__setattr__(self, "classes", _sharing_images([c.resolved(self.domain.area) for c in classes]))
        object.__setattr__(self, "seed", validation.check_seed(self.seed))
        object.__setattr__(self, "avoid_overlap", validation.check_switch(self.avoid_overlap, "`avoid_overlap`"))
        self._check_balance()
        self._check_lines()
        self._check_areas()
        self._check_emphasis()
        self._check_extents()

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
                ranks = len({size.area for size in c.sizes})
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
        small = min(sizes, key=lambda pair: np.min(pair[1].area))
        large = max(sizes, key=lambda pair: np.max(pair[1].area))
        low, high = float(np.min(small[1].area)), float(np.max(large[1].area))
        if high > validation.MOST_AREA_RATIO * low:
            raise ProblemError(
                f'`area` of size "{large[1].name}" of class "{large[0].name}" must not be more than '
                f'{validation.MOST_AREA_RATIO:g} times that of size "{small[1].name}" of class "{small[0].name}"; got {high:g} and '
                f"{low:g} m²"
            )
        # Counts may be larger than any float.
        covered = sum(float(min(size.count or 0, 10**18)) * (size.footprint / self.domain.area) for _, size in sizes)
        if self.avoid_overlap and covered > validation.MOST_COVERED:
            raise ProblemError(
                f"`avoid_overlap` cannot keep footprints apart that add up to {covered:.3g} times the domain; lower the counts or "
                "the areas, or let them overlap"
            )

    def _check_emphasis(self) -> None:
        emphasis = self.balance.size_emphasis
        for c in self.classes:
            areas = [area for size in c.sizes for area in np.atleast_1d(size.area).tolist()]
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
        if self.domain.periodic:
            side, most, which = min(self.domain.size), validation.MOST_PERIODS, "shorter side of the periodic domain"
        for c in self.classes:
            for size in c.sizes:
                disc = 2.0 * math.sqrt(float(np.max(size.area)) / math.pi)
                key, extent = "area", disc
                if size.line is not None:
                    key, extent = "line", size.line.longest + (size.line.width or disc)
                if extent > most * side:
                    raise ProblemError(
                        f'`{key}` of size "{size.name}" of class "{c.name}" must not make bodies longer than {most:,} times the '
                        f"{which}, {side:g} m; they are {extent:g} m long"
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
        return np.concatenate(
            [size.areas([self.seed, 2, c, s]) for c, k in enumerate(self.classes) for s, size in enumerate(k.sizes)]
        )


def _sharing_images(classes: Sequence[BodyClass]) -> tuple[BodyClass, ...]:
    """Let classes whose densities are equal share one image, so that whatever is made of an image is made once."""
    result: list[BodyClass] = []
    seen: dict[tuple[tuple[int, ...], int], list[np.ndarray]] = {}
    for body_class in classes:
        image = body_class.density_image
        alike = seen.setdefault((image.shape, zlib.crc32(np.ascontiguousarray(image).data)), [])
        shared = next((other for other in alike if other is image or np.array_equal(other, image)), None)
        if shared is None:
            alike.append(image)
        elif shared is not image:
            body_class = body_class._following(shared)
        result.append(body_class)
    return tuple(result)
