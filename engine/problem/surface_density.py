"""Densities on a surface: a number, a function of points, values of the meshes, or images that are laid over them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..errors import ProblemError
from . import validation
from .given_values import is_function, numbers_of
from .image_filters import LUMINANCE
from .settings import Settings, described, setting
from .surface import PointsOnSurface

__all__ = ["SurfaceAttribute", "SurfaceDensity", "SurfaceImage", "SurfaceTriplanar", "check_density", "density_at"]

# A UV map goes beyond an image where it does so by more than rounding.
BEYOND = 1e-6
# Gets points and returns one value of 0 or more for each, shape [n].
SurfaceDensity = Callable[[PointsOnSurface], np.ndarray]


@described
@dataclass(frozen=True)
class SurfaceAttribute(Settings):
    """A density on a surface: an attribute of its meshes, by vertex or by triangle; colors by their luminance."""

    name: str = field(metadata=setting("Name of the attribute", text=True))

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Values at points, shape ``[n]``."""
        return self.at(points, "`density`")

    def at(self, points: PointsOnSurface, key: str) -> np.ndarray:
        """Return the same; sentences call the density ``key``."""
        values = points.attribute(self.name, key)
        if values.ndim == 1:
            return values
        if values.shape[1] < 3:
            return values.mean(axis=1)
        return values[:, :3] @ LUMINANCE


def _check_image(value: object, key: str) -> np.ndarray:
    return validation.check_density(value, f"{key} of a density")


@described
@dataclass(frozen=True, eq=False)
class SurfaceImage(Settings):
    """A density on a surface: an image through the meshes' UV maps; it repeats where a map goes beyond it."""

    image: np.ndarray = field(
        metadata=setting("The image", more="Shape ``[height, width]``, row 0 at v = 1", check=_check_image)
    )

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Values at points, shape ``[n]``."""
        return self.at(points, "`density`")

    def at(self, points: PointsOnSurface, key: str) -> np.ndarray:
        """Return the same; sentences call the density ``key``."""
        uv = points.uv(key)
        meshes = points.surface.meshes
        assert isinstance(meshes, tuple)
        maps = [mesh.uv for mesh in meshes if mesh.uv is not None]
        beyond = any(m.min(initial=0.0) < -BEYOND or m.max(initial=1.0) > 1.0 + BEYOND for m in maps)
        return _bilinear(self.image, uv, repeats=beyond)


@described
@dataclass(frozen=True, eq=False)
class SurfaceTriplanar(Settings):
    """A density on a surface: an image projected along x, y and z, blended by where the surface looks to; it repeats."""

    image: np.ndarray = field(
        metadata=setting("The image", more="Shape ``[height, width]``, row 0 at the top", check=_check_image)
    )
    size: float = field(
        metadata=setting(
            "Extent of the image's width",
            unit="m",
            check=lambda value, key: validation.check_length(value, f"{key} of a triplanar density"),
        )
    )

    def __call__(self, points: PointsOnSurface) -> np.ndarray:
        """Values at points, shape ``[n]``."""
        weight = points.normal**4
        weight = weight / weight.sum(axis=1, keepdims=True)
        aspect = self.image.shape[1] / self.image.shape[0]
        x, y, z = (points.position / self.size).T
        seen = ((y, z * aspect), (x, z * aspect), (x, y * aspect))
        return np.sum([weight[:, k] * _bilinear(self.image, np.stack(uv, axis=1)) for k, uv in enumerate(seen)], axis=0)


def check_density(value: object, key: str) -> np.ndarray | SurfaceDensity:
    """Return an image as :func:`~.validation.check_density` does, or a function of points as it is."""
    if is_function(value):
        return value  # type: ignore[return-value]
    if isinstance(value, type):
        what = "an image (an array of numbers), a number or a function of points"
        raise ProblemError(f"{key} must be {what}; got the class {value.__name__}")
    return validation.check_density(value, key)


def density_at(density: SurfaceDensity | None, points: PointsOnSurface, key: str) -> np.ndarray:
    """Values of a density at points, shape ``[n]``, float64; None is uniform.

    Raises:
        ProblemError: It returns something else than one finite value of 0 or more for each.
    """
    count = len(points.triangle)
    if density is None:
        return np.ones(count)
    given = density.at(points, key) if isinstance(density, SurfaceAttribute | SurfaceImage) else density(points)
    values = numbers_of(given, key)
    if values.shape != (count,):
        raise ProblemError(f"{key} must return one value per point, shape [{count}]; got shape {list(values.shape)}")
    if not np.isfinite(values).all():
        raise ProblemError(f"{key} must be finite everywhere; it returned NaN or infinity")
    if values.min(initial=0.0) < 0.0:
        raise ProblemError(f"{key} must be 0 or more everywhere; it returned {values.min():g}")
    return values


def _bilinear(image: np.ndarray, uv: np.ndarray, *, repeats: bool = True) -> np.ndarray:
    """An image between the centers of its pixels; it repeats, or its borders go on as they are."""
    height, width = image.shape
    x, y = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    # Coordinates that are no numbers give values that are none, whichever pixel they are taken from.
    column, row = (np.where(np.isfinite(at), at, 0.0).astype(np.int64) for at in (left, top))
    columns, rows = (
        [at % n if repeats else at.clip(0, n - 1) for at in (first, first + 1)]
        for first, n in ((column, width), (row, height))
    )
    upper = (1.0 - fx) * image[rows[0], columns[0]] + fx * image[rows[0], columns[1]]
    lower = (1.0 - fx) * image[rows[1], columns[0]] + fx * image[rows[1], columns[1]]
    return (1.0 - fy) * upper + fy * lower
