"""An image as a density, seen from above or laid out by a UV map."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ...engine.problem.settings import Choice, as_given, described, setting
from ...engine.problem.validation import LARGEST_ANGLE, check_density
from ..targets.target import check_exists
from .density_source import (
    TO_PAINT,
    Density,
    DensityReader,
    DensitySource,
    Known,
    checksum,
    inverted,
    sample_image,
)
from .image_pixels import FIRST_TILE, TILES_IN_ROW, StoredImage, read_image

if TYPE_CHECKING:
    from ...engine.surface.surface_points import SurfacePoints

__all__ = ["ImageDensity", "stored_density"]


@described
@dataclass(frozen=True)
class ImageDensity(DensitySource):
    """An image: white = many, black = none."""

    hint: ClassVar[str] = TO_PAINT

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
            "UV map of the target, of an image that a UV map lays out. If this is empty, the one that is active for rendering is used",
            label="UV Map",
            check=as_given,
        ),
    )
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))
    channel: str = field(
        default="luminance",
        metadata=setting(
            "Which channel of the image is read",
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
                Choice(
                    "stored", "As Stored", "the numbers in the file: a gray that looks like 50% counts as 50%", "STORED"
                ),
                Choice(
                    "linear", "Linear", "amounts of light: a gray that looks like 50% counts as about 20%", "LINEAR"
                ),
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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.uv_map and self.mapping != "UV":
            raise ProblemError(
                f'`uv_map` of an ImageDensity must be empty unless its `mapping` is "UV"; got {show(self.uv_map)}'
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
            known[number] = read_image(self.image, key, whole)
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


def stored_density(density: Density, key: str, known: Known | None = None) -> Density:
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


def _image_at(density: ImageDensity, points: SurfacePoints, key: str) -> np.ndarray:
    stored = density.image
    assert isinstance(stored, StoredImage)
    name = f'{key}, image "{stored.name}",'
    by_uv = density.mapping == "UV"
    coordinates = points.uv(density.uv_map, key) if by_uv else points.rectangle_coordinates
    moved = (density.tiling, density.offset, density.rotation) != ((1.0, 1.0), (0.0, 0.0), 0.0)
    if moved:
        coordinates = _moved(coordinates, density, np.ones(2) if by_uv else points.rectangle_size())
    tiled, images = stored.tiled, stored.channel(density.channel, density.color_space)
    # Inverted before it is interpolated, so that white pixels stay empty to their very edge.
    upright = {n: inverted(image, density.invert) for n, image in images.items()}
    checked = check_density(np.concatenate([image.ravel() for image in upright.values()])[None], name, empty=True)[0]
    ends = np.cumsum([image.size for image in upright.values()])
    parts = zip(upright.items(), np.split(checked, ends[:-1]), strict=True)
    shown = {number: part.reshape(image.shape) for (number, image), part in parts}
    if not tiled:
        return sample_image(shown[FIRST_TILE], coordinates, repeat=by_uv or moved)
    column, row = np.floor(coordinates).astype(np.int64).T
    values = np.zeros(len(coordinates), np.float32)
    for number, image in shown.items():
        down, along = divmod(number - FIRST_TILE, TILES_IN_ROW)
        own = np.flatnonzero((column == along) & (row == down))
        values[own] = sample_image(image, coordinates[own] - (along, down), repeat=False)
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
