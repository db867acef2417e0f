"""The part of a domain that bodies may be in, where that is small: what is computed on a mesh is computed there alone, and finely."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

__all__ = ["LARGEST_PART", "Part", "part_of"]

# Share of the domain up to which a part is worth it: beyond, meshes over all of it are about as fine.
LARGEST_PART = 0.25


@dataclass(frozen=True)
class Part:
    """A rectangle within a domain.

    Attributes:
        low: Its lower left corner, as shares of the domain's extent along x and y.
        high: Its upper right corner, likewise.
    """

    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (1.0, 1.0)

    @property
    def share(self) -> float:
        """What share of the domain it is."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    @property
    def touches_border(self) -> bool:
        """Whether it reaches an edge of the domain."""
        return min(self.low) <= 0.0 or max(self.high) >= 1.0

    def origin(self, size: tuple[float, float]) -> tuple[float, float]:
        """Where it begins in a domain of this size."""
        return self.low[0] * size[0], self.low[1] * size[1]

    def extent(self, size: tuple[float, float]) -> tuple[float, float]:
        """How large it is in a domain of this size, along x and y."""
        return (self.high[0] - self.low[0]) * size[0], (self.high[1] - self.low[1]) * size[1]

    def joined(self, other: Part) -> Part:
        """The rectangle around both."""
        return Part(
            (min(self.low[0], other.low[0]), min(self.low[1], other.low[1])),
            (max(self.high[0], other.high[0]), max(self.high[1], other.high[1])),
        )

    def with_positions(self, position: np.ndarray, size: tuple[float, float]) -> Part:
        """The rectangle around it and positions in a domain of this size, shape ``[n, 2]``."""
        if not len(position):
            return self
        low, high = position.min(axis=0) / size, position.max(axis=0) / size
        return self.joined(Part((float(low[0]), float(low[1])), (float(high[0]), float(high[1]))))

    def with_margin(self, margin: float, size: tuple[float, float]) -> Part:
        """A larger one: by so much on all sides, as far as the domain of this size goes."""
        x, y = margin / size[0], margin / size[1]
        return Part(
            (max(self.low[0] - x, 0.0), max(self.low[1] - y, 0.0)),
            (min(self.high[0] + x, 1.0), min(self.high[1] + y, 1.0)),
        )


def part_of(images: Iterable[np.ndarray]) -> Part | None:
    """The smallest part that holds all pixels above zero of densities, row 0 at the top; None where that is no small one."""
    result: Part | None = None
    for image in {id(image): image for image in images}.values():
        # Most densities reach all edges, which is soon seen.
        if image[0].any() and image[-1].any() and image[:, 0].any() and image[:, -1].any():
            return None
        own = _around(image)
        if own is not None:
            result = own if result is None else result.joined(own)
    return None if result is None or result.share > LARGEST_PART else result


def _around(image: np.ndarray) -> Part | None:
    height, width = image.shape
    # Largest values are found several times faster than whether there is any.
    rows, columns = (np.flatnonzero(image.max(axis=axis) > 0.0) for axis in (1, 0))
    if not len(rows):
        return None
    low = float(columns[0]) / width, float(height - 1 - rows[-1]) / height
    return Part(low, (float(columns[-1] + 1) / width, float(height - rows[0]) / height))
