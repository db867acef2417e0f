"""The rectangle in which bodies are placed, and what is beyond its edges."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..errors import ProblemError
from . import validation
from .settings import Choice, Settings, belongs_to, described, setting
from .validation import Boundary

__all__ = ["Domain"]


@belongs_to("problem")
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
                Choice(
                    "mirror", "Mirror", "the edges are mirrors: bodies neither crowd along them nor keep away", "MIRROR"
                ),
                Choice(
                    "natural",
                    "Natural",
                    "as if more bodies stood beyond, and were cut off: no rows along the edges, nor where densities end",
                    "NATURAL",
                ),
                Choice("periodic", "Periodic", "opposite edges are joined, so the result can be tiled", "PERIODIC"),
            ),
            check=validation.check_boundary,
        ),
    )
    inset: bool = field(
        default=False,
        metadata=setting(
            "Keep whole footprints inside an open domain, and not only their centers",
            more="Requires ``avoid_overlap``: contact sees the edges as walls",
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
    def natural(self) -> bool:
        """Whether bodies are placed as if there were more of them beyond the edges."""
        return self.boundary == "natural"

    @property
    def mirrored(self) -> bool:
        """Whether the edges are mirrors."""
        return self.boundary == "mirror"
