"""Preferred directions of lines: from the structure tensor of a density, or given.

The structure tensor is equation 8 of the paper (Schmaltz, Gwosdek and Weickert 2012).

Directions have no front: they count modulo pi, and are averaged as vectors of the doubled angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ProblemError
from .image_filters import gaussian_blur
from .validation import check_direction

__all__ = [
    "DirectionField",
    "density_directions",
    "direction_field",
    "direction_from_angle_image",
    "direction_from_rg",
    "structure_tensor",
]


@dataclass(frozen=True, eq=False)
class DirectionField:
    """An image of directions over the domain, row 0 at the top.

    Attributes:
        angle: Counter-clockwise from x [rad], y up, modulo pi, shape ``[height, width]``.
        weight: How much each counts, 0..1, shape ``[height, width]``.
        coherence: How clearly there is one direction, 0..1, shape ``[height, width]``; 1 where it was given.
    """

    angle: np.ndarray
    weight: np.ndarray
    coherence: np.ndarray

    def double_angle_vectors(self) -> np.ndarray:
        """``weight * (cos 2 angle, sin 2 angle)``, which can be interpolated; shape ``[height, width, 2]``, float32."""
        vectors = np.stack([np.cos(2.0 * self.angle), np.sin(2.0 * self.angle)], axis=-1)
        return (self.weight[..., None] * vectors).astype(np.float32)


def structure_tensor(
    image: np.ndarray, sigma: float = 1.0, rho: float = 3.0, pixel_size: tuple[float, float] = (1.0, 1.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smoothed structure tensor of equation 8: ``K_rho * (grad u_sigma grad u_sigma^T)`` with ``u_sigma = K_sigma * u``.

    Args:
        image: Shape ``[height, width]``, row 0 at the top.
        sigma: Standard deviation of the inner Gaussian [pixels].
        rho: Of the outer one [pixels].
        pixel_size: Extent of a pixel along x and y, in any unit: an image that is stretched over a domain of another aspect has
            its edges at other angles there. Only the ratio of the two matters.

    Returns:
        Its entries xx, xy and yy, y pointing up, each of shape ``[height, width]``, float64.
    """
    smooth = gaussian_blur(image, sigma)
    padded = np.pad(smooth, 1, mode="symmetric")
    # The finer side of a pixel counts as 1, so that neither gradient grows beyond the image's own.
    finer = min(pixel_size)
    x = 0.5 * finer / pixel_size[0] * (padded[1:-1, 2:] - padded[1:-1, :-2])
    y = 0.5 * finer / pixel_size[1] * (padded[:-2, 1:-1] - padded[2:, 1:-1])
    return gaussian_blur(x * x, rho), gaussian_blur(x * y, rho), gaussian_blur(y * y, rho)


def density_directions(
    image: np.ndarray, sigma: float = 1.0, rho: float = 3.0, pixel_size: tuple[float, float] = (1.0, 1.0)
) -> DirectionField:
    """Directions along the edges of an image: orthogonal to the eigenvector of its structure tensor's largest eigenvalue.

    The weight is that eigenvalue over the largest one in the image; an image without any edge has weight 0 everywhere.
    The arguments are those of :func:`structure_tensor`.
    """
    xx, xy, yy = structure_tensor(image, sigma, rho, pixel_size)
    half_gap = np.hypot(0.5 * (xx - yy), xy)
    largest = 0.5 * (xx + yy) + half_gap
    # The eigenvector of the largest eigenvalue has the doubled angle atan2(2 xy, xx - yy).
    angle = np.mod(0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * np.pi, np.pi)
    most = float(largest.max())
    # Rounding leaves a constant image with gradients of some 1e-17 of its values.
    if most <= 1e-20 * float(np.square(image, dtype=np.float64).max()):
        nothing = np.zeros(image.shape)
        return DirectionField(angle, nothing, nothing.copy())
    total = xx + yy
    coherence = np.where(total > 1e-12 * most, 2.0 * half_gap / np.where(total > 0.0, total, 1.0), 0.0)
    return DirectionField(angle, np.clip(largest / most, 0.0, 1.0), np.clip(coherence, 0.0, 1.0))


def direction_field(
    direction: str | float | np.ndarray,
    density: np.ndarray,
    sigma: float = 1.0,
    rho: float = 3.0,
    pixel_size: tuple[float, float] = (1.0, 1.0),
) -> DirectionField:
    """Return the directions that ``Line.direction`` means.

    Args:
        direction: ``"density"``, ``"none"``, an angle [rad], an image of angles, or an image ``[height, width, 2]`` of vectors whose
            lengths, at most 1, are the weights.
        density: The density that ``"density"`` looks at.
        sigma: Inner standard deviation of its structure tensor [pixels].
        rho: Outer one.
        pixel_size: Extent of a pixel of the density along x and y, of which only the ratio matters. Angles and vectors that are
            given are angles and vectors in the domain already.

    Returns:
        An image of directions, of the density's shape, of the given image's, or of shape ``[1, 1]`` where all are alike.

    Raises:
        ProblemError: Anything else, NaN, another shape, vectors that are all 0.
    """
    direction = check_direction(direction, "`direction`")
    if isinstance(direction, str):
        if direction == "density":
            return density_directions(density, sigma, rho, pixel_size)
        return DirectionField(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    given = np.atleast_2d(np.asarray(direction, dtype=np.float64))
    if given.ndim == 2:
        return DirectionField(np.mod(given, np.pi), np.ones(given.shape), np.ones(given.shape))
    length = np.hypot(given[..., 0], given[..., 1])
    angle = np.mod(np.arctan2(given[..., 1], given[..., 0]), np.pi)
    return DirectionField(angle, np.minimum(length, 1.0), (length > 0.0).astype(np.float64))


def direction_from_rg(image: np.ndarray) -> np.ndarray:
    """Vectors from an image whose red and green hold x and y, 0..1 with 0.5 for zero, as flow maps do.

    Args:
        image: Shape ``[height, width, channels]``, at least two channels.

    Returns:
        Shape ``[height, width, 2]``, float32, x to the right and y up. 8 bits have no value for 0.5: those next to it are 0.
    """
    image = np.asarray(image)
    if image.ndim != 3 or image.shape[2] < 2:
        raise ProblemError(f"an image of vectors must have a red and a green channel; got shape {list(image.shape)}")
    vectors = 2.0 * image[..., :2].astype(np.float64) - 1.0
    return np.where(np.abs(vectors) < 1.5 / 255.0, 0.0, vectors).astype(np.float32)


def direction_from_angle_image(image: np.ndarray) -> np.ndarray:
    """Angles [rad], float32, of an image of gray values, of its shape: 0 is along x, 1 is half a turn further (the same again)."""
    return (np.asarray(image, dtype=np.float64) * np.pi).astype(np.float32)
