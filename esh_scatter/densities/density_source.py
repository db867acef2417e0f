"""What all densities have in common that are more than a number, and how densities are read at points of a target's surface."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.settings import Settings
from ...engine.problem.validation import check_density

if TYPE_CHECKING:
    from ...engine.surface.surface_points import SurfacePoints

__all__ = [
    "TO_PAINT",
    "Density",
    "DensityReader",
    "DensitySource",
    "Known",
    "attribute_names",
    "checksum",
    "content_of",
    "inverted",
    "sample_image",
]

# What to do where nothing has been painted yet.
TO_PAINT = ": paint where objects are to stand"
# What was read of Blender's data, by what it was read of: images and objects that several densities name are read once.
Known = dict[Hashable, Any]


def checksum(*arrays: np.ndarray) -> Hashable:
    """Return numbers that differ where arrays do."""
    return tuple((array.shape, zlib.crc32(np.ascontiguousarray(array).data)) for array in arrays)


class DensitySource(Settings, ABC):
    """Base of what a density can be read from.

    Attributes:
        hint: What to do where it is 0 everywhere, behind that sentence; empty where there is nothing to say.
    """

    hint: ClassVar[str] = ""

    @property
    def label(self) -> str:
        """How sentences name it: ``image "mask.png"``."""
        return type(self).__name__.removesuffix("Density").lower()

    def read(self, _key: str, _known: Known) -> DensitySource:
        """Return the same density, which no longer needs Blender. Only the main thread may call this.

        Args:
            _key: How sentences name it.
            _known: What was read already; gets what is read now.

        Raises:
            ProblemError: What is asked for is missing.
        """
        return self

    @abstractmethod
    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the density at the reader's points, shape ``[n]``; of what :meth:`read` returned, in any thread.

        Raises:
            ProblemError: What is asked for is missing; the sentence calls the density ``key``.
        """

    def content(self, _reader: DensityReader) -> Hashable | None:
        """Return what it says at the reader's points, in short: two that say the same are the same. None where that cannot be told."""
        return type(self).__name__, *(getattr(self, entry.name) for entry in fields(self))  # type: ignore[arg-type]

    def attribute_names(self) -> set[str]:
        """Return the vertex groups and attributes of the target that are read."""
        return set()

    def _key(self, name: str) -> str:
        cls = type(self).__name__
        return f"`{name}` of {'an' if cls[0] in 'AEIOU' else 'a'} {cls}"


Density: TypeAlias = DensitySource | bpy.types.Image | np.ndarray | float


class DensityReader:
    """Reads densities at points of a surface; of what :func:`.stored_density` returned, in any thread.

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
            image = check_density(density, key, empty=True)
            if image.size == 1:
                values = np.full(len(self.points.triangle), image.item(), np.float32)
            else:
                values = sample_image(image, self.points.rectangle_coordinates, repeat=False)
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
            what, hint = (density.label, density.hint) if isinstance(density, DensitySource) else ("it", "")
            raise ProblemError(
                f"{key} must be above 0 somewhere on {self.points.target_name}; {what} is 0 everywhere{hint}"
            )
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


def attribute_names(density: Density) -> set[str]:
    """Return the vertex groups and attributes of the target that a density reads."""
    return density.attribute_names() if isinstance(density, DensitySource) else set()


def inverted(values: np.ndarray, invert: bool) -> np.ndarray:
    """Return values, or 1 minus what they are between 0 and 1."""
    # NaN stays NaN.
    return 1.0 - np.clip(values, 0.0, 1.0) if invert else values


def sample_image(image: np.ndarray, coordinates: np.ndarray, repeat: bool) -> np.ndarray:
    """Interpolate ``image`` at ``coordinates`` ``[n, 2]`` (0..1, y up); a black pixel stays black to its edge."""
    # Warp is not imported before something is computed.
    from ...engine.surface import kernels_chart
    from ...engine.surface.launching import launch_on_cpu

    values = np.empty(len(coordinates), np.float32)
    coordinates = np.ascontiguousarray(coordinates, np.float64)
    launch_on_cpu(kernels_chart.interpolate_image, len(values), [image, coordinates, repeat], [values])
    return values
