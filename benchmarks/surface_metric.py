"""Measures placements on surfaces by code that shares nothing with the solver: SciPy, finite elements, k-d trees.

The coverage error at k is the root mean square of the difference between charges and target, both smoothed by the heat kernel of the
surface as long as a Gaussian of k mean spacings would take, over the mean. The heat kernel is exact in time (a Chebyshev expansion of
exp(-t L)), and of linear finite elements in space, on a mesh that is cut until its sides are a quarter of a spacing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sparse
import scipy.special as special
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Density = Callable[[np.ndarray], np.ndarray]

# Sides of the finite elements' triangles for every mean spacing.
PER_SPACING = 4.0
# Triangles near a body that are looked at for the one that it lies on.
CANDIDATES = 16


class SurfaceMetric:
    """Finite elements on a mesh, fine enough for ``count`` bodies; lengths in the mesh's unit."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, count: int, per_spacing: float = PER_SPACING) -> None:
        longest = np.sqrt(2.0 * _areas(vertices, faces).sum() / count) / per_spacing
        while np.percentile(_sides(vertices, faces).max(axis=1), 90) > longest:
            vertices, faces = trimesh.remesh.subdivide(vertices, faces)
        self.vertices, self.faces = vertices, faces
        self.areas = _areas(vertices, faces)
        self.area = float(self.areas.sum())
        self.mass = np.bincount(faces.ravel(), np.repeat(self.areas / 3.0, 3), len(vertices))
        self._root = np.sqrt(self.mass)
        scale = sparse.diags(1.0 / self._root)
        self._operator = (scale @ _stiffness(vertices, faces) @ scale).tocsr()
        vector = np.random.default_rng(0).normal(size=len(vertices))
        for _ in range(30):
            vector = self._operator @ vector
            vector /= np.linalg.norm(vector)
        self._largest = 1.1 * float(np.linalg.norm(self._operator @ vector))
        self._tree = cKDTree(vertices[faces].mean(axis=1))

    def target(self, density: Density) -> np.ndarray:
        """Share of a density at every vertex."""
        corner = self.vertices[self.faces]
        weights = ([4 / 6, 1 / 6, 1 / 6], [1 / 6, 4 / 6, 1 / 6], [1 / 6, 1 / 6, 4 / 6])
        mean = sum(density(np.einsum("k,fkd->fd", np.array(w), corner)) for w in weights) / 3.0 * self.areas
        share = np.bincount(self.faces.ravel(), np.repeat(mean / 3.0, 3), len(self.vertices))
        return share / share.sum()

    def charges(self, position: np.ndarray, charge: np.ndarray | None = None) -> np.ndarray:
        """Charge at every vertex, shared out by where bodies lie in their triangles."""
        near = self._tree.query(position, k=CANDIDATES)[1]
        best, weight = np.full(len(position), np.inf), np.zeros((len(position), 3))
        face = np.zeros(len(position), int)
        for k in range(CANDIDATES):
            corner = self.vertices[self.faces[near[:, k]]]
            place = trimesh.triangles.closest_point(corner, position)
            far = np.linalg.norm(place - position, axis=1)
            closer = far < best
            found = trimesh.triangles.points_to_barycentric(corner[closer], place[closer])
            best[closer], weight[closer], face[closer] = far[closer], found, near[closer, k]
        amount = np.ones(len(position)) if charge is None else charge
        return np.bincount(self.faces[face].ravel(), (weight * amount[:, None]).ravel(), len(self.vertices))

    def coverage(
        self,
        position: np.ndarray,
        density: Density,
        ks: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
        charge: np.ndarray | None = None,
    ) -> np.ndarray:
        """Coverage errors."""
        placed = self.charges(position, charge)
        total = placed.sum()
        difference = placed - total * self.target(density)
        spacing = np.sqrt(self.area / len(position))
        result = []
        for k in ks:
            smooth = self._heat(difference, 0.5 * (k * spacing) ** 2)
            result.append(np.sqrt((self.mass * smooth**2).sum() / self.area) * self.area / total)
        return np.array(result)

    def _heat(self, charge: np.ndarray, time: float) -> np.ndarray:
        half = 0.5 * time * self._largest
        before = charge / self._root
        now = (2.0 / self._largest) * (self._operator @ before) - before
        result = special.ive(0, half) * before - 2.0 * special.ive(1, half) * now
        k = 2
        while True:
            factor = special.ive(k, half)
            if factor < 1e-9 and k > np.sqrt(half):
                return result / self._root
            before, now = now, 2.0 * ((2.0 / self._largest) * (self._operator @ now) - now) - before
            result += 2.0 * (-1) ** k * factor * now
            k += 1


def parts_of(faces: np.ndarray) -> np.ndarray:
    """Number of the part that each face is in: faces that share a vertex are in one."""
    pair = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    count = int(faces.max()) + 1
    graph = sparse.csr_matrix((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1][faces[:, 0]]


def spacing(
    position: np.ndarray, normal: np.ndarray, number_density: np.ndarray | float, part: np.ndarray | None = None
) -> tuple[float, float]:
    """Smallest and mean distance to the nearest neighbor on the same side and part, over that of a hexagonal lattice."""
    distance, near = cKDTree(position).query(position, k=min(24, len(position)))
    same = (normal[near] * normal[:, None]).sum(axis=2) > 0.0
    if part is not None:
        same &= part[near] == part[:, None]
    same[:, 0] = False
    nearest = np.where(same, distance, np.inf).min(axis=1)
    ratio = nearest / np.sqrt(2.0 / np.sqrt(3.0) / number_density)
    ratio = ratio[np.isfinite(ratio)]
    return float(ratio.min()), float(ratio.mean())


def _sides(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corner = vertices[faces]
    return np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)


def _areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corner = vertices[faces]
    return 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)


def _stiffness(vertices: np.ndarray, faces: np.ndarray) -> sparse.csr_matrix:
    """Cotangent Laplacian."""
    rows, columns, values = [], [], []
    for k in range(3):
        i, j, opposite = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3], faces[:, k]
        a, b = vertices[i] - vertices[opposite], vertices[j] - vertices[opposite]
        weight = 0.5 * (a * b).sum(axis=1) / np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1e-300)
        rows += [i, j]
        columns += [j, i]
        values += [weight, weight]
    n = len(vertices)
    matrix = sparse.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    return sparse.diags(np.asarray(matrix.sum(axis=1)).ravel()) - matrix
