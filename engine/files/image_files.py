"""Density images from files: what white means, and how much of it a pixel holds.

Every reader ends in one float32 array of shape ``[height, width]``, row 0 the image's top, white (1) = many. Values are
taken as they are stored (a density is data, not a color to be looked at); color counts by its luminance (Rec. 709).
Transparent places hold nothing, whether the image is inverted or not.

PNG and JPEG are read with Pillow; colors of 16 bits, of which it keeps eight, with pypng, all Python: up to half a second per
megapixel and channel. EXR is read with the OpenEXR project's own Python module: 2 MB, NumPy its only dependency, wheels for
Linux, Windows and macOS, kept by the people who keep the format.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputFileError, ProblemError
from ..native_output import muted
from ..problem.given_values import as_path
from ..problem.image_filters import luminance
from ..problem.validation import check_density
from .input_file import check_is_file, reason_of

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["read_array", "read_color", "read_density"]

# A square of 16384: more than any texture, and 4 GB of work already. A file of a few bytes can claim any size.
MOST_PIXELS = 2**28
ACCEPTED = "an image is a PNG, JPEG, EXR or .npy file"
SAVE_AGAIN = "save or copy it again"
# Tag of how a photograph is to be turned.
EXIF_ORIENTATION = 0x0112
# A square of 4096, as many cells as the start of a million bodies looks at. Of more pixels than this blocks are averaged, and so many
# pixels are looked at at once.
MOST_USED = 2**24
PIXELS_AT_ONCE = 2**23
# What the first bytes of a PNG and of a JPEG are.
SIGNATURES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")


def read_density(path: str | Path, invert: bool = False) -> np.ndarray:
    """Read the density that a file holds.

    Args:
        path: PNG (1 to 16 bits per channel), JPEG, EXR (first part; R, G, B or Y or an only channel) or ``.npy``
            (a two-dimensional array of numbers; 8- and 16-bit unsigned integers and booleans are scaled to 0..1 like an
            image's, everything else is taken as it is). Which one, the ending says.
        invert: Take 1 minus the value: black = many. Needs values within 0..1.

    Returns:
        Values >= 0, shape ``[height, width]``, float32, row 0 the top; somewhere above 0. Of more than 16 million pixels, which no
        solver can tell apart, blocks are averaged.

    Raises:
        InputFileError: A missing, unreadable or truncated file; values that are negative, not finite or 0 everywhere.
    """
    path = as_path(path)

    def density_of(color: np.ndarray, alpha: np.ndarray | None) -> np.ndarray:
        value = luminance(color) if color.ndim == 3 else color
        if invert:
            if np.isfinite(value).all() and value.max() > 1.0:
                raise InputFileError(
                    f"{path} cannot be inverted: `invert` takes 1 minus the value, so values must be between 0 and 1; "
                    f"the largest is {value.max():g}"
                )
            value = 1.0 - value
        return value if alpha is None else value * np.clip(alpha, 0.0, 1.0)

    value = _read(path, density_of, reduced=True)
    try:
        return check_density(value, f"{path}" + (", inverted," if invert else ""))
    except ProblemError as error:
        raise InputFileError(str(error)) from None


def read_color(path: str | Path, *, reduced: bool = False) -> np.ndarray:
    """Read an image as colors, as stored, transparent places white.

    Args:
        path: As for :func:`read_density`.
        reduced: Whether blocks of pixels may be averaged where there are more than a solver can use.

    Returns:
        Shape ``[height, width, 3]``, float32, 0..1, row 0 the top; gray images have three equal channels.

    Raises:
        InputFileError: A missing, unreadable or truncated file; values beyond 0..1 or not finite.
    """
    path = as_path(path)

    def color_of(color: np.ndarray, alpha: np.ndarray | None) -> np.ndarray:
        if not np.isfinite(color).all() or color.min() < 0.0 or color.max() > 1.0:
            raise InputFileError(f"{path} must hold values between 0 and 1; got {color.min():g} to {color.max():g}")
        if color.ndim == 2:
            color = np.repeat(color[..., None], 3, axis=2)
        if alpha is not None:
            opaque = np.clip(alpha, 0.0, 1.0)[..., None]
            color = color * opaque + (1.0 - opaque)
        return np.asarray(color, dtype=np.float32)

    return np.asarray(_read(path, color_of, reduced=reduced), dtype=np.float32)


def read_array(path: str | Path) -> np.ndarray:
    """Read the numbers of a ``.npy`` file as they are.

    Returns:
        Shape ``[height, width]`` or ``[height, width, channels]``.

    Raises:
        InputFileError: A missing or damaged file, or something else than such an array of numbers.
    """
    path = Path(path)
    if path.suffix.lower() != ".npy":
        raise InputFileError(f"{path} must be a .npy file; got the ending {path.suffix!r}")
    check_is_file(path, ACCEPTED)
    try:
        return np.array(_map_npy(path, "[height, width] or [height, width, channels]", {2, 3}))
    except MemoryError:
        raise InputFileError(f"{path} holds more pixels than this machine's memory") from None


def _read(path: Path, wanted: Callable[[np.ndarray, np.ndarray | None], np.ndarray], *, reduced: bool) -> np.ndarray:
    """Return what ``wanted`` makes of an image, strip by strip, ``reduced`` to what a solver can use.

    Args:
        path: The file.
        wanted: Gets values, shape ``[rows, width]`` or ``[rows, width, 3]``, and alpha, None where everything is opaque.
        reduced: Whether blocks of pixels are averaged where there are more than ``MOST_USED``.
    """
    readers = {
        ".png": _read_picture,
        ".jpg": _read_picture,
        ".jpeg": _read_picture,
        ".exr": _read_exr,
        ".npy": _read_npy,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputFileError(f"{path} is not of a kind that can be read: {ACCEPTED}; got the ending {path.suffix!r}")
    check_is_file(path, ACCEPTED)
    try:
        stored = reader(path)
        side = math.ceil(math.sqrt(stored.height * stored.width / MOST_USED)) if reduced else 1
        # One strip where nothing is averaged, or else whole blocks of rows.
        rows = stored.height if side == 1 else side * max(1, PIXELS_AT_ONCE // (stored.width * side))
        parts = [_mean_of_blocks(wanted(*strip), side) for strip in stored.strips(rows)]
        return _turned(parts[0] if len(parts) == 1 else np.concatenate(parts), stored.orientation)
    except MemoryError:
        raise InputFileError(f"{path} holds more pixels than this machine's memory") from None


@dataclass(frozen=True)
class _Stored:
    """An image as it is stored.

    Attributes:
        height: Its rows.
        width: Its columns.
        strips: Yields values and alpha of so many rows after the other, from the top.
        orientation: How it is to be turned to be seen, as EXIF numbers it; 1 is as it is.
    """

    height: int
    width: int
    strips: Callable[[int], Iterator[tuple[np.ndarray, np.ndarray | None]]]
    orientation: int = 1


def _mean_of_blocks(values: np.ndarray, side: int) -> np.ndarray:
    """Means of blocks of ``side`` by ``side`` pixels; those at the lower and right edge may be smaller."""
    if side == 1:
        return values
    for axis in (0, 1):
        first = np.arange(0, values.shape[axis], side)
        count = np.minimum(first + side, values.shape[axis]) - first
        shape = [1] * values.ndim
        shape[axis] = len(count)
        values = np.add.reduceat(values, first, axis=axis) / count.reshape(shape).astype(np.float32)
    return values


def _turned(image: np.ndarray, orientation: int) -> np.ndarray:
    """Turn and mirror an image as its EXIF orientation, 1 to 8, says."""
    if orientation in (5, 6, 7, 8):
        image = np.swapaxes(image, 0, 1)
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    return np.ascontiguousarray(image)


def _check_pixel_count(path: Path, width: int, height: int) -> None:
    if width * height > MOST_PIXELS:
        raise InputFileError(
            f"{path} claims {width} x {height} pixels; at most {MOST_PIXELS} (16384 x 16384) are read as a density"
        )


# PNG and JPEG


def _read_picture(path: Path) -> _Stored:
    """Return values and alpha, both 0..1; alpha is None where everything is opaque. A photograph is the right way up."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=("PNG", "JPEG"))
    except Image.DecompressionBombError:
        raise InputFileError(
            f"{path} claims too many pixels; at most {2 * (Image.MAX_IMAGE_PIXELS or 0)} are read"
        ) from None
    except Image.UnidentifiedImageError:
        raise InputFileError(f"{path} {_what_pillow_does_not_know(path)}") from None
    except Exception as error:  # decoders raise whatever damaged bytes lead them to: struct.error, OverflowError, ...
        raise InputFileError(f"{path} {_damage(error)}") from None
    try:
        _check_pixel_count(path, *image.size)
        if image.format == "PNG" and _bit_depth(path) == 16:
            return _deep_png(path, image)
        orientation = image.getexif().get(EXIF_ORIENTATION, 1)
        image.load()
    except InputFileError:
        raise
    except Exception as error:
        raise InputFileError(f"{path} {_damage(error)}") from None

    def strips(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        with image:
            for top in range(0, image.height, rows):
                bottom = min(top + rows, image.height)
                whole = bottom - top == image.height
                yield _shallow(image if whole else image.crop((0, top, image.width, bottom)))

    return _Stored(image.height, image.width, strips, orientation)


def _damage(error: Exception) -> str:
    """Say what an error of Pillow's decoders means."""
    if isinstance(error, OSError) and error.errno is not None:  # the system's, not the decoder's
        return f"cannot be read ({reason_of(error)}); {ACCEPTED}"
    if "truncated" in str(error).lower():
        return f"is cut short: {SAVE_AGAIN}"
    return f"is damaged ({reason_of(error)}): {SAVE_AGAIN}"


def _what_pillow_does_not_know(path: Path) -> str:
    """Say what is wrong with a picture whose header Pillow cannot read."""
    with path.open("rb") as file:
        start = file.read(8)
    if not start:
        return f"is empty: {SAVE_AGAIN}"
    if any(start.startswith(signature) or signature.startswith(start) for signature in SIGNATURES):
        return f"is cut short or damaged in its header: {SAVE_AGAIN}"
    return f"is neither a PNG nor a JPEG, whatever its ending; {ACCEPTED}"


def _shallow(image: Image.Image) -> tuple[np.ndarray, np.ndarray | None]:
    """Split a picture of up to 8 bits per channel."""
    transparent = image.has_transparency_data
    gray = image.mode in ("1", "L", "LA")
    image = image.convert(("LA" if transparent else "L") if gray else ("RGBA" if transparent else "RGB"))
    return _split(np.asarray(image, dtype=np.float32) / np.float32(255))


def _split(channels: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return values and alpha of an array of shape ``[height, width]`` or ``[height, width, 1..4]``."""
    if channels.ndim == 2:
        return channels, None
    colors = channels.shape[2]
    alpha = channels[..., -1] if colors in (2, 4) else None
    return (channels[..., :3] if colors >= 3 else channels[..., 0]), alpha


def _bit_depth(path: Path) -> int:
    """Bits per channel of a PNG: byte 24 of the file, in the header chunk that must come first."""
    with path.open("rb") as file:
        return file.read(25)[24]


def _deep_png(path: Path, image: Image.Image) -> _Stored:
    """Read a PNG of 16 bits per channel as such: Pillow holds so many in gray only, and drops half of every color's."""
    # All of it, whatever it holds: what is damaged is found here.
    image.load()
    width, height = image.size
    orientation = image.getexif().get(EXIF_ORIENTATION, 1)
    if image.mode.startswith("I"):
        gray = np.asarray(image, dtype=np.uint16)[..., None]
        see_through = image.info.get("transparency")
        image.close()

        def gray_strips(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
            for top in range(0, height, rows):
                yield _deep(gray[top : top + rows], see_through)

        return _Stored(height, width, gray_strips, orientation)
    image.close()
    try:
        import png
    except ImportError:
        raise InputFileError(f"{path} needs the Python module pypng to be read: pip install pypng") from None

    def strips(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        try:
            with warnings.catch_warnings():
                # What it complains of are notes beside the picture: Pillow was content with them.
                warnings.simplefilter("ignore")
                _, _, lines, info = png.Reader(filename=str(path)).read(lenient=True)
                lines = iter(lines)
                while strip := [np.asarray(line, dtype=np.uint16) for line in itertools.islice(lines, rows)]:
                    yield _deep(np.vstack(strip).reshape(len(strip), width, info["planes"]), info.get("transparent"))
        except InputFileError:
            raise
        except Exception as error:
            raise InputFileError(f"{path} {_damage(error)}") from None

    return _Stored(height, width, strips, orientation)


def _deep(channels: np.ndarray, see_through: object) -> tuple[np.ndarray, np.ndarray | None]:
    """Return values and alpha of 16-bit channels; ``see_through`` is the one color of a picture without alpha that is, or None."""
    value, alpha = _split(channels.astype(np.float32) / np.float32(65535))
    if alpha is None and see_through is not None:
        alpha = (channels != np.asarray(see_through)).any(axis=2).astype(np.float32)
    return value, alpha


# EXR


def _read_exr(path: Path) -> _Stored:
    """Return values and alpha of the first part; color is freed from the alpha it was multiplied by."""
    try:
        import OpenEXR  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise InputFileError(f"{path} needs the Python module OpenEXR to be read: pip install OpenEXR") from None

    try:
        with muted():
            header = OpenEXR.File(str(path), header_only=True).header()
        x, y, width, height = _window(header["dataWindow"])
        _check_pixel_count(path, width, height)
        shown_x, shown_y, shown_width, shown_height = _window(header["displayWindow"])
        _check_pixel_count(path, shown_width, shown_height)
        with muted():
            channels = OpenEXR.File(str(path), separate_channels=True).channels()
    except InputFileError:
        raise
    except Exception as error:  # the module documents no exceptions of its own
        raise InputFileError(f"{path} is damaged, or not an EXR ({reason_of(error)}); {ACCEPTED}") from None

    def pixels(name: str) -> np.ndarray:
        plane = np.asarray(channels[name].pixels)
        if plane.shape != (height, width) or plane.dtype.kind not in "fu":
            raise InputFileError(
                f"{path} stores its channel {name} in a form that is not read: write a flat, full-size one"
            )
        # What lies outside the stored window is empty, what lies outside the shown one is not shown.
        whole = np.zeros((shown_height, shown_width), np.float32)
        top, left = max(y, shown_y), max(x, shown_x)
        bottom, right = min(y + height, shown_y + shown_height), min(x + width, shown_x + shown_width)
        if top < bottom and left < right:
            part = plane[top - y : bottom - y, left - x : right - x]
            whole[top - shown_y : bottom - shown_y, left - shown_x : right - shown_x] = part
        return whole

    colors = [name for name in channels if name != "A"]
    if {"R", "G", "B"} <= set(colors):
        value = np.stack([pixels(name) for name in "RGB"], axis=2)
    elif "Y" in colors:
        value = pixels("Y")
    elif len(colors) == 1:
        value = pixels(colors[0])
    else:
        names = ", ".join(sorted(channels)) or "none"
        raise InputFileError(f"{path} must have the channels R, G and B, or Y, or only one; got {names}")
    alpha = pixels("A") if "A" in channels and colors else None

    def strips(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        for top in range(0, len(value), rows):
            part = value[top : top + rows]
            if alpha is None:
                yield part, None
                continue
            opacity = alpha[top : top + rows]
            divisor = opacity if part.ndim == 2 else opacity[..., None]
            yield np.divide(part, divisor, out=np.zeros_like(part), where=divisor != 0), opacity

    return _Stored(value.shape[0], value.shape[1], strips)


def _window(window: tuple) -> tuple[int, int, int, int]:
    """Return left, top, width and height of an EXR's window."""
    (left, top), (right, bottom) = ((int(value) for value in corner) for corner in window)
    return left, top, right - left + 1, bottom - top + 1


# NumPy


def _read_npy(path: Path) -> _Stored:
    """Return the values of an image, whole numbers of 8 and 16 bits and truth values as numbers 0..1."""
    stored = _map_npy(path, "[height, width]", {2})

    def strips(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        for top in range(0, len(stored), rows):
            value = np.array(stored[top : top + rows])
            if value.dtype in (np.dtype(np.uint8), np.dtype(np.uint16)):
                value = value.astype(np.float32) / np.float32(np.iinfo(value.dtype).max)
            yield (value.astype(np.float32) if value.dtype == bool else value), None

    return _Stored(stored.shape[0], stored.shape[1], strips)


def _map_npy(path: Path, accepted: str, dimensions: set[int]) -> np.ndarray:
    """Return the array, mapped from its file; never unpickles, and never allocates what the file only claims to hold."""
    try:
        # Mapping the file compares the claimed shape with the file's size, and refuses Python objects.
        stored = np.lib.format.open_memmap(path, mode="r")
    except Exception as error:  # NumPy's parser lets Python's own tokenizer, and more, shine through
        if "object" in str(error).lower():
            raise InputFileError(
                f"{path} holds Python objects, which are never loaded; {ACCEPTED} of numbers"
            ) from None
        raise InputFileError(f"{path} is damaged, or not a .npy file ({reason_of(error)}); {ACCEPTED}") from None
    if stored.ndim not in dimensions or stored.size == 0:
        shape = list(stored.shape)
        raise InputFileError(f"{path} must hold an array of shape {accepted}, neither of them 0; got shape {shape}")
    if stored.dtype.kind not in "buif":
        raise InputFileError(f"{path} must hold numbers; got the type {stored.dtype}")
    _check_pixel_count(path, stored.shape[1], stored.shape[0])
    return stored
