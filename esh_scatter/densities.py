"""What the density of a class can be in Blender, and how it is read at points of a target's surface."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import bpy
import numpy as np

from ..engine.errors import ProblemError
from ..engine.problem.image_filters import luminance
from ..engine.problem.validation import check_density, show
from ..engine.surface import kernels_chart
from ..engine.surface.launching import launch_on_cpu
from .target import check_exists

if TYPE_CHECKING:
    from ..engine.surface.surface_points import SurfacePoints

__all__ = [
    "AttributeDensity",
    "Density",
    "ImageDensity",
    "StoredImage",
    "VertexGroupDensity",
    "density_at",
    "image_luminance",
    "image_pixels",
    "read_density",
]


# Tiles of an image are numbered from here on, so many for each whole step of v.
FIRST_TILE = 1001
TILES_IN_ROW = 10


@dataclass(frozen=True, eq=False)
class StoredImage:
    """The pixels of an image of Blender as they were when it was read: what any thread may look at.

    Attributes:
        name: Of the image.
        tiled: Whether it has UDIM tiles.
        tiles: Stored values by the number of the tile, shape ``[height, width, channels]``, float32, row 0 at the top; an image
            without tiles is tile 1001.
    """

    name: str
    tiled: bool
    tiles: dict[int, np.ndarray]

    @cached_property
    def grey(self) -> dict[int, np.ndarray]:
        """The tiles as one channel, shape ``[height, width]``, float32."""
        return {number: _grey(pixels) for number, pixels in self.tiles.items()}


@dataclass(frozen=True)
class ImageDensity:
    """An image: white = many, black = none.

    Attributes:
        image: Its stored values are used (what an 8-bit file holds over 255, without any conversion of colour spaces);
            colours count by their luminance, transparent pixels hold nothing.
        mapping: ``"POSITION"`` stretches the image over the target's bounding rectangle seen from above, its top towards
            larger y; ``"UV"`` reads it through a UV map and repeats it outside 0..1; of an image with UDIM tiles every
            tile is read where it lies, and there is nothing where there is none.
        uv_map: Name of the UV map; empty means the active one.
        invert: White = none.
    """

    image: bpy.types.Image | StoredImage
    mapping: Literal["POSITION", "UV"] = "POSITION"
    uv_map: str = ""
    invert: bool = False


@dataclass(frozen=True)
class VertexGroupDensity:
    """The weights of a vertex group of the target, interpolated within each face."""

    name: str
    invert: bool = False


@dataclass(frozen=True)
class AttributeDensity:
    """An attribute of the target's mesh, on points, faces or face corners: a number, a truth value or a colour."""

    name: str
    invert: bool = False


Density: TypeAlias = ImageDensity | VertexGroupDensity | AttributeDensity | bpy.types.Image | np.ndarray | float


def read_density(density: Density, key: str, images: dict[int, StoredImage] | None = None) -> Density:
    """Return a density that no longer needs Blender: of an image, its pixels. Only the main thread may call this.

    Args:
        density: What the class was given.
        key: How sentences name it.
        images: Images that were read already, by their ``session_uid``; gets those that are read now.

    Raises:
        ProblemError: The image is missing, or has no pixels.
    """
    if isinstance(density, bpy.types.Image):
        density = ImageDensity(density)
    if not isinstance(density, ImageDensity) or isinstance(density.image, StoredImage):
        return density
    if not isinstance(density.image, bpy.types.Image):
        raise ProblemError(f"{key} must be an image of Blender; got {show(density.image)}")
    if density.mapping not in ("POSITION", "UV"):
        raise ProblemError(f'{key}: `mapping` must be "POSITION" or "UV"; got {show(density.mapping)}')
    check_exists(density.image, key)
    known = {} if images is None else images
    # Only a UV map leads to tiles beyond the first.
    whole = density.mapping == "UV"
    number = density.image.session_uid * 2 + whole
    if number not in known:
        known[number] = _read_image(density.image, key, whole)
    return replace(density, image=known[number])


def density_at(density: Density, points: SurfacePoints, key: str) -> np.ndarray:
    """Return the density at points of a surface, per unit of its area; of what :func:`read_density` has read, in any thread.

    Args:
        density: What the class was given.
        points: Where, ``n`` of them.
        key: How sentences name it, e.g. ``density of class "pine"``.

    Returns:
        Values >= 0, shape ``[n]``, float32.

    Raises:
        ProblemError: What is asked for is missing or has no meaning as a density.
    """
    density = read_density(density, key)
    invert = False
    if isinstance(density, ImageDensity):
        values = _image_at(density, points, key)
    elif isinstance(density, VertexGroupDensity):
        values, invert = points.vertex_group(density.name, key), density.invert
    elif isinstance(density, AttributeDensity):
        values, invert = points.attribute(density.name, key), density.invert
    else:
        values = _sample(check_density(density, key), points.rectangle_coordinates(), repeat=False)
    values = np.asarray(values, np.float32)
    if not np.isfinite(values).all():
        raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity on {points.target_name}")
    if invert:
        values = 1.0 - np.clip(values, 0.0, 1.0)
    if values.min() < 0:
        raise ProblemError(f"{key} must be 0 or more everywhere; its smallest value is {values.min():g}")
    if not values.any():
        raise ProblemError(f"{key} must be above 0 somewhere on {points.target_name}; it is 0 everywhere")
    return values


def image_luminance(image: bpy.types.Image, key: str) -> np.ndarray:
    """Return the stored values of an image as one channel, shape ``[height, width]``, float32, row 0 at the top.

    Raises:
        ProblemError: The image has no pixels, because its file is missing or is no image.
    """
    return _grey(image_pixels(image, key))


def image_pixels(image: bpy.types.Image, key: str) -> np.ndarray:
    """Return the stored values of an image, shape ``[height, width, channels]``, float32, row 0 at the top.

    Raises:
        ProblemError: The image has no pixels, because its file is missing or is no image; or it was removed from the file.
    """
    check_exists(image, key)
    width, height = image.size
    channels = image.channels
    if width * height * channels == 0 or len(image.pixels) != width * height * channels:
        path = bpy.path.abspath(image.filepath, library=image.library) if image.filepath else ""
        where = f"its file {path} is missing or cannot be read" if path else "it holds none"
        raise ProblemError(f'{key}: image "{image.name}" must have pixels; {where}')
    pixels = np.empty(width * height * channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, channels)[::-1]


def _grey(pixels: np.ndarray) -> np.ndarray:
    """Return pixels ``[height, width, channels]`` as one channel; what is transparent holds nothing."""
    channels = pixels.shape[2]
    grey = luminance(pixels) if channels >= 3 else pixels[..., 0]
    return np.ascontiguousarray(grey * pixels[..., -1] if channels in (2, 4) else grey)


def _read_image(image: bpy.types.Image, key: str, whole: bool) -> StoredImage:
    """Read an image; ``whole``: with all of its tiles."""
    tiled = whole and image.source == "TILED"
    return StoredImage(image.name, tiled, _tiles(image, key) if tiled else {FIRST_TILE: image_pixels(image, key)})


def _image_at(density: ImageDensity, points: SurfacePoints, key: str) -> np.ndarray:
    stored = density.image
    assert isinstance(stored, StoredImage)
    name = f'{key}, image "{stored.name}",'
    by_uv = density.mapping == "UV"
    coordinates = points.uv(density.uv_map, key) if by_uv else points.rectangle_coordinates()
    tiled, images = stored.tiled, stored.grey
    # Inverted before it is interpolated, so that white pixels stay empty to their very edge. NaN stays NaN.
    upright = {n: 1.0 - np.clip(image, 0.0, 1.0) if density.invert else image for n, image in images.items()}
    checked = check_density(np.concatenate([image.ravel() for image in upright.values()])[None], name)[0]
    ends = np.cumsum([image.size for image in upright.values()])
    parts = zip(upright.items(), np.split(checked, ends[:-1]), strict=True)
    shown = {number: part.reshape(image.shape) for (number, image), part in parts}
    if not tiled:
        return _sample(shown[FIRST_TILE], coordinates, repeat=by_uv)
    column, row = np.floor(coordinates).astype(np.int64).T
    values = np.zeros(len(coordinates), np.float32)
    for number, image in shown.items():
        down, along = divmod(number - FIRST_TILE, TILES_IN_ROW)
        own = np.flatnonzero((column == along) & (row == down))
        values[own] = _sample(image, coordinates[own] - (along, down), repeat=False)
    return values


def _tiles(image: bpy.types.Image, key: str) -> dict[int, np.ndarray]:
    """Return the pixels of every tile of an image, by the tile's number.

    Blender tells the pixels of the first tile only, so that all of them, changed or packed as they may be, are saved and read again.
    """
    result = {}
    with tempfile.TemporaryDirectory(prefix="esh-scatter-") as folder:
        ending = ".exr" if image.file_format in ("OPEN_EXR", "OPEN_EXR_MULTILAYER") else ".png"
        try:
            image.save(filepath=str(Path(folder) / f"tile.<UDIM>{ending}"), save_copy=True)
        except RuntimeError:  # Blender names the image, not the tile
            raise ProblemError(f'{key}: image "{image.name}" must have pixels in all its tiles; one has none') from None
        for tile in image.tiles:
            path = Path(folder) / f"tile.{tile.number}{ending}"
            if not path.is_file():
                raise ProblemError(
                    f'{key}: image "{image.name}" must have pixels in all its tiles; {tile.number} has none'
                )
            loaded = bpy.data.images.load(str(path))
            try:
                loaded.alpha_mode = image.alpha_mode
                result[tile.number] = image_pixels(loaded, key)
            finally:
                bpy.data.images.remove(loaded)
    return result


def _sample(image: np.ndarray, coordinates: np.ndarray, repeat: bool) -> np.ndarray:
    """Interpolate ``image`` at ``coordinates`` ``[n, 2]`` (0..1, y up); a black pixel stays black to its edge."""
    values = np.empty(len(coordinates), np.float32)
    coordinates = np.ascontiguousarray(coordinates, np.float64)
    launch_on_cpu(kernels_chart.interpolate_image, len(values), [image, coordinates, repeat], [values])
    return values
