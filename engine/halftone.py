"""A placement as ink on paper: discs and strokes in the colours of their classes, mixed subtractively (figures 10 to 17)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .errors import EshError
from .placement import Placement
from .placement_files import write_files

__all__ = ["ink_coverage", "line_axis", "render_halftone", "write_halftone_png", "write_halftone_svg"]

# Samples along each axis of a pixel. Discs are drawn exactly to half a sample.
SUPERSAMPLING = 4
MOST_PIXELS = 200_000_000
# Rows of samples that are drawn at once; bounds the memory.
SAMPLES_AT_ONCE = 30_000_000

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

    The colour of a spot is the product of the colours of the inks that lie there; ink upon the same ink counts once.

    Args:
        placement: What to draw: dots as discs of their area, lines as strokes of their width with round ends.
        pixels_per_metre: Scale.
        colors: One per class, red, green and blue 0..1; black when None.
        supersampling: Samples along each axis of a pixel.
        chosen: Truth value of every body, shape ``[n]``: only these are drawn.

    Returns:
        Mean over the samples of every pixel, 0..1, shape ``[height, width, 3]``, float32, row 0 at the top.

    Raises:
        EshError: A picture of more than 200 million pixels, or fewer colours than classes.
    """
    classes = len(placement.problem.classes)
    colors = _checked_colors(colors, classes)
    width, height = placement.problem.domain.size
    shape = (max(1, round(height * pixels_per_metre)), max(1, round(width * pixels_per_metre)))
    if shape[0] * shape[1] > MOST_PIXELS:
        raise EshError(
            f"a picture of {shape[1]} x {shape[0]} pixels is too large; lower the scale {pixels_per_metre:g}"
        )
    result = np.ones((*shape, 3), dtype=np.float32)
    band = max(1, SAMPLES_AT_ONCE // (shape[1] * supersampling**2))
    for top in range(0, shape[0], band):
        rows = slice(top, min(top + band, shape[0]))
        samples: np.ndarray | None = None
        for c, color in enumerate(colors):
            mask = _mask(placement, c, shape, rows, supersampling, chosen)
            if mask is None:
                continue
            if samples is None:
                samples = np.ones((*mask.shape, 3), dtype=np.float32)
            samples[mask] *= np.array(color, dtype=np.float32)
        if samples is not None:
            height_of_band = rows.stop - rows.start
            blocks = samples.reshape(height_of_band, supersampling, shape[1], supersampling, 3)
            result[rows] = blocks.mean(axis=(1, 3))
    return result


def ink_coverage(placement: Placement, *, pixels_per_metre: float, chosen: np.ndarray | None = None) -> np.ndarray:
    """Where which ink lies: truth values, shape ``[classes, height, width]``, one sample per pixel, row 0 at the top."""
    width, height = placement.problem.domain.size
    shape = (max(1, round(height * pixels_per_metre)), max(1, round(width * pixels_per_metre)))
    result = np.zeros((len(placement.problem.classes), *shape), dtype=bool)
    for c in range(len(result)):
        mask = _mask(placement, c, shape, slice(0, shape[0]), 1, chosen)
        if mask is not None:
            result[c] = mask
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

    picture = render_halftone(placement, pixels_per_metre=pixels_per_metre, colors=colors, supersampling=supersampling)
    image = Image.fromarray(np.round(255.0 * picture).astype(np.uint8), "RGB")
    _write(path, lambda file: image.save(file, format="PNG"))


def write_halftone_svg(
    path: str | Path | BinaryIO, placement: Placement, *, colors: Sequence[Color] | None = None
) -> None:
    """Write a placement as an SVG, one group per class, in metres; raises EshError where it cannot be written."""
    colors = _checked_colors(colors, len(placement.problem.classes))
    width, height = placement.problem.domain.size
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.9g} {height:.9g}" style="isolation:isolate">',
        f'<rect width="{width:.9g}" height="{height:.9g}" fill="white"/>',
    ]
    radius = np.sqrt(placement.area / math.pi)
    for c, color in enumerate(colors):
        paint = "#" + "".join(f"{round(255 * value):02x}" for value in color)
        parts.append(
            f'<g style="mix-blend-mode:multiply" fill="{paint}" stroke="{paint}" stroke-width="0" stroke-linecap="round">'
        )
        for i in np.flatnonzero(placement.class_index == c).tolist():
            x, y = placement.position[i, 0], height - placement.position[i, 1]
            if placement.width[i] <= 0.0:
                parts.append(f'<circle cx="{x:.7g}" cy="{y:.7g}" r="{radius[i]:.6g}"/>')
                continue
            points = " ".join(f"{p[0]:.7g},{height - p[1]:.7g}" for p in line_axis(placement, i))
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


def _strokes(placement: Placement, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Straight strokes with round ends: their ends [m], shapes ``[k, 2]``, and radii [m]; a disc is one of length 0."""
    starts, ends, radii = [], [], []
    dots = bodies[placement.width[bodies] <= 0.0]
    starts.append(placement.position[dots])
    ends.append(placement.position[dots])
    radii.append(np.sqrt(placement.area[dots] / math.pi))
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
    return np.concatenate(starts), np.concatenate(ends), np.concatenate(radii)


def _mask(
    placement: Placement,
    c: int,
    shape: tuple[int, int],
    rows: slice,
    supersampling: int,
    chosen: np.ndarray | None,
) -> np.ndarray | None:
    """Samples of some rows of pixels that a class covers; None where it has no bodies."""
    bodies = np.flatnonzero((placement.class_index == c) & (True if chosen is None else chosen))
    if not len(bodies):
        return None
    domain = placement.problem.domain
    start, end, radius = _strokes(placement, bodies)
    # Metres to samples, the first of which lies half a step from the top left corner.
    scale = np.array([shape[1], shape[0]]) * supersampling / np.array(domain.size)
    flip = np.array([0.0, domain.size[1]])
    sign = np.array([1.0, -1.0])
    a, b = ((flip + sign * p) * scale - 0.5 for p in (start, end))
    r = radius * scale.mean()
    count = (supersampling * (rows.stop - rows.start), supersampling * shape[1])
    offset = rows.start * supersampling
    mask = np.zeros(count, dtype=bool)
    shifts = [np.zeros(2)]
    if domain.periodic:
        period = np.array([shape[1], shape[0]]) * supersampling
        shifts = [period * np.array([x, y]) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    for shift in shifts:
        _draw_strokes(mask, a + shift - [0, offset], b + shift - [0, offset], r)
    return mask


def _draw_strokes(mask: np.ndarray, a: np.ndarray, b: np.ndarray, r: np.ndarray) -> None:
    """Set the samples within ``r`` of the segments from ``a`` to ``b`` (columns, rows); strokes of like extent at once."""
    height, width = mask.shape
    low = np.floor(np.minimum(a, b) - r[:, None]).astype(np.int64)
    high = np.ceil(np.maximum(a, b) + r[:, None]).astype(np.int64)
    seen = (high[:, 0] >= 0) & (low[:, 0] < width) & (high[:, 1] >= 0) & (low[:, 1] < height)
    a, b, r, low, high = a[seen], b[seen], r[seen], low[seen], high[seen]
    low, high = np.maximum(low, 0), np.minimum(high, [width - 1, height - 1])
    extent = high - low + 1
    # Windows of a few sizes, powers of two apart by quarters, so that none is much larger than what it is for.
    window = np.ceil(np.exp2(np.ceil(4.0 * np.log2(np.maximum(extent, 1))) / 4.0)).astype(np.int64)
    kinds, kind = np.unique(window, axis=0, return_inverse=True)
    for number, (columns, rows) in enumerate(kinds):
        own = np.flatnonzero(kind.ravel() == number)
        at_once = max(1, 4_000_000 // int(columns * rows))
        for chunk in np.split(own, range(at_once, len(own), at_once)):
            x = low[chunk, 0, None, None] + np.arange(columns)[None, None, :]
            y = low[chunk, 1, None, None] + np.arange(rows)[None, :, None]
            axis = b[chunk] - a[chunk]
            squared = np.maximum((axis**2).sum(axis=1), 1e-12)[:, None, None]
            dx, dy = x - a[chunk, 0, None, None], y - a[chunk, 1, None, None]
            ax, ay = axis[:, 0, None, None], axis[:, 1, None, None]
            t = np.clip((dx * ax + dy * ay) / squared, 0.0, 1.0)
            inside = (dx - t * ax) ** 2 + (dy - t * ay) ** 2 <= r[chunk, None, None] ** 2
            inside &= (x < width) & (y < height)
            which, row, column = np.nonzero(inside)
            mask[y[which, row, 0], x[which, 0, column]] = True


def _checked_colors(colors: Sequence[Color] | None, count: int) -> list[Color]:
    if colors is None:
        return [BLACK] * count
    if len(colors) < count:
        raise EshError(f"`colors` must hold one colour per class, {count}; got {len(colors)}")
    return [tuple(float(value) for value in color[:3]) for color in colors[:count]]  # type: ignore[misc]


def _write(path: str | Path | BinaryIO, writer: Any) -> None:
    if isinstance(path, (str, Path)):
        write_files({Path(path): writer})
    else:
        writer(path)
