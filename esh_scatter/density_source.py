"""What all densities have in common that are more than a number."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Hashable
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine.problem.settings import Settings

if TYPE_CHECKING:
    from .densities import DensityReader

__all__ = ["DensitySource", "Known", "checksum"]

# What was read of Blender's data, by what it was read of: images and objects that several densities name are read once.
Known = dict[Hashable, Any]


def checksum(*arrays: np.ndarray) -> Hashable:
    """Return numbers that differ where arrays do."""
    return tuple((array.shape, zlib.crc32(np.ascontiguousarray(array).data)) for array in arrays)


class DensitySource(Settings, ABC):
    """Base of what a density can be read from."""

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
