"""The forest's ground: a real elevation model, brought to the size of a wood, and the density textures made from it.

Heights are arrays of shape ``[rows, columns]`` [m], row 0 in the north (largest y); x to the east, y to the north. Nothing
here needs Blender.

The model covers 30 km: a tree of 20 m would be a speck in it. So the land is shrunk by ``SHRINK`` in all three
directions alike, which keeps every slope as it is in nature. Between the cells of the model (about 90 m apart, 15 m after
shrinking) heights follow a cubic curve, and a little roughness of a few decimeters is added so that the ground is not
as smooth as cloth.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Terrain", "density_textures", "load_backdrop", "load_terrain"]

ELEVATION_FILE = Path(__file__).parent / "data" / "jacksboro_elevation.npz"
SHRINK = 6.0
METERS_PER_DEGREE = 111_320.0
# The cells of the model in which the wood grows: (first row, first column) and how many of each.
CROP_START = (214, 90)
CROP_SHAPE = (36, 54)
# Distance between two vertices of the ground [m].
SPACING = 2.0


@dataclass(frozen=True)
class Terrain:
    """A rectangle of land.

    Attributes:
        height: Heights of the grid's points [m], shape ``[rows, columns]``, row 0 in the north.
        size: Extent along x and y [m]; the rectangle is centered on the origin.
    """

    height: np.ndarray
    size: tuple[float, float]

    @property
    def x(self) -> np.ndarray:
        """East coordinates of the columns [m]."""
        return np.linspace(-0.5, 0.5, self.height.shape[1]) * self.size[0]

    @property
    def y(self) -> np.ndarray:
        """North coordinates of the rows [m], falling."""
        return np.linspace(0.5, -0.5, self.height.shape[0]) * self.size[1]

    def height_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights [m] at points of shape ``[n]``, bilinear between the grid's points, clamped to the rectangle."""
        rows, columns = self.height.shape
        column = (np.asarray(x) / self.size[0] + 0.5) * (columns - 1)
        row = (0.5 - np.asarray(y) / self.size[1]) * (rows - 1)
        column, row = np.clip(column, 0.0, columns - 1.001), np.clip(row, 0.0, rows - 1.001)
        c, r = column.astype(int), row.astype(int)
        right, down = column - c, row - r
        upper = self.height[r, c] * (1 - right) + self.height[r, c + 1] * right
        lower = self.height[r + 1, c] * (1 - right) + self.height[r + 1, c + 1] * right
        return upper * (1 - down) + lower * down

    def slope(self) -> np.ndarray:
        """Steepness of the grid's points [rad], the shape of :attr:`height`."""
        step = (self.size[1] / (self.height.shape[0] - 1), self.size[0] / (self.height.shape[1] - 1))
        down, right = np.gradient(self.height, *step)
        return np.arctan(np.hypot(down, right))

    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices, shape ``[n, 3]`` [m], and quadrilaterals, shape ``[m, 4]``, normals up."""
        x, y = np.meshgrid(self.x, self.y)
        vertex = np.stack([x, y, self.height], -1).reshape(-1, 3)
        index = np.arange(self.height.size).reshape(self.height.shape)
        face = np.stack([index[1:, :-1], index[1:, 1:], index[:-1, 1:], index[:-1, :-1]], -1).reshape(-1, 4)
        return vertex, face


def _cell_size(data: np.lib.npyio.NpzFile) -> tuple[float, float]:
    """Extent of one cell of the model after shrinking, east and north [m]."""
    latitude = 0.5 * (float(data["south"]) + float(data["north"]))
    meters = METERS_PER_DEGREE / SHRINK * float(data["cell"])
    return meters * float(np.cos(np.radians(latitude))), meters


def _cubic_rows(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Catmull-Rom interpolation between the rows of ``image`` at the row coordinates ``at``: ``[len(at), columns]``."""
    start = np.clip(np.floor(at).astype(int), 0, len(image) - 2)
    t = (at - start)[:, None]
    a, b, c, d = (image[np.clip(start + offset, 0, len(image) - 1)] for offset in (-1, 0, 1, 2))
    return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))


def _cubic(image: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Catmull-Rom interpolation on the grid of the coordinates ``row`` by ``column``."""
    return _cubic_rows(_cubic_rows(image, row).T, column).T


def _blur(image: np.ndarray, sigma: float) -> np.ndarray:
    """Gaussian blur, ``sigma`` in grid points; beyond the rim the image goes on as it ends."""
    reach = int(np.ceil(3.5 * sigma))
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weight /= weight.sum()
    for _ in range(2):
        padded = np.pad(image, ((reach, reach), (0, 0)), mode="edge")
        image = sum(w * padded[i : i + len(image)] for i, w in enumerate(weight)).T
    return image


def _noise(shape: tuple[int, int], wavelength: float, rng: np.random.Generator) -> np.ndarray:
    """Smooth noise of mean 0 and standard deviation 1; ``wavelength`` in grid points."""
    field = _blur(rng.standard_normal(shape), wavelength / 4)
    return (field - field.mean()) / field.std()


def load_terrain() -> Terrain:
    """Read the land on which the wood grows, its lowest point at height 0."""
    with np.load(ELEVATION_FILE, allow_pickle=False) as data:
        east, north = _cell_size(data)
        elevation = data["elevation"].astype(np.float64)
    (row, column), (rows, columns) = CROP_START, CROP_SHAPE
    size = ((columns - 1) * east, (rows - 1) * north)
    shape = (round(size[1] / SPACING) + 1, round(size[0] / SPACING) + 1)
    at_row = np.linspace(row, row + rows - 1, shape[0])
    at_column = np.linspace(column, column + columns - 1, shape[1])
    height = (_cubic(elevation, at_row, at_column) - _lowest(elevation)) / SHRINK
    rng = np.random.default_rng(36)
    rough = 0.5 * _noise(shape, 24.0, rng) + 0.12 * _noise(shape, 7.0, rng)
    # The rim stays as it is, so that the backdrop meets it.
    edge = np.minimum.reduce(
        [*np.broadcast_arrays(np.arange(shape[0])[:, None], np.arange(shape[0])[::-1, None],
                              np.arange(shape[1])[None], np.arange(shape[1])[None, ::-1])]
    )  # fmt: skip
    return Terrain(height + rough * np.clip(edge / 10.0, 0.0, 1.0), size)


def _lowest(elevation: np.ndarray) -> float:
    (row, column), (rows, columns) = CROP_START, CROP_SHAPE
    return float(elevation[row : row + rows, column : column + columns].min())


def load_backdrop() -> tuple[np.ndarray, np.ndarray]:
    """Read the land all around, out to the end of the model, with a hole where :func:`load_terrain` lies.

    Returns:
        Vertices, shape ``[n, 3]`` [m], and quadrilaterals, shape ``[m, 4]``.
    """
    with np.load(ELEVATION_FILE, allow_pickle=False) as data:
        east, north = _cell_size(data)
        elevation = data["elevation"].astype(np.float64)
    (row, column), (rows, columns) = CROP_START, CROP_SHAPE
    finer = 2
    shape = tuple((count - 1) * finer + 1 for count in elevation.shape)
    at_row, at_column = (np.arange(count) / finer for count in shape)
    height = (_cubic(elevation, at_row, at_column) - _lowest(elevation)) / SHRINK
    x, y = np.meshgrid((at_column - column - 0.5 * (columns - 1)) * east, (row + 0.5 * (rows - 1) - at_row) * north)
    index = np.arange(height.size).reshape(shape)
    face = np.stack([index[1:, :-1], index[1:, 1:], index[:-1, 1:], index[:-1, :-1]], -1)
    hole = np.zeros(face.shape[:2], bool)
    hole[row * finer : (row + rows - 1) * finer, column * finer : (column + columns - 1) * finer] = True
    return np.stack([x, y, height], -1).reshape(-1, 3), face[~hole]


def _rise(value: np.ndarray, low: float, high: float) -> np.ndarray:
    """0 below ``low``, 1 above ``high``, smooth between."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def density_textures(
    terrain: Terrain, keep_clear: tuple[tuple[float, float, float], ...] = ()
) -> dict[str, np.ndarray]:
    """Paint where pines and beeches grow: pines high and steep, beeches low and gentle, neither in the clearings.

    Args:
        terrain: The land.
        keep_clear: Further clearings: x, y and radius [m] of each.

    Returns:
        For ``"pine"`` and ``"beech"`` an image of shape ``[height, width]``, 0..1, row 0 in the north.
    """
    altitude = (terrain.height - terrain.height.min()) / np.ptp(terrain.height)
    slope = _blur(np.degrees(terrain.slope()), 3.0)
    rng = np.random.default_rng(7)
    # How much a place suits pines: altitude counts most, steepness next, and a little chance frays the border.
    favor = altitude + 0.012 * (slope - 18.0) + 0.05 * _noise(altitude.shape, 30.0, rng)
    pine = _rise(favor, 0.40, 0.62)
    beech = _rise(-favor, -0.48, -0.28)
    # Clearings, wet meadows along the valley's floor, and bare rock on the steepest ground.
    clearing = _rise(_noise(altitude.shape, 60.0, rng), -1.25, -0.95)
    meadow = _rise(altitude + 0.02 * _noise(altitude.shape, 20.0, rng), 0.05, 0.11)
    rock = 1.0 - _rise(slope, 36.0, 41.0)
    open_ground = clearing * meadow * rock
    x, y = np.meshgrid(terrain.x, terrain.y)
    for east, north, radius in keep_clear:
        open_ground = open_ground * _rise(np.hypot(x - east, y - north), 0.8 * radius, radius)
    return {"pine": pine * open_ground, "beech": beech * open_ground}
