"""The energy of a few bodies, by direct summation in float64: which of several starts ended best.

It is that of the descent without its blur: E = 1/2 sum M[g, h] <rho_g - u_g, K (rho_h - u_h)>, with K = -log r, less what no place of
the bodies changes. In an open domain log r is integrated over the cells of the targets exactly; where a domain repeats itself or is
mirrored, E is a sum over waves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..field.field_targets import FieldTarget
from ..space.density import box_integrals
from .attraction import group_targets
from .model import Model

__all__ = ["Energy"]

# Targets are averaged over so many cells along a side: bodies are few, and a cell is far smaller than the ground of each.
MOST_CELLS = 32
# Corners of cells, seen from several positions, that are worked out together: as many as a processor's cache holds.
CORNERS_AT_ONCE = 1 << 12
# Waves down to a length of 2 pi times SHORTEST_WAVE are summed, damped as if charges were Gaussians of WIDTH, both over the spacing of
# charges: the shortest then count 1e-4 of what they would undamped.
SHORTEST_WAVE, WIDTH = 0.05, 0.15
# Squares of distances, over that of the unit, that stand for 0 in a logarithm: between charges, and between a charge and a corner of a
# cell, where what it is multiplied by is 0.
NO_DISTANCE, AT_CORNER = 1e-12, 1e-24


class Energy:
    """Energies of bodies of a model, wherever they are.

    Args:
        model: What is placed, in a rectangle.

    Attributes:
        scale: Energies over this are energies a body, whatever charges and factors between groups are.
    """

    def __init__(self, model: Model) -> None:
        domain = model.problem.rectangle
        self._model = model
        self._mirrored = domain.mirrored
        self._repeats = domain.mirrored or not model.space.has_straight_ways
        self._charge = model.charge.charge.astype(np.float64)
        self._body = model.charge.body
        self._group = model.body.group[self._body]
        self._matrix = model.interaction
        # What a typical body contributes: the square of its charge, as its own group sees it.
        own = self._matrix.diagonal()[model.body.group]
        self.scale = float((own * model.body_charge**2).sum())
        self._targets = [self._cells(target) for target in group_targets(model)]
        if self._repeats:
            self._prepare_waves()

    def of(self, position: np.ndarray) -> float:
        """Energy of charges at ``position``, in the model's unit, shape ``[charges, 2]``; only differences mean something."""
        position = position.astype(np.float64)
        return self._of_waves(position) if self._repeats else self._of_pairs(position)

    def _cells(self, target: FieldTarget) -> np.ndarray:
        """Charge of a group's target in every cell, shape ``[rows, columns]``, row 0 at the bottom."""
        images = [target, *target.more]
        rows, columns = (min(MOST_CELLS, max(part.image.shape[axis] for part in images)) for axis in (0, 1))
        return np.sum([part.charge * box_integrals(part.image, (rows, columns)) for part in images], axis=0)

    def _of_pairs(self, position: np.ndarray) -> float:
        """Energy in an open domain: of every two charges, and of each with the targets."""
        between = self._matrix[np.ix_(self._group, self._group)] * self._charge[:, None] * self._charge
        between[self._body[:, None] == self._body] = 0.0
        squared = ((position[:, None] - position) ** 2).sum(axis=2)
        result = -0.25 * float((between * np.log(np.maximum(squared, NO_DISTANCE))).sum())
        for group, potential in enumerate(_potentials(position, self._targets, self._model.size)):
            seen = self._matrix[self._group, group] * self._charge
            result += float((seen * potential).sum())
        return result

    def _prepare_waves(self) -> None:
        """Lay out the wave vectors of the domain, or of the one with its mirror images, and what targets have of each wave."""
        factor = 2.0 if self._mirrored else 1.0
        size = factor * np.array(self._model.size)
        spacing = math.sqrt(float(np.prod(self._model.size)) / len(self._charge))
        most = [math.ceil(length / (2.0 * math.pi * SHORTEST_WAVE * spacing)) for length in size]
        # Of a wave and its opposite one is enough.
        x, y = (m.ravel() for m in np.meshgrid(np.arange(-most[0], most[0] + 1), np.arange(0, most[1] + 1)))
        half = (y > 0) | (x > 0)
        number = np.stack([x[half], y[half]], axis=1)
        wave = 2.0 * math.pi * number / size
        squared = (wave**2).sum(axis=1)
        near = squared * (SHORTEST_WAVE * spacing) ** 2 <= 1.0
        self._wave, number, squared = wave[near], number[near], squared[near]
        self._weight = 2.0 * math.pi / (squared * size.prod()) * np.exp(-squared * (WIDTH * spacing) ** 2) / factor**2
        self._of_targets = [self._waves_of(target, number) for target in self._targets]

    def _waves_of(self, target: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Amplitudes of a target, whose cells are rectangles of even charge, shape ``[waves]``."""
        if self._mirrored:
            target = np.block([[target, target[:, ::-1]], [target[::-1], target[::-1, ::-1]]])
        rows, columns = target.shape
        spectrum = np.fft.fft2(target)[number[:, 1] % rows, number[:, 0] % columns]
        turn = np.exp(-1j * math.pi * (number[:, 0] / columns + number[:, 1] / rows))
        return spectrum * turn * np.sinc(number[:, 0] / columns) * np.sinc(number[:, 1] / rows)

    def _of_waves(self, position: np.ndarray) -> float:
        """Energy in a domain that repeats itself, or with its mirror images: of every wave of what is off its target."""
        group, charge = self._group, self._charge
        if self._mirrored:
            width, height = self._model.size
            x = np.concatenate([position[:, 0], 2.0 * width - position[:, 0]] * 2)
            y = np.repeat(np.stack([position[:, 1], 2.0 * height - position[:, 1]]), 2, axis=0).ravel()
            position = np.stack([x, y], axis=1)
            group, charge = np.tile(group, 4), np.tile(charge, 4)
        amplitudes = []
        for g, target in enumerate(self._of_targets):
            own = group == g
            phase = self._wave[:, :1] * position[own, 0] + self._wave[:, 1:] * position[own, 1]
            amplitudes.append((np.exp(-1j * phase) * charge[own]).sum(axis=1) - target)
        result = 0.0
        for g, one in enumerate(amplitudes):
            for h, other in enumerate(amplitudes):
                result += float(self._matrix[g, h] * (self._weight * (one * other.conj()).real).sum())
        return result


def _potentials(position: np.ndarray, targets: Sequence[np.ndarray], size: tuple[float, float]) -> list[np.ndarray]:
    """Sums of log r over the cells of every target at positions, exact for cells of even charge; shape ``[n]`` each."""
    result = [np.empty(len(position)) for _ in targets]
    # Targets of as many cells have them at the same places.
    for rows, columns in sorted({target.shape for target in targets}):
        own = [number for number, target in enumerate(targets) if target.shape == (rows, columns)]
        x = np.arange(columns + 1) * size[0] / columns
        y = np.arange(rows + 1) * size[1] / rows
        area = size[0] * size[1] / (rows * columns)
        at_once = max(1, CORNERS_AT_ONCE // ((rows + 1) * (columns + 1)))
        for first in range(0, len(position), at_once):
            some = position[first : first + at_once, :, None, None]
            corner = _corner(x - some[:, 0], y[:, None] - some[:, 1])
            cells = corner[:, 1:, 1:] - corner[:, 1:, :-1] - corner[:, :-1, 1:] + corner[:, :-1, :-1]
            for number in own:
                result[number][first : first + at_once] = [(targets[number] * of_one).sum() / area for of_one in cells]
    return result


def _corner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Integral of log r over rectangles from the origin to (x, y), signed."""
    squared = np.maximum(x * x + y * y, AT_CORNER)
    # The angles are those of y / x and x / y, also where one of them is 0.
    wide, high = (np.broadcast_to(np.abs(one), squared.shape).copy() for one in (x, y))
    upward = np.arctan2(y * np.sign(x), wide) * x * x
    sideward = np.arctan2(x * np.sign(y), high) * y * y
    return 0.5 * (x * y * (np.log(squared) - 3.0) + upward + sideward)
