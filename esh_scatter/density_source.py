"""What all densities have in common that are more than a number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..engine.problem.settings import Settings

if TYPE_CHECKING:
    from .densities import DensityReader

__all__ = ["DensitySource"]


class DensitySource(Settings):
    """Base of what a density can be read from."""

    @property
    def label(self) -> str:
        """How sentences name it: ``image "mask.png"``."""
        return type(self).__name__.removesuffix("Density").lower()

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the density at the reader's points, shape ``[n]``.

        Raises:
            ProblemError: What is asked for is missing; the sentence calls the density ``key``.
        """
        raise NotImplementedError

    def attribute_names(self) -> set[str]:
        """Return the vertex groups and attributes of the target that are read."""
        return set()

    def _key(self, name: str) -> str:
        cls = type(self).__name__
        return f"`{name}` of {'an' if cls[0] in 'AEIOU' else 'a'} {cls}"
