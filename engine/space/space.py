"""The space that bodies are in: a rectangle that ends at its edges, or wraps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..problem.domain import Domain
from . import kernels_space

__all__ = ["Space"]


@dataclass(frozen=True)
class Space:
    """A rectangle from (0, 0) to ``size``, in any unit of length; what kernels ask of it is in :mod:`.kernels_space`.

    Attributes:
        size: Extent along x and y.
        periodic: Whether it wraps: opposite edges are one.
    """

    size: tuple[float, float]
    periodic: bool = False

    @classmethod
    def of(cls, domain: Domain, unit: float = 1.0) -> Space:
        """The space of a domain, in a unit of so many meters. One with mirrors ends at them; only the field sees what lies behind."""
        return cls((domain.size[0] / unit, domain.size[1] / unit), domain.periodic)

    @property
    def area(self) -> float:
        """Area of the rectangle."""
        return self.size[0] * self.size[1]

    @property
    def has_straight_ways(self) -> bool:
        """Whether the way from one position to another is always their difference: nothing repeats itself."""
        return not self.periodic

    @property
    def has_edges(self) -> bool:
        """Whether it ends somewhere, where what is crowded finds a way out."""
        return not self.periodic

    def with_mirror_images(self) -> Space:
        """The space of everything in this one and of its images in two mirrors, the right and the upper edge, which repeats itself."""
        return Space((2.0 * self.size[0], 2.0 * self.size[1]), True)

    def shortest(self, way: np.ndarray) -> np.ndarray:
        """Ways between positions, shape ``[..., 2]``, each the shorter one round a space that wraps."""
        return way - np.array(self.size) * np.round(way / np.array(self.size)) if self.periodic else way

    def wrapped(self, position: np.ndarray) -> np.ndarray:
        """Positions, shape ``[..., 2]``, inside a space that wraps, as precise as they were; where one ends, they are as they were."""
        if not self.periodic:
            return position
        size = np.array(self.size, position.dtype)
        return self.inside(position - np.floor(position / size) * size)

    def inside(self, position: np.ndarray) -> np.ndarray:
        """Put positions, shape ``[n, 2]``, that rounding left beyond the far edges onto these, or where it wraps onto the near ones.

        They are changed in place, and returned.
        """
        size = np.array(self.size, position.dtype)
        if not self.periodic:
            return np.minimum(position, size, out=position)
        position[position >= size] = 0.0
        return position

    def padded(self, image: np.ndarray, rows: int, columns: int) -> np.ndarray:
        """An image over the space with so many more rows and columns on every side: its own other side, or mirrored where it ends."""
        return np.pad(image, [(rows, rows), (columns, columns)], mode="wrap" if self.periodic else "symmetric")

    def images_within(self, distance: float, most: int) -> tuple[int, int]:
        """How many periods away along x and y, at most ``most``, images lie within ``distance``; 0 where nothing repeats."""
        if not self.periodic:
            return 0, 0
        along_x, along_y = (min(most, int(min(distance / side + 0.5, 1e6))) for side in self.size)
        return along_x, along_y

    def for_kernels(self) -> kernels_space.Space:
        """The same as kernels take it."""
        space = kernels_space.Space()
        space.size = wp.vec2(*self.size)
        space.periodic = int(self.periodic)
        return space
