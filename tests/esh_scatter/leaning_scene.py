"""Objects and grounds for tests of what leans into each other, and what Blender shows of that."""

from __future__ import annotations

import math

import bpy
import numpy as np
from esh.engine.quality.solids import TOLERANCE
from scipy import optimize


def solid(name: str, position: np.ndarray, faces: list[tuple[int, ...]]) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(position).tolist(), [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


def tree(name: str = "Tree", radius: float = 0.35, height: float = 2.0) -> bpy.types.Object:
    """A cone on its origin."""
    turn = np.arange(16) * (2.0 * math.pi / 16)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(16)])
    sides = [(k, (k + 1) % 16, 16) for k in range(16)]
    return solid(name, np.vstack([ring, [[0.0, 0.0, height]]]), [*sides, tuple(range(16))])


def box(name: str = "Box", size: float = 0.6) -> bpy.types.Object:
    corner = np.array([(x, y, z) for z in (0.0, 1.0) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return solid(name, size * corner, faces)


def ground(height, size: float = 14.0, cells: int = 50) -> bpy.types.Object:
    x, y = np.meshgrid(np.linspace(0.0, size, cells), np.linspace(0.0, size, cells))
    number = np.arange(cells * cells).reshape(cells, cells)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    return solid("Ground", np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3), quads.tolist())


GROUNDS = {
    "flat": lambda x, _: 0.0 * x,
    "slope": lambda x, _: 0.7 * x,
    "bumps": lambda x, y: 0.6 * np.sin(x) * np.cos(y),
}


def placed_hulls(result: bpy.types.Object) -> list[np.ndarray]:
    """The corners of every instance, as Blender shows it, but for what touching bodies lie in each other."""
    found = []
    for entry in bpy.context.evaluated_depsgraph_get().object_instances:
        if entry.is_instance and entry.parent.original == result:
            corner = np.array([vertex.co for vertex in entry.object.data.vertices])
            corner = corner + TOLERANCE * (0.5 * (corner.min(axis=0) + corner.max(axis=0)) - corner)
            matrix = np.array(entry.matrix_world)
            found.append(corner @ matrix[:3, :3].T + matrix[:3, 3])
    return found


def meeting(hulls: list[np.ndarray]) -> int:
    """Pairs of which some mean of the corners of one is a mean of those of the other."""
    low, high = (np.array([take(hull, axis=0) for hull in hulls]) for take in (np.min, np.max))
    first, second = np.triu_indices(len(hulls), 1)
    near = ((low[first] < high[second]) & (low[second] < high[first])).all(axis=1)
    count = 0
    for one, two in zip(first[near], second[near], strict=True):
        a, b = hulls[one], hulls[two]
        sums = np.repeat([[1.0, 0.0], [0.0, 1.0]], [len(a), len(b)], axis=1)
        equal = np.vstack([np.hstack([a.T, -b.T]), sums])
        zero = np.zeros(len(a) + len(b))
        count += optimize.linprog(zero, A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0], method="highs").status == 0
    return count
