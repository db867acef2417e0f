"""Meshes and densities that placements on surfaces are measured on."""

from __future__ import annotations

import numpy as np
import trimesh


def square(cells: int = 64, columns: tuple[float, float] = (0.0, 1.0)) -> tuple[np.ndarray, np.ndarray]:
    """A square of side 1 in x and y, or the strip of it between two values of x."""
    x = np.linspace(*columns, max(1, round(cells * (columns[1] - columns[0]))) + 1)
    y = np.linspace(0.0, 1.0, cells + 1)
    return _grid(x, y)


def _grid(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b = np.meshgrid(x, y, indexing="ij")
    number = np.arange(a.size).reshape(a.shape)
    corner = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    return np.stack([a.ravel(), b.ravel(), np.zeros(a.size)], axis=1), faces


def sphere(subdivisions: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of radius 1."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def hills(cells: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Ground of 60 m x 60 m with hills of 8 m."""
    line = np.linspace(0.0, 60.0, cells + 1)
    vertices, triangles = _grid(line, line)
    vertices[:, 2] = 4.0 * np.sin(vertices[:, 0] / 9.0) * np.cos(vertices[:, 1] / 11.0)
    return vertices, triangles


def torus() -> tuple[np.ndarray, np.ndarray]:
    """A torus of radii 1 and 0.4."""
    mesh = trimesh.creation.torus(1.0, 0.4, major_sections=96, minor_sections=48)
    return np.array(mesh.vertices), np.array(mesh.faces)


def rock() -> tuple[np.ndarray, np.ndarray]:
    """A sphere with waves of seven lengths on it."""
    vertices, faces = sphere(5)
    rng = np.random.default_rng(3)
    height = np.zeros(len(vertices))
    for octave in range(7):
        for _ in range(6):
            wave = rng.normal(size=3)
            wave *= 2.0 * 1.7**octave / np.linalg.norm(wave)
            height += 0.28 * 0.55**octave * np.sin(vertices @ wave + rng.random() * 6.28) / 2.5
    return vertices * (1.0 + height)[:, None], faces


def thin_box(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A box of side 1 whose height is 0.3 of the spacing of ``count`` bodies on both its sides."""
    mesh = trimesh.creation.box(extents=(1.0, 1.0, 0.3 * np.sqrt(2.0 / count)))
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    while len(faces) < 12 * 4**5:
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return vertices, faces


def gradient(vertices: np.ndarray):
    """A density that rises from 1 to 10 along the longest axis."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    axis = int(np.argmax(high - low))
    return lambda place: 1.0 + 9.0 * (place[:, axis] - low[axis]) / (high[axis] - low[axis])


def checker(place: np.ndarray) -> np.ndarray:
    """Six squares a side, 10 to 1."""
    even = np.floor(place[:, :2] * 6.0 + 1e-6).astype(int).sum(axis=1) % 2 == 0
    return np.where(even, 1.0, 0.1)
