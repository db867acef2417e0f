"""How much of the ground can be covered without overlap, and how a density is brought down to that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .body_kind import disc_radius
from .domain import Domain
from .footprint import Footprint
from .footprints import Footprints
from .size import Size

__all__ = ["elongation_of", "in_cells", "is_long", "packable", "packable_share", "scale_to_fit", "share_inside"]

# Share of the ground that contact fills in a few seconds: with discs; with bodies that may turn; with those that may not, as wide as
# they are long, and how fast that falls with their length.
DISCS = 0.82
FREE = 0.8
FIXED = 0.8
FIXED_FALL = 0.12
LEAST = 0.25
# Bodies are long where their elongation is above this.
LONG = 1.5
# Cells along the longer side of the domain in which the densities of several classes are added up.
CELLS = 128


def packable(elongation: float, free: bool, agreement: float = 0.0) -> float:
    """Share of the ground that such bodies can cover without overlap, about.

    Args:
        elongation: Length over width of the rectangle that has a body's area and width; 0.79 for a disc.
        free: Whether bodies may turn so that they fit.
        agreement: How far the directions of bodies that may not agree, from 0 to 1. Parallel ones fit like squares: where the plane is
            stretched across them they are.
    """
    if elongation < 0.9:
        return DISCS
    if free:
        return FREE
    across = math.sqrt(max(1.0 - agreement**2, 0.0))
    return max(LEAST, FIXED / (1.0 + FIXED_FALL * math.sqrt(max(elongation - 1.0, 0.0) * across)))


def elongation_of(outline: Footprint) -> float:
    """Length over width of the rectangle that has the area and the width of an outline."""
    return outline.area / outline.width**2


def is_long(outline: Footprint) -> bool:
    """Whether an outline is so long that it matters how bodies with it are turned to each other."""
    return elongation_of(outline) > LONG


def packable_share(sizes: Sequence[Size], room: float, gap: float) -> float:
    """Share of the ground that bodies of these sizes can cover without overlap, about, by the shares that sizes have.

    Args:
        sizes: Sizes of a class.
        room: Factor of the class on its footprints for keeping apart.
        gap: Distance that footprints of the class keep from each other [m].
    """
    fits = []
    for size in sizes:
        given = size.footprint
        # Lines lie side by side.
        share = FREE if size.kind.has_axis else DISCS
        if isinstance(given, Footprints):
            free = size.kind.has_axis or given.is_free
            share = float(np.mean([packable(elongation_of(outline), free) for outline in given.outlines]))
        # The room that outlines keep for themselves is ground that they do not cover.
        radius = float(disc_radius(size.mean_area))
        fits.append(share * min(1.0, (radius / (radius * size.room * room + 0.5 * (size.gap + gap))) ** 2))
    return float(np.average(fits, weights=[size.share or 1.0 for size in sizes]))


def share_inside(domain: Domain, area: float) -> float:
    """Part of what fits in a domain that fits where bodies of this area [m²] must lie inside of its edges; 1 where they need not.

    Along an edge they leave gaps, about as if a quarter of a disc's width were lost there: 16 discs of 1 m² fit in 5 m x 5 m.
    """
    if not domain.inset:
        return 1.0
    lost = float(disc_radius(area))
    return float(np.prod([max(1.0 - lost / length, 0.0) for length in domain.size]))


def scale_to_fit(images: Sequence[np.ndarray], fits: float) -> float:
    """Factor on densities, covered shares of the ground, by which all of them together ask for no more than fits, on the whole."""
    shape = (CELLS, CELLS)
    total = np.sum([in_cells(image, shape) for image in images], axis=0)
    return float(np.minimum(total, fits).sum() / total.sum())


def in_cells(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Mean of an image over every cell of a grid, float64, shape ``[rows, columns]``."""
    return _mean_of_rows(_mean_of_rows(image, shape[0]).T, shape[1]).T


def _mean_of_rows(image: np.ndarray, cells: int) -> np.ndarray:
    """Mean of the rows that lie in every cell of the first axis, shape ``[cells, columns]``.

    A product with the overlaps of cells and rows takes half a second on the grids of small bodies.
    """
    rows = len(image)
    edges = np.arange(cells + 1) * (rows / cells)
    cut = np.minimum(edges.astype(np.int64), rows - 1)
    total = np.empty((cells, image.shape[1]))
    # A cell at a time, which is several times as fast as what NumPy adds up between indices.
    for cell, (first, end) in zip(total, pairwise(cut.tolist()), strict=True):
        np.add.reduce(image[first:end], axis=0, dtype=np.float64, out=cell)
    # And of the rows that edges cut, the parts before them.
    total += np.diff((edges - cut)[:, None] * image[cut], axis=0)
    total *= cells / rows
    return total
