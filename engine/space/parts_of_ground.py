"""Parts of the ground that bodies do not leave for each other: a density is next to nothing between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..device.launcher import Launcher
from ..geometry.connected import connected, connected_pixels
from ..geometry.morton_order import morton_order
from .space import Space
from .support import nearest_in_support

__all__ = ["PartsOfGround", "parts_of_ground"]

# Densities below this share of what the average body sees part the ground: over a gap that is four spacings wide and as empty as that
# nobody goes, as its own charge is too much there.
LITTLE = 0.05
# Pixels for a mean spacing, and along an axis, at most: of finer images the sums of some together, which closes gaps that bodies reach
# across.
PIXELS_PER_SPACING, FEWEST_PIXELS, MOST_PIXELS = 2.0, 64, 512
# Parts that ask for fewer bodies are no parts, but belong to the nearest one.
FEWEST_OF_PART = 4.0
# More parts than this are so small that what one has too many is missing beside it.
MOST_PARTS = 256


@dataclass(frozen=True, eq=False)
class PartsOfGround:
    """The parts of a density.

    Attributes:
        density: In pixels, shape ``[height, width]``, row 0 at the top; its sum is 1.
        part: Number of the part that each of these is in, or nearest to, likewise.
    """

    density: np.ndarray
    part: np.ndarray

    @cached_property
    def share(self) -> np.ndarray:
        """What share of the density each part has."""
        return np.bincount(self.part.ravel(), self.density.ravel())

    @property
    def count(self) -> int:
        """How many parts there are."""
        return len(self.share)

    def even_places(self, part: int, count: int, size: tuple[float, float], rng: np.random.Generator) -> np.ndarray:
        """Return places in a part of a domain of this size [m], evenly along a curve through its pixels, shape ``[count, 2]``."""
        pixel, running, first = self._curve
        height, width = self.part.shape
        begin, end = first[part], first[part + 1]
        before = running[begin - 1] if begin else 0.0
        step = (np.arange(count) + rng.random()) / count
        at = np.searchsorted(running[begin:end], before + step * (running[end - 1] - before)).clip(max=end - begin - 1)
        row, column = np.divmod(pixel[begin:end][at], width)
        x, y = column + rng.random(count), row + rng.random(count)
        return np.stack([x / width * size[0], (1.0 - y / height) * size[1]], axis=1)

    @cached_property
    def _curve(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels that are not empty, part after part along a curve; the running sum of their densities; and where parts begin."""
        row, column = np.nonzero(self.density > 0.0)
        order = morton_order(np.stack([column, row, np.zeros_like(row)], axis=1))
        pixel = (row * self.part.shape[1] + column)[order]
        part = self.part.ravel()[pixel]
        pixel = pixel[np.argsort(part, kind="stable")]
        first = np.concatenate([[0], np.cumsum(np.bincount(part, minlength=self.count))])
        return pixel, np.cumsum(self.density.ravel()[pixel]), first


def parts_of_ground(launcher: Launcher, image: np.ndarray, space: Space, bodies: int) -> PartsOfGround | None:
    """Find the parts of a density; None where it is one.

    Args:
        launcher: Where to run.
        image: The density, shape ``[height, width]``.
        space: The domain.
        bodies: How many follow it.
    """
    if float(image.min()) >= LITTLE * float(image.max()):
        return None
    spacing = math.sqrt(space.area / bodies)
    density = _pooled(image, [length * PIXELS_PER_SPACING / spacing for length in space.size[::-1]])
    density /= density.sum()
    enough = density > LITTLE * float((density**2).sum())
    part = connected_pixels(enough)
    if space.periodic:
        part = _joined(part)
    share = np.bincount(part[enough], density[enough])
    large = share * bodies >= FEWEST_OF_PART
    if not 2 <= large.sum() <= MOST_PARTS:
        return None
    number = np.append(np.where(large, np.cumsum(large) - 1, -1), -1)[part]
    nearest, _ = nearest_in_support(launcher, (number >= 0).astype(np.float32), space.size)
    return PartsOfGround(density, number.astype(np.int32).ravel()[nearest])


def _pooled(image: np.ndarray, pixels: list[float]) -> np.ndarray:
    """Sums of pixels together, float64, where there are far more than so many along an axis."""
    for axis, (count, most) in enumerate(zip(image.shape, pixels, strict=True)):
        together = int(count / min(max(most, FEWEST_PIXELS), MOST_PIXELS))
        if together > 1:
            image = np.add.reduceat(image, np.arange(0, count, together), axis=axis)
    return image.astype(np.float64)


def _joined(part: np.ndarray) -> np.ndarray:
    """Parts of which those that meet across the edges are one."""
    one, other = (np.concatenate([part[a], part[:, a]]) for a in (0, -1))
    meet = (one >= 0) & (other >= 0)
    label = connected(int(part.max()) + 1, one[meet], other[meet])
    return np.append(label, -1)[part]
