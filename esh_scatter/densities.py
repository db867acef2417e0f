"""What the density of a class can be in Blender, and how it is read at points of a target's surface."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import bpy
import numpy as np

from ..engine.errors import ProblemError
from ..engine.problem.image_filters import luminance
from ..engine.problem.settings import Choice, as_given, described, setting
from ..engine.problem.validation import LARGEST_ANGLE, check_density, show
from .density_source import DensitySource, Known, checksum
from .density_stack import ClassDensity, DensityLayer, DensityStack
from .ground_densities import AltitudeDensity, FacingDensity, NoiseDensity, SlopeDensity
from .scene_densities import CameraDensity, DistanceDensity, InsideDensity
from .target import check_exists

if TYPE_CHECKING:
    from ..engine.surface.surface_points import SurfacePoints

__all__ = [
    "AltitudeDensity",
    "AttributeDensity",
    "CameraDensity",
    "ClassDensity",
    "Density",
    "DensityLayer",
    "DensityReader",
    "DensityStack",
    "DistanceDensity",
    "FacingDensity",
    "ImageDensity",
    "InsideDensity",
    "NoiseDensity",
    "SlopeDensity",
    "StoredImage",
    "VertexGroupDensity",
    "attribute_names",
    "image_luminance",
    "image_pixels",
    "read_density",
]


# Tiles of an image are numbered from here on, so many for each whole step of v.
FIRST_TILE = 1001
TILES_IN_ROW = 10
_CHANNELS = ("red", "green", "blue")


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
        return tuple((number, checksum(pixels)) for number, pixels in self.tiles.items())

    def channel(self, channel: str, color_space: str) -> dict[int, np.ndarray]:
        """Return the tiles as one channel, shape ``[height, width]``, float32; see :class:`ImageDensity` for the words."""
        known = self._channels
        if (channel, color_space) not in known:
            decoded = color_space == "linear" and not self.linear
            known[channel, color_space] = {n: _channel_of(pixels, channel, decoded) for n, pixels in self.tiles.items()}
        return known[channel, color_space]

    @cached_property
    def _channels(self) -> dict[tuple[str, str], dict[int, np.ndarray]]:
        return {}


@described
@dataclass(frozen=True)
class ImageDensity(DensitySource):
    """An image: white = many, black = none."""

    image: bpy.types.Image | StoredImage = field(
        metadata=setting(
            "The image: white means many, black means none",
            more="Transparent pixels hold nothing. Packed, generated and unsaved images are read as they are",
            check=as_given,
        )
    )
    mapping: str = field(
        default="POSITION",
        metadata=setting(
            "How the image lies on the target",
            more="Through a UV map it repeats outside 0..1; of an image with UDIM tiles every tile is read where it lies, and there "
            "is nothing where there is none",
            choices=(
                Choice(
                    "POSITION",
                    "From Above",
                    "stretched over the extent of the target in x and y, its top at the largest y",
                    "POSITION",
                ),
                Choice("UV", "UV Map", "laid out by a UV map of the target", "UV"),
            ),
        ),
    )
    uv_map: str = field(
        default="",
        metadata=setting(
            "UV map of the target. If this is empty, the one that is active for rendering is used",
            label="UV Map",
            check=as_given,
        ),
    )
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))
    channel: str = field(
        default="luminance",
        metadata=setting(
            "What of the image is read",
            choices=(
                Choice("luminance", "Brightness", "how bright the colors are", "LUMINANCE"),
                Choice("red", "Red", "the red channel", "RED"),
                Choice("green", "Green", "the green channel", "GREEN"),
                Choice("blue", "Blue", "the blue channel", "BLUE"),
                Choice("alpha", "Alpha", "how opaque it is", "ALPHA"),
            ),
        ),
    )
    color_space: str = field(
        default="stored",
        metadata=setting(
            "Which values are read",
            choices=(
                Choice("stored", "As Stored", "the numbers in the file, as a gray of 50% looks", "STORED"),
                Choice("linear", "Linear", "amounts of light, which a gray of 50% has a fifth of", "LINEAR"),
            ),
        ),
    )
    tiling: tuple[float, float] = field(
        default=(1.0, 1.0),
        metadata=setting("How often the image is repeated in each direction", soft_low=0.1, soft_high=20.0),
    )
    offset: tuple[float, float] = field(
        default=(0.0, 0.0),
        metadata=setting(
            "How far the image is moved; 1 is the whole extent of what it is laid over", soft_low=-1.0, soft_high=1.0
        ),
    )
    rotation: float = field(
        default=0.0,
        metadata=setting(
            "How far the image is turned about its middle, counter-clockwise",
            unit="rad",
            low=-LARGEST_ANGLE,
            high=LARGEST_ANGLE,
            soft_low=-math.pi,
            soft_high=math.pi,
        ),
    )

    @property
    def label(self) -> str:
        """``image "mask.png"``."""
        return f'image "{self.image.name}"' if isinstance(self.image, bpy.types.Image | StoredImage) else "image"

    def read(self, key: str, known: Known) -> ImageDensity:
        """Return it with the pixels of its image."""
        if isinstance(self.image, StoredImage):
            return self
        if not isinstance(self.image, bpy.types.Image):
            raise ProblemError(f"{key} must be an image of Blender; got {show(self.image)}")
        check_exists(self.image, key)
        # Only a UV map leads to tiles beyond the first.
        whole = self.mapping == "UV"
        number = "image", self.image.session_uid, whole
        if number not in known:
            known[number] = _read_image(self.image, key, whole)
        return replace(self, image=known[number])

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the image where the points lie on it, 0 or more."""
        return _image_at(self, reader.points, key)

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return the pixels and the UV map, in short, and how they are read."""
        if not isinstance(self.image, StoredImage):
            return None
        uv: Hashable = None
        if self.mapping == "UV":
            mesh = reader.points.view.mesh
            name = self.uv_map or mesh.active_uv_map
            uv = name, checksum(mesh.uv_map[name]) if name in mesh.uv_map else None
        how = self.mapping, self.invert, self.channel, self.color_space, self.tiling, self.offset, self.rotation
        return "image", self.image.checksum, uv, how


@described
@dataclass(frozen=True)
class VertexGroupDensity(DensitySource):
    """The weights of a vertex group of the target, interpolated within each face."""

    name: str = field(metadata=setting("Name of the vertex group", check=as_given))
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))

    @property
    def label(self) -> str:
        """``vertex group "wet"``."""
        return f'vertex group "{self.name}"'

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the weights."""
        return _inverted(reader.points.vertex_group(self.name, key), self.invert)

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return the weights, in short."""
        groups = reader.points.view.mesh.vertex_group
        return ("group", self.name, self.invert, checksum(groups[self.name])) if self.name in groups else None

    def attribute_names(self) -> set[str]:
        """Return its name."""
        return {str(self.name)}


@described
@dataclass(frozen=True)
class AttributeDensity(DensitySource):
    """An attribute of the target's mesh, on points, faces or face corners: a number, a truth value or a colour."""

    name: str = field(metadata=setting("Name of the attribute", check=as_given))
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))

    @property
    def label(self) -> str:
        """``attribute "wet"``."""
        return f'attribute "{self.name}"'

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the attribute's values, colours by their luminance."""
        return _inverted(reader.points.attribute(self.name, key), self.invert)

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return the values, in short."""
        attributes = reader.points.view.mesh.attribute
        if self.name not in attributes:
            return None
        domain, values = attributes[self.name]
        return "attribute", self.name, self.invert, domain, checksum(values)

    def attribute_names(self) -> set[str]:
        """Return its name."""
        return {str(self.name)}


Density: TypeAlias = DensitySource | bpy.types.Image | np.ndarray | float


class DensityReader:
    """Reads densities at points of a surface; of what :func:`read_density` returned, in any thread.

    Args:
        points: Where, ``n`` of them.
        classes: What the classes of a scatter follow, by name.
    """

    def __init__(self, points: SurfacePoints, classes: Mapping[str, Density] | None = None) -> None:
        self.points = points
        self._classes = classes or {}
        # Classes that are being read, each because of the one before it.
        self._following: list[str] = []

    @cached_property
    def normal(self) -> np.ndarray:
        """Shading normals at the points, shape ``[n, 3]``, float32."""
        return self.points.normal

    def values(self, density: Density, key: str) -> np.ndarray:
        """Return a density at the points: 0 or more and finite, shape ``[n]``, float32.

        Raises:
            ProblemError: What is asked for is missing or has no meaning as a density; the sentence calls it ``key``.
        """
        if isinstance(density, DensitySource):
            values = density.values(self, key)
        else:
            assert not isinstance(density, bpy.types.Image)
            values = _sample(check_density(density, key, empty=True), self.points.rectangle_coordinates(), repeat=False)
        values = np.asarray(values, np.float32)
        if not np.isfinite(values).all():
            raise ProblemError(
                f"{key} must be finite everywhere; it holds NaN or infinity on {self.points.target_name}"
            )
        if len(values) and values.min() < 0:
            raise ProblemError(f"{key} must be 0 or more everywhere; its smallest value is {values.min():g}")
        return values

    def class_density(self, name: str) -> np.ndarray:
        """Return the density that a class follows, which must be above 0 somewhere; shape ``[n]``, float32."""
        key = f'`density` of class "{name}"'
        values = self.of_class(name, key)
        if not values.any():
            density = self._classes[name]
            what = density.label if isinstance(density, DensitySource) else "it"
            raise ProblemError(f"{key} must be above 0 somewhere on {self.points.target_name}; {what} is 0 everywhere")
        return values

    def of_class(self, name: str, key: str) -> np.ndarray:
        """Return the density of a class at the points."""
        self._follow(name, key)
        try:
            return self.values(self._classes[name], key)
        finally:
            self._following.pop()

    def content(self, name: str) -> Hashable | None:
        """Return what the density of a class says, in short; None where that cannot be told."""
        if name in self._following or name not in self._classes:
            return None
        self._following.append(name)
        try:
            return content_of(self._classes[name], self)
        finally:
            self._following.pop()

    def _follow(self, name: str, key: str) -> None:
        if name not in self._classes:
            names = ", ".join(f'"{other}"' for other in self._classes) or "none"
            raise ProblemError(f'{key} must follow another class of the scatter; "{name}" is none of them: {names}')
        if name in self._following:
            chain = " follows ".join(f'"{other}"' for other in (*self._following, name))
            raise ProblemError(f"{key} must not follow itself: {chain}")
        self._following.append(name)


def content_of(density: Density, reader: DensityReader) -> Hashable | None:
    """Return what a density says at a reader's points, in short; None where that cannot be told."""
    if isinstance(density, DensitySource):
        return density.content(reader)
    if isinstance(density, np.ndarray):
        return "array", checksum(density)
    return ("number", float(density)) if isinstance(density, int | float) else None


def read_density(density: Density, key: str, known: Known | None = None) -> Density:
    """Return a density that no longer needs Blender: of an image, its pixels. Only the main thread may call this.

    Args:
        density: What the class was given.
        key: How sentences name it.
        known: What was read already; gets what is read now.

    Raises:
        ProblemError: What is asked for is missing, or an image has no pixels.
    """
    if isinstance(density, bpy.types.Image):
        density = ImageDensity(density)
    return density.read(key, {} if known is None else known) if isinstance(density, DensitySource) else density


def attribute_names(density: Density) -> set[str]:
    """Return the vertex groups and attributes of the target that a density reads."""
    return density.attribute_names() if isinstance(density, DensitySource) else set()


def _inverted(values: np.ndarray, invert: bool) -> np.ndarray:
    # NaN stays NaN.
    return 1.0 - np.clip(values, 0.0, 1.0) if invert else values


def image_luminance(image: bpy.types.Image, key: str) -> np.ndarray:
    """Return the stored values of an image as one channel, shape ``[height, width]``, float32, row 0 at the top.

    Raises:
        ProblemError: The image has no pixels, because its file is missing or is no image.
    """
    return _channel_of(image_pixels(image, key), "luminance", decoded=False)


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
        grey = colors[..., 0]
    elif channel in _CHANNELS:
        grey = colors[..., _CHANNELS.index(channel)]
    else:
        grey = luminance(colors)
    return np.ascontiguousarray(grey * alpha)


def _read_image(image: bpy.types.Image, key: str, whole: bool) -> StoredImage:
    """Read an image; ``whole``: with all of its tiles."""
    tiled = whole and image.source == "TILED"
    # Images of floating-point numbers hold amounts of light already.
    linear = image.is_float or image.colorspace_settings.name != "sRGB"
    tiles = _tiles(image, key) if tiled else {FIRST_TILE: image_pixels(image, key)}
    return StoredImage(image.name, tiled, linear, tiles)


def _image_at(density: ImageDensity, points: SurfacePoints, key: str) -> np.ndarray:
    stored = density.image
    assert isinstance(stored, StoredImage)
    name = f'{key}, image "{stored.name}",'
    by_uv = density.mapping == "UV"
    coordinates = points.uv(density.uv_map, key) if by_uv else points.rectangle_coordinates()
    moved = (density.tiling, density.offset, density.rotation) != ((1.0, 1.0), (0.0, 0.0), 0.0)
    if moved:
        coordinates = _moved(coordinates, density, np.ones(2) if by_uv else points.rectangle_size())
    tiled, images = stored.tiled, stored.channel(density.channel, density.color_space)
    # Inverted before it is interpolated, so that white pixels stay empty to their very edge.
    upright = {n: _inverted(image, density.invert) for n, image in images.items()}
    checked = check_density(np.concatenate([image.ravel() for image in upright.values()])[None], name, empty=True)[0]
    ends = np.cumsum([image.size for image in upright.values()])
    parts = zip(upright.items(), np.split(checked, ends[:-1]), strict=True)
    shown = {number: part.reshape(image.shape) for (number, image), part in parts}
    if not tiled:
        return _sample(shown[FIRST_TILE], coordinates, repeat=by_uv or moved)
    column, row = np.floor(coordinates).astype(np.int64).T
    values = np.zeros(len(coordinates), np.float32)
    for number, image in shown.items():
        down, along = divmod(number - FIRST_TILE, TILES_IN_ROW)
        own = np.flatnonzero((column == along) & (row == down))
        values[own] = _sample(image, coordinates[own] - (along, down), repeat=False)
    return values


def _moved(coordinates: np.ndarray, density: ImageDensity, extent: np.ndarray) -> np.ndarray:
    """Return where points lie on an image that is repeated, moved and turned about the middle of what it is laid over.

    Args:
        coordinates: Where they lie on it as it was, shape ``[n, 2]``.
        density: How it is moved.
        extent: Of what it is laid over, in whatever unit: it turns without being sheared, shape ``[2]``.
    """
    c, s = math.cos(density.rotation), math.sin(density.rotation)
    way = (coordinates - 0.5 - np.array(density.offset)) * extent
    turned = way @ np.array([[c, -s], [s, c]]) / extent
    return turned * np.array(density.tiling) + 0.5


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
    # Warp is not imported before something is computed.
    from ..engine.surface import kernels_chart
    from ..engine.surface.launching import launch_on_cpu

    values = np.empty(len(coordinates), np.float32)
    coordinates = np.ascontiguousarray(coordinates, np.float64)
    launch_on_cpu(kernels_chart.interpolate_image, len(values), [image, coordinates, repeat], [values])
    return values
