"""How many of a class are placed, said in other ways than by a number."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ...engine.errors import ProblemError
from ...engine.problem.given_values import as_float, show
from ...engine.problem.settings import Settings, belongs_to, described, setting

__all__ = ["Amount"]

# A density or a distance that was mistyped can ask for any number.
MOST = 50_000_000


def _check_amount(value: object, key: str) -> float:
    number = as_float(value)
    if number is None or not 0.0 < number < math.inf:
        raise ProblemError(f"{key} must be a number above 0, and finite; got {show(value)}")
    return number


@belongs_to("scatter")
@described
@dataclass(frozen=True)
class Amount(Settings):
    """How many of a class are placed, for ``count`` of a :class:`~esh.ScatterClass`. One of these is given.

    It holds where the class's density is 1 or more. Where the density is lower, so is the number.

    Raises:
        ProblemError: None or several are given, or one that is not above 0.
    """

    per_area: float | None = field(
        default=None,
        metadata=setting(
            "How many to place on each square meter of ground where the density is white, all sizes together",
            label="Per Area",
            unit="1/m²",
            soft_high=100.0,
            check=_check_amount,
        ),
    )
    distance: float | None = field(
        default=None,
        metadata=setting(
            "How far neighbors of this class are apart where the density is white",
            unit="m",
            soft_low=0.05,
            soft_high=100.0,
            check=_check_amount,
        ),
    )
    cover: float | None = field(
        default=None,
        metadata=setting(
            "Share of the ground that the footprints of this class cover together where the density is white",
            check=_check_amount,
        ),
    )

    def __post_init__(self) -> None:
        given = {name: value for name, value in vars(self).items() if value is not None}
        if len(given) != 1:
            raise ProblemError(
                f"an Amount must have one of `per_area`, `distance` and `cover`; got {show(given or None)}"
            )
        super().__post_init__()

    def _key(self, name: str) -> str:
        return f"`{name}` of an Amount"

    def number(self, area: float, footprint: float, where: str) -> int:
        """Return how many that are: at least one.

        Args:
            area: Surface, every point weighed by the density there, up to 1 [m²].
            footprint: Mean ground that one takes [m²].
            where: How a sentence names the class.

        Raises:
            ProblemError: More than anything could hold.
        """
        if self.per_area is not None:
            number = self.per_area * area
        elif self.distance is not None:
            # As many as a hexagonal lattice of this distance has.
            number = area * 2.0 / (math.sqrt(3.0) * self.distance**2)
        else:
            assert self.cover is not None
            number = self.cover * area / footprint
        if number > MOST:
            raise ProblemError(
                f"`count` of {where} comes to {number:,.0f} on {area:,.4g} m² of ground; at most {MOST:,} can be placed"
            )
        return max(1, round(number))
