"""Inks: separating a color image into channels, and the halftoning problem that they pose.

The method is section 5 of the paper (Schmaltz, Gwosdek and Weickert 2012), with its figures 7 and 13.

Colors mix subtractively: an ink is described by how much of cyan, magenta and yellow it holds, so red is (0, 1, 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ProblemError
from .apportionment import apportion
from .balance import Balance
from .body_class import BodyClass
from .domain import Domain
from .given_values import FOREIGN_ERRORS, as_tuple, check_unique, show
from .ink_models import DEFAULT_MODEL, INK_MODELS
from .prepared_class import prepare, prepare_density
from .problem import Problem
from .settings import settle
from .size import Size
from .validation import check_name, check_non_overlap

__all__ = ["MODELS", "Ink", "InkModel", "halftone_problem", "ink_colors", "separate"]


@dataclass(frozen=True)
class Ink:
    """An ink of an :class:`InkModel`.

    Args:
        name: Unique within its model.
        cmy: Whether the ink contains cyan, magenta and yellow: three numbers, each 0 or 1, not all 0. Red is (0, 1, 1).
    """

    name: str
    cmy: tuple[int, int, int]

    def __post_init__(self) -> None:
        check_name(self.name, "`name` of an ink")
        try:
            given = tuple(self.cmy)
            parts = tuple(int(part) for part in given if part in (0, 1))
        except FOREIGN_ERRORS:
            given, parts = (), ()
        if len(given) != 3 or len(parts) != 3 or not any(parts):
            raise ProblemError(
                f'`cmy` of ink "{self.name}" must be three of 0 and 1 (cyan, magenta, yellow), not all 0; got {show(self.cmy)}'
            )
        settle(self, cmy=parts)

    @property
    def rgb(self) -> tuple[float, float, float]:
        """Color of the ink on white paper."""
        cyan, magenta, yellow = self.cmy
        return 1.0 - cyan, 1.0 - magenta, 1.0 - yellow


@dataclass(frozen=True, eq=False)
class InkModel:
    """A list of inks, and whose dots make room for each other (the paper's non-overlap map).

    Args:
        name: E.g. ``"CMYK"``.
        inks: At least one; cyan, magenta and yellow themselves must be among them, so that every color can be made.
        non_overlap: Symmetric, shape ``[inks, inks]``, 1 on the diagonal: see :class:`Balance`.
    """

    name: str
    inks: Sequence[Ink]
    non_overlap: np.ndarray | Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        check_name(self.name, "`name` of an ink model")
        inks = as_tuple(self.inks, Ink, "`inks`")
        check_unique([ink.name for ink in inks], "ink names")
        check_unique([str(ink.cmy) for ink in inks], "`cmy` of the inks")
        for wanted, color in (((1, 0, 0), "cyan"), ((0, 1, 0), "magenta"), ((0, 0, 1), "yellow")):
            if wanted not in [ink.cmy for ink in inks]:
                raise ProblemError(
                    f"`inks` must hold {color}, `cmy` {wanted}; got {', '.join(ink.name for ink in inks)}"
                )
        matrix = check_non_overlap(self.non_overlap, "`non_overlap`")
        if matrix is None or len(matrix) != len(inks):
            size = 0 if matrix is None else len(matrix)
            raise ProblemError(f"`non_overlap` must have one row and column per ink, {len(inks)}; got {size}")
        settle(self, inks=inks, non_overlap=matrix)


_INKS = {
    "C": (1, 0, 0),
    "M": (0, 1, 0),
    "Y": (0, 0, 1),
    "R": (0, 1, 1),
    "G": (1, 0, 1),
    "B": (1, 1, 0),
    "K": (1, 1, 1),
}


def _model(name: str, letters: str, may_overlap: Sequence[str]) -> InkModel:
    matrix = np.ones((len(letters), len(letters)))
    for pair in may_overlap:
        i, j = (letters.index(letter) for letter in pair)
        matrix[i, j] = matrix[j, i] = 0.0
    return InkModel(name, tuple(Ink(letter, _INKS[letter]) for letter in letters), matrix)


MODELS: dict[str, InkModel] = {name: _model(name, *letters_and_pairs) for name, letters_and_pairs in INK_MODELS.items()}


def separate(image: np.ndarray, model: str | InkModel = DEFAULT_MODEL) -> np.ndarray:
    """Split an image into ink channels by achromatic composition (section 5 of Schmaltz, Gwosdek and Weickert 2012).

    Inks that hold several colors are taken out first, from black downwards: each gets the minimum of the channels that it
    holds, which then lose it. So the channels of all inks add up to 1 - image, for every color.

    Args:
        image: ``[height, width]`` gray, ``[height, width, 3]`` or with alpha (laid on white); 8- or 16-bit whole numbers, or
            numbers 0..1.
        model: A name in :data:`MODELS`, or a model.

    Returns:
        Covered share of every ink, 0..1, shape ``[inks, height, width]``, float64.

    Raises:
        ProblemError: An unknown model, or something that is no such image.
    """
    inks = _find_model(model).inks
    rest = 1.0 - _rgb(image)
    channels = np.zeros((len(inks), *rest.shape[:2]))
    for index in sorted(range(len(inks)), key=lambda i: -sum(inks[i].cmy)):
        held = np.array(inks[index].cmy, dtype=bool)
        share = rest[..., held].min(axis=-1)
        rest[..., held] -= share[..., None]
        channels[index] = share
    return channels


def halftone_problem(
    image: np.ndarray,
    model: str | InkModel = DEFAULT_MODEL,
    *,
    area: float = 1.0,
    sizes: Sequence[Size] | None = None,
    domain: Domain | None = None,
    class_separation: float = 0.5,
    size_emphasis: float | Sequence[float] = 2.0,
    rare_emphasis: float = 1.0,
    density_correction: bool = False,
    seed: int = 0,
) -> Problem:
    """Return the problem of halftoning an image with dots: one class per ink that the image needs.

    Every ink gets as many dots as add up to its channel. Inks whose channel adds up to less than half a dot are left out. Sizes of an
    ink are left out if its channel is too light for one dot of that size.

    Args:
        image: See :func:`separate`.
        model: See there.
        area: Area of a dot [m²].
        sizes: Sizes with shares, used instead of ``area``.
        domain: The rectangle that the image covers; None makes every pixel one square meter.
        class_separation: See :class:`~esh.Balance`; the alpha of Schmaltz, Gwosdek and Weickert 2012.
        size_emphasis: See :class:`~esh.Balance`; the C of that paper.
        rare_emphasis: How much more evenly inks of few dots are spread among themselves; the paper has 0.
        density_correction: Whether every channel gets the gray-value correction of section 3 of that paper.
        seed: Seed of the problem.

    Raises:
        ProblemError: As :func:`separate`, an image without any ink, or one too small for the dots.
    """
    found = _find_model(model)
    channels = separate(image, found)
    if domain is None:
        domain = Domain((float(channels.shape[2]), float(channels.shape[1])))
    if not isinstance(domain, Domain):
        raise ProblemError(f"`domain` must be a Domain, or None; got {show(domain)}")
    given = as_tuple(sizes, Size, "`sizes`") if sizes is not None else (Size("dot", area),)
    most = int(channels.mean(axis=(1, 2)).argmax())
    if not channels[most].any():
        raise ProblemError("the image is white: there is no ink to print")
    classes, used = [], []
    for i, ink in enumerate(found.inks):
        if not channels[i].any():
            continue
        body_class = BodyClass(ink.name, given, channels[i], count="cover", density_correction=density_correction)
        density = prepare_density(body_class)
        covered = float(density.image.mean(dtype=np.float64)) * domain.area
        kept = _printable(body_class.sizes, covered)
        if kept and i != most:
            body_class = replace(body_class, sizes=kept)
        # Sizes of which even the most used ink has too little are for the problem to complain about.
        if kept:
            classes.append(prepare(body_class, domain.area, density))
            used.append(i)
    if not classes:
        smallest = min(size.mean_area for size in given)
        raise ProblemError(
            f"`area` must be smaller: {smallest:g} m² is more than twice what ink {found.inks[most].name} covers, "
            f"{channels[most].mean() * domain.area:.3g} m², and the other inks cover less"
        )
    apart = np.asarray(found.non_overlap)[np.ix_(used, used)]
    balance = Balance(class_separation, size_emphasis, apart, rare_emphasis)
    return Problem(domain, classes, balance, seed=seed)


def _printable(sizes: Sequence[Size], covered: float) -> list[Size]:
    """The sizes that get a dot when all of them together cover so much [m²]; the scarcest go first, none if none does."""
    left = list(sizes)
    while left:
        share = np.array([size.share for size in left], dtype=np.float64)
        exact = covered * share / share.sum() / np.array([size.mean_area for size in left])
        if exact.sum() >= 0.5 and apportion(max(round(exact.sum()), 1), exact).all():
            return [replace(size, share=value) for size, value in zip(left, share / share.sum(), strict=True)]
        left.pop(int(exact.argmin()))
    return []


def ink_colors(problem: Problem, model: str | InkModel) -> list[tuple[float, float, float]]:
    """Colors of the classes of a :func:`halftone_problem`, red, green and blue 0..1."""
    color = {ink.name: ink.rgb for ink in _find_model(model).inks}
    return [color[body_class.name] for body_class in problem.classes]


def _find_model(model: str | InkModel) -> InkModel:
    if isinstance(model, InkModel):
        return model
    if not isinstance(model, str) or model not in MODELS:
        raise ProblemError(f"`model` must be one of {', '.join(MODELS)}, or an InkModel; got {show(model)}")
    return MODELS[model]


def _rgb(image: np.ndarray) -> np.ndarray:
    """Colors 0..1, shape ``[height, width, 3]``, on white where the image is transparent."""
    try:
        given = np.asarray(image)
    except FOREIGN_ERRORS:  # rows of unequal length
        given = np.empty(0)
    if given.dtype.kind not in "buif" or given.ndim not in (2, 3) or not given.size:
        raise ProblemError(f"`image` must be an array [height, width] or [height, width, channels]; got {show(image)}")
    if given.ndim == 2:
        given = given[..., None]
    if given.shape[2] > 4:
        raise ProblemError(f"`image` must have 1 to 4 channels; got {given.shape[2]}")
    values = given.astype(np.float64)
    if given.dtype.kind in "ui":
        values = values / np.iinfo(given.dtype).max
    if not np.isfinite(values).all() or values.min() < 0.0 or values.max() > 1.0:
        raise ProblemError("`image` must hold numbers 0..1, or whole numbers of 8 or 16 bits; it goes beyond")
    color = values if given.shape[2] in (1, 3) else values[..., :-1]
    if color.shape[2] == 1:
        color = np.repeat(color, 3, axis=2)
    if given.shape[2] in (2, 4):
        alpha = values[..., -1:]
        color = color * alpha + (1.0 - alpha)
    return color
