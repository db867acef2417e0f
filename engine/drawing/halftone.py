"""A placement as ink on paper: discs and strokes in the colors of their classes, mixed subtractively.

The paper (Schmaltz, Gwosdek and Weickert 2012) shows such pictures in its figures 10 to 17.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import EshError
from ..files.placement_files import write_files
from ..problem import validation
from ..problem.given_values import as_path_or_file, check_is
from ..problem.placement import Placement
from .periodic_copies import copies_of_bodies, copies_within

__all__ = ["ink_coverage", "line_axis", "render_halftone", "write_halftone_png", "write_halftone_svg"]

# Samples along each axis of a pixel. A sample is ink where its center lies in a body.
SUPERSAMPLING = 4
MOST_SUPERSAMPLING = 64
MOST_PIXELS = 200_000_000
# Samples that are drawn at once, and rows of bodies laid into them: they bound the memory, some 100 MB.
SAMPLES_AT_ONCE = 4_000_000
SPANS_AT_ONCE = 500_000

Color = tuple[float, float, float]
BLACK: Color = (0.0, 0.0, 0.0)


def render_halftone(
    placement: Placement,
    *,
    pixels_per_metre: float,
    colors: Sequence[Color] | None = None,
    supersampling: int = SUPERSAMPLING,
    chosen: np.ndarray | None = None,
) -> np.ndarray:
    """Draw every body as ink on white paper.

    The color of a spot is the product of the colors of the inks that lie there; ink upon the same ink counts once.

    Args:
        placement: What to draw: dots as discs of their area, lines as strokes of their width with round ends.
        pixels_per_metre: Scale.
        colors: One per class, red, green and blue 0..1; black when None.
        supersampling: Samples along each axis of a pixel.
        chosen: Truth value of every body, shape ``[n]``: only these are drawn.

    Returns:
        Mean over the samples of every pixel, 0..1, shape ``[height, width, 3]``, float32, row 0 at the top.

    Raises:
        EshError: A picture of more than 200 million pixels, a scale or a supersampling without meaning, colors beyond 0..1 or
            fewer than classes.
    """
    check_is(placement, Placement, "`placement`")
    shape = _picture_shape(placement, pixels_per_metre, supersampling)
    result = np.empty((*shape, 3), dtype=np.float32)
    for rows, band in _bands(placement, shape, colors, supersampling, chosen):
        result[rows] = band
    return result


def ink_coverage(placement: Placement, *, pixels_per_metre: float) -> np.ndarray:
    """Where which ink lies: truth values, shape ``[classes, height, width]``, one sample per pixel, row 0 at the top."""
    shape = _picture_shape(placement, pixels_per_metre, 1)
    result = np.zeros((len(placement.problem.classes), *shape), dtype=bool)
    inks = [_strokes(placement, c, None) for c in range(len(result))]
    for rows in _row_bands(shape, 1):
        for c, strokes in enumerate(inks):
            result[c, rows] = _mask(strokes, _Samples(placement.problem.rectangle.size, shape, 1, rows))
    return result


def write_halftone_png(
    path: str | Path | BinaryIO,
    placement: Placement,
    *,
    pixels_per_metre: float,
    colors: Sequence[Color] | None = None,
    supersampling: int = SUPERSAMPLING,
) -> None:
    """Write :func:`render_halftone` as a PNG; raises EshError where it cannot be written."""
    from PIL import Image

    check_is(placement, Placement, "`placement`")
    shape = _picture_shape(placement, pixels_per_metre, supersampling)
    picture = np.empty((*shape, 3), dtype=np.uint8)
    for rows, band in _bands(placement, shape, colors, supersampling, None):
        picture[rows] = np.round(255.0 * band)
    image = Image.fromarray(picture, "RGB")
    _write(path, lambda file: image.save(file, format="PNG"))


def write_halftone_svg(
    path: str | Path | BinaryIO, placement: Placement, *, colors: Sequence[Color] | None = None
) -> None:
    """Write a placement as an SVG, one group per class, in meters; raises EshError where it cannot be written.

    In a periodic domain, bodies that reach over an edge are there once more on the other side.
    """
    check_is(placement, Placement, "`placement`")
    colors = _checked_colors(colors, len(placement.problem.classes))
    width, height = placement.problem.rectangle.size
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.9g} {height:.9g}" style="isolation:isolate">',
        f'<rect width="{width:.9g}" height="{height:.9g}" fill="white"/>',
    ]
    radius = placement.radius
    shifts = copies_of_bodies(placement)
    for c, color in enumerate(colors):
        paint = "#" + "".join(f"{round(255 * value):02x}" for value in color)
        parts.append(
            f'<g style="mix-blend-mode:multiply" fill="{paint}" stroke="{paint}" stroke-width="0" stroke-linecap="round" '
            'stroke-linejoin="round">'
        )
        for shift, seen in shifts:
            for i in np.flatnonzero(seen & (placement.class_index == c)).tolist():
                if placement.width[i] <= 0.0:
                    x, y = placement.position[i] + shift
                    parts.append(f'<circle cx="{x:.7g}" cy="{height - y:.7g}" r="{radius[i]:.6g}"/>')
                    continue
                points = " ".join(f"{x:.7g},{height - y:.7g}" for x, y in line_axis(placement, i) + shift)
                parts.append(f'<polyline points="{points}" fill="none" stroke-width="{placement.width[i]:.6g}"/>')
        parts.append("</g>")
    parts.append("</svg>\n")
    _write(path, lambda file: file.write("\n".join(parts).encode("ascii")))


def line_axis(placement: Placement, i: int) -> np.ndarray:
    """Points along the axis of a line [m], shape ``[2 or more, 2]``."""
    if placement.bends is not None and np.isfinite(placement.bends[i, 0, 0]):
        points = placement.bends[i]
        return points[np.isfinite(points[:, 0])]
    half = 0.5 * placement.length[i] * np.array([math.cos(placement.angle[i]), math.sin(placement.angle[i])])
    return np.stack([placement.position[i] - half, placement.position[i] + half])


def _picture_shape(placement: Placement, pixels_per_metre: float, supersampling: int) -> tuple[int, int]:
    """Rows and columns of a picture of the domain; raises EshError where it would be too large."""
    scale = validation.check_positive(pixels_per_metre, "`pixels_per_metre`")
    if validation.check_count(supersampling, "`supersampling`") > MOST_SUPERSAMPLING:
        raise EshError(f"`supersampling` must be at most {MOST_SUPERSAMPLING}; got {supersampling}")
    width, height = placement.problem.rectangle.size
    columns, rows = (max(1.0, extent * scale) for extent in (width, height))
    # A single row of samples has to fit the memory, too.
    if columns * rows > MOST_PIXELS or columns * supersampling**2 > MOST_PIXELS:
        raise EshError(f"a picture of {columns:.6g} x {rows:.6g} pixels is too large; lower the scale {scale:g}")
    return round(rows), round(columns)


def _row_bands(shape: tuple[int, int], supersampling: int) -> Iterator[slice]:
    """Rows of pixels that are drawn at once, from the top."""
    band = max(1, SAMPLES_AT_ONCE // (shape[1] * supersampling**2))
    for top in range(0, shape[0], band):
        yield slice(top, min(top + band, shape[0]))


def _bands(
    placement: Placement,
    shape: tuple[int, int],
    colors: Sequence[Color] | None,
    supersampling: int,
    chosen: np.ndarray | None,
) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield rows of pixels and their colors 0..1, shape ``[rows, columns, 3]``."""
    colors = _checked_colors(colors, len(placement.problem.classes))
    inks = [_strokes(placement, c, chosen) for c in range(len(colors))]
    for rows in _row_bands(shape, supersampling):
        samples = _Samples(placement.problem.rectangle.size, shape, supersampling, rows)
        masks = [_mask(strokes, samples) for strokes in inks]
        result = np.empty((rows.stop - rows.start, shape[1], 3))
        drawn: dict[tuple[float, ...], np.ndarray] = {}
        for channel in range(3):
            passed = tuple(color[channel] for color in colors)
            # Red, green and blue of black ink are alike.
            if passed not in drawn:
                blocks = _light(masks, passed, samples).reshape(len(result), supersampling, shape[1], supersampling)
                drawn[passed] = blocks.mean(axis=(1, 3), dtype=np.float64)
            result[..., channel] = drawn[passed]
        yield rows, result


def _light(masks: Sequence[np.ndarray], passed: Sequence[float], samples: _Samples) -> np.ndarray:
    """Light of one channel that comes back from every sample, where each ink passes on so much of it."""
    light = np.ones((samples.rows, samples.columns), dtype=np.float32)
    for mask, value in zip(masks, passed, strict=True):
        if value != 1.0:
            np.multiply(light, np.float32(value), out=light, where=mask)
    return light


@dataclass(frozen=True)
class _Samples:
    """Some rows of samples: where they lie in the domain."""

    size: tuple[float, float]
    shape: tuple[int, int]
    supersampling: int
    band: slice

    @property
    def rows(self) -> int:
        return (self.band.stop - self.band.start) * self.supersampling

    @property
    def columns(self) -> int:
        return self.shape[1] * self.supersampling

    @property
    def step(self) -> tuple[float, float]:
        """Distance between columns and between rows [m]; they differ where pixels do not divide the domain."""
        return self.size[0] / self.columns, self.size[1] / (self.shape[0] * self.supersampling)

    def row_of(self, y: np.ndarray) -> np.ndarray:
        """Row at a height [m], counted from the first of the band; whole where a sample lies."""
        return (self.size[1] - y) / self.step[1] - 0.5 - self.band.start * self.supersampling

    def height_of(self, row: np.ndarray) -> np.ndarray:
        """Height of a row [m]."""
        return self.size[1] - (row + 0.5 + self.band.start * self.supersampling) * self.step[1]

    def column_of(self, x: np.ndarray) -> np.ndarray:
        """Column at a place [m]; whole where a sample lies."""
        return x / self.step[0] - 0.5


@dataclass(frozen=True)
class _Strokes:
    """Straight strokes with round ends from ``a`` to ``b`` [m], shapes ``[k, 2]``, of ``radius`` [m]; a disc has length 0."""

    a: np.ndarray
    b: np.ndarray
    radius: np.ndarray

    def low(self) -> np.ndarray:
        return np.minimum(self.a, self.b) - self.radius[:, None]

    def high(self) -> np.ndarray:
        return np.maximum(self.a, self.b) + self.radius[:, None]


def _strokes(placement: Placement, c: int, chosen: np.ndarray | None) -> _Strokes:
    """Strokes of the bodies of a class, those that come in again over the edges of a periodic domain among them."""
    bodies = np.flatnonzero((placement.class_index == c) & (True if chosen is None else chosen))
    dots = bodies[placement.width[bodies] <= 0.0]
    starts, ends = [placement.position[dots]], [placement.position[dots]]
    radii = [placement.radius[dots]]
    lines = bodies[placement.width[bodies] > 0.0]
    bent = np.zeros(len(lines), dtype=bool)
    if placement.bends is not None:
        bent = np.isfinite(placement.bends[lines, 0, 0])
        for i in lines[bent].tolist():
            points = line_axis(placement, i)
            starts.append(points[:-1])
            ends.append(points[1:])
            radii.append(np.full(len(points) - 1, 0.5 * placement.width[i]))
    straight = lines[~bent]
    angle = placement.angle[straight]
    half = 0.5 * placement.length[straight, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    starts.append(placement.position[straight] - half)
    ends.append(placement.position[straight] + half)
    radii.append(0.5 * placement.width[straight])
    once = _Strokes(np.concatenate(starts), np.concatenate(ends), np.concatenate(radii))
    domain = placement.problem.rectangle
    if not domain.periodic:
        return once
    seen = copies_within(once.low(), once.high(), domain.size)
    return _Strokes(
        np.concatenate([once.a[which] + shift for shift, which in seen]),
        np.concatenate([once.b[which] + shift for shift, which in seen]),
        np.concatenate([once.radius[which] for _, which in seen]),
    )


def _mask(strokes: _Strokes, samples: _Samples) -> np.ndarray:
    """Which samples lie in a stroke, shape ``[rows, columns]``.

    A stroke is convex, so it fills one span of every row that it meets: steps up and down, summed along the row.
    """
    low, high = strokes.low(), strokes.high()
    top = np.maximum(np.ceil(samples.row_of(high[:, 1])), 0.0)
    bottom = np.minimum(np.floor(samples.row_of(low[:, 1])), samples.rows - 1.0)
    seen = np.flatnonzero((top <= bottom) & (high[:, 0] > 0.0) & (low[:, 0] < samples.size[0]))
    if not len(seen):
        return np.zeros((samples.rows, samples.columns), dtype=bool)
    top = top[seen].astype(np.int64)
    count = bottom[seen].astype(np.int64) - top + 1
    steps = np.zeros((samples.rows, samples.columns + 1), dtype=np.int32)
    flat = steps.reshape(-1)
    stop = np.cumsum(count)
    begin = 0
    while begin < len(seen):
        done = stop[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(stop, done + SPANS_AT_ONCE, side="right")))
        part = np.repeat(np.arange(begin, end), count[begin:end])
        row = top[part] + np.arange(len(part)) - (stop[part] - count[part] - done)
        left, right = _spans(strokes, seen[part], samples.height_of(row))
        # Clipped before they become whole numbers: an empty span may be infinite.
        first = np.ceil(samples.column_of(np.clip(left, 0.0, samples.size[0]))).astype(np.int64)
        last = np.floor(samples.column_of(np.clip(right, 0.0, samples.size[0]))).astype(np.int64)
        first, last = np.maximum(first, 0), np.minimum(last, samples.columns - 1)
        filled = (left <= right) & (first <= last)
        start_of_row = row[filled] * (samples.columns + 1)
        np.add.at(flat, start_of_row + first[filled], 1)
        np.add.at(flat, start_of_row + last[filled] + 1, -1)
        begin = end
    return np.cumsum(steps, axis=1, out=steps)[:, :-1] > 0


def _spans(strokes: _Strokes, which: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where to where strokes reach along horizontals at ``y`` [m], shapes ``[k]``; left beyond right where they do not."""
    a, b, radius = strokes.a[which], strokes.b[which], strokes.radius[which]
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    axis = b - a
    length = np.hypot(axis[:, 0], axis[:, 1])
    long = length > 0.0
    for end in (a, b) if long.any() else (a,):
        squared = radius**2 - (y - end[:, 1]) ** 2
        half = np.where(squared >= 0.0, np.sqrt(np.maximum(squared, 0.0)), -np.inf)
        left, right = np.minimum(left, end[:, 0] - half), np.maximum(right, end[:, 0] + half)
    if long.any():
        x_part, y_part = (axis[long] / length[long, None]).T
        over = y[long] - a[long, 1]
        along = _between(x_part, over * y_part, np.zeros(len(over)), length[long])
        across = _between(-y_part, over * x_part, -radius[long], radius[long])
        start, stop = np.maximum(along[0], across[0]), np.minimum(along[1], across[1])
        met = start <= stop
        left[long] = np.where(met, np.minimum(left[long], a[long, 0] + start), left[long])
        right[long] = np.where(met, np.maximum(right[long], a[long, 0] + stop), right[long])
    return left, right


def _between(slope: np.ndarray, offset: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where to where ``slope * x + offset`` lies between ``low`` and ``high``."""
    level = slope == 0.0
    divisor = np.where(level, 1.0, slope)
    with np.errstate(over="ignore"):
        one, other = (low - offset) / divisor, (high - offset) / divisor
    always = (low <= offset) & (offset <= high)
    start = np.where(level, np.where(always, -np.inf, np.inf), np.minimum(one, other))
    stop = np.where(level, np.where(always, np.inf, -np.inf), np.maximum(one, other))
    return start, stop


def _checked_colors(colors: Sequence[Color] | None, count: int) -> list[Color]:
    return [BLACK] * count if colors is None else validation.check_colors(colors, count)


def _write(path: str | Path | BinaryIO, writer: Any) -> None:
    out = as_path_or_file(path)
    if isinstance(out, Path):
        write_files({out: writer})
    else:
        writer(out)
