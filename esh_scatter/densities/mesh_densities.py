"""What is stored on the target's mesh as a density: vertex groups and attributes."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...engine.problem.settings import as_given, described, setting
from .density_source import TO_PAINT, DensityReader, DensitySource, checksum, inverted

__all__ = ["AttributeDensity", "VertexGroupDensity"]


@described
@dataclass(frozen=True)
class VertexGroupDensity(DensitySource):
    """The weights of a vertex group of the target, interpolated within each face."""

    hint: ClassVar[str] = TO_PAINT

    name: str = field(metadata=setting("Name of the vertex group", check=as_given))
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))

    @property
    def label(self) -> str:
        """``vertex group "wet"``."""
        return f'vertex group "{self.name}"'

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the weights."""
        return inverted(reader.points.vertex_group(self.name, key), self.invert)

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
    """An attribute of the target's mesh, on points, faces or face corners: a number, a truth value or a color."""

    name: str = field(metadata=setting("Name of the attribute", check=as_given))
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))

    @property
    def label(self) -> str:
        """``attribute "wet"``."""
        return f'attribute "{self.name}"'

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the attribute's values, colors by their luminance."""
        return inverted(reader.points.attribute(self.name, key), self.invert)

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
