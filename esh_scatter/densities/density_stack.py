"""A density made of layers, one upon the other; and the density of another class."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import as_float, show
from ...engine.problem.settings import Choice, as_given, described, setting
from ...engine.problem.validation import check_name
from .density_source import Density, DensityReader, DensitySource, Known, attribute_names, content_of
from .image_density import stored_density

__all__ = ["ClassDensity", "DensityLayer", "DensityStack"]


@described
@dataclass(frozen=True)
class ClassDensity(DensitySource):
    """The density of another class of the same scatter."""

    name: str = field(metadata=setting("Name of the class", check=check_name))

    @property
    def label(self) -> str:
        """``class "pine"``."""
        return f'class "{self.name}"'

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return what the other class follows."""
        return reader.of_class(self.name, key)

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return what the other class follows, in short."""
        return reader.content(self.name)


def _check_curve(value: object, key: str) -> tuple[tuple[float, float], ...]:
    given = value if isinstance(value, list | tuple) else ()
    points = [tuple(point) if isinstance(point, list | tuple) else () for point in given]
    numbers = [tuple(as_float(entry) for entry in point) for point in points]
    good = len(numbers) >= 2 and all(
        len(point) == 2 and all(entry is not None and 0.0 <= entry <= 1.0 for entry in point) for point in numbers
    )
    if not good or not all(a[0] < b[0] for a, b in pairwise(numbers)):  # type: ignore[operator]
        raise ProblemError(
            f"{key} must be two or more points (x, y) between 0 and 1, each farther along x than the one before; got {show(value)}"
        )
    return tuple(numbers)  # type: ignore[arg-type]


@described
@dataclass(frozen=True, eq=False)
class DensityLayer(DensitySource):
    """One layer of a :class:`DensityStack`."""

    density: Density = field(
        metadata=setting(
            "What the layer reads", more="Whatever a class can follow, a number or an image for example", check=as_given
        )
    )
    blend: str = field(
        default="multiply",
        metadata=setting(
            "How the layer acts on those above it",
            choices=(
                Choice("multiply", "Multiply", "only where both are", "MULTIPLY"),
                Choice("add", "Add", "where either of them is", "ADD"),
                Choice("subtract", "Subtract", "not where this layer is", "SUBTRACT"),
                Choice("minimum", "Minimum", "the smaller of both", "MINIMUM"),
            ),
        ),
    )
    strength: float = field(
        default=1.0,
        metadata=setting("How strongly the layer acts. At 0 it has no effect", unit="share", low=0.0, high=1.0),
    )
    invert: bool = field(default=False, metadata=setting("Let white mean none and black mean many"))
    curve: Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "How the layer's values are remapped",
            more="Points (x, y) from 0 to 1, joined by straight lines; None leaves values as they are",
            check=_check_curve,
        ),
    )
    name: str = field(
        default="",
        metadata=setting(
            "Name of the layer in messages",
            more="If it is empty, the layer is named after what it reads",
            check=as_given,
        ),
    )

    @property
    def label(self) -> str:
        """Its name, or that of what it reads."""
        return f'"{self.name}"' if self.name else getattr(self.density, "label", "a number or an image")

    def read(self, key: str, known: Known) -> DensityLayer:
        """Return it with what it reads."""
        return replace(self, density=stored_density(self.density, key, known))

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return what it reads, in short, and what is done with it."""
        content = content_of(self.density, reader)
        return None if content is None else (content, self.blend, self.strength, self.invert, self.curve)

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return what it reads, inverted and bent."""
        values = reader.values(self.density, key)
        if self.invert:
            values = 1.0 - np.clip(values, 0.0, 1.0)
        if self.curve is not None:
            x, y = np.array(self.curve, np.float64).T
            values = np.interp(np.clip(values, 0.0, 1.0), x, y).astype(np.float32)
        return values

    def on(self, below: np.ndarray | None, values: np.ndarray) -> np.ndarray:
        """Return the density of the layers so far with this one, which has these values; ``below`` is None for the first of them."""
        strength = np.float32(self.strength)
        if self.blend == "add":
            return strength * values if below is None else below + strength * values
        if below is None:
            below = np.ones_like(values)
        if self.blend == "subtract":
            return np.maximum(below - strength * values, np.float32(0.0))
        changed = below * values if self.blend == "multiply" else np.minimum(below, values)
        return changed if self.strength == 1.0 else below + strength * (changed - below)

    def attribute_names(self) -> set[str]:
        """Return the vertex groups and attributes that it reads."""
        return attribute_names(self.density)


def _check_layers(value: object, key: str) -> tuple[DensityLayer, ...]:
    layers = tuple(value) if isinstance(value, list | tuple) else ()
    if not layers or not all(isinstance(layer, DensityLayer) for layer in layers):
        raise ProblemError(f"{key} must be a list of at least one DensityLayer; got {show(value)}")
    return layers


@described
@dataclass(frozen=True, eq=False)
class DensityStack(DensitySource):
    """A density of layers, which act one after the other on a density that is 1 everywhere, or 0 where the first of them adds."""

    layers: Sequence[DensityLayer] = field(metadata=setting("The layers, in their order", check=_check_layers))

    def read(self, key: str, known: Known) -> DensityStack:
        """Return it with what its layers read."""
        numbered = enumerate(self.layers, start=1)
        return DensityStack([layer.read(f"{key}, layer {number} ({layer.label})", known) for number, layer in numbered])

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return what its layers say, in short."""
        contents = tuple(layer.content(reader) for layer in self.layers)
        return None if None in contents else ("stack", contents)

    def values(self, reader: DensityReader, key: str) -> np.ndarray:
        """Return the density of all layers.

        Raises:
            ProblemError: It is 0 everywhere; the sentence says which layer makes it so.
        """
        result: np.ndarray | None = None
        # What made the density 0 everywhere, as far as it still is.
        culprit: str | None = None
        for number, layer in enumerate(self.layers, start=1):
            where = f"{key}, layer {number} ({layer.label})"
            values = layer.values(reader, where)
            before, result = result, layer.on(result, values)
            if result.any():
                culprit = None
            elif culprit is None:
                nothing = not values.any() and layer.blend != "subtract"
                told = "is 0 everywhere" if nothing or before is None else "leaves nothing of those before it"
                hint = "" if layer.invert or values.any() else getattr(layer.density, "hint", "")
                culprit = f"layer {number} ({layer.label}) {told}{hint}"
        assert result is not None
        if culprit is not None:
            raise ProblemError(f"{key} must be above 0 somewhere on {reader.points.target_name}; {culprit}")
        return result

    def attribute_names(self) -> set[str]:
        """Return the vertex groups and attributes that any layer reads."""
        return set().union(*(layer.attribute_names() for layer in self.layers))
