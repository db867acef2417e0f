"""The outlines of a size's bodies: which of them every body has, how large it is and how it is turned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from . import validation
from .footprint import Footprint
from .given_values import FOREIGN_ERRORS, as_float, as_tuple, is_real, show
from .settings import Settings, belongs_to, described, setting

__all__ = ["DrawnFootprints", "Footprints", "checked_footprints"]

# Turns of a long body about its axis: its frame lies along it, or the other way round.
ALONG_THE_AXIS = 1e-6
# Largest rise of the ground over a meter.
STEEPEST = 100.0
# Factors on outlines, far from what float32 cannot tell from nothing.
SMALLEST_SCALE, LARGEST_SCALE = 1e-9, 1e9
# Beyond this an angle [rad] has no digits left that say where it points.
LARGEST_ANGLE = 1e9


@dataclass(frozen=True, eq=False)
class DrawnFootprints:
    """What was drawn for the bodies of a size.

    Attributes:
        variant: Which of the variants it is, shape ``[n]``, int32.
        scale: Factor on the variant's outline, shape ``[n]``, float64.
        turn: Turn that it starts with, or has [rad], shape ``[n]``, float64.
    """

    variant: np.ndarray
    scale: np.ndarray
    turn: np.ndarray

    def chosen(self, which: np.ndarray) -> DrawnFootprints:
        """Those of some bodies: indices, or a truth value for each."""
        return DrawnFootprints(self.variant[which], self.scale[which], self.turn[which])


def _check_variants(value: object, key: str) -> tuple[Footprint, ...]:
    variants = as_tuple((value,) if isinstance(value, Footprint) else value, Footprint, key)
    if not variants:
        raise ProblemError(f"{key} must hold at least one Footprint; got none")
    return variants


def _check_weights(value: object, key: str) -> tuple[float, ...]:
    accepted = "a number of 0 or more for each variant"
    weights = _numbers(value, key, accepted)
    if not (weights >= 0.0).all() or not weights.sum() > 0.0:
        raise ProblemError(f"{key} must be {accepted}, and one above 0; got {show(value)}")
    return tuple(weights.tolist())


def _check_variant(value: object, key: str) -> np.ndarray:
    index = _numbers(value, key, "the number of a variant for each body")
    if not ((index >= 0) & (index < 2**31) & (index == np.floor(index))).all():
        raise ProblemError(f"{key} must hold whole numbers of 0 or more; got {show(value)}")
    return _kept(index.astype(np.int32))


def _check_scale(value: object, key: str) -> float | np.ndarray:
    accepted = "a factor above 0, or one for each body"
    single = is_real(value)
    scale = validation.check_positive(value, key) if single else _kept(_numbers(value, key, accepted))
    factors = np.atleast_1d(scale)
    outside = factors[~((factors >= SMALLEST_SCALE) & (factors <= LARGEST_SCALE))]
    if len(outside):
        raise ProblemError(f"{key} must lie between {SMALLEST_SCALE:g} and {LARGEST_SCALE:g}; got {outside[0]:g}")
    return scale


def _check_jitter(value: object, key: str) -> float:
    jitter = validation.check_at_least_zero(value, key)
    if not jitter < 1.0:
        raise ProblemError(f"{key} must be below 1; got {jitter:g}")
    return jitter


def _check_turn(value: object, key: str) -> str | float | np.ndarray:
    accepted = '"free", "random", an angle in radians, or one for each body'
    if isinstance(value, str):
        if value not in ("free", "random"):
            raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
        return value
    if is_real(value):
        number = as_float(value)
        if number is None or not abs(number) <= LARGEST_ANGLE:
            raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
        return number
    angles = _numbers(value, key, accepted)
    if not (np.abs(angles) <= LARGEST_ANGLE).all():
        raise ProblemError(f"{key} must be at most {LARGEST_ANGLE:g} radians; got {np.abs(angles).max():g}")
    return _kept(angles)


def _check_slope(value: object, key: str) -> np.ndarray:
    accepted = f"an image of slopes, shape [rows, columns, 2], of at most {STEEPEST:g} meters per meter"
    try:
        slope = None if isinstance(value, (str, bytes)) else np.asarray(value)
    except FOREIGN_ERRORS:
        slope = None
    if slope is None or slope.ndim != 3 or slope.shape[2] != 2 or not slope.size or slope.dtype.kind not in "uif":
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    if slope.dtype != np.float32 or slope.flags.writeable or slope.base is not None:
        # Nobody changes it; what is kept already stays one image for all sizes.
        slope = slope.astype(np.float32)
    # NaN is neither.
    if not (slope.min() >= -STEEPEST and slope.max() <= STEEPEST):
        raise ProblemError(f"{key} must be {accepted}; it holds {float(np.abs(slope).max()):g}")
    return _kept(slope)


@belongs_to("problem")
@described
@dataclass(frozen=True, eq=False)
class Footprints(Settings):
    """The outlines of a size's bodies: which each of them has, how large it is and how it is turned.

    Raises:
        ProblemError: A value outside these ranges.
    """

    variants: Footprint | Sequence[Footprint] = field(
        metadata=setting("The outlines that there are, one or several", check=_check_variants)
    )
    weights: Sequence[float] | np.ndarray | None = field(
        default=None,
        metadata=setting(
            "How often each variant is drawn",
            more="A number of 0 or more for each; None: all as often",
            check=_check_weights,
        ),
    )
    variant: np.ndarray | Sequence[int] | None = field(
        default=None,
        metadata=setting("The variant of every body", more="Shape ``[count]``; None draws them", check=_check_variant),
    )
    scale: float | np.ndarray | Sequence[float] | None = field(
        default=None,
        metadata=setting(
            "Factor on every body's outline",
            more="A number or shape ``[count]``; None: 1, and for a size whose area is a range what gives the body its area",
            check=_check_scale,
        ),
    )
    scale_jitter: float = field(
        default=0.0,
        metadata=setting(
            "Outlines are scaled by a random factor within 1 ± this, below 1",
            unit="share",
            low=0.0,
            check=_check_jitter,
        ),
    )
    turn: str | float | np.ndarray | Sequence[float] = field(
        default="free",
        metadata=setting(
            "How bodies are turned",
            unit="rad",
            more='``"free"``: the solver may turn bodies so that they fit; ``"random"``: drawn before solving; an angle; or one for '
            'every body, shape ``[count]``. Of a line the frame lies along the axis: ``"free"`` and 0 leave it so, ``"random"`` turns '
            "half of the bodies round, and an array holds 0 or pi",
            check=_check_turn,
        ),
    )
    may_turn: bool | None = field(
        default=None,
        metadata=setting(
            "Whether the solver may turn bodies on from ``turn``, so that they fit",
            more='None: where that is ``"free"``. Lines turn with their axes',
            check=validation.check_switch,
        ),
    )
    room: float = field(
        default=1.0,
        metadata=setting(
            "Factor on the outlines for keeping apart", low=validation.SMALLEST_ROOM, high=validation.LARGEST_ROOM
        ),
    )
    gap: float = field(
        default=0.0,
        metadata=setting(
            "Distance that outlines keep from each other, instead of ``room``",
            unit="m",
            low=0.0,
            high=validation.LARGEST_LENGTH,
        ),
    )
    slope: np.ndarray | None = field(
        default=None,
        metadata=setting(
            "How far the ground rises for each meter along x and y, where bodies lean with it",
            more="Their outlines lie in planes of this slope, and are foreshortened in the domain. An image stretched over it, "
            "shape ``[rows, columns, 2]``, row 0 at the largest y; None: they are horizontal. Discs and the round of other outlines "
            "stay as large as they are",
            check=_check_slope,
        ),
    )
    tilt: float = field(
        default=0.0,
        metadata=setting(
            "Largest random lean of a body, in any direction, beside that of the ground. Its outline lies in the plane that leans so",
            more="At most a right angle: of what is turned over the outline would be another one",
            unit="rad",
            low=0.0,
            high=0.5 * math.pi,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        number = len(self.outlines)
        if self.weights is not None and len(self.weights) != number:
            raise ProblemError(
                f"{self._key('weights')} must be a number of 0 or more for each of the {number} variants; got {show(self.weights)}"
            )
        if self.variant is not None and np.max(self.variant) >= number:
            raise ProblemError(
                f"{self._key('variant')} must hold whole numbers from 0 to {number - 1}; got {show(self.variant)}"
            )
        if self.room != 1.0 and self.gap != 0.0:
            raise ProblemError(f"{self._key('room')} cannot be combined with a `gap`; got {self.room:g}")
        self._check_lengths()

    def _key(self, name: str) -> str:
        return f"`{name}` of footprints"

    def _check_lengths(self) -> None:
        lengths = {
            name: len(value)
            for name, value in (("variant", self.variant), ("scale", self.scale), ("turn", self.turn))
            if isinstance(value, np.ndarray)
        }
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"`{name}` has {length}" for name, length in lengths.items())
            raise ProblemError(f"arrays of footprints must all have one entry per body; {told}")

    @property
    def outlines(self) -> tuple[Footprint, ...]:
        """The variants."""
        return self.variants  # type: ignore[return-value]

    @property
    def is_free(self) -> bool:
        """Whether the solver may turn bodies that are no lines."""
        return isinstance(self.turn, str) and self.turn == "free" if self.may_turn is None else self.may_turn

    @property
    def body_count(self) -> int | None:
        """Number of bodies that arrays are given for; None where there is no array."""
        for value in (self.variant, self.scale, self.turn):
            if isinstance(value, np.ndarray):
                return len(value)
        return None

    @property
    def mean_area(self) -> float:
        """Mean area of the outlines that bodies get [m²]."""
        area = np.array([outline.area for outline in self.outlines])
        square = np.array(1.0 if self.scale is None else self.scale, dtype=np.float64) ** 2
        square = square * (1.0 + self.scale_jitter**2 / 3.0)
        if self.variant is not None:
            return float(np.mean(area[np.asarray(self.variant)] * square))
        weights = np.ones(len(area)) if self.weights is None else np.array(self.weights)
        return float(area @ weights / weights.sum()) * float(np.mean(square))

    @property
    def area_span(self) -> tuple[float, float]:
        """Smallest and largest area that a body's outline may have [m²]."""
        area = np.array([outline.area for outline in self.outlines])
        if self.variant is not None:
            area = area[np.asarray(self.variant)]
        elif self.weights is not None:
            area = area[np.array(self.weights) > 0.0]
        scale = np.array(1.0 if self.scale is None else self.scale, dtype=np.float64)
        low, high = 1.0 - self.scale_jitter, 1.0 + self.scale_jitter
        if self.variant is not None and scale.ndim:
            area = area * scale**2
            return float(area.min() * low**2), float(area.max() * high**2)
        return float(area.min() * (scale.min() * low) ** 2), float(area.max() * (scale.max() * high) ** 2)

    def draw(self, count: int, seed: Sequence[int], area: np.ndarray | None, long: bool) -> DrawnFootprints:
        """Draw what is not given for every body.

        Args:
            count: Number of bodies.
            seed: Of the stream that is drawn from.
            area: Areas that the outlines are to have [m²], shape ``[count]``; None leaves them as large as they are.
            long: Whether the bodies are lines.
        """
        # Three numbers for each body, in their order: a longer list of bodies leaves the earlier ones as they are.
        random = np.random.default_rng(seed).random((count, 3))
        number = len(self.outlines)
        if self.variant is not None:
            # Given for fixed bodies, too, where counts include them; those come last.
            variant = np.asarray(self.variant)[:count]
        elif self.weights is None:
            variant = np.minimum((random[:, 0] * number).astype(np.int32), number - 1)
        else:
            steps = np.cumsum(np.array(self.weights)) / sum(self.weights)
            last = int(np.flatnonzero(np.array(self.weights) > 0.0)[-1])
            variant = np.minimum(np.searchsorted(steps, random[:, 0], side="right"), last).astype(np.int32)
        scale = 1.0 + self.scale_jitter * (2.0 * random[:, 1] - 1.0)
        if self.scale is not None:
            scale = scale * (self.scale[:count] if isinstance(self.scale, np.ndarray) else np.float64(self.scale))  # type: ignore[arg-type]
        elif area is not None:
            scale = scale * np.sqrt(area / np.array([outline.area for outline in self.outlines])[variant])
        if isinstance(self.turn, str):
            turn = 2.0 * math.pi * random[:, 2]
            if long:
                turn = np.where((random[:, 2] < 0.5) | (self.turn == "free"), 0.0, math.pi)
        else:
            turn = np.array(np.asarray(self.turn, dtype=np.float64)[..., :count] if np.ndim(self.turn) else self.turn)
            turn = np.broadcast_to(turn, count).astype(np.float64)
        return DrawnFootprints(variant, scale, turn)


def checked_footprints(value: object, where: str, count: int | None, long: bool) -> Footprints:
    """Return what a size was given as footprints.

    Args:
        value: A Footprint, several, or Footprints.
        where: What messages call the size.
        count: Number of its bodies, None where it has a share instead.
        long: Whether they are lines.
    """
    if isinstance(value, Footprints):
        footprints = value
    elif isinstance(value, Footprint) or (isinstance(value, Sequence) and not isinstance(value, str)):
        footprints = Footprints(value)
    else:
        raise ProblemError(
            f"`footprint` {where} must be a Footprint, a list of them, Footprints, or None; got {show(value)}"
        )
    given = footprints.body_count
    if given is not None and count is not None and given != count:
        raise ProblemError(f"arrays of the `footprint` {where} must have one entry per body, {count}; got {given}")
    if given is not None and count is None:
        raise ProblemError(
            f"arrays of the `footprint` {where} need a `count` of the size; it has a share of the class instead"
        )
    if long and not isinstance(footprints.turn, str):
        angle = np.asarray(footprints.turn, dtype=np.float64)
        if not (np.abs(np.sin(angle)) <= ALONG_THE_AXIS).all():
            raise ProblemError(
                f'`turn` of the `footprint` {where} must be "free", "random", 0 or pi, because its bodies are lines; '
                f"got {show(footprints.turn)}"
            )
    return footprints


def _numbers(value: object, key: str, accepted: str) -> np.ndarray:
    """Return a new list of finite numbers, float64."""
    try:
        values = None if isinstance(value, (str, bytes)) else np.array(value)
    except FOREIGN_ERRORS:
        values = None
    if values is None or values.ndim != 1 or not values.size or values.dtype.kind not in "uif":
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}")
    values = values.astype(np.float64)
    if not np.isfinite(values).all():
        raise ProblemError(f"{key} must be finite; it holds NaN or infinity")
    return values


def _kept(values: np.ndarray) -> np.ndarray:
    """Return an array that nobody changes any more."""
    values.flags.writeable = False
    return values
