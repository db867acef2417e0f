"""Widths of lines that are drawn: wider where they lie on each other, so that a picture is as dark as was asked.

Charges follow the density, and lines that have no width of their own are as wide as their areas say. Where they overlap they cover
less than these add up to. So they are drawn, what is covered is compared with what was asked, and they are made wider or narrower,
cell by cell, until it is that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..problem.domain import Domain
from ..problem.image_filters import gaussian_blur
from ..problem.placement import Placement
from ..space.density import box_integrals
from ..space.space import Space
from . import kernels_ink

__all__ = ["with_widths"]

# Samples across a line that are enough: the mean over many lines counts. And samples in all, beyond which there are fewer.
SAMPLES_ACROSS = 2.0
MOST_SAMPLES = 1 << 25
# Samples along a side of a cell.
FEWEST_OF_CELL, MOST_OF_CELL = 4, 64
# What is drawn and what was asked are compared after a blur by so many cells, which are as large as lines have ground.
BLUR = 1.0
# How often lines are drawn; the share of what is missing that the first time makes up for, and its factor in a cell from one time to
# the next: where the error changed its sign, because evenly laid lines cover far more as soon as they are a little wider, and where it
# did not.
TIMES = 6
GAIN = 0.6
BACK, ON = 0.5, 1.2
# Widths are changed by these factors at most.
NARROWEST, WIDEST = 0.4, 3.0
# Times that bodies cover the domain at most; what is beyond that is black in any case, and would take long to draw.
MOST_LAYERS = 8.0
# Share of its darkness that a picture may lack or have too much of for its widths to stay as they are: where lines do not overlap,
# they all have one.
UNNOTICED = 0.02
# The same of the darkest parts of a picture, tenth by tenth from this tone on, where there are so many cells of one: lines that hardly
# overlap in most of it may do so there.
UNNOTICED_IN_TONE, DARK, FEWEST_OF_TONE = 0.04, 3, 16
# So many cells beside the border have lines that reach out of the picture.
BESIDE_BORDER = 3
# Nothing is asked to be darker than this: it would take infinitely wide lines.
DARKEST = 0.985
# Added to a tone before its logarithm is taken.
FAINTEST = 0.01


def with_widths(placement: Placement, launcher: Launcher) -> np.ndarray:
    """Thickness of every body [m], shape ``[n]``, with which lines cover what the densities of their classes ask for.

    Only lines that have no width and no outline of their own are changed. A class that lacks nothing is left as it is, and so is one
    that covers the domain many times, or has bodies longer than it. Lines cover each other within a class: those of others have other
    colors.
    """
    width = placement.width.copy()
    for index, body_class in enumerate(placement.problem.classes):
        adapting = [k for k, s in enumerate(body_class.sizes) if s.line and s.line.width is None and not s.outlines]
        if not adapting:
            continue
        own = np.flatnonzero(placement.class_index == index)
        adapts = np.isin(placement.size_index[own], adapting)
        domain = placement.problem.rectangle
        thickness = 2.0 * placement.radius[own]
        extent = placement.length[own] + thickness
        drawable = (extent * thickness).sum() <= MOST_LAYERS * domain.area and extent.max() <= max(domain.size)
        if adapts.any() and drawable:
            width[own] *= _factors(placement, index, own, adapts, launcher)
    return width


def _factors(placement: Placement, index: int, own: np.ndarray, adapts: np.ndarray, launcher: Launcher) -> np.ndarray:
    """Factors on the widths of a class's bodies ``own``, shape ``[len(own)]``."""
    domain = placement.problem.rectangle
    drawing = _Drawing(placement, own, adapts, launcher)
    shape = drawing.cells
    image = placement.problem.classes[index].density_image
    tone = box_integrals(image, shape) * (placement.area[own].sum() / (domain.area / (shape[0] * shape[1])))
    asked = _blurred(np.minimum(tone, 1.0), domain)
    factor, gain, before = np.ones(shape), np.full(shape, GAIN), np.zeros(shape)
    drawn = drawing.draw(factor)
    if abs(drawn.mean() / asked.mean() - 1.0) >= UNNOTICED or _lacks_tone(_blurred(drawn, domain), asked):
        for _ in range(TIMES):
            missing = np.log(_opacity(asked) / _opacity(_blurred(drawn, domain)))
            gain = np.minimum(gain * np.where(missing * before < 0.0, BACK, ON), 1.0)
            factor = np.clip(factor * np.exp(gain * missing), NARROWEST, WIDEST)
            before = missing
            drawn = drawing.draw(factor)
    return drawing.factor.numpy().astype(np.float64)


def _lacks_tone(drawn: np.ndarray, asked: np.ndarray) -> bool:
    """Whether cells of some dark tone are too light, taken together, but for those at the border; both blurred."""
    drawn, asked = (values[BESIDE_BORDER:-BESIDE_BORDER, BESIDE_BORDER:-BESIDE_BORDER] for values in (drawn, asked))
    tenth = np.minimum(10.0 * asked, 9.0).astype(np.int64).ravel()
    cells, wanted, there = (np.bincount(tenth, w, 10)[DARK:] for w in (None, asked.ravel(), drawn.ravel()))
    return bool(((cells >= FEWEST_OF_TONE) & (there < (1.0 - UNNOTICED_IN_TONE) * wanted)).any())


def _opacity(tone: np.ndarray) -> np.ndarray:
    """What lines add up to that were strewn without regard for each other, and cover so much."""
    return FAINTEST - np.log1p(-np.minimum(tone, DARKEST))


def _blurred(values: np.ndarray, domain: Domain) -> np.ndarray:
    space = Space.of(domain)
    if space.has_straight_ways:
        return gaussian_blur(values, BLUR)
    rows, columns = (min(math.ceil(4.0 * BLUR), n) for n in values.shape)
    return gaussian_blur(space.padded(values, rows, columns), BLUR)[rows:-rows, columns:-columns]


class _Cells(NamedTuple):
    """Cells along y and x, and samples of each."""

    shape: tuple[int, int]
    samples: tuple[int, int]


class _Drawing:
    """The strokes of a class's bodies, and what they cover.

    Attributes:
        cells: Rows and columns of cells; the first row is the lowest.
        factor: On the width of every body, on the device.
    """

    def __init__(self, placement: Placement, own: np.ndarray, adapts: np.ndarray, launcher: Launcher) -> None:
        domain = placement.problem.rectangle
        self._launcher = launcher
        width = placement.width[own]
        self.cells, self._per_cell = _cells(domain, len(own), float(width[adapts].mean()))
        count = [cells * many for cells, many in zip(self.cells, self._per_cell, strict=True)]
        # In steps between samples, which all fit float32.
        unit = max(domain.size[1] / count[0], domain.size[0] / count[1])
        self._samples = kernels_ink.Samples()
        self._samples.rows, self._samples.columns = count
        self._samples.step = wp.vec2(domain.size[0] / count[1] / unit, domain.size[1] / count[0] / unit)
        self._samples.space = Space.of(domain, unit).for_kernels()

        position, half = placement.position[own], 0.5 * placement.length[own]
        half = half[:, None] * np.stack([np.cos(placement.angle[own]), np.sin(placement.angle[own])], axis=1)
        half[width <= 0.0] = 0.0
        radius = placement.radius[own]
        a, b, body = position - half, position + half, np.arange(len(own))
        if placement.bends is not None:
            bends = placement.bends[own]
            straight = ~np.isfinite(bends[:, 0, 0])
            there = np.isfinite(bends[:, 1:, 0])
            a = np.concatenate([a[straight], bends[:, :-1][there]])
            b = np.concatenate([b[straight], bends[:, 1:][there]])
            body = np.concatenate([body[straight], np.nonzero(there)[0]])
        self._strokes = kernels_ink.Strokes()
        self._strokes.a, self._strokes.b = (
            launcher.array((ends / unit).astype(np.float32), wp.vec2) for ends in (a, b)
        )
        self._strokes.radius = launcher.array((radius[body] / unit).astype(np.float32), float)
        self._strokes.body = launcher.array(body.astype(np.int32), wp.int32)
        self._stroke_count = len(body)
        self._middle, self._half = (
            launcher.array((values / unit).astype(np.float32), wp.vec2) for values in (position, half)
        )
        self._adapts = launcher.array(adapts.astype(np.uint8), wp.uint8)
        self._covered = launcher.zeros(count[0] * count[1], wp.uint8)
        self._count = launcher.zeros(self.cells[0] * self.cells[1], wp.int32)
        self.factor = launcher.zeros(len(own), float)

    def set_factors(self, of_cell: np.ndarray) -> None:
        """Take every body's factor from those of the cells."""
        self._launcher.launch(
            kernels_ink.find_factors,
            len(self._adapts),
            [
                self._middle,
                self._half,
                self._adapts,
                self._launcher.array(of_cell.astype(np.float32).ravel(), float),
                *of_cell.shape,
                self._samples.space,
            ],
            [self.factor],
        )

    def draw(self, of_cell: np.ndarray) -> np.ndarray:
        """Share of every cell that is covered, shape ``cells``, with these factors."""
        self.set_factors(of_cell)
        self._launcher.launch(
            kernels_ink.draw_strokes,
            self._stroke_count,
            [self._strokes, self.factor, self._samples],
            [self._covered],
            grain=GRAIN_OF_NEIGHBORS,
        )
        up, across = self._per_cell
        self._launcher.launch(
            kernels_ink.count_covered,
            self.cells[0] * self.cells[1],
            [self.cells[1], across, up],
            [self._covered, self._count],
            grain=GRAIN_OF_NEIGHBORS,
        )
        return self._count.numpy().reshape(self.cells) / (up * across)


def _cells(domain: Domain, count: int, width: float) -> _Cells:
    """Cells as large as ``count`` bodies have ground, with enough samples to show lines of a ``width`` [m]."""
    edge = math.sqrt(domain.area / count)
    shape = tuple(max(1, round(length / edge)) for length in domain.size[::-1])
    sides = [length / cells for length, cells in zip(domain.size[::-1], shape, strict=True)]
    pitch = max(width / SAMPLES_ACROSS, math.sqrt(domain.area / MOST_SAMPLES))
    samples = tuple(min(max(math.ceil(side / pitch), FEWEST_OF_CELL), MOST_OF_CELL) for side in sides)
    return _Cells((shape[0], shape[1]), (samples[0], samples[1]))
