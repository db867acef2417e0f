"""A class of bodies as it is asked for: its sizes, the density that it follows, and how many there are to be.

The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from . import validation
from .given_values import as_tuple, check_unique
from .look_at import LookAt
from .settings import Settings, belongs_to, described, setting, settle
from .size import Size
from .surface_density import SurfaceDensity, check_density

__all__ = ["BodyClass", "ClassSettings", "PlacingSettings", "Unsharp"]


@belongs_to("problem", "scatter")
@described
@dataclass(frozen=True)
class Unsharp(Settings):
    """Unsharp masking of a density: ``image + amount * (image - blurred)``, kept between the pixels around, and at 0 or more."""

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
    overshoot: float = field(
        default=0.0,
        metadata=setting(
            "How far beyond the densities nearby it may go. 0: edges are steeper, without halos beside them. 1: plain unsharp masking",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )

    def _key(self, name: str) -> str:
        return f"`unsharp.{name}`"


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class PlacingSettings(Settings):
    """What of a class still matters once its density is prepared: :class:`~.prepared_class.PreparedClass` has it, too."""

    clustering: float = field(
        default=0.0,
        metadata=setting(
            "How strongly this class forms clumps. 0: no clumps. 1: nearly everything stands in one. Counts and the overall "
            "density do not change",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )
    clump_size: float = field(
        default=0.0,
        metadata=setting(
            "Diameter of a clump. 0 chooses about 2.5 times the mean spacing of the class",
            more="Requires ``clustering``",
            unit="m",
            low=0.0,
            high=validation.LARGEST_LENGTH,
            soft_high=20.0,
        ),
    )
    room: float = field(
        default=1.0,
        metadata=setting(
            "Scales footprints while objects are kept apart. Above 1 leaves space around them, below 1 lets them overlap a little. "
            "The objects themselves keep their size",
            more="Requires ``avoid_overlap``, and multiplies the ``room`` that :class:`Footprints` have",
            label="Room",
            low=validation.SMALLEST_ROOM,
            high=validation.LARGEST_ROOM,
            soft_low=0.5,
            soft_high=3.0,
        ),
    )
    gap: float = field(
        default=0.0,
        metadata=setting(
            "Smallest distance between footprints of this class. Between two classes it is half of one gap plus half of the other",
            more="Requires ``avoid_overlap``, and adds to the ``gap`` that :class:`Footprints` have",
            label="Gap",
            unit="m",
            low=0.0,
            high=validation.LARGEST_LENGTH,
            soft_high=2.0,
        ),
    )
    look_at: LookAt | None = field(
        default=None,
        metadata=setting(
            "Turn objects so that they look at a point or an object",
            more="Long bodies lie along their direction instead",
            label="Look At",
            of=LookAt,
        ),
    )


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ClassSettings(PlacingSettings):
    """What the engine and Blender understand alike of a class, beside its name, sizes, density and count."""

    density_correction: bool = field(
        default=False,
        metadata=setting(
            "Treat the density as the share of the ground to cover. Where discs have to overlap to cover it, more are placed",
            more="The density is then 0..1, and raised above 0.907 (section 3 of Schmaltz, Gwosdek and Weickert 2012)",
            label="Cover Dark Areas",
        ),
    )
    unsharp: Unsharp | None = field(
        default=None,
        metadata=setting(
            "Make the edges of the density stronger", more="Before everything else", label="Sharpen", of=Unsharp
        ),
    )


@belongs_to("problem")
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
        metadata=setting("At least one :class:`Size`", check=lambda value, key: as_tuple(value, Size, key))
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
        check_unique([size.name for size in sizes], f"size names of {where}")
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
                raise ProblemError(
                    f"`unsharp` of {where} needs a density that is an image; it is a function of points",
                    Refusal(Reason.SHARPENED_ON_SURFACE, self.unsharp.amount, 0, (self.name, "")),
                )
            return
        largest = float(np.max(self.density))
        if (self.density_correction or self.count == "cover") and largest > 1.0 and self.unsharp is None:
            why = "`density_correction`" if self.density_correction else '`count = "cover"`'
            raise ProblemError(
                f"`density` of {where} must be a covered share between 0 and 1 for {why}; its largest value is {largest:g}",
                Refusal(Reason.DENSITY_ABOVE_ONE, largest, 1, (self.name, "")),
            )
