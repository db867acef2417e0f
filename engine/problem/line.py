"""What makes bodies long: charges in a row, a preferred direction, a preferred length.

The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import validation
from .body_kind import disc_radius
from .given_values import is_function
from .settings import Settings, belongs_to, described, setting

__all__ = ["Line"]


def _check_direction(value: object, key: str) -> str | float | np.ndarray | Callable[..., Any]:
    """Return a preferred direction; those that there are on surfaces only are told from the others where the domain is known."""
    if is_function(value) or (isinstance(value, str) and value == "slope"):
        return value  # type: ignore[return-value]
    return validation.check_direction(value, key)


@belongs_to("problem", "scatter")
@described
@dataclass(frozen=True, eq=False)
class Line(Settings):
    """Makes bodies long: a straight row of charges with a direction and a length.

    Hatching, as in section 6 of Schmaltz, Gwosdek and Weickert 2012.

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
    direction: str | float | np.ndarray | Callable[..., Any] = field(
        default="density",
        metadata=setting(
            "Preferred direction",
            more='``"density"`` (along the edges of the class\'s density, by its structure tensor, equation 8 of '
            "Schmaltz, Gwosdek and Weickert 2012), "
            '``"none"``, an angle [rad], an image of angles, or an image ``[height, width, 2]`` of vectors (x to the right, y up) '
            "whose lengths 0..1 weigh them. A line has no front: angles count modulo pi. On a surface: "
            '``"density"``, ``"none"``, ``"slope"`` (where water runs), or a function of points, such as '
            ":class:`~esh.SurfaceVectors` or :class:`~esh.AlongCurves`, that returns a vector for each",
            check=_check_direction,
        ),
    )
    width: float | None = field(
        default=None,
        metadata=setting(
            "Thickness",
            unit="m",
            more="None makes it the area over the mean length reached, so that the average gray is kept; where lines lie on each "
            "other and may do so, wider, until they cover what the density asks for",
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
            "Charge of the middle one divided by that of an end, if their number is odd",
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

    @property
    def has_axis(self) -> bool:
        """See :class:`~.body_kind.BodyKind`."""
        return True

    @property
    def mean_length(self) -> float:
        """The mean preferred length [m]."""
        return float(np.mean(self.length))

    def charge_places(self) -> np.ndarray:
        """Coordinate of every charge along the axis, -1 at one end to 1 at the other, shape ``[charges]``."""
        return np.linspace(-1.0, 1.0, self.charges)

    def thickness(self, area: np.ndarray, mean_length: float) -> np.ndarray:
        """Thickness [m] of capsules around axes of a mean length, shape ``[n]``.

        Where a line has none of its own, it is that of capsules whose mean area is the footprint: the average gray is that of the
        image.
        """
        if self.width is not None:
            return np.full(len(area), self.width)
        # length * width + pi width² / 4 = area; as a quotient, since the difference is 0 for lines that are far longer than wide.
        return 2.0 * area / (np.sqrt(mean_length**2 + math.pi * area) + mean_length)

    def reach_across(self, area: np.ndarray) -> np.ndarray:
        """Half the thickness of capsules whose axes are as long as is asked in the mean [m], shape ``[n]``."""
        return 0.5 * self.thickness(area, self.mean_length)

    def ground(self, area: float) -> float:
        """Ground that a body covers [m²]: the capsule, where its width is given, or else its area."""
        return area if self.width is None else self.width * (self.mean_length + 0.25 * math.pi * self.width)

    def narrowest(self, area: float) -> float:
        """The width, where it is given, or else 0."""
        return self.width or 0.0

    def extent(self, area: float) -> float:
        """From one end of the capsule to the other [m], at most."""
        return self.longest + (self.width or 2.0 * float(disc_radius(area)))
