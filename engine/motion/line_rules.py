"""What the lines of a problem are to do: directions, lengths and weights, one set per size that is a line.

Section 6 of the paper (Schmaltz, Gwosdek and Weickert 2012).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.body_flags import BodyFlags
from ..model.model import LineKind, Model
from ..problem.direction_field import direction_field
from ..problem.domain import Domain
from ..problem.line import Line
from ..space.density import sample_density
from . import kernels_lines

__all__ = [
    "FIRST_LENGTH",
    "LineRules",
    "first_length_factors",
    "length_blocks",
    "numbers_for_kernels",
    "pressed_of",
    "weights_of",
]

# Lines start at this share of their preferred length: short enough not to cross, and grow while they spread.
FIRST_LENGTH = 0.1
# Side of the blocks in which lines get their lengths, in spacings of lines: a block has some dozens of them.
BLOCK = 6.0


def numbers_for_kernels(launcher: Launcher, values: Sequence[float] | np.ndarray) -> wp.array:
    """Return numbers on the device, ``float``, for kernels to read; a single 0 where there are none."""
    if not len(values):
        return launcher.shared(("no numbers",), lambda: launcher.own_array(np.zeros(1, np.float32), float))
    return launcher.array(np.array(values, np.float32), float)


def first_length_factors(launcher: Launcher, count: int) -> wp.array:
    """Return factors of 1 on preferred lengths, which steps will change; a single one where there are none."""
    return launcher.own_array(np.ones(max(count, 1), np.float32), float)


def weights_of(rules: Sequence[Line], launcher: Launcher) -> kernels_lines.Lines:
    """Return how far kinds of lines follow forces and what is preferred, and how straight they are; nothing else is set."""
    lines = kernels_lines.Lines()
    lines.turn_by_force, lines.turn_by_preference, lines.stretch_by_force, lines.stretch_by_preference = (
        numbers_for_kernels(launcher, [getattr(line, weights)[k] for line in rules])
        for weights in ("turn_weights", "stretch_weights")
        for k in (0, 1)
    )
    straightness = [-1.0 if line.straightness is None else line.straightness for line in rules]
    lines.straightness = numbers_for_kernels(launcher, straightness)
    return lines


def pressed_of(rules: Sequence[Line], launcher: Launcher) -> wp.array:
    """Return 1 for kinds whose length the forces change: a line of others reaches its length by itself."""
    return numbers_for_kernels(launcher, [float(line.stretch_weights[0] > 0.0) for line in rules])


class LineRules:
    """Rules for the kernels; every size with a line is one kind.

    Args:
        model: What is to be placed.
        launcher: Where the arrays are to be.

    Attributes:
        kind_count: Number of kinds.
        lines: The rules as kernels take them.
        line_count: Number of bodies of every kind that are not pinned, on the device.
        pressed: 1 for kinds whose length the forces change, on the device.
        block_count: Blocks of all kinds in which lines get lengths of their own.
    """

    def __init__(self, model: Model, launcher: Launcher) -> None:
        self._model = model
        problem = model.problem
        rules = [kind.line for kind in model.kinds]
        self.kind_count = len(rules)
        if not rules:
            # Nobody reads what lines are to do then.
            self._directions, self._lengths, self.block_count = [], [], 0
            self.lines = kernels_lines.Lines()
            self.lines.length_factor = launcher.array(np.ones(1, np.float32), float)
            self.line_count = self.pressed = numbers_for_kernels(launcher, [])
            return
        made: dict[tuple[object, ...], np.ndarray] = {}
        self._directions = [_directions_of(kind, problem.rectangle, made) for kind in model.kinds]
        self._lengths = [np.atleast_2d(np.asarray(line.length, dtype=np.float32)) for line in rules]

        lines = weights_of(rules, launcher)
        blocks = length_blocks(model)
        self.block_count = sum(rows * columns for rows, columns in blocks)
        lines.length_factor = first_length_factors(launcher, len(rules) + self.block_count)
        starts = np.cumsum([len(rules)] + [rows * columns for rows, columns in blocks])[: len(rules)]
        lines.block_start, lines.block_rows, lines.block_columns = (
            launcher.array(np.array(values, np.int32).reshape(-1), wp.int32)
            for values in (starts, [rows for rows, _ in blocks], [columns for _, columns in blocks])
        )
        lines.direction, *shape = _joined(launcher, self._directions, wp.vec2)
        lines.direction_start, lines.direction_height, lines.direction_width = shape
        lines.length, *shape = _joined(launcher, [length / model.unit for length in self._lengths], float)
        lines.length_start, lines.length_height, lines.length_width = shape
        self.lines = lines
        # Those that are pinned keep their lengths.
        moving = model.body.kind[(model.body.flags & BodyFlags.PINNED) == 0]
        self.line_count = numbers_for_kernels(launcher, np.bincount(moving + 1, minlength=self.kind_count + 1)[1:])
        self.pressed = pressed_of(rules, launcher)

    def first_angle_and_length(self, position: np.ndarray, share: float = FIRST_LENGTH) -> np.ndarray:
        """Angle [rad] and length of every body at the start, shape ``[body_count, 2]``, for positions in the solver's unit.

        Lengths are so large a ``share`` of those that are asked for.
        """
        result = np.zeros((len(position), 2))
        model = self._model
        size = model.problem.rectangle.size
        rng = np.random.default_rng([model.problem.seed, 3])
        for kind in range(self.kind_count):
            own = np.flatnonzero(model.body.kind == kind)
            meters = position[own].astype(np.float64) * model.unit
            angle = rng.uniform(0.0, math.pi, len(own))
            preferred = sample_density(self._directions[kind], meters, size)
            led = (preferred**2).sum(axis=1) > 0.0
            angle[led] = 0.5 * np.arctan2(preferred[led, 1], preferred[led, 0])
            result[own, 0] = angle
            result[own, 1] = share * sample_density(self._lengths[kind], meters, size) / model.unit
        return result

    def without_room(self, pose: np.ndarray, step: float) -> np.ndarray:
        """Which bodies are lines that lie across what is no support, bool, shape ``[body_count]``.

        Args:
            pose: Where bodies are, in the solver's unit, shape ``[body_count, 4]``.
            step: Distance of the points of a line that are looked at, in that unit.
        """
        model, result = self._model, np.zeros(len(pose), bool)
        lines = np.flatnonzero(model.body.kind >= 0)
        extent = np.array(model.size)
        for number in np.unique(model.body.support[lines]).tolist():
            own = lines[model.body.support[lines] == number]
            image = model.supports[number]
            height, width = image.shape
            count = int(np.ceil(pose[own, 3].max(initial=0.0) / step)) + 1
            along = np.stack([np.cos(pose[own, 2]), np.sin(pose[own, 2])], axis=1) * pose[own, 3:4]
            for share in np.linspace(-0.5, 0.5, max(count, 2)):
                at = model.space.wrapped(pose[own, :2] + share * along) / extent
                column = np.clip((at[:, 0] * width).astype(np.int64), 0, width - 1)
                row = np.clip(((1.0 - at[:, 1]) * height).astype(np.int64), 0, height - 1)
                result[own] |= image[row, column] <= 0.0
        return result

    def fixed_angle_and_length(self) -> np.ndarray:
        """Angle [rad] and length of every fixed body in the solver's unit, shape ``[fixed bodies, 2]``; 0 for dots."""
        model = self._model
        table = model.problem.fixed
        result = np.zeros((len(table.id), 2))
        kinds = model.body.kind[model.fixed]
        for kind in range(self.kind_count):
            own = kinds == kind
            asked = sample_density(self._lengths[kind], table.position[own], model.problem.rectangle.size)
            length = np.where(np.isnan(table.length[own]), asked, table.length[own])
            result[own] = np.stack([table.angle[own], length / model.unit], axis=1)
        return result


def length_blocks(model: Model) -> list[tuple[int, int]]:
    """Rows and columns of blocks in which kinds of lines get their lengths; none for one length in an even density, or in contact.

    Forces stretch lines to where there are few, so that one factor for all would leave them longer in light parts of a picture than
    in dark ones. Lengths that no force changes have no blocks, either.
    """
    result: list[tuple[int, int]] = []
    if not model.kinds:
        return result
    domain = model.problem.rectangle
    count = np.bincount(model.body.kind + 1, minlength=len(model.kinds) + 1)[1:]
    for kind, many in zip(model.kinds, count.tolist(), strict=True):
        line = kind.line
        # What keeps apart has its length from contact, too.
        alike = model.problem.avoid_overlap or kind.body_class.density_image.size == 1
        even = line.longest == line.shortest and alike
        if even or line.stretch_weights[0] <= 0.0:
            result.append((0, 0))
            continue
        side = BLOCK * math.sqrt(domain.area / max(many, 1))
        width, height = (max(1, round(length / side)) for length in domain.size)
        result.append((height, width))
    return result


def _directions_of(kind: LineKind, domain: Domain, made: dict[tuple[object, ...], np.ndarray]) -> np.ndarray:
    """Desired directions of a kind, as :class:`DirectionField` gives them to kernels; those of equal preferences are ``made`` once."""
    line, image = kind.line, kind.body_class.density_image
    assert not callable(line.direction)
    preferred = line.direction if isinstance(line.direction, (str, float)) else id(line.direction)
    key = (preferred, id(image), *line.tensor_scales)
    if key not in made:
        height, width = image.shape
        field = direction_field(
            line.direction, image, *line.tensor_scales, pixel_size=(domain.size[0] / width, domain.size[1] / height)
        )
        made[key] = field.double_angle_vectors()
    return made[key]


def _joined(launcher: Launcher, images: list[np.ndarray], kind: type) -> tuple[wp.array, wp.array, wp.array, wp.array]:
    """Images one after the other on the device, each once: pixels, where each starts, heights and widths."""
    channels = (2,) if kind is wp.vec2 else ()
    distinct = list({id(image): image for image in images}.values())
    pixels = np.concatenate([np.asarray(image, np.float32).reshape(-1, *channels) for image in distinct])
    ends = np.cumsum([image.shape[0] * image.shape[1] for image in distinct])
    first = {id(image): end - image.shape[0] * image.shape[1] for image, end in zip(distinct, ends, strict=True)}
    numbers = ([first[id(image)] for image in images], *([image.shape[axis] for image in images] for axis in (0, 1)))
    start, height, width = (launcher.array(np.array(n, np.int32), wp.int32) for n in numbers)
    return launcher.array(pixels, kind), start, height, width
