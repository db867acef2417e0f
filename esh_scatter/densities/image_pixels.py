"""The pixels of Blender's images, as they are now or as they were when they were read."""

from __future__ import annotations

import tempfile
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.image_filters import luminance
from ..targets.target import check_exists
from .density_source import checksum

__all__ = ["FIRST_TILE", "TILES_IN_ROW", "StoredImage", "any_image", "image_pixels", "only_shown", "read_image"]

# Tiles of an image are numbered from here on, so many for each whole step of v.
FIRST_TILE = 1001
TILES_IN_ROW = 10
_CHANNELS = ("red", "green", "blue")
# Images that Blender tells scripts no pixels of, though their files hold some: which frame is meant, only who shows them says.
_ONLY_SHOWN = {
    "SEQUENCE": "is an image sequence, of which no frame can be read: set its Source to Single Image",
    "MOVIE": "is a movie, of which no frame can be read: use an image instead",
}


@dataclass(frozen=True, eq=False)
class StoredImage:
    """The pixels of an image of Blender as they were when it was read: what any thread may look at.

    Attributes:
        name: Of the image.
        tiled: Whether it has UDIM tiles.
        linear: Whether its values are amounts of light, or plain numbers: not those of a display.
        tiles: Stored values by the number of the tile, shape ``[height, width, channels]``, float32, row 0 at the top; an image
            without tiles is tile 1001.
    """

    name: str
    tiled: bool
    linear: bool
    tiles: dict[int, np.ndarray]

    @cached_property
    def checksum(self) -> Hashable:
        """Numbers that differ where pixels do."""
        # Turned over, they lie as they were read: nothing has to be copied, which takes ten times as long.
        return tuple((number, checksum(pixels[::-1])) for number, pixels in self.tiles.items())

    def channel(self, channel: str, color_space: str) -> dict[int, np.ndarray]:
        """Return the tiles as one channel, shape ``[height, width]``, float32; see :class:`.ImageDensity` for the words."""
        known = self._channels
        if (channel, color_space) not in known:
            decoded = color_space == "linear" and not self.linear
            known[channel, color_space] = {n: _channel_of(pixels, channel, decoded) for n, pixels in self.tiles.items()}
        return known[channel, color_space]

    @cached_property
    def _channels(self) -> dict[tuple[str, str], dict[int, np.ndarray]]:
        return {}


def any_image() -> bpy.types.Image | None:
    """Return an image of the file whose pixels can be read; None where there is none."""
    # Those that were made here, and maybe painted, are of the type that is called "UV_TEST".
    found = (image for image in bpy.data.images if image.type in ("IMAGE", "UV_TEST") and image.size[0])
    return next(found, None)


def only_shown(image: bpy.types.Image) -> str:
    """Return why no pixels of an image can be read, and what to do, as the end of a sentence; an empty text where they can."""
    return _ONLY_SHOWN.get(image.source, "")


def image_pixels(image: bpy.types.Image, key: str) -> np.ndarray:
    """Return the stored values of an image, shape ``[height, width, channels]``, float32, row 0 at the top.

    Raises:
        ProblemError: The image has no pixels, because its file is missing or is no image, or because it has many frames; or it was
            removed from the file.
    """
    check_exists(image, key)
    width, height = image.size
    channels = image.channels
    if width * height * channels == 0 or len(image.pixels) != width * height * channels:
        path = bpy.path.abspath(image.filepath, library=image.library) if image.filepath else ""
        where = f"its file {path} is missing or cannot be read" if path else "it holds none"
        where = f"it {only_shown(image)}" if only_shown(image) else where
        raise ProblemError(f'{key}: image "{image.name}" must have pixels; {where}')
    pixels = np.empty(width * height * channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, channels)[::-1]


def _channel_of(pixels: np.ndarray, channel: str, decoded: bool) -> np.ndarray:
    """Return a channel of pixels ``[height, width, channels]``, where ``decoded`` as amounts of light; what is transparent is 0."""
    channels = pixels.shape[2]
    alpha = pixels[..., -1] if channels in (2, 4) else np.ones((), np.float32)
    if channel == "alpha":
        return np.ascontiguousarray(np.broadcast_to(alpha, pixels.shape[:2]))
    colors = pixels[..., : max(1, channels - 1) if channels in (2, 4) else channels]
    if decoded:
        # As sRGB has it.
        colors = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4).astype(np.float32)
    if channels < 3:
        gray = colors[..., 0]
    elif channel in _CHANNELS:
        gray = colors[..., _CHANNELS.index(channel)]
    else:
        gray = luminance(colors)
    return np.ascontiguousarray(gray * alpha)


def read_image(image: bpy.types.Image, key: str, whole: bool) -> StoredImage:
    """Read an image; ``whole``: with all of its tiles."""
    tiled = whole and image.source == "TILED"
    # Images of floating-point numbers hold amounts of light already.
    linear = image.is_float or image.colorspace_settings.name != "sRGB"
    tiles = _tiles(image, key) if tiled else {FIRST_TILE: image_pixels(image, key)}
    return StoredImage(image.name, tiled, linear, tiles)


def _tiles(image: bpy.types.Image, key: str) -> dict[int, np.ndarray]:
    """Return the pixels of every tile of an image, by the tile's number.

    Blender tells the pixels of the first tile only, so that all of them, changed or packed as they may be, are saved and read again.
    """
    result = {}
    # Floating-point numbers have other colors in a PNG, and end at 1 there.
    wanted, ending = ("OPEN_EXR", ".exr") if image.is_float else ("PNG", ".png")
    kept = image.file_format
    with tempfile.TemporaryDirectory(prefix="esh-scatter-") as folder:
        try:
            image.file_format = wanted
            image.save(filepath=str(Path(folder) / f"tile.<UDIM>{ending}"), save_copy=True)
        except RuntimeError:  # Blender names the image, not the tile
            raise ProblemError(f'{key}: image "{image.name}" must have pixels in all its tiles; one has none') from None
        finally:
            image.file_format = kept
        for tile in image.tiles:
            path = Path(folder) / f"tile.{tile.number}{ending}"
            if not path.is_file():
                raise ProblemError(
                    f'{key}: image "{image.name}" must have pixels in all its tiles; {tile.number} has none'
                )
            loaded = bpy.data.images.load(str(path))
            try:
                # Decoded as the image is: masks of 16 bits are often plain numbers.
                loaded.colorspace_settings.name = image.colorspace_settings.name
                # Saved as they are in memory, colors must neither be multiplied with alpha again nor divided by it.
                loaded.alpha_mode = "CHANNEL_PACKED"
                result[tile.number] = image_pixels(loaded, key)
            finally:
                bpy.data.images.remove(loaded)
    return result
