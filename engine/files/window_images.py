"""Densities that are read window by window: NumPy arrays mapped into memory, and GeoTIFF; and where images lie in the world."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputFileError
from .extras import import_extra
from .input_file import kind_and_reason_of

__all__ = ["GEOTIFF", "WINDOWED", "Georeference", "WindowImage", "open_window_image", "read_world_file"]

# Endings of files that are read window by window.
GEOTIFF = (".tif", ".tiff")
WINDOWED = (".npy", *GEOTIFF)


@dataclass(frozen=True)
class Georeference:
    """Where the lower left corner of an image lies in the world, and how large its pixels are there.

    Attributes:
        left: World's x of the left edge.
        bottom: World's y of the lower edge.
        pixel: Extent of a pixel along x and y, in the world's units.
        crs: The coordinate system as PROJJSON; None where nothing says it.
    """

    left: float
    bottom: float
    pixel: tuple[float, float]
    crs: str | None = None


@dataclass(frozen=True, eq=False)
class WindowImage:
    """An image of which parts can be read.

    Attributes:
        path: Its file.
        shape: Rows and columns.
        georeference: Where it lies, where the file says it.
    """

    path: Path
    shape: tuple[int, int]
    georeference: Georeference | None
    _read: Callable[[int, int, int, int], np.ndarray]
    _invert: bool = False

    def read(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """Return the values of rows and columns, shape ``[bottom - top, right - left]``, float32; row 0 is the image's top.

        Raises:
            InputFileError: Values that are negative or not finite, or a part that cannot be read.
        """
        values = self._read(top, bottom, left, right)
        if values.dtype.kind == "u" and values.dtype.itemsize <= 2:
            values = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
        values = values.astype(np.float32)
        if self._invert:
            values = np.float32(1.0) - values
        if values.size and not (np.isfinite(values).all() and values.min() >= 0.0):
            raise InputFileError(
                f"{self.path} must hold finite values of 0 or more; between rows {top} and {bottom} it does not"
            )
        return values


def open_window_image(path: str | Path, invert: bool) -> WindowImage:
    """Open a density that is read window by window.

    Args:
        path: A ``.npy`` file of shape ``[height, width]``, which is mapped into memory, or a ``.tif`` whose first band is read; places
            without data hold nothing. 8- and 16-bit unsigned integers and truth values are taken as 0..1.
        invert: Take 1 minus the value.

    Raises:
        InputFileError: A file that cannot be read so.
        EshError: A GeoTIFF, and rasterio is not installed.
    """
    path = Path(path)
    if path.suffix.lower() in GEOTIFF:
        return _open_geotiff(path, invert)
    try:
        stored = np.lib.format.open_memmap(path, mode="r")
    except Exception as error:  # NumPy's parser lets Python's own tokenizer, and more, shine through
        raise InputFileError(f"{path} cannot be read as a .npy file: {kind_and_reason_of(error)}") from None
    if stored.ndim != 2 or stored.size == 0 or stored.dtype.kind not in "buif":
        raise InputFileError(
            f"{path} must hold numbers of shape [height, width]; got the type {stored.dtype} and the shape {list(stored.shape)}"
        )
    shape = (stored.shape[0], stored.shape[1])

    offset, dtype, order = stored.offset, stored.dtype, "F" if stored.flags.f_contiguous else "C"

    def read(top: int, bottom: int, left: int, right: int) -> np.ndarray:
        # Mapped anew: what was read of the file before is no memory of this process any more.
        mapped = np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape, order="F" if order == "F" else "C")
        return np.array(mapped[top:bottom, left:right])

    return WindowImage(path, shape, read_world_file(path, shape), read, invert)


def _open_geotiff(path: Path, invert: bool) -> WindowImage:
    rasterio = import_extra("rasterio", "geo", f"{path}, a GeoTIFF,")
    windows = import_extra("rasterio.windows", "geo", f"{path}, a GeoTIFF,")
    try:
        opened = rasterio.open(path)
    except (rasterio.errors.RasterioError, OSError, ValueError) as error:
        raise InputFileError(f"{path} cannot be read as a GeoTIFF: {kind_and_reason_of(error)}") from None
    shape = (int(opened.height), int(opened.width))

    def read(top: int, bottom: int, left: int, right: int) -> np.ndarray:
        window = windows.Window(left, top, right - left, bottom - top)
        try:
            values = opened.read(1, window=window)
            there = opened.read_masks(1, window=window)
        except (rasterio.errors.RasterioError, OSError, ValueError) as error:
            raise InputFileError(f"{path} cannot be read: {kind_and_reason_of(error)}") from None
        values[there == 0] = 1 if invert and values.dtype.kind == "f" else 0
        if invert and values.dtype.kind == "u":
            values[there == 0] = np.iinfo(values.dtype).max
        return np.asarray(values)

    place = None
    transform = opened.transform
    if not transform.is_identity:
        if transform.b or transform.d:
            raise InputFileError(f"{path} must have its rows along x; it is rotated")
        crs = None
        if opened.crs is not None:
            with contextlib.suppress(Exception):  # systems that have no such form
                crs = _sorted_json(opened.crs.to_dict(projjson=True))
        place = Georeference(
            transform.c, transform.f + transform.e * shape[0], (abs(transform.a), abs(transform.e)), crs
        )
    return WindowImage(path, shape, place, read, invert)


def read_world_file(path: Path, shape: tuple[int, int]) -> Georeference | None:
    """Return where an image lies by the world file beside it (``.pgw``, ``.wld``, ``.npyw``, ...); None where there is none.

    Args:
        path: The image.
        shape: Its rows and columns.

    Raises:
        InputFileError: A world file that is none, or that turns the image.
    """
    ending = path.suffix
    short = f"{ending[:2]}{ending[-1:]}w"
    for name in (path.with_suffix(short), path.with_name(path.name + "w"), path.with_suffix(".wld")):
        if not name.is_file():
            continue
        try:
            numbers = [float(word) for word in name.read_text(encoding="ascii").split()]
            width, turned_y, turned_x, height, x, y = numbers
        except (OSError, ValueError):
            raise InputFileError(f"{name} must hold six numbers, as world files do") from None
        if turned_x or turned_y or not (width > 0.0 > height):
            raise InputFileError(f"{name} must not turn or mirror the image")
        # A world file names the center of the pixel at the top left.
        return Georeference(x - 0.5 * width, y - 0.5 * height + height * shape[0], (width, -height))
    return None


def _sorted_json(value: Any) -> str:
    import json

    return json.dumps(value, sort_keys=True)
